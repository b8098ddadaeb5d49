/* Which kernel this processor can run. */
#include "render/cpu/kernel.h"

extern const rcpu_kernel rcpu_kernel_portable;
#ifdef __x86_64__
extern const rcpu_kernel rcpu_kernel_avx2, rcpu_kernel_avx512;
#endif

const rcpu_kernel *rcpu_kernel_find(const char *name)
{
    const rcpu_kernel *found[3];
    int count = 0;
#ifdef __x86_64__
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq"))
        found[count++] = &rcpu_kernel_avx512;
    if (__builtin_cpu_supports("avx2")) found[count++] = &rcpu_kernel_avx2;
#endif
    found[count++] = &rcpu_kernel_portable;
    for (int i = 0; i < count; i++)
        if (name == NULL || strcmp(name, found[i]->name) == 0) return found[i];
    return NULL;
}
