/* preprocess/build.h - from files of scans to a dataset.
 *
 * Wimmer & Scheiblauer 2006, section 5.2: find the bounds, stream all points through passes, write
 * the hierarchy. */
#pragma once
#include "mospt/dataset.h"
#include "preprocess/source.h"

enum { PREP_INNER_DEPTH_DEFAULT = 6 };

typedef enum { PREP_PHASE_MEASURE, PREP_PHASE_READ, PREP_PHASE_WRITE, PREP_PHASES } prep_phase;

/* "measuring", "reading", "building" */
const char *prep_phase_name(prep_phase phase);

typedef struct {
    prep_phase phase;
    uint64_t points, points_total; /* of this phase; total 0: unknown */
    double share;                  /* of the whole build, 0 to 1; below 0: unknown */
    uint64_t scratch_bytes;
} prep_progress;

typedef struct {
    const char *const *inputs; /* [input_count] files and folders */
    size_t input_count;
    const char *output;      /* the dataset */
    const char *temp_dir;    /* for scratch files; NULL: beside the output */
    bool compress_scratch;   /* of these, with LZ4 */
    bool force;              /* replace a dataset that is there */
    bool dedupe;             /* of several points at one position, keep only the first */
    uint32_t threads;        /* 0: one per processor */
    uint64_t memory;         /* bytes, the peak of the process; 0: a quarter of the machine */
    uint32_t inner_depth;    /* 0: 6 */
    prep_scan_options scans; /* columns, poses, crop */
    const char *attributes;  /* names, separated by commas, of those to keep besides "scan", or
                                "none"; NULL: all */
    const char *crs;         /* coordinate reference system; NULL: what the scans say */
    /* Told often, by one thread at a time; returns false to stop. NULL: none. */
    bool (*progress)(void *context, const prep_progress *progress);
    /* Told before the points are read: points (0: unknown), and the scratch space that may be
     * needed. And `again` if they have less in common than those looked at first, so that they are
     * read once more. */
    void (*announce)(void *context, uint64_t points, uint64_t scratch_bytes, uint64_t output_bytes,
                     bool again);
    void *context;
} prep_build_options;

typedef struct {
    mospt_metadata metadata; /* as committed */
    prep_source source;      /* scans, what they dropped, and files left out */
    prep_folder_list files;
    uint32_t node_count, level_count;
    uint64_t kept_points; /* that an interrupted build had left, and need not be written again */
    uint64_t payload_bytes, peak_memory;
    uint64_t scratch_bytes, scratch_announced; /* used at the most, and said before */
    double seconds[PREP_PHASES], total_seconds;
} prep_build_result;

void prep_build_result_fini(prep_build_result *result);

/* True if some of what was asked for is not in the dataset: a file left out, or a damaged one of
 * which a part was read. */
bool prep_build_left_something_out(const prep_build_result *result);

/* Builds a dataset.
 * out      released by prep_build_result_fini(), also when the build fails: it says which files
 * were left out errors   MOSPT_EINVAL (output exists, memory too small), MOSPT_EEMPTY (no point in
 * any input), MOSPT_EIO, MOSPT_ECANCELLED; nothing is left behind then but an
 *          unfinished dataset, from which the same build goes on */
bool prep_build(const prep_build_options *options, prep_build_result *out, mospt_err *err);
