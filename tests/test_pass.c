/* The multi-pass builder writes the same dataset as the builder in memory, whatever memory, levels,
 * batches and threads. */
#include "tests/core_tools.h"

#include "mospt/sink.h"
#include "mospt/writer.h"
#include "preprocess/finish.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <signal.h>

typedef struct {
    uint32_t levels, threads, batch;
    size_t block_size, store_memory, solve_memory;
    uint32_t slice; /* records; 0: as many as it can have */
    bool bypasses_cache;
} way;

/* Who stops a build, after so many reports. */
typedef struct {
    uint32_t reports_left;
    bool commits; /* what is there by then stays */
    mospt_writer *writer;
    const mospt_metadata *metadata;
} stopper;

static const uint64_t BUILD = 77; /* any number */

static bool go_on(void *context)
{
    stopper *s = context;
    mospt_err err = {0};
    if (s == NULL || s->reports_left-- > 0) return true;
    if (s->commits) CORE_NEED(mospt_writer_commit_part(s->writer, s->metadata, BUILD, &err));
    return false;
}

/* Records [begin, begin + count) of a site as a batch. */
typedef struct {
    const core_site *site;
    uint32_t begin, count, slice;
} feed;

static uint32_t feed_slice(void *context, uint32_t slice, uint8_t *records)
{
    const feed *f = context;
    uint32_t begin = slice * f->slice, left = f->count - begin;
    uint32_t n = left < f->slice ? left : f->slice;
    memcpy(records, f->site->records + (f->begin + begin) * f->site->stride, n * f->site->stride);
    return n;
}

/* Builds the site, or goes on from what is there of it; `stop` NULL: until the end. */
static bool pass_build(const core_site *site, const prep_shape *shape, const way *w,
                       const char *path, const char *scratch, stopper *stop, mospt_err *err)
{
    prep_workers *workers = NULL;
    prep_store *store = NULL;
    mospt_writer *writer = NULL;
    prep_pass *pass = NULL;
    prep_resume *resume = NULL;
    mospt_metadata metadata;
    core_metadata_make(site, shape->add_threshold, &metadata);
    metadata.point_count = site->count;
    assert_true(prep_workers_create(w->threads, &workers, err));
    assert_true(
        prep_store_create(scratch, site->stride, w->block_size, w->store_memory, &store, err));
    assert_true(mospt_writer_create(path, shape->inner_depth, &writer, err));
    assert_true(prep_resume_open(path, BUILD, workers, &resume, err));
    if (resume != NULL) mospt_writer_keep(writer, prep_resume_metadata(resume));
    if (w->bypasses_cache)
        assert_true(mospt_writer_bypass_cache(writer, MOSPT_SINK_CHUNK_MIN, err));
    if (stop != NULL) stop->writer = writer, stop->metadata = &metadata;
    uint32_t slice = w->slice > 0 ? w->slice : PREP_PASS_SLICE_MAX;
    prep_arena *arena = NULL;
    assert_true(prep_arena_create(w->solve_memory, &arena, err));
    prep_pass_env env = {.shape = shape,
                         .workers = workers,
                         .store = store,
                         .writer = writer,
                         .levels = w->levels,
                         .arena = arena,
                         .emit_memory = w->threads * (size_t)PREP_FINISH_BUFFER_MIN,
                         .slice_points = slice,
                         .batch_slices = (w->batch + slice - 1) / slice,
                         .solve_points = w->solve_memory / prep_finish_size(site->stride, 1),
                         .resume = resume,
                         .report = go_on,
                         .report_context = stop};
    bool ok = prep_pass_begin(&env, site->grid.root, 0, &pass, err);
    for (uint32_t i = 0; ok && i < site->count; i += w->batch) {
        uint32_t left = site->count - i;
        feed f = {site, i, left < w->batch ? left : w->batch, slice};
        ok = prep_pass_insert(pass, (f.count + slice - 1) / slice, feed_slice, &f, err);
    }
    if (ok) ok = prep_pass_end(pass, err);
    else prep_pass_abandon(pass);
    if (ok) {
        assert_int_equal(mospt_writer_written(writer).points, site->count);
        assert_true(mospt_writer_written(writer).points_hash == metadata.points_hash);
        ok = mospt_writer_commit(writer, &metadata, err);
    }
    mospt_metadata_fini(&metadata);
    prep_resume_close(resume);
    mospt_writer_destroy(writer);
    prep_store_destroy(store);
    prep_arena_destroy(arena);
    prep_workers_destroy(workers);
    return ok;
}

