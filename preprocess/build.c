#include "preprocess/build.h"

#include "mospt/file.h"
#include "preprocess/attributes.h"
#include "preprocess/dedupe.h"
#include "preprocess/feed.h"
#include "preprocess/feed_scans.h"
#include "preprocess/finish.h"
#include "preprocess/frame.h"
#include "preprocess/generations.h"
#include "preprocess/output.h"
#include "preprocess/plan.h"
#include "preprocess/provenance.h"
#include "preprocess/resume.h"

#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

typedef struct {
    const prep_build_options *options;
    prep_build_result *result;
    prep_workers *workers;
    uint64_t memory; /* bytes, the peak of the process */
    prep_plan plan;
    bool bypasses_cache;
    prep_shape shape;
    mospt_metadata *metadata; /* of the result */
    prep_store *store;
    prep_arena *arena;
    mospt_writer *writer;
    uint64_t identity;   /* of this build, see prep_provenance_hash() */
    prep_resume *resume; /* what an interrupted one has left; NULL: nothing */
    prep_phase phase;
    uint64_t points_total; /* 0: unknown */
    double phase_start;
    char *scratch_folder; /* owned */
    prep_output output;
} build;

const char *prep_phase_name(prep_phase phase)
{
    static const char *const names[PREP_PHASES] = {"measuring", "reading", "building"};
    return names[phase];
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void enter(build *b, prep_phase phase)
{
    double t = now();
    b->result->seconds[b->phase] += t - b->phase_start;
    b->phase = phase;
    b->phase_start = t;
}

static bool tell(build *b, uint64_t points)
{
    if (b->options->progress == NULL) return true;
    prep_progress p = {
        .phase = b->phase, .points = points, .points_total = b->points_total, .share = -1};
    p.scratch_bytes =
        b->store != NULL ? prep_store_scratch_peak(b->store) : b->result->source.spool_size;
    /* Of the time, reading takes about a quarter: measured on sites of 1 to 10 million points. */
    double before = b->phase == PREP_PHASE_WRITE ? 0.25 : 0;
    if (b->points_total > 0 && b->phase != PREP_PHASE_MEASURE)
        p.share = before + (b->phase == PREP_PHASE_WRITE ? 0.75 : 0.25) * (double)points /
                               (double)b->points_total;
    return b->options->progress(b->options->context, &p);
}

static bool tell_points(void *context, uint64_t points)
{
    return tell(context, points);
}

static bool tell_fed(void *context, uint64_t points, bool only_looks)
{
    build *b = context;
    if (only_looks && b->phase == PREP_PHASE_READ) enter(b, PREP_PHASE_MEASURE);
    return tell(b, points);
}

static bool tell_written(void *context)
{
    build *b = context;
    return tell(b, mospt_writer_written(b->writer).points);
}

/* The scratch folder, which must be there. */
static bool choose_scratch(build *b, mospt_err *err)
{
    const prep_build_options *o = b->options;
    b->scratch_folder = o->temp_dir != NULL ? strdup(o->temp_dir) : prep_output_folder(o->output);
    if (b->scratch_folder == NULL) return mospt_err_nomem(err, strlen(o->output));
    if (access(b->scratch_folder, W_OK | X_OK) == 0) return true;
    return mospt_err_set(err, MOSPT_EIO, mospt_at_file(b->scratch_folder), "cannot be written to");
}

static bool check_space(const char *folder, uint64_t needed, const char *what, mospt_err *err)
{
    struct statvfs disk;
    if (statvfs(folder, &disk) != 0) return true; /* then writing will tell */
    uint64_t left = (uint64_t)disk.f_bavail * disk.f_frsize;
    if (left >= needed) return true;
    return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(folder),
                         "%s takes up to %.1f MB there, and %.1f MB are free%s", what,
                         (double)needed / 1e6, (double)left / 1e6,
                         strcmp(what, "scratch space") == 0 ? "; --temp-dir names another disk"
                                                            : "");
}

/* Says how much disk will be needed, and stops where it is not there. */
static bool check_disks(build *b, bool again, mospt_err *err)
{
    uint64_t bytes = mospt_payload_size(&b->metadata->schema, b->points_total),
             scratch = bytes + bytes / 16;
    /* Of a pass, and of one in it, blocks that are not full are left, too. */
    if (bytes + 2 * b->plan.spools_size < b->plan.store_memory) scratch = 0;
    b->result->scratch_announced = scratch + b->result->source.spool_size;
    if (b->options->announce != NULL)
        b->options->announce(b->options->context, b->points_total, b->result->scratch_announced,
                             bytes, again);
    if (!check_space(b->scratch_folder, scratch, "scratch space", err)) return false;
    char *folder = prep_output_folder(b->output.target);
    bool ok = folder != NULL && check_space(folder, bytes, "the dataset", err);
    free(folder);
    return ok;
}

