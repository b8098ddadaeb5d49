#include "render/pace.h"

#include <math.h>
#include <stdlib.h>

/* Frames vary; this share of the target is planned with, so that few are late. */
#define PLANNED 0.85
#define UPLOAD_SHARE 0.1
/* Points get this share at least: where shading alone takes longer than a frame should, showing
 * nothing would not help. And so points are always tried, and their cost known. */
#define POINT_SHARE 0.25
#define OLDER 0.985       /* weight of a frame by that of the next one */
#define FAR_OFF 2.5       /* times the usual error: such frames count less */
#define GROWTH 1.5        /* beyond what has been tried */
#define PRIOR_WEIGHT 0.02 /* of an assumption, in frames */
#define POINTS_MIN 50000.0
#define BYTES_MIN 262144.0
#define BYTES_MAX 67108864.0
enum { FIXED, POINTS, BYTES, SHOWN, LATELY = 16 };

/* What a machine is taken for before it has drawn anything: slow. */
static const double assumed[REND_PACE_TERMS] = {2, 60, 0.5, 2};
/* Frames with uploads are those in which other threads read, too: no bus is so slow. */
static const double highest[REND_PACE_TERMS] = {INFINITY, INFINITY, 5, INFINITY};

void rend_pace_init(rend_pace *pace, double fps)
{
    *pace = (rend_pace){.target_ms = 1000 / fps};
    for (int k = 0; k < REND_PACE_TERMS; k++)
        pace->cost[k] = assumed[k];
}

static double error_of(const rend_pace *p, const rend_pace_frame *f)
{
    double error = f->ms;
    for (int k = 0; k < REND_PACE_TERMS; k++)
        error -= p->cost[k] * f->terms[k];
    return error;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double usual_error(const rend_pace *p)
{
    double errors[REND_PACE_FRAMES];
    uint32_t count = 0;
    for (uint32_t i = 0; i < REND_PACE_FRAMES; i++)
        if (p->frames[i].number > 0) errors[count++] = fabs(error_of(p, &p->frames[i]));
    qsort(errors, count, sizeof *errors, compare);
    return fmax(errors[count / 2], 0.2);
}

/* Least squares within bounds: one cost after the other, until nothing changes much. */
static void solve(double h[REND_PACE_TERMS][REND_PACE_TERMS], const double g[REND_PACE_TERMS],
                  double cost[REND_PACE_TERMS])
{
    for (int round = 0; round < 100; round++)
        for (int k = 0; k < REND_PACE_TERMS; k++) {
            double rest = g[k];
            for (int j = 0; j < REND_PACE_TERMS; j++)
                if (j != k) rest -= h[k][j] * cost[j];
            cost[k] = fmin(fmax(rest / h[k][k], 0), highest[k]);
        }
}

/* The costs so far are an assumption, too, that a few frames outweigh. */
static void fit(rend_pace *p)
{
    static const double size[REND_PACE_TERMS] = {1, 0.2, 1, 1}; /* that makes a difference */
    double usual = usual_error(p), h[REND_PACE_TERMS][REND_PACE_TERMS] = {{0}};
    double g[REND_PACE_TERMS] = {0};
    for (int k = 0; k < REND_PACE_TERMS; k++) {
        h[k][k] = PRIOR_WEIGHT * size[k] * size[k];
        g[k] = h[k][k] * p->cost[k];
    }
    for (uint32_t i = 0; i < REND_PACE_FRAMES; i++) {
        const rend_pace_frame *f = &p->frames[i];
        if (f->number == 0) continue;
        double off = fabs(error_of(p, f)) / (FAR_OFF * usual);
        double weight = pow(OLDER, (double)(p->count - f->number)) / fmax(off, 1);
        for (int k = 0; k < REND_PACE_TERMS; k++) {
            g[k] += weight * f->terms[k] * f->ms;
            for (int j = 0; j < REND_PACE_TERMS; j++)
                h[k][j] += weight * f->terms[k] * f->terms[j];
        }
    }
    solve(h, g, p->cost);
}

void rend_pace_note(rend_pace *pace, uint64_t points, uint64_t bytes, bool shown, double ms)
{
    uint32_t size = 0;
    while (size + 1 < REND_PACE_SIZES && points >> (13 + size) > 0)
        size++;
    uint32_t slot = pace->next[size]++ % REND_PACE_EACH;
    pace->frames[size * REND_PACE_EACH + slot] =
        (rend_pace_frame){.terms = {1, (double)points * 1e-6, (double)bytes * 1e-6, shown},
                          .ms = fmax(ms, 0),
                          .number = ++pace->count};
    fit(pace);
}

/* The most of a term in the last frames. */
static double lately(const rend_pace *p, int term)
{
    double most = 0;
    for (uint32_t i = 0; i < REND_PACE_FRAMES; i++)
        if (p->frames[i].number > 0 && p->count - p->frames[i].number < LATELY)
            most = fmax(most, p->frames[i].terms[term]);
    return most;
}

uint64_t rend_pace_bytes(const rend_pace *pace)
{
    double bytes = UPLOAD_SHARE * pace->target_ms / fmax(pace->cost[BYTES], 1e-9) * 1e6;
    return (uint64_t)fmin(fmax(bytes, BYTES_MIN), BYTES_MAX);
}

/* What uploads have taken lately is set aside for them. */
uint64_t rend_pace_points(const rend_pace *pace)
{
    const double *cost = pace->cost;
    double other = cost[FIXED] + cost[SHOWN] + cost[BYTES] * lately(pace, BYTES);
    double left = fmax(PLANNED * pace->target_ms - other, POINT_SHARE * pace->target_ms);
    double points = left / fmax(cost[POINTS], 1e-6) * 1e6;
    points = fmin(points, fmax(GROWTH * 1e6 * lately(pace, POINTS), 4 * POINTS_MIN));
    return (uint64_t)fmax(points, POINTS_MIN);
}
