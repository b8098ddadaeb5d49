#include "preprocess/pages.h"

#include <stdint.h>
#include <sys/mman.h>
#include <unistd.h>

/* Half a huge page is better than hundreds of small ones. */
enum { HUGE_SIZE = 2 << 20, HUGE_FROM = HUGE_SIZE / 2 };

static size_t rounded(size_t size)
{
    size_t unit = size >= HUGE_FROM ? HUGE_SIZE : (size_t)sysconf(_SC_PAGESIZE);
    return (size + unit - 1) / unit * unit;
}

void *prep_pages_take(size_t size)
{
    size_t wanted = rounded(size), spare = wanted >= HUGE_SIZE ? HUGE_SIZE : 0;
    if (wanted < size || wanted + spare < wanted) return NULL;
    uint8_t *memory = mmap(NULL, wanted + spare, PROT_READ | PROT_WRITE,
                           MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory == MAP_FAILED) return NULL;
    if (spare == 0) return memory;
    /* What lies before and behind the huge pages goes back. */
    size_t before = (HUGE_SIZE - (uintptr_t)memory % HUGE_SIZE) % HUGE_SIZE;
    if (before > 0) munmap(memory, before);
    if (spare > before) munmap(memory + before + wanted, spare - before);
    madvise(memory + before, wanted, MADV_HUGEPAGE); /* only faster, a refusal does not matter */
    return memory + before;
}

void prep_pages_touch(void *memory, size_t size)
{
#ifdef MADV_POPULATE_WRITE
    uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE), begin = (uintptr_t)memory / page * page;
    madvise((void *)begin, (uintptr_t)memory + size - begin, MADV_POPULATE_WRITE); /* only faster */
#else
    (void)memory, (void)size;
#endif
}

void prep_pages_give(void *memory, size_t size)
{
    if (memory != NULL) munmap(memory, rounded(size));
}