/* Divides what there is among points with the attributes of the schema. */
static bool plan_tree(build *b, bool again, mospt_err *err)
{
    mospt_metadata *m = b->metadata;
    size_t record_size = mospt_record_size(&m->schema);
    m->add_threshold = prep_add_threshold(record_size);
    if (!prep_plan_make(b->memory, record_size, m->inner_depth, prep_workers_count(b->workers),
                        &b->plan, err) ||
        !check_disks(b, again, err))
        return false;
    /* The page cache is left to others by what would be more than its share of it. */
    if (b->bypasses_cache || mospt_payload_size(&m->schema, b->points_total) <= b->memory / 2)
        return true;
    b->bypasses_cache = true;
    return mospt_writer_bypass_cache(b->writer, b->plan.chunk_size, err);
}

static bool measure(build *b, bool all, mospt_err *err)
{
    prep_source *source = &b->result->source;
    enter(b, PREP_PHASE_MEASURE);
    b->points_total = 0;
    if (!prep_source_measure(source, all, tell_points, b, err)) return false;
    double low[3], high[3];
    if (prep_frame_range(source, low, high)) {
        prep_source_set_range(source, low, high);
        if (!prep_source_measure(source, true, tell_points, b, err)) return false;
    }
    if (source->scan_count == 0) {
        if (source->left_out_count == 1 && err != NULL) *err = source->left_out[0].err;
        else
            mospt_err_set(err, MOSPT_EEMPTY, mospt_nowhere(),
                          "no point to build from: %u files were left out", source->left_out_count);
        return false;
    }
    for (uint32_t i = 0; i < source->scan_count; i++) {
        const prep_source_scan *scan = &source->scans[i];
        b->points_total += scan->measured ? scan->points : scan->info.point_count;
    }
    return true;
}

/* Divides all points first, and starts the first pass again without duplicates.
 * pass     in: dividing; out: the first pass; NULL after a failure */
static bool drop_duplicates(build *b, prep_pass_env *env, prep_pass **pass, prep_pack_sums *of_scan,
                            mospt_err *err)
{
    prep_source *source = &b->result->source;
    prep_pass *divided = *pass;
    prep_spool kept = {0};
    prep_dedupe_scan *scans = calloc(source->scan_count, sizeof *scans);
    *pass = NULL;
    if (scans == NULL) {
        prep_pass_abandon(divided);
        return mospt_err_nomem(err, source->scan_count * sizeof *scans);
    }
    bool ok = prep_dedupe(env, divided, scans, source->scan_count, &kept, err);
    for (uint32_t i = 0; ok && i < source->scan_count; i++) {
        scans[i].sums.position_error = of_scan[i].position_error;
        of_scan[i] = scans[i].sums;
        source->scans[i].points -= scans[i].dropped;
        source->scans[i].dropped[PREP_DROP_DUPLICATE] = scans[i].dropped;
    }
    free(scans);
    env->divides = false;
    ok = ok && prep_pass_begin(env, b->metadata->grid.root, 0, pass, err) &&
         prep_feed_spool(env, *pass, &kept, err);
    prep_spool_drop(b->store, &kept);
    return ok;
}

/* Writes all nodes, and commits them as they are finished. Takes over the pass. */
static bool write_tree(build *b, prep_pass *pass, const prep_pack_sums *of_scan, mospt_err *err)
{
    prep_generations *generations = NULL;
    if (!prep_provenance_fill(b->metadata, &b->result->source, of_scan, b->options->crs, err)) {
        prep_pass_abandon(pass);
        return false;
    }
    b->metadata->point_count = b->points_total;
    if (b->resume != NULL) {
        const mospt_metadata *kept = prep_resume_metadata(b->resume);
        b->result->kept_points = kept->point_count;
        mospt_writer_keep(b->writer, kept);
    }
    if (!prep_generations_start(b->writer, b->metadata, b->identity, &generations, err)) {
        prep_pass_abandon(pass);
        return false;
    }
    bool ok = prep_pass_end(pass, err);
    return prep_generations_stop(generations, ok ? err : NULL) && ok;
}

