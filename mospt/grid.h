/* mospt/grid.h - integer grid coordinates for every point of a dataset.
 *
 * A world coordinate is offset + (base + g) * step metres, with g an unsigned 32-bit grid
 * coordinate; offset and step are those of LAS where a site is made of LAS, so that its positions
 * come back bit for bit. The root cube of the outer octree spans 2^bits steps from the corner
 * `root`, whose lower `bits` bits are zero: the cell of a point at level L is the top L of the
 * lower `bits` bits of its coordinates. What lies around the root cube in the 32-bit range is room
 * to grow. */
#pragma once
#include "mospt/err.h"

enum { MOSPT_GRID_BITS_MAX = 32 };

typedef struct {
    double offset[3]; /* metres */
    int64_t base[3];  /* steps */
    double step;      /* metres, > 0 */
    uint32_t bits;    /* log2 of the width of the root cube in steps, 0 to 32 */
    uint32_t root[3]; /* low corner of the root cube, grid coordinates */
} mospt_grid;

/* Makes the grid for points that lie in [low, high].
 * step     wanted step, metres; 0: a power of two, at most extent / 2^30. A wanted step too fine
 * for 32 bits is doubled until it fits. offset   see above; NULL: zero errors   MOSPT_EINVAL:
 * bounds that are not finite, or too far from zero for 2^62 steps */
bool mospt_grid_make(const double low[3], const double high[3], double step, const double offset[3],
                     mospt_grid *out, mospt_err *err);

/* True if every field is in its range, and the root cube inside the 32-bit range. */
bool mospt_grid_is_valid(const mospt_grid *grid);

/* Nearest grid coordinates of a world position; false if that lies outside the root cube. */
bool mospt_grid_from_world(const mospt_grid *grid, const double world[3], uint32_t out[3]);

static inline double mospt_grid_axis_to_world(const mospt_grid *grid, int axis, uint32_t g)
{
    return (double)(grid->base[axis] + (int64_t)g) * grid->step + grid->offset[axis];
}

static inline void mospt_grid_to_world(const mospt_grid *grid, const uint32_t g[3], double world[3])
{
    for (int a = 0; a < 3; a++)
        world[a] = mospt_grid_axis_to_world(grid, a, g[a]);
}
