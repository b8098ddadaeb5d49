#include "render/cpu/memory.h"

#include <sys/mman.h>

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
