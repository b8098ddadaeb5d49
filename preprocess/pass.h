/* preprocess/pass.h - one pass: a stream of points fills several levels of the outer octree at
 * once.
 *
 * Wimmer & Scheiblauer 2006, section 5.2. Of each finest cell of a node the first point is
 * accepted; the others go on to the node in the next level, and after the last level of the pass
 * into the rejection file of that octant. A rejection file that fits in memory is finished in one
 * go (preprocess/solve.h); a larger one is the input of another pass. What comes out does not
 * depend on the number of levels of a pass, on memory, or on threads: only on the points and their
 * order.
 *
 * Each batch is partitioned by the octant at the end of the pass (a stable counting sort), and one
 * worker has one octant at a time: it owns every cell there, at every level of the pass, so nothing
 * is locked. */
#pragma once
#include "mospt/writer.h"
#include "preprocess/solve.h"
#include "preprocess/spool.h"
#include "preprocess/workers.h"

enum { PREP_PASS_LEVELS_MAX = 3 };

/* What has been written so far. */
typedef struct {
    uint64_t points, points_hash;
} prep_written;

/* Told now and then, by one thread at a time. Returns false to stop the build. */
typedef bool (*prep_pass_report)(void *context, const prep_written *written);

typedef struct {
    const prep_shape *shape;
    prep_workers *workers;
    prep_store *store;
    mospt_writer *writer;
    uint32_t levels;       /* of the outer octree that one pass fills, 1 to PREP_PASS_LEVELS_MAX */
    uint32_t batch_count;  /* records that one call inserts at most */
    size_t solve_memory;   /* bytes for rejection files being finished */
    prep_written *written; /* borrowed, added to */
    prep_pass_report report;
    void *report_context;
} prep_pass_env;

typedef struct prep_pass prep_pass;

/* Bytes of the bit sets that a pass may need at the worst. */
size_t prep_pass_cells_size(uint32_t levels, uint32_t inner_depth);

/* Starts a pass at a node of the outer octree. env: borrowed until the end. */
bool prep_pass_begin(const prep_pass_env *env, const uint32_t corner[3], uint32_t level,
                     prep_pass **out, mospt_err *err);

/* Inserts records, all inside the node, in the order in which they arrive.
 * records  [count][mospt_record_size()], count at most env->batch_count */
bool prep_pass_insert(prep_pass *pass, const uint8_t *records, uint32_t count, mospt_err *err);

/* Writes the nodes of the pass and all that is below them. Frees the pass, also when it fails. */
bool prep_pass_end(prep_pass *pass, mospt_err *err);

/* Frees a pass that will not be ended. NULL is fine. */
void prep_pass_abandon(prep_pass *pass);
