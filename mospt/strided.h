/* mospt/strided.h - values that stand at equal distances, from one place to another. */
#pragma once
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Calls `copy` with a size that is a constant for the usual ones, so that each copy is a load and a
 * store. */
#define MOSPT_WITH_CONSTANT_SIZE(size, copy)                                                       \
    switch (size) {                                                                                \
    case 1:                                                                                        \
        copy(1);                                                                                   \
        break;                                                                                     \
    case 2:                                                                                        \
        copy(2);                                                                                   \
        break;                                                                                     \
    case 4:                                                                                        \
        copy(4);                                                                                   \
        break;                                                                                     \
    case 6:                                                                                        \
        copy(6);                                                                                   \
        break;                                                                                     \
    case 8:                                                                                        \
        copy(8);                                                                                   \
        break;                                                                                     \
    case 12:                                                                                       \
        copy(12);                                                                                  \
        break;                                                                                     \
    case 16:                                                                                       \
        copy(16);                                                                                  \
        break;                                                                                     \
    default:                                                                                       \
        copy(size);                                                                                \
        break;                                                                                     \
    }

/* Copies `count` values of `size` bytes; those of a stride of 0 are one and the same. */
static inline void mospt_copy_strided(uint8_t *to, size_t to_stride, const uint8_t *from,
                                      size_t from_stride, size_t size, uint32_t count)
{
#define COPY(size)                                                                                 \
    for (uint32_t i = 0; i < count; i++)                                                           \
    memcpy(to + i * to_stride, from + i * from_stride, size)
    MOSPT_WITH_CONSTANT_SIZE(size, COPY)
#undef COPY
}