static void check_ways(const core_site *site, uint32_t depth, uint32_t threshold, const way *ways,
                       size_t way_count)
{
    prep_shape shape = core_shape(site, depth, threshold);
    mospt_err err = {0};
    char *want = core_path(core_folder, "want.ipts"), *got = core_path(core_folder, "got.ipts");
    core_dataset_make(site, depth, threshold, want);
    assert_int_equal(core_findings(want, &err), 0);
    for (size_t k = 0; k < way_count; k++) {
        CORE_NEED(pass_build(site, &shape, &ways[k], got, core_folder, NULL, &err));
        core_assert_same_folders(want, got);
        core_folder_remove(got);
        got = core_path(core_folder, "got.ipts");
    }
    core_folder_remove(want);
    free(got);
    assert_int_equal(core_entries(core_folder), 0);
}

/* Every combination in which the parts of a pass meet each other, thinned by a fixed stride. */
static void check_all_ways(const core_site *site, uint32_t depth, uint32_t threshold,
                           uint32_t first, uint32_t stride)
{
    static const size_t store[] = {0, 3000, 60000, 1 << 30}, solve[] = {0, 20000, 300000, 1 << 30};
    static const uint32_t threads[] = {1, 2, 7}, batch[] = {1000, 20000, 333},
                          block[] = {64, 700, 1 << 14};
    for (uint32_t k = first; k < 4 * 4 * 3 * 3 * 3 * 3; k += stride) {
        uint32_t n = k;
        way w = {0};
        w.store_memory = store[n % 4], n /= 4;
        w.solve_memory = solve[n % 4], n /= 4;
        w.levels = 1 + n % 3, n /= 3;
        w.threads = threads[n % 3], n /= 3;
        w.batch = batch[n % 3], n /= 3;
        w.block_size = block[n % 3];
        w.slice = k % 2 == 0 ? 0 : 1024;
        check_ways(site, depth, threshold, &w, 1);
    }
}

static void any_way_of_building_gives_the_same_bytes(void **state)
{
    (void)state;
    for (int kind = 0; kind < CORE_KINDS; kind++) {
        core_site site;
        core_site_make((core_kind)kind, 16, 4000, (uint64_t)kind, &site);
        check_all_ways(&site, 1 + (uint32_t)kind % 5, 30, (uint32_t)kind, 191);
        core_site_fini(&site);
    }
}

static void all_inner_depths_give_the_same_bytes(void **state)
{
    (void)state;
    for (uint32_t depth = MOSPT_DEPTH_MIN; depth <= MOSPT_DEPTH_MAX; depth++) {
        core_site site;
        core_site_make(CORE_CLUSTERED, 20, 4000, depth, &site);
        const way ways[] = {
            {.levels = 1,
             .threads = 2,
             .batch = 500,
             .block_size = 300,
             .slice = PREP_PASS_SLICE_MIN},
            {.levels = 2, .threads = 1, .batch = 4000, .block_size = 300, .solve_memory = 100000},
            {.levels = 3, .threads = 2, .batch = 1234, .block_size = 300, .store_memory = 2000},
        };
        check_ways(&site, depth, 10, ways, 3);
        core_site_fini(&site);
    }
}

static void grids_of_all_widths_give_the_same_bytes(void **state)
{
    static const uint32_t bits[] = {0, 1, 2, 3, 4, 21, 31, 32};
    static const core_kind kinds[] = {CORE_UNIFORM, CORE_CLUSTERED, CORE_COPIES};
    (void)state;
    for (size_t k = 0; k < sizeof bits / sizeof bits[0]; k++)
        for (int kind = 0; kind < 3; kind++) {
            core_site site;
            core_site_make(kinds[kind], bits[k], 1000, k, &site);
            check_all_ways(&site, 3, 8, (uint32_t)(37 * k) + (uint32_t)(131 * kind), 500);
            core_site_fini(&site);
        }
}

static void deep_trees_of_neighbours_give_the_same_bytes(void **state)
{
    (void)state;
    core_site site;
    core_site_make(CORE_LINE, 32, 2000, 1, &site);
    for (uint32_t i = 0; i < site.count; i++) {
        mospt_vertex v = mospt_vertex_of(site.records + i * site.stride);
        v.x = 77 + i % 2, v.y = 5, v.z = 5;
        memcpy(site.records + i * site.stride, &v, sizeof v);
    }
    check_all_ways(&site, 4, 3, 5, 211);
    core_site_fini(&site);
}

