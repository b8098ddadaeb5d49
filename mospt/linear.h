/* mospt/linear.h - the points of one inner octree in the order of its levels: a MOSPT.
 *
 * Wimmer & Scheiblauer 2006, sections 4.4 to 4.6. Every inner cell is represented by one of the
 * original points below it, the one whose colour is nearest to the average of its children; a point
 * stands in the coarsest level that it represents. So the first level_end[i] points are level i:
 * exactly one point for each occupied cell of depth i. Points that share a finest cell with another
 * one (octants that add, section 4.6) follow in one more level, depth + 1. What a level adds is
 * dealt (mospt/deal.h), so that a prefix that ends inside of it is even, too. */
#pragma once
#include "mospt/hierarchy.h"
#include "mospt/point.h"

/* A key is a point in the Morton order of its node: the cell in its upper bits, the index of its
 * record in the lower `index_bits`. */
typedef struct {
    const mospt_records *records; /* borrowed; all of a record orders points in one cell */
    uint32_t depth;               /* of the inner octree, MOSPT_DEPTH_MIN to MOSPT_DEPTH_MAX */
    uint32_t index_bits;          /* 0 to 32 */
    uint32_t cell_shift; /* bits of a key below that depth, the index included: the cell of a key is
                            key >> cell_shift */
} mospt_linear_input;

static inline uint32_t mospt_linear_index(uint64_t key, uint32_t index_bits)
{
    return (uint32_t)(key & ((UINT64_C(1) << index_bits) - 1));
}

/* Bytes of working memory that mospt_linear_build() needs for `count` points. */
size_t mospt_linear_work_size(uint32_t count);

/* Puts the points of one node in the order of a MOSPT.
 * keys       [count], by rising cell; those in one cell may come in any order, and are put into the
 *            one that their bytes give
 * work       mospt_linear_work_size(count) bytes, aligned for any type
 * order      out, [count] record indices, coarsest level first; within a level the Morton
 *            order, dealt (mospt/deal.h)
 * level_end  out, [depth + 2] */
void mospt_linear_build(const mospt_linear_input *input, uint64_t *keys, uint32_t count, void *work,
                        uint32_t *order, uint32_t *level_end);

/* The colour of a point, as they are compared. */
static inline uint32_t mospt_linear_colour(const mospt_vertex *v)
{
    return v->r | (uint32_t)v->g << 8 | (uint32_t)v->b << 16;
}

/* Which of up to eight points that stand for the children of a cell stands for the cell itself
 * (section 4.6).
 * colours  [count], in Morton order */
uint32_t mospt_linear_choose(const uint32_t *colours, uint32_t count);

/* Number of leading points to draw so that cells of the level drawn are at most `max_px` wide on
 * screen, or all. root_px  projected width of the node's cube, pixels; each level halves it */
static inline uint32_t mospt_linear_prefix(const uint32_t *level_end, uint32_t depth, float root_px,
                                           float max_px)
{
    uint32_t level = 0;
    while (level <= depth && root_px > max_px)
        root_px *= 0.5f, level++;
    return level_end[level <= depth ? level : depth + 1];
}
