#include "mospt/grid.h"

#include <math.h>
#include <string.h>

/* The root cube is put at an odd place of every second level above it (binary ...0101), so that
 * growing by one level makes room on one side of it and growing by two levels on both. */
static uint32_t root_corner(uint32_t bits)
{
    uint64_t pattern = 0;
    for (uint32_t bit = bits; bit + 1 < 32; bit += 2)
        pattern |= UINT64_C(1) << bit;
    return (uint32_t)pattern;
}

static uint32_t bits_for(double steps)
{
    uint32_t bits = 0;
    while (bits < 40 && ldexp(1, (int)bits) <= steps)
        bits++;
    return bits;
}

static void put_root(mospt_grid *grid, const double low[3], double step, uint32_t bits)
{
    uint32_t corner = root_corner(bits);
    grid->step = step;
    grid->bits = bits;
    for (int a = 0; a < 3; a++) {
        grid->root[a] = corner;
        grid->base[a] = (int64_t)floor((low[a] - grid->offset[a]) / step) - (int64_t)corner;
    }
}

bool mospt_grid_make(const double low[3], const double high[3], double step, const double offset[3],
                     mospt_grid *out, mospt_err *err)
{
    mospt_grid grid = {0};
    double extent = 0, largest = 0;
    for (int a = 0; a < 3; a++) {
        if (!isfinite(low[a]) || !isfinite(high[a]) || !(low[a] <= high[a]))
            return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                                 "bounds %g to %g along axis %c are not a range", low[a], high[a],
                                 "xyz"[a]);
        grid.offset[a] = offset != NULL ? offset[a] : 0;
        extent = fmax(extent, high[a] - low[a]);
        largest =
            fmax(largest, fmax(fabs(low[a] - grid.offset[a]), fabs(high[a] - grid.offset[a])));
    }
    if (!isfinite(extent) || !isfinite(largest))
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "bounds reach further than numbers do");
    if (!(step > 0)) {
        step = extent > 0 ? ldexp(1, ilogb(extent) - 30) : 0;
        /* A double holds 53 bits: a finer step than the last of them would only store noise. Points
         * all at one position get that step, and points all at the origin any. */
        step = fmax(step, largest > 0 ? ldexp(1, (int)ceil(log2(largest)) - 53) : 0x1p-20);
        step = fmax(step, 0x1p-1000);
    }
    for (;; step *= 2) {
        uint32_t bits = bits_for(ceil(extent / step) + 1);
        if (bits > MOSPT_GRID_BITS_MAX) continue;
        if (!(largest / step < 0x1p62 - 0x1p33))
            return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                                 "coordinates up to %g need more than 2^62 steps of %g", largest,
                                 step);
        /* Where steps are finer than a double can tell, rounding may put the far corner further
         * out. */
        for (; bits <= MOSPT_GRID_BITS_MAX; bits++) {
            uint32_t unused[3];
            put_root(&grid, low, step, bits);
            if (!mospt_grid_from_world(&grid, low, unused) ||
                !mospt_grid_from_world(&grid, high, unused))
                continue;
            *out = grid;
            return true;
        }
    }
}

bool mospt_grid_is_valid(const mospt_grid *grid)
{
    if (!(grid->step > 0) || !isfinite(grid->step) || grid->bits > MOSPT_GRID_BITS_MAX)
        return false;
    uint64_t width = UINT64_C(1) << grid->bits;
    for (int a = 0; a < 3; a++) {
        if (!isfinite(grid->offset[a])) return false;
        if (grid->base[a] > INT64_MAX / 2 || grid->base[a] < INT64_MIN / 2) return false;
        if ((grid->root[a] & (width - 1)) != 0) return false;
    }
    return true;
}

bool mospt_grid_from_world(const mospt_grid *grid, const double world[3], uint32_t out[3])
{
    double width = ldexp(1, (int)grid->bits);
    for (int a = 0; a < 3; a++) {
        double steps = nearbyint((world[a] - grid->offset[a]) / grid->step);
        double local = steps - (double)(grid->base[a] + (int64_t)grid->root[a]);
        if (!(local >= 0 && local < width)) return false;
        out[a] = grid->root[a] + (uint32_t)local;
    }
    return true;
}