static void piles_give_the_same_bytes(void **state)
{
    static const uint32_t more[] = {101, PREP_PILE_MAX + 101}; /* one point is in the node above */
    (void)state;
    for (int k = 0; k < 2; k++) {
        core_site site;
        core_site_make(CORE_ONE_POSITION, 1, PREP_PILE_MAX + more[k], 1, &site);
        const way ways[] = {
            {.levels = 3, .threads = 2, .batch = 65536, .block_size = 1 << 14},
            {.levels = 1,
             .threads = 1,
             .batch = 50000,
             .block_size = 1 << 14,
             .store_memory = 1 << 20},
        };
        check_ways(&site, 5, 100, ways, k == 1 ? 2 : 1);
        core_site_fini(&site);
    }
}

static void stopping_at_any_report_is_a_cancellation(void **state)
{
    (void)state;
    core_site site;
    core_site_make(CORE_CLUSTERED, 16, 6000, 2, &site);
    prep_shape shape = core_shape(&site, 3, 30);
    char *got = core_path(core_folder, "got.ipts");
    uint32_t reports = 0;
    for (uint32_t stop_after = 0;; stop_after = stop_after < 10 ? stop_after + 1 : stop_after * 3) {
        mospt_err err = {0};
        way w = {
            .levels = 2, .threads = 2, .batch = 1000, .block_size = 400, .solve_memory = 60000};
        stopper left = {.reports_left = stop_after};
        if (pass_build(&site, &shape, &w, got, core_folder, &left, &err)) break;
        assert_int_equal(err.code, MOSPT_ECANCELLED);
        assert_false(core_exists(got));
        reports++;
    }
    assert_true(reports > 10);
    core_folder_remove(got);
    core_site_fini(&site);
    assert_int_equal(core_entries(core_folder), 0);
}

/* Stops a build again and again, each time a little later and building in another way, and checks
 * what is there in between. Returns how often there was something. */
static uint32_t interrupt(const core_site *site, const prep_shape *shape, uint32_t more,
                          const char *path)
{
    static const way ways[] = {
        {.levels = 2, .threads = 2, .batch = 1000, .block_size = 400, .solve_memory = 60000},
        {.levels = 1,
         .threads = 1,
         .batch = 6000,
         .block_size = 900,
         .solve_memory = 1 << 30,
         .bypasses_cache = true},
        {.levels = 3,
         .threads = 7,
         .batch = 777,
         .block_size = 64,
         .store_memory = 1 << 30,
         .bypasses_cache = true},
        {.levels = 2, .threads = 3, .batch = 500, .block_size = 700, .solve_memory = 60000},
    };
    uint32_t found = 0;
    uint64_t points = 0;
    for (uint32_t k = 0;; k++) {
        mospt_err err = {0};
        stopper stop = {.reports_left = k * more, .commits = true};
        if (pass_build(site, shape, &ways[k % 4], path, core_folder, &stop, &err)) return found;
        assert_int_equal(err.code, MOSPT_ECANCELLED);
        if (!core_exists(path)) continue;
        mospt_metadata m;
        assert_true(mospt_dataset_is_unfinished(path));
        assert_int_equal(core_findings(path, &err), 0);
        CORE_NEED(mospt_metadata_read(path, &m, &err));
        assert_int_equal(m.unfinished.points, site->count);
        assert_true(m.point_count >= points && m.point_count <= site->count);
        points = m.point_count;
        mospt_metadata_fini(&m);
        found++;
    }
}

static void an_interrupted_build_goes_on_to_the_same_bytes(void **state)
{
    (void)state;
    for (int kind = 0; kind < CORE_KINDS; kind++) {
        core_site site;
        core_site_make((core_kind)kind, 16, 6000, (uint64_t)kind, &site);
        char *want = core_path(core_folder, "want.ipts"), *got = core_path(core_folder, "got.ipts");
        prep_shape shape = core_shape(&site, 3, 30);
        core_dataset_make(&site, 3, 30, want);
        uint32_t found = interrupt(&site, &shape, 7, got);
        assert_true(found > 1 || kind == CORE_ONE_POSITION || kind == CORE_IDENTICAL);
        core_assert_same_folders(want, got);
        core_folder_remove(want);
        core_folder_remove(got);
        core_site_fini(&site);
    }
    assert_int_equal(core_entries(core_folder), 0);
}

