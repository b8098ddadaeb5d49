/* mospt/cell.h - cells of the nested octree as bit strings, without any floating-point box.
 *
 * A node of the outer octree is a cube: a level (0 is the root), and the grid coordinates of its
 * low corner. It is 2^(bits - level) steps wide; from level `bits` on, where the grid has no finer
 * position, every level is one step wide and all points fall into octant 0. Inside a node, the cell
 * of a point at depth i is the next i bits of each coordinate, here as a Morton code of 3 i bits: x
 * is bit 0, y bit 1, z bit 2 of each octant. */
#pragma once
#include "mospt/grid.h"

enum {
    MOSPT_DEPTH_MIN = 1,
    MOSPT_DEPTH_MAX = 9,    /* of an inner octree: its finest cells are then numbered in 27 bits */
    MOSPT_CODE_LEVELS = 21, /* that a 64-bit Morton code holds */
};

/* log2 of the width of a node at `level`, steps. */
static inline uint32_t mospt_cell_bits(const mospt_grid *grid, uint32_t level)
{
    return level < grid->bits ? grid->bits - level : 0;
}

/* Width of a node at `level`, steps. */
static inline uint64_t mospt_cell_width(const mospt_grid *grid, uint32_t level)
{
    return UINT64_C(1) << mospt_cell_bits(grid, level);
}

/* Puts two zero bits between each two of the lower 21 bits. */
static inline uint64_t mospt_morton_spread(uint64_t v)
{
    v &= 0x1fffff;
    v = (v | v << 32) & UINT64_C(0x001f00000000ffff);
    v = (v | v << 16) & UINT64_C(0x001f0000ff0000ff);
    v = (v | v << 8) & UINT64_C(0x100f00f00f00f00f);
    v = (v | v << 4) & UINT64_C(0x10c30c30c30c30c3);
    v = (v | v << 2) & UINT64_C(0x1249249249249249);
    return v;
}

/* The same for the lower 10 bits. */
static inline uint32_t mospt_morton_spread_short(uint32_t v)
{
    v &= 0x3ff;
    v = (v | v << 16) & 0x030000ff;
    v = (v | v << 8) & 0x0300f00f;
    v = (v | v << 4) & 0x030c30c3;
    v = (v | v << 2) & 0x09249249;
    return v;
}

/* Morton code of the first `depth` (at most 21) levels below a node that is 2^cell_bits steps wide.
 * The point must lie in the node: of its coordinates only the lower cell_bits are looked at. Below
 * the grid's resolution the code ends in zeros. */
static inline uint64_t mospt_cell_code(uint32_t x, uint32_t y, uint32_t z, uint32_t cell_bits,
                                       uint32_t depth)
{
    uint64_t mask = (UINT64_C(1) << cell_bits) - 1;
    uint64_t lx = x & mask, ly = y & mask, lz = z & mask;
    if (cell_bits >= depth) {
        uint32_t drop = cell_bits - depth;
        lx >>= drop, ly >>= drop, lz >>= drop;
    } else {
        uint32_t pad = depth - cell_bits;
        lx <<= pad, ly <<= pad, lz <<= pad;
    }
    return mospt_morton_spread(lx) | mospt_morton_spread(ly) << 1 | mospt_morton_spread(lz) << 2;
}

/* Coordinates of some points, axis by axis. */
enum { MOSPT_CELL_POINTS_MAX = 128 };
typedef struct {
    uint32_t x[MOSPT_CELL_POINTS_MAX], y[MOSPT_CELL_POINTS_MAX], z[MOSPT_CELL_POINTS_MAX];
} mospt_cell_points;

/* Codes of `count` points, as mospt_cell_code() makes them; short ones of at most 10 levels. */
void mospt_cell_codes(const mospt_cell_points *restrict points, uint32_t count, uint32_t cell_bits,
                      uint32_t depth, uint64_t *restrict codes);
void mospt_cell_codes_short(const mospt_cell_points *restrict points, uint32_t count,
                            uint32_t cell_bits, uint32_t depth, uint32_t *restrict codes);

/* True if a point lies in the node at `level` whose low corner is `corner`. */
static inline bool mospt_cell_contains(const mospt_grid *grid, const uint32_t corner[3],
                                       uint32_t level, uint32_t x, uint32_t y, uint32_t z)
{
    uint32_t bits = mospt_cell_bits(grid, level);
    return ((uint64_t)x >> bits) == ((uint64_t)corner[0] >> bits) &&
           ((uint64_t)y >> bits) == ((uint64_t)corner[1] >> bits) &&
           ((uint64_t)z >> bits) == ((uint64_t)corner[2] >> bits);
}

/* Low corner of child `octant` of a node at `level`. Below the resolution only octant 0 exists. */
static inline void mospt_cell_child(const mospt_grid *grid, const uint32_t corner[3],
                                    uint32_t level, uint32_t octant, uint32_t out[3])
{
    uint32_t bits = mospt_cell_bits(grid, level);
    for (int a = 0; a < 3; a++)
        out[a] =
            corner[a] + (bits > 0 && (octant >> a & 1) ? (uint32_t)(UINT64_C(1) << (bits - 1)) : 0);
}
