/* render/cpu/log.h - log2 of distances, the same in every kernel, and depths made of them. */
#pragma once
#include <math.h>
#include <stdint.h>
#include <string.h>

/* log2 of the positive number of these bits: its exponent, and for a mantissa m between sqrt(1/2)
 * and sqrt(2) the series of atanh((m - 1) / (m + 1)), whose next term is below 1e-9. */
static inline float rcpu_log2(uint32_t bits)
{
    uint32_t shifted = bits - 0x3f3504f3u; /* sqrt(1/2) */
    int32_t exponent = (int32_t)shifted >> 23;
    uint32_t mantissa = (shifted & 0x7fffffu) + 0x3f3504f3u;
    float m;
    memcpy(&m, &mantissa, sizeof m);
    float t = (m - 1) / (m + 1), t2 = t * t;
    float series =
        2.88539008f +
        t2 * (0.961796694f + t2 * (0.577078016f + t2 * (0.412198583f + t2 * 0.320598898f)));
    return (float)exponent + t * series;
}

/* Depth of a logarithm, as rgl_read_depths() says it: 0 near, 1 where there is no point.
 * near_log, range_log  log2 of the nearest distance, and of the farthest by that */
static inline float rcpu_depth(float log, float near_log, float range_log)
{
    float depth = (log - near_log) / range_log;
    depth = depth > 0 ? depth : 0;
    depth = depth < 0.99999994f ? depth : 0.99999994f; /* of a point */
    return log == INFINITY ? 1 : depth;
}