static void what_is_damaged_is_made_again(void **state)
{
    (void)state;
    core_site site;
    core_site_make(CORE_CLUSTERED, 16, 6000, 5, &site);
    prep_shape shape = core_shape(&site, 3, 30);
    char *want = core_path(core_folder, "want.ipts"), *got = core_path(core_folder, "got.ipts");
    const way w = {.levels = 2, .threads = 2, .batch = 1000, .block_size = 400};
    mospt_err err = {0};
    core_dataset_make(&site, 3, 30, want);
    stopper stop = {.reports_left = 60, .commits = true};
    CORE_FAILS(pass_build(&site, &shape, &w, got, core_folder, &stop, &err), MOSPT_ECANCELLED);
    for (int level = 0; level < 3; level++) {
        char *path = core_path(got, "points-%02d.bin", level);
        size_t size;
        uint8_t *bytes = core_file_read(path, &size);
        bytes[size / 2] ^= 1;
        core_file_write(path, bytes, size);
        free(bytes), free(path);
    }
    assert_true(core_findings(got, NULL) > 0);
    CORE_NEED(pass_build(&site, &shape, &w, got, core_folder, NULL, &err));
    core_assert_same_folders(want, got);
    core_folder_remove(want);
    core_folder_remove(got);
    core_site_fini(&site);
}

static void points_that_have_changed_are_an_error(void **state)
{
    (void)state;
    core_site site, other;
    core_site_make(CORE_CLUSTERED, 16, 6000, 5, &site);
    core_site_make(CORE_CLUSTERED, 16, 6000, 6, &other);
    prep_shape shape = core_shape(&site, 3, 30);
    char *got = core_path(core_folder, "got.ipts");
    const way w = {.levels = 2, .threads = 2, .batch = 1000, .block_size = 400};
    mospt_err err = {0};
    stopper stop = {.reports_left = 60, .commits = true};
    CORE_FAILS(pass_build(&site, &shape, &w, got, core_folder, &stop, &err), MOSPT_ECANCELLED);
    CORE_FAILS(pass_build(&other, &shape, &w, got, core_folder, NULL, &err), MOSPT_EFORMAT);
    assert_int_equal(core_findings(got, NULL), 0); /* of the first site */
    core_folder_remove(got);
    core_site_fini(&site);
    core_site_fini(&other);
}

static void a_scratch_disk_that_fills_up_is_an_error(void **state)
{
    /* The scratch file may not grow beyond this; the payloads here stay smaller. */
    static const rlim_t limits[] = {0, 1000, 20000, 60000};
    struct rlimit old, small;
    (void)state;
    core_site site;
    core_site_make(CORE_CLUSTERED, 16, 6000, 2, &site);
    prep_shape shape = core_shape(&site, 3, 30);
    char *got = core_path(core_folder, "got.ipts");
    signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &old);
    for (size_t k = 0; k < sizeof limits / sizeof limits[0]; k++) {
        for (uint32_t threads = 1; threads <= 7; threads += 3) {
            mospt_err err = {0};
            way w = {.levels = 2, .threads = threads, .batch = 1000, .block_size = 400};
            small = old;
            small.rlim_cur = limits[k];
            setrlimit(RLIMIT_FSIZE, &small);
            bool ok = pass_build(&site, &shape, &w, got, core_folder, NULL, &err);
            setrlimit(RLIMIT_FSIZE, &old);
            assert_false(ok);
            assert_int_equal(err.code, MOSPT_EIO);
            assert_false(core_exists(got));
        }
    }
    free(got);
    core_site_fini(&site);
}

static void a_scratch_folder_that_is_not_there_is_an_error(void **state)
{
    (void)state;
    mospt_err err = {0};
    core_site site;
    core_site_make(CORE_CLUSTERED, 16, 6000, 2, &site);
    prep_shape shape = core_shape(&site, 3, 30);
    char *got = core_path(core_folder, "got.ipts"), *scratch = core_path(core_folder, "nowhere");
    way w = {.levels = 2, .threads = 2, .batch = 1000, .block_size = 400};
    CORE_FAILS(pass_build(&site, &shape, &w, got, scratch, NULL, &err), MOSPT_EIO);
    assert_string_equal(err.file, scratch);
    assert_false(core_exists(got));
    free(got), free(scratch);
    core_site_fini(&site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_way_of_building_gives_the_same_bytes),
        cmocka_unit_test(all_inner_depths_give_the_same_bytes),
        cmocka_unit_test(grids_of_all_widths_give_the_same_bytes),
        cmocka_unit_test(deep_trees_of_neighbours_give_the_same_bytes),
        cmocka_unit_test(piles_give_the_same_bytes),
        cmocka_unit_test(stopping_at_any_report_is_a_cancellation),
        cmocka_unit_test(an_interrupted_build_goes_on_to_the_same_bytes),
        cmocka_unit_test(what_is_damaged_is_made_again),
        cmocka_unit_test(points_that_have_changed_are_an_error),
        cmocka_unit_test(a_scratch_disk_that_fills_up_is_an_error),
        cmocka_unit_test(a_scratch_folder_that_is_not_there_is_an_error),
    };
    return cmocka_run_group_tests(tests, core_folder_set_up, core_folder_tear_down);
}