static bool run_passes(build *b, prep_pass_env *env, prep_pack_sums *of_scan,
                       prep_feed_outcome *out, mospt_err *err)
{
    const prep_source *source = &b->result->source;
    prep_pass *pass = NULL;
    enter(b, PREP_PHASE_READ);
    bool ok = prep_pass_begin(env, b->metadata->grid.root, 0, &pass, err) &&
              prep_feed_scans(env, &b->result->source, &b->metadata->schema, tell_fed, b, &pass,
                              of_scan, out, err);
    if (!ok || *out != PREP_FEED_DONE) {
        prep_pass_abandon(pass);
        return ok;
    }
    enter(b, PREP_PHASE_WRITE);
    if (env->divides && !drop_duplicates(b, env, &pass, of_scan, err)) {
        prep_pass_abandon(pass);
        return false;
    }
    b->points_total = 0;
    for (uint32_t i = 0; i < source->scan_count; i++)
        b->points_total += source->scans[i].points;
    if (b->points_total > 0) return write_tree(b, pass, of_scan, err);
    prep_pass_abandon(pass);
    return mospt_err_set(err, MOSPT_EEMPTY, mospt_nowhere(), "no point could be read");
}

/* One try at the whole tree. */
static bool build_tree(build *b, prep_pack_sums *of_scan, prep_feed_outcome *out, mospt_err *err)
{
    b->shape = (prep_shape){.grid = &b->metadata->grid,
                            .schema = &b->metadata->schema,
                            .inner_depth = b->metadata->inner_depth,
                            .add_threshold = b->metadata->add_threshold};
    b->identity = prep_provenance_hash(b->metadata, &b->result->source, b->options->dedupe);
    bool ok = prep_resume_open(b->output.target, b->identity, b->workers, &b->resume, err) &&
              prep_store_create(b->scratch_folder, mospt_record_size(&b->metadata->schema),
                                b->plan.block_size, b->plan.store_memory, &b->store, err) &&
              prep_arena_create(b->plan.solve_memory, &b->arena, err);
    if (ok && b->options->compress_scratch) prep_store_compress(b->store);
    prep_pass_env env = {.shape = &b->shape,
                         .workers = b->workers,
                         .store = b->store,
                         .arena = b->arena,
                         .writer = b->writer,
                         .divides = b->options->dedupe,
                         .levels = b->plan.levels,
                         .slice_points = b->plan.slice_points,
                         .batch_slices = b->plan.batch_slices,
                         .emit_memory = b->plan.emit_memory,
                         .solve_points = b->plan.solve_points,
                         .resume = b->resume,
                         .report = tell_written,
                         .report_context = b};
    ok = ok && run_passes(b, &env, of_scan, out, err);
    uint64_t scratch = b->result->source.spool_size;
    if (b->store != NULL) scratch += prep_store_scratch_peak(b->store);
    if (scratch > b->result->scratch_bytes) b->result->scratch_bytes = scratch;
    prep_resume_close(b->resume);
    prep_store_destroy(b->store);
    prep_arena_destroy(b->arena);
    b->resume = NULL;
    b->store = NULL;
    b->arena = NULL;
    return ok;
}

/* Tries again where the points are not as their headers, or the first of them, have promised. */
static bool try_until_done(build *b, prep_pack_sums *of_scan, mospt_err *err)
{
    const prep_source *source = &b->result->source;
    bool is_measured = false, again = false;
    for (prep_feed_outcome out = PREP_FEED_DIFFERS; out != PREP_FEED_DONE; again = true) {
        bool is_doubtful = false;
        if (out == PREP_FEED_OUTSIDE && is_measured)
            return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                                 "the scans changed while they were read");
        if (out == PREP_FEED_OUTSIDE && !measure(b, true, err)) return false;
        if (out == PREP_FEED_DIFFERS && !plan_tree(b, again, err)) return false;
        is_measured = is_measured || out == PREP_FEED_OUTSIDE;
        for (uint32_t i = 0; i < source->scan_count; i++)
            of_scan[i] = prep_pack_sums_empty;
        if (!prep_frame_grid(source, &b->metadata->grid, &is_doubtful, err)) return false;
        if (is_doubtful) out = PREP_FEED_OUTSIDE;
        else if (!build_tree(b, of_scan, &out, err)) return false;
    }
    return true;
}

