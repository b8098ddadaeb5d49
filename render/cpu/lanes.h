/* render/cpu/lanes.h - vectors of RCPU_LANES numbers, in the compiler's own terms, for the sources
 * that are compiled once for each instruction set. */
#pragma once
#include "render/cpu/kernel.h"

#define RCPU_JOIN2(a, b) a##_##b
#define RCPU_JOIN(a, b) RCPU_JOIN2(a, b)
/* rcpu_points in the sources of the kernel `avx2` is rcpu_points_avx2. */
#define RCPU_NAME(name) RCPU_JOIN(rcpu_##name, RCPU_KERNEL)

typedef float lanes_f __attribute__((vector_size(4 * RCPU_LANES)));
typedef int32_t lanes_i __attribute__((vector_size(4 * RCPU_LANES)));
typedef uint32_t lanes_u __attribute__((vector_size(4 * RCPU_LANES)));

/* Lanes side by side, four at a time: what all instruction sets have. */
#if RCPU_LANES == 4
#define LANES_LOW(a, b) __builtin_shufflevector(a, b, 0, 4, 1, 5)
#define LANES_HIGH(a, b) __builtin_shufflevector(a, b, 2, 6, 3, 7)
#define LANES_LOW2(a, b) __builtin_shufflevector(a, b, 0, 1, 4, 5)
#define LANES_HIGH2(a, b) __builtin_shufflevector(a, b, 2, 3, 6, 7)
#elif RCPU_LANES == 8
#define LANES_LOW(a, b) __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13)
#define LANES_HIGH(a, b) __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15)
#define LANES_LOW2(a, b) __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13)
#define LANES_HIGH2(a, b) __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15)
#else
#define LANES_LOW(a, b)                                                                            \
    __builtin_shufflevector(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29)
#define LANES_HIGH(a, b)                                                                           \
    __builtin_shufflevector(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31)
#define LANES_LOW2(a, b)                                                                           \
    __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29)
#define LANES_HIGH2(a, b)                                                                          \
    __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31)
#endif

/* Where the mask is -1 the first, where it is 0 the second. */
static inline lanes_i lanes_pick_i(lanes_i mask, lanes_i yes, lanes_i no)
{
    return (mask & yes) | (~mask & no);
}

static inline lanes_f lanes_pick(lanes_i mask, lanes_f yes, lanes_f no)
{
    return (lanes_f)lanes_pick_i(mask, (lanes_i)yes, (lanes_i)no);
}

static inline lanes_f lanes_max(lanes_f a, lanes_f b)
{
    return lanes_pick(a > b, a, b);
}

static inline lanes_f lanes_min(lanes_f a, lanes_f b)
{
    return lanes_pick(a < b, a, b);
}

static inline lanes_f lanes_all(float value)
{
    return (lanes_f){0} + value;
}

static inline bool lanes_any(lanes_i mask)
{
    int32_t any = 0;
    for (int l = 0; l < RCPU_LANES; l++)
        any |= mask[l];
    return any != 0;
}
