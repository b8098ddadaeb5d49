#include "render/cpu/memory.h"

#include <stdint.h>
#include <sys/mman.h>
#include <unistd.h>

void *rcpu_memory_take(size_t size)
{
    void *memory = mmap(NULL, size, PROT_READ | PROT_WRITE,
                        MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory == MAP_FAILED) return NULL;
    madvise(memory, size, MADV_HUGEPAGE); /* only a wish */
    return memory;
}

void rcpu_memory_release(void *memory, size_t size)
{
    if (memory != NULL) munmap(memory, size);
}

void rcpu_memory_touch(void *memory, size_t size)
{
#ifdef MADV_POPULATE_WRITE
    uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE), begin = (uintptr_t)memory / page * page;
    madvise((void *)begin, (uintptr_t)memory + size - begin, MADV_POPULATE_WRITE); /* only a wish */
#else
    (void)memory, (void)size;
#endif
}
