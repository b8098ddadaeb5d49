/* mospt/linear.h - the points of one inner octree in the order of its levels: a MOSPT.
 *
 * Wimmer & Scheiblauer 2006, sections 4.4 to 4.6. Every inner cell is represented by one of the
 * original points below it, the one whose colour is nearest to the average of its children; a point
 * stands in the coarsest level that it represents. So the first level_end[i] points are level i:
 * exactly one point for each occupied cell of depth i. Points that share a finest cell with another
 * one (octants that add, section 4.6) follow in one more level, depth + 1. */
#pragma once
#include "mospt/hierarchy.h"
#include "mospt/point.h"

/* A point in the Morton order of its node. */
typedef struct {
    uint64_t code;  /* mospt_cell_code() of at least `depth` levels */
    uint32_t index; /* of its record */
} mospt_linear_key;

typedef struct {
    const uint8_t *records; /* [..][stride], borrowed; each starts with a vertex, and all of it
                               orders points in one cell */
    size_t stride;
    uint32_t depth;      /* of the inner octree, MOSPT_DEPTH_MIN to MOSPT_DEPTH_MAX */
    uint32_t code_shift; /* bits of the codes below that depth: the cell of a key is code >>
                            code_shift */
} mospt_linear_input;

/* Bytes of working memory that mospt_linear_build() needs for `count` points. */
size_t mospt_linear_work_size(uint32_t count);

/* Puts the points of one node in the order of a MOSPT.
 * keys       [count], by rising cell; those in one cell may come in any order, and are put into the
 * one that their bytes give work       mospt_linear_work_size(count) bytes, aligned for any type
 * order      out, [count] record indices, coarsest level first, Morton order within a level
 * level_end  out, [depth + 2] */
void mospt_linear_build(const mospt_linear_input *input, mospt_linear_key *keys, uint32_t count,
                        void *work, uint32_t *order, uint32_t *level_end);

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
