/* preprocess/solve.h - the subtree of a node whose points are all in memory.
 *
 * One sort by Morton code; then every cell of every level is a run of the sorted array, and the
 * passes of Wimmer & Scheiblauer 2006, section 5.2, are linear scans over it. The result is that of
 * streaming the points one by one: of each finest cell the first point is accepted and the others
 * rejected to the child's octant, unless fewer than `add_threshold` are, which are then added. */
#pragma once
#include "mospt/linear.h"
#include "mospt/payload.h"

enum {
    PREP_ADD_THRESHOLD = 4096, /* default: a child has at least so many points */
    PREP_PILE_MAX =
        1
        << 18, /* points of one node whose cube is one step wide, so that all are at one position */
};

typedef struct {
    const mospt_grid *grid;     /* borrowed */
    const mospt_schema *schema; /* borrowed */
    uint32_t inner_depth;
    uint32_t add_threshold;
} prep_shape;

/* Nodes with their payloads, parents first, octants in their order. */
typedef struct {
    mospt_node *nodes; /* [node_count], owned; payload_offset counts from `payload` */
    uint32_t node_count, node_capacity;
    uint8_t *payload; /* [point_count][mospt_record_size()], owned */
    uint64_t point_count;
    uint64_t points_hash; /* of the points as they stand in the payloads */
} prep_subtree;

void prep_subtree_fini(prep_subtree *subtree);

/* Bytes that prep_solve() takes for each point: its result and its working memory, the caller's
 * records not counted. */
size_t prep_solve_point_size(const prep_shape *shape);

/* Builds the subtree below a node.
 * records  [count][mospt_record_size()], all inside the node, in the order in which they arrived
 * out      released by prep_subtree_fini()
 * errors   MOSPT_ENOMEM, MOSPT_EINVAL (deeper than a file can say)
 * threads  any */
bool prep_solve(const prep_shape *shape, const uint32_t corner[3], uint32_t level,
                const uint8_t *records, uint32_t count, prep_subtree *out, mospt_err *err);

/* Makes one node of all the given points.
 * child_mask  octants that have a child; no two of the points in such an octant share a finest cell
 */
bool prep_solve_node(const prep_shape *shape, const uint32_t corner[3], uint32_t level,
                     uint8_t child_mask, const uint8_t *records, uint32_t count, prep_subtree *out,
                     mospt_err *err);
