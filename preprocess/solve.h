/* preprocess/solve.h - the subtree of a node whose points are all in memory.
 *
 * One sort by Morton code; then every cell of every level is a run of the sorted array, and the
 * passes of Wimmer & Scheiblauer 2006, section 5.2, are linear scans over it. The result is that of
 * streaming the points one by one: of each finest cell the first point is accepted and the others
 * rejected to the child's octant, unless fewer than `add_threshold` are, which are then added. */
#pragma once
#include "mospt/linear.h"
#include "mospt/payload.h"
#include "preprocess/workers.h"

enum {
    PREP_ADD_THRESHOLD = 4096, /* points that a child has at least; */
    PREP_ADD_SIZE = 4 << 20,   /* fewer where they are wide: bytes of their records */
    PREP_PILE_MAX = 1 << 18,   /* points of a node of a pile, at most, */
    PREP_PILE_SIZE = 6 << 20,  /* and bytes of their records */
};

/* The threshold of points that have not said another one. */
uint32_t prep_add_threshold(size_t record_size);

/* Most points of a node of a pile, whose cube is one step wide, so that all are at one position. */
uint32_t prep_pile_points(size_t record_size);

typedef struct {
    const mospt_grid *grid;     /* borrowed */
    const mospt_schema *schema; /* borrowed */
    uint32_t inner_depth;
    uint32_t add_threshold;
} prep_shape;

/* A node, and the points that it keeps. */
typedef struct {
    mospt_node node; /* corner, level, child_mask, count and payload_size; the rest is told by
                        prep_solve_emit() */
    uint64_t *keys;  /* [node.count], borrowed, in the caller's working memory, by rising cell */
    uint32_t first;  /* so many points of the subtree are in the nodes before it */
    uint32_t cell_shift; /* of its keys, see mospt_linear_input */
} prep_solved;

/* Which point is in which node: nodes with their keys, parents first, octants in their order. */
typedef struct {
    prep_solved *nodes; /* [node_count], owned */
    uint32_t node_count, node_capacity;
    uint32_t index_bits; /* of the keys */
} prep_subtree;

void prep_subtree_fini(prep_subtree *subtree);

/* Bytes of working memory for `count` points, which the subtree goes on using; the records come on
 * top. */
size_t prep_solve_work_size(uint32_t count);

/* Divides points among the nodes of a subtree.
 * records  `count` of them, all inside the node, in the order in which they arrived
 * work     prep_solve_work_size(count) bytes, aligned for any type
 * out      released by prep_subtree_fini()
 * errors   MOSPT_ENOMEM, MOSPT_EINVAL (deeper than a file can say)
 * threads  any */
bool prep_solve(const prep_shape *shape, const uint32_t corner[3], uint32_t level,
                const mospt_records *records, uint32_t count, void *work, prep_subtree *out,
                mospt_err *err);

/* The same for many points, in two steps. All workers sort them, and divide them as long as they
 * are many; what comes of that are pieces, which are solved by one thread each. The nodes of all
 * pieces, one after another, are those of the subtree. */
typedef struct prep_solving prep_solving;

/* Parameters as of prep_solve().
 * out      ended by prep_solving_end()
 * threads  that of the workers */
bool prep_solving_begin(const prep_shape *shape, prep_workers *workers, const uint32_t corner[3],
                        uint32_t level, const mospt_records *records, uint32_t count, void *work,
                        prep_solving **out, mospt_err *err);
uint32_t prep_solving_pieces(const prep_solving *solving);

/* threads  any, each piece once */
bool prep_solving_piece(const prep_solving *solving, uint32_t piece, prep_subtree *out,
                        mospt_err *err);
void prep_solving_end(prep_solving *solving);

/* Makes one node of all the given points.
 * child_mask  octants that have a child; no two of the points in such an octant share a finest cell
 */
bool prep_solve_node(const prep_shape *shape, const uint32_t corner[3], uint32_t level,
                     uint8_t child_mask, const mospt_records *records, uint32_t count, void *work,
                     prep_subtree *out, mospt_err *err);

/* Bytes of working memory for the payload of a node of `count` points. */
size_t prep_solve_emit_size(const prep_shape *shape, uint32_t count);

/* Makes the payload of a node, and completes what is said of the node.
 * memory   prep_solve_emit_size() bytes, aligned for any type; the payload is where it begins
 * returns  the sum of the hashes of the points as they stand in the payload
 * threads  any, each node once */
uint64_t prep_solve_emit(const prep_shape *shape, const mospt_records *records,
                         prep_subtree *subtree, uint32_t node, void *memory);
