#include "preprocess/frame.h"

#include <math.h>
#include <stdlib.h>

/* Steps up to this are finer than any scanner measures. */
static const double STEP_FINE_M = 0x1p-12;
/* Of the samples along an axis, so many at either end may be strays... */
static const double STRAYS = 0.01;
/* ... and what is so many times as far out as the others reach is one. */
static const double FAR = 16;

/* What the scans declare or were measured to be. */
typedef struct {
    double low[3], high[3], extent;
    double step;          /* of the finest LAS file; 0: none */
    const double *offset; /* of the first LAS file; NULL: none */
    bool any_float, all_measured;
} declared;

static declared look_at(const prep_source *source)
{
    declared d = {.low = {INFINITY, INFINITY, INFINITY},
                  .high = {-INFINITY, -INFINITY, -INFINITY},
                  .all_measured = true};
    for (uint32_t i = 0; i < source->scan_count; i++) {
        const prep_scan_info *info = &source->scans[i].info;
        d.all_measured = d.all_measured && source->scans[i].measured;
        for (int a = 0; a < 3; a++)
            d.low[a] = fmin(d.low[a], info->low[a]), d.high[a] = fmax(d.high[a], info->high[a]);
        if (info->step > 0) {
            if (d.step == 0 || info->step < d.step) d.step = info->step;
            if (d.offset == NULL) d.offset = info->offset;
        } else {
            d.any_float = true;
        }
    }
    for (int a = 0; a < 3; a++)
        d.extent = fmax(d.extent, d.high[a] - d.low[a]);
    return d;
}

/* The step that points of this extent ask for. */
static double step_for(const declared *d, double extent)
{
    double floats = extent > 0 ? ldexp(1, ilogb(extent) - 30) : 0, step = d->step;
    if (step == 0) return floats;
    while (d->any_float && floats > 0 && step > floats)
        step /= 2;
    while (extent / step >= 0x1p32)
        step *= 2;
    return step;
}

/* True if that step is coarser than the points deserve. */
static bool is_coarse(const declared *d)
{
    double wanted = d->step > 0 && !d->any_float ? d->step : fmax(STEP_FINE_M, d->step);
    return step_for(d, d->extent) > wanted;
}

bool prep_frame_grid(const prep_source *source, mospt_grid *out, bool *doubtful, mospt_err *err)
{
    declared d = look_at(source);
    double step = d.step;
    while (d.any_float && step > 0 && d.extent > 0 && step > ldexp(d.extent, -30))
        step /= 2;
    bool ok = mospt_grid_make(d.low, d.high, step, d.offset, out, err);
    *doubtful = !d.all_measured && (!ok || is_coarse(&d));
    return ok || *doubtful;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Where the samples lie along an axis, without the strays. values: [count], for sorting */
static void find_core(const prep_source *source, int axis, double *values, double *low,
                      double *high)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < source->scan_count; i++)
        for (uint32_t k = 0; k < source->scans[i].sample_count; k++)
            values[count++] = source->scans[i].samples[k][axis];
    qsort(values, count, sizeof *values, compare);
    uint32_t tail = (uint32_t)(STRAYS * count);
    *low = values[tail], *high = values[count - 1 - tail];
}

bool prep_frame_range(const prep_source *source, double low[3], double high[3])
{
    declared d = look_at(source);
    double extent = 0;
    uint32_t count = 0;
    if (source->options.has_range || source->scan_count == 0 || !d.all_measured || !is_coarse(&d))
        return false;
    for (uint32_t i = 0; i < source->scan_count; i++)
        count += source->scans[i].sample_count;
    double *values = malloc((count + 1) * sizeof *values);
    if (values == NULL || count == 0) {
        free(values);
        return false; /* a coarser grid is no fault */
    }
    for (int a = 0; a < 3; a++) {
        find_core(source, a, values, &low[a], &high[a]);
        extent = fmax(extent, high[a] - low[a]);
    }
    free(values);
    if (!(d.extent > FAR * extent)) return false;

    /* Half of what the grid can hold, so that it can be put anywhere; more than a site needs. */
    double step = fmax(step_for(&d, extent), d.step > 0 ? d.step : STEP_FINE_M);
    for (int a = 0; a < 3; a++) {
        double middle = low[a] + (high[a] - low[a]) / 2;
        low[a] = middle - 0x1p30 * step, high[a] = middle + 0x1p30 * step;
    }
    return true;
}
