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
#include "preprocess/arena.h"
#include "preprocess/resume.h"
#include "preprocess/solve.h"
#include "preprocess/spool.h"
#include "preprocess/workers.h"

enum {
    PREP_PASS_LEVELS_MAX = 3,
    PREP_PASS_SLICE_MIN = 64,
    PREP_PASS_SLICE_MAX = 4096,
};

/* Told now and then, by one thread at a time. Returns false to stop the build. */
typedef bool (*prep_pass_report)(void *context);

typedef struct {
    const prep_shape *shape;
    prep_workers *workers;
    prep_store *store;
    mospt_writer *writer;
    prep_arena *arena;     /* for rejection files being finished */
    bool divides;          /* nothing is accepted: points are only divided among octants */
    uint32_t levels;       /* of the outer octree that one pass fills, 1 to PREP_PASS_LEVELS_MAX */
    uint32_t slice_points; /* records that one thread prepares at a time: they fit its cache; a
                              power of two, PREP_PASS_SLICE_MIN to PREP_PASS_SLICE_MAX */
    uint32_t batch_slices; /* that one call inserts at most */
    size_t emit_memory;    /* bytes for the payloads of their nodes */
    uint64_t solve_points; /* rejection files up to so many points are finished in one go */
    const prep_resume *resume; /* what need not be made again; NULL: nothing */
    prep_pass_report report;
    void *report_context;
} prep_pass_env;

typedef struct prep_pass prep_pass;

/* Bytes of the bit sets that a pass may need at the worst. */
size_t prep_pass_cells_size(uint32_t levels, uint32_t inner_depth);

/* Starts a pass at a node of the outer octree. env: borrowed until the end. */
bool prep_pass_begin(const prep_pass_env *env, const uint32_t corner[3], uint32_t level,
                     prep_pass **out, mospt_err *err);

/* Writes the records of a slice of a batch, at most env->slice_points, all inside the node. Returns
 * how many. A job: it touches only what its index names. */
typedef uint32_t (*prep_pass_prepare)(void *context, uint32_t slice, uint8_t *records);

/* Inserts a batch. Its slices are prepared now, in any order and by all workers; the records are
 * sent to their cells, in the order of the slices, together with the next batch.
 * slice_count  at most env->batch_slices */
bool prep_pass_insert(prep_pass *pass, uint32_t slice_count, prep_pass_prepare prepare,
                      void *context, mospt_err *err);

/* Writes the nodes of the pass and all that is below them. Frees the pass, also when it fails. */
bool prep_pass_end(prep_pass *pass, mospt_err *err);

/* What lies in an octant. */
typedef bool (*prep_pass_part)(void *context, prep_spool *spool, const uint32_t corner[3],
                               uint32_t level, mospt_err *err);

/* Ends a pass that only divides: hands over what lies in each octant, in Morton order, or all that
 * lies at one position. Frees the pass, also when it fails. */
bool prep_pass_divide(prep_pass *pass, prep_pass_part part, void *context, mospt_err *err);

/* Frees a pass that will not be ended. NULL is fine. */
void prep_pass_abandon(prep_pass *pass);
