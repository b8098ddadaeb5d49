#include "mospt/cell.h"

#include "mospt/wide.h"

MOSPT_WIDE void mospt_cell_codes(const mospt_cell_points *restrict points, uint32_t count,
                                 uint32_t cell_bits, uint32_t depth, uint64_t *restrict codes)
{
    for (uint32_t i = 0; i < count; i++)
        codes[i] = mospt_cell_code(points->x[i], points->y[i], points->z[i], cell_bits, depth);
}

MOSPT_WIDE void mospt_cell_codes_short(const mospt_cell_points *restrict points, uint32_t count,
                                       uint32_t cell_bits, uint32_t depth, uint32_t *restrict codes)
{
    uint32_t drop = cell_bits > depth ? cell_bits - depth : 0,
             pad = depth > cell_bits ? depth - cell_bits : 0, mask = (1u << depth) - 1;
    for (uint32_t i = 0; i < count; i++)
        codes[i] = mospt_morton_spread_short((points->x[i] >> drop << pad) & mask) |
                   mospt_morton_spread_short((points->y[i] >> drop << pad) & mask) << 1 |
                   mospt_morton_spread_short((points->z[i] >> drop << pad) & mask) << 2;
}
