/* render/cpu/span.h - pixels of a row that are drawn at once: as many keys as fit a vector.
 *
 * Spans begin at multiples of their length. Points that follow each other cover the same pixels,
 * and what was just written is read without waiting only where it lies in the same place; nor does
 * a span ever lie in two cache lines. */
#pragma once
#include "render/cpu/lanes.h"

enum { SPAN = RCPU_LANES / 2 };
typedef int64_t span_l __attribute__((vector_size(8 * SPAN)));
typedef int32_t span_i __attribute__((vector_size(4 * SPAN)));
typedef float span_f __attribute__((vector_size(4 * SPAN)));

/* 0, 1, 2 ... */
static inline span_i span_count(void)
{
    span_i count;
    for (int i = 0; i < SPAN; i++)
        count[i] = i;
    return count;
}

static inline span_f span_all(float value)
{
    return (span_f){0} + value;
}

/* Where the mask is -1 the first, where it is 0 the second. */
static inline span_i span_pick_i(span_i mask, span_i yes, span_i no)
{
    return (mask & yes) | (~mask & no);
}

static inline span_f span_pick(span_i mask, span_f yes, span_f no)
{
    return (span_f)span_pick_i(mask, (span_i)yes, (span_i)no);
}

static inline bool span_any(span_i mask)
{
    uint64_t any = 0, some[SPAN / 2];
    memcpy(some, &mask, sizeof some);
    for (int i = 0; i < SPAN / 2; i++)
        any |= some[i];
    return any != 0;
}
