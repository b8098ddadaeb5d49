#include "render/sweep.h"

#include <math.h>
#include <string.h>

enum {
    STEP_BITS = 23 - 5, /* of a float's mantissa, below a step */
    FIRST = (127 - REND_SWEEP_OCTAVES / 2) * REND_SWEEP_STEPS, /* step of the smallest x */
    ROUNDS = 200,
};

uint32_t rend_growth_at(rend_growth growth, double x)
{
    double part = (x / (double)growth.begin - 1) / 3;
    if (!(part > 0)) return 0;
    return part < 1 ? (uint32_t)(part * growth.points) : growth.points;
}

uint32_t rend_sweep_bucket(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits >>= STEP_BITS;
    if (bits < FIRST) return 0;
    return bits - FIRST < REND_SWEEP_BUCKETS ? bits - FIRST : REND_SWEEP_BUCKETS - 1;
}

double rend_sweep_begin(uint32_t bucket)
{
    float x;
    uint32_t bits = (bucket + FIRST) << STEP_BITS;
    memcpy(&x, &bits, sizeof x);
    return bucket > 0 ? (double)x : 0;
}

double rend_sweep_end(uint32_t bucket)
{
    return rend_sweep_begin(bucket + 1);
}

static void change(rend_sweep *s, double x, double slope)
{
    uint32_t bucket = rend_sweep_bucket((float)x);
    if (bucket <= s->bucket) s->slope_now += slope, s->constant_now -= slope * x;
    else s->slope[bucket] += slope, s->constant[bucket] -= slope * x;
}

void rend_sweep_add(rend_sweep *s, rend_growth growth)
{
    double begin = (double)growth.begin, slope = growth.points / (3 * begin);
    change(s, begin, slope);
    change(s, 4 * begin, -slope);
}

double rend_sweep_points(const rend_sweep *s)
{
    return s->constant_now + s->slope_now * rend_sweep_end(s->bucket);
}

void rend_sweep_advance(rend_sweep *s)
{
    s->bucket++;
    s->slope_now += s->slope[s->bucket];
    s->constant_now += s->constant[s->bucket];
}

static double points_at(const rend_growth *levels, uint32_t count, double x)
{
    double sum = 0;
    for (uint32_t i = 0; i < count; i++) {
        double part = (x / (double)levels[i].begin - 1) * (1.0 / 3);
        part = part < 0 ? 0 : part;
        sum += levels[i].points * (part < 1 ? part : 1);
    }
    return sum;
}

/* Regula falsi, which is exact where no level begins or ends in between; every other step halves
 * the range, since alone it would creep. */
double rend_sweep_solve(const rend_growth *levels, uint32_t count, double points, double from,
                        double to)
{
    double low = points_at(levels, count, from), high = points_at(levels, count, to);
    if (high <= points) return to;
    for (int round = 0; round < ROUNDS && points - low > 1e-6 * points; round++) {
        double part = round % 2 == 0 ? (points - low) / (high - low) : 0.5,
               x = from + (to - from) * part, sum = points_at(levels, count, x);
        if (sum <= points) from = x, low = sum;
        else to = x, high = sum;
    }
    return from;
}
