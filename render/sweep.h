/* render/sweep.h - the one cell size of a picture, found while the cells shrink.
 *
 * Cells start out larger than the picture and shrink. A level of detail appears little by little
 * while they halve, from its parent's cell size to its own: a surface needs four times the points
 * at half the cell size, so with x = 1 / cell^2, what has been drawn of a level of p points that
 * begins at x0 is
 *
 *     p (x / x0 - 1) / 3,  at least 0 and at most p:
 *
 * the density on screen follows x everywhere, and nothing appears at once. The sum over all levels
 * is a piecewise linear function of x, which is kept up to date while x rises from bucket to bucket
 * (a 32nd of an octave each), and with a queue of what begins in each bucket the outer octree is
 * walked once, in the order of the paper's priority queue, and not further than the budget goes. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

enum {
    REND_SWEEP_STEPS = 32,   /* buckets per octave of x */
    REND_SWEEP_OCTAVES = 56, /* cells from 2^14 pixels down to 2^-14; beyond, the ends take all */
    REND_SWEEP_BUCKETS = REND_SWEEP_STEPS * REND_SWEEP_OCTAVES,
};

typedef struct {
    float begin;     /* x0, pixels^-2, > 0 */
    uint32_t points; /* p */
} rend_growth;

/* Points of one level that are drawn at x, rounded down. */
uint32_t rend_growth_at(rend_growth growth, double x);

/* The bucket of x, and where the bucket begins and ends. */
uint32_t rend_sweep_bucket(float x);
double rend_sweep_begin(uint32_t bucket);
double rend_sweep_end(uint32_t bucket);

/* {0} is the start: x is at the end of bucket 0, and nothing is there. */
typedef struct {
    double slope[REND_SWEEP_BUCKETS], constant[REND_SWEEP_BUCKETS]; /* what changes in a bucket */
    double slope_now, constant_now;
    uint32_t bucket;
} rend_sweep;

/* A level joins. What begins before the bucket in hand ends counts from here on. */
void rend_sweep_add(rend_sweep *sweep, rend_growth growth);

/* Points at the end of the bucket in hand, exactly. */
double rend_sweep_points(const rend_sweep *sweep);

void rend_sweep_advance(rend_sweep *sweep);

/* The largest x from `from` to `to` at which all levels together have at most `points`, or a little
 * less than that; `from` if they have more there already. */
double rend_sweep_solve(const rend_growth *levels, uint32_t count, double points, double from,
                        double to);
