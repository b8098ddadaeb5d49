#include "render/pace.h"

#include <math.h>
#include <stdlib.h>

/* Frames vary; this share of the target is planned with, so that few are late. */
#define PLANNED 0.85
#define UPLOAD_SHARE 0.2
/* Points get this share at least: where shading alone takes longer than a frame should, showing
 * nothing would not help. And so points are always tried, and their cost known. */
#define POINT_SHARE 0.25
#define OLDER 0.93        /* weight of a frame by that of the next one */
#define FAR_OFF 2.5       /* times the usual error: such frames count less */
#define GROWTH 1.5        /* beyond what has been tried */
#define PRIOR_WEIGHT 0.02 /* of an assumption, in frames */
#define POINTS_MIN 50000.0
#define BYTES_MIN 262144.0
#define BYTES_MAX 67108864.0

/* What a machine is taken for before it has drawn anything: slow. */
static const double assumed[3] = {2, 60, 0.5};

void rend_pace_init(rend_pace *pace, double fps)
{
    *pace = (rend_pace){.target_ms = 1000 / fps};
    for (int k = 0; k < 3; k++)
        pace->cost[k] = assumed[k];
}

static void terms(const rend_pace_frame *f, double out[3])
{
    out[0] = 1, out[1] = f->millions, out[2] = f->megabytes;
}

static double error_of(const rend_pace *p, const rend_pace_frame *f)
{
    double x[3];
    terms(f, x);
    return f->ms - (p->cost[0] * x[0] + p->cost[1] * x[1] + p->cost[2] * x[2]);
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double usual_error(const rend_pace *p)
{
    double errors[REND_PACE_FRAMES];
    for (uint32_t i = 0; i < p->count; i++)
        errors[i] = fabs(error_of(p, &p->frames[i]));
    qsort(errors, p->count, sizeof *errors, compare);
    return fmax(errors[p->count / 2], 0.2);
}

/* Frames with uploads are those in which other threads read, too: no bus is so slow. */
static const double highest[3] = {INFINITY, INFINITY, 5};

/* Least squares within bounds: one cost after the other, until nothing changes much. */
static void solve(double h[3][3], const double g[3], double cost[3])
{
    for (int round = 0; round < 100; round++)
        for (int k = 0; k < 3; k++) {
            double rest = g[k];
            for (int j = 0; j < 3; j++)
                if (j != k) rest -= h[k][j] * cost[j];
            cost[k] = fmin(fmax(rest / h[k][k], 0), highest[k]);
        }
}

/* The costs so far are an assumption, too, that a few frames outweigh. */
static void fit(rend_pace *p)
{
    double usual = usual_error(p), h[3][3] = {{0}}, g[3] = {0}, weight = 1;
    static const double size[3] = {1, 0.2, 1}; /* of each term that makes a difference */
    for (int k = 0; k < 3; k++) {
        h[k][k] = PRIOR_WEIGHT * size[k] * size[k];
        g[k] = h[k][k] * p->cost[k];
    }
    for (uint32_t age = 0; age < p->count; age++, weight *= OLDER) {
        const rend_pace_frame *f =
            &p->frames[(p->next + REND_PACE_FRAMES - 1 - age) % REND_PACE_FRAMES];
        double x[3], off = fabs(error_of(p, f)) / (FAR_OFF * usual);
        double w = weight / fmax(off, 1);
        terms(f, x);
        for (int k = 0; k < 3; k++) {
            g[k] += w * x[k] * f->ms;
            for (int j = 0; j < 3; j++)
                h[k][j] += w * x[k] * x[j];
        }
    }
    solve(h, g, p->cost);
}

void rend_pace_note(rend_pace *pace, uint64_t points, uint64_t bytes, double ms)
{
    pace->frames[pace->next] =
        (rend_pace_frame){(double)points * 1e-6, (double)bytes * 1e-6, fmax(ms, 0)};
    pace->next = (pace->next + 1) % REND_PACE_FRAMES;
    if (pace->count < REND_PACE_FRAMES) pace->count++;
    fit(pace);
}

uint64_t rend_pace_bytes(const rend_pace *pace)
{
    double bytes = UPLOAD_SHARE * pace->target_ms / fmax(pace->cost[2], 1e-9) * 1e6;
    return (uint64_t)fmin(fmax(bytes, BYTES_MIN), BYTES_MAX);
}

/* What uploads have taken lately is set aside for them. */
static double upload_ms(const rend_pace *p)
{
    double most = 0;
    for (uint32_t i = 0; i < p->count && i < 8; i++)
        most = fmax(most,
                    p->frames[(p->next + REND_PACE_FRAMES - 1 - i) % REND_PACE_FRAMES].megabytes);
    return most * p->cost[2];
}

uint64_t rend_pace_points(const rend_pace *pace)
{
    double left = fmax(PLANNED * pace->target_ms - pace->cost[0] - upload_ms(pace),
                       POINT_SHARE * pace->target_ms);
    double points = left / fmax(pace->cost[1], 1e-6) * 1e6, tried = 0;
    for (uint32_t i = 0; i < pace->count; i++)
        tried = fmax(tried, pace->frames[i].millions * 1e6);
    points = fmin(points, fmax(GROWTH * tried, 4 * POINTS_MIN));
    return (uint64_t)fmax(points, POINTS_MIN);
}