/* Conservation of points is not a hope: what was read is what was written. */
static bool check_conservation(const build *b, const mospt_metadata *m, mospt_err *err)
{
    mospt_written written = mospt_writer_written(b->writer);
    if (written.points == b->points_total && written.points_hash == m->points_hash) return true;
    return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(b->output.target),
                         "%llu points were read and %llu written, with checksums %016llx and "
                         "%016llx: the scans have changed, or this is an error of the program",
                         (unsigned long long)b->points_total, (unsigned long long)written.points,
                         (unsigned long long)m->points_hash,
                         (unsigned long long)written.points_hash);
}

static bool run(build *b, mospt_err *err)
{
    const prep_build_options *o = b->options;
    prep_source *source = &b->result->source;
    long processors = sysconf(_SC_NPROCESSORS_ONLN);
    uint32_t threads = o->threads > 0 ? o->threads : processors > 0 ? (uint32_t)processors : 1;
    prep_pack_sums *of_scan;

    b->memory = o->memory > 0 ? o->memory : prep_plan_machine_memory() / 4;
    b->metadata->inner_depth = o->inner_depth > 0 ? o->inner_depth : PREP_INNER_DEPTH_DEFAULT;
    if (!prep_output_choose(o->output, o->force, &b->output, err) || !choose_scratch(b, err))
        return false;
    /* A place that cannot be had is known before the scans are read. */
    if (!mospt_writer_create(b->output.target, b->metadata->inner_depth, &b->writer, err))
        return false;
    if (!prep_folder_list_make(o->inputs, o->input_count, &b->result->files, err)) return false;
    if (!prep_source_open(&b->result->files, &o->scans, b->scratch_folder, source, err))
        return false;
    if (!measure(b, false, err)) return false;
    if (!prep_attributes_choose(source, o->attributes, &b->metadata->schema, err)) return false;
    if (!prep_workers_create(threads, &b->workers, err)) return false;
    of_scan = malloc(source->scan_count * sizeof *of_scan);
    if (of_scan == NULL) return mospt_err_nomem(err, source->scan_count * sizeof *of_scan);
    bool ok = try_until_done(b, of_scan, err) && check_conservation(b, b->metadata, err);
    free(of_scan);
    b->result->node_count = mospt_writer_nodes(b->writer);
    b->result->payload_bytes = mospt_writer_bytes(b->writer);
    ok = ok && mospt_writer_commit(b->writer, b->metadata, err) &&
         prep_output_take_place(&b->output, err);
    b->result->level_count = b->metadata->file_count;
    return ok;
}

/* A person who stops a build wants to know whether that was for nothing. */
static void say_what_is_left(const build *b, mospt_err *err)
{
    mospt_metadata m;
    if (b->output.target == NULL || !mospt_metadata_read(b->output.target, &m, NULL)) return;
    if (m.unfinished.commit > 0)
        mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(),
                      "stopped with %llu of %llu points in %s; the same command goes on from there",
                      (unsigned long long)m.point_count, (unsigned long long)m.unfinished.points,
                      b->output.target);
    mospt_metadata_fini(&m);
}

bool prep_build(const prep_build_options *options, prep_build_result *out, mospt_err *err)
{
    double start = now();
    struct rusage usage;
    *out = (prep_build_result){.source = {.spool_fd = -1}};
    build b = {.options = options, .result = out, .metadata = &out->metadata, .phase_start = start};
    bool ok = run(&b, err);
    enter(&b, PREP_PHASE_MEASURE);
    out->total_seconds = now() - start;
    if (!ok && err != NULL && err->code == MOSPT_ECANCELLED) say_what_is_left(&b, err);
    if (getrusage(RUSAGE_SELF, &usage) == 0) out->peak_memory = (uint64_t)usage.ru_maxrss * 1024;
    mospt_writer_destroy(b.writer);
    prep_workers_destroy(b.workers);
    prep_output_fini(&b.output);
    free(b.scratch_folder);
    return ok;
}

void prep_build_result_fini(prep_build_result *result)
{
    mospt_metadata_fini(&result->metadata);
    prep_source_close(&result->source);
    prep_folder_list_fini(&result->files);
}

bool prep_build_left_something_out(const prep_build_result *result)
{
    if (result->source.left_out_count > 0) return true;
    for (uint32_t i = 0; i < result->source.scan_count; i++)
        if (result->source.scans[i].damage.code != MOSPT_OK) return true;
    return false;
}
