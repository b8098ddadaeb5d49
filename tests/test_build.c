/* From files of scans to a checked dataset, and nothing left behind where that fails. */
#include "tests/core_scans.h"
#include "tests/core_tools.h"

#include "preprocess/build.h"

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

enum { LARGE = 150000 };

static char *folder, *scans, *output;

static int set_up(void **state)
{
    (void)state;
    signal(SIGXFSZ, SIG_IGN);
    folder = core_folder_make();
    scans = core_path(folder, "scans");
    output = core_path(folder, "site.ipts");
    return mkdir(scans, 0777);
}

static int tear_down(void **state)
{
    (void)state;
    core_folder_remove(folder);
    free(scans), free(output);
    return 0;
}

/* ---- points ---- */

typedef struct {
    double xyz[3];
    uint32_t scan;
} point;

typedef struct {
    point *at;
    uint32_t count;
} points;

static int compare_points(const void *a, const void *b)
{
    const point *p = a, *q = b;
    if (p->scan != q->scan) return p->scan < q->scan ? -1 : 1;
    for (int k = 0; k < 3; k++)
        if (p->xyz[k] != q->xyz[k]) return p->xyz[k] < q->xyz[k] ? -1 : 1;
    return 0;
}

/* All points of a dataset, by scan and place. */
static points read_dataset(const char *path, mospt_metadata *metadata_copy)
{
    mospt_dataset *d = NULL;
    mospt_err err = {0};
    CORE_NEED(mospt_dataset_open(path, &d, &err));
    points all = {.at = calloc(d->metadata.point_count + 1, sizeof *all.at)};
    int k = mospt_schema_find(&d->metadata.schema, "scan");
    assert_non_null(all.at);
    assert_true(k >= 0 && d->metadata.schema.at[k].type == MOSPT_U16);
    for (uint32_t i = 0; i < d->hierarchy.count; i++) {
        uint32_t n = d->hierarchy.nodes[i].count;
        mospt_vertex *v = malloc(n * sizeof *v);
        uint8_t *planes = malloc(n * d->metadata.schema.row_size);
        assert_true(v != NULL && planes != NULL);
        CORE_NEED(mospt_dataset_read_vertices(d, i, v, &err));
        CORE_NEED(mospt_dataset_read_attributes(d, i, v, planes, &err));
        for (uint32_t j = 0; j < n; j++) {
            point *p = &all.at[all.count++];
            uint16_t scan;
            memcpy(&scan, planes + n * d->metadata.schema.at[k].offset + j * sizeof scan,
                   sizeof scan);
            p->scan = scan;
            mospt_grid_to_world(&d->metadata.grid, (uint32_t[3]){v[j].x, v[j].y, v[j].z}, p->xyz);
        }
        free(v), free(planes);
    }
    if (metadata_copy != NULL) { /* numbers only: texts go with the dataset */
        *metadata_copy = d->metadata;
        metadata_copy->sources = NULL, metadata_copy->files = NULL, metadata_copy->crs = NULL;
    }
    qsort(all.at, all.count, sizeof *all.at, compare_points);
    mospt_dataset_close(d);
    return all;
}

static void add_point(points *list, const double xyz[3], uint32_t scan)
{
    if ((list->count & (list->count - 1)) == 0) {
        list->at =
            realloc(list->at, (list->count > 0 ? 2 * (size_t)list->count : 1) * sizeof *list->at);
        assert_non_null(list->at);
    }
    point *p = &list->at[list->count++];
    memset(p, 0, sizeof *p);
    for (int a = 0; a < 3; a++)
        p->xyz[a] = xyz[a];
    p->scan = scan;
}

/* The dataset holds these points, each at most `off` away along an axis. Sorted neighbours must not
 * be nearer than that. */
static void assert_holds(const char *path, points *wanted, double off)
{
    points got = read_dataset(path, NULL);
    qsort(wanted->at, wanted->count, sizeof *wanted->at, compare_points);
    assert_int_equal(got.count, wanted->count);
    for (uint32_t i = 0; i < got.count; i++) {
        assert_int_equal(got.at[i].scan, wanted->at[i].scan);
        for (int a = 0; a < 3; a++)
            if (!(fabs(got.at[i].xyz[a] - wanted->at[i].xyz[a]) <= off))
                fail_msg("point %u: %.17g instead of %.17g", i, got.at[i].xyz[a],
                         wanted->at[i].xyz[a]);
    }
    free(got.at);
}

/* ---- scans ---- */

static int32_t raw[LARGE][3];
static double world[LARGE][3];

/* A wall, a floor and a dense corner, as a scanner sees them; raw coordinates in [-half, half]. */
static void make_raw(uint32_t count, int32_t half, uint64_t seed)
{
    uint64_t random = seed;
    for (uint32_t i = 0; i < count; i++)
        for (int a = 0; a < 3; a++) {
            raw[i][a] = (int32_t)core_below(&random, 2 * (uint32_t)half + 1) - half;
            if (i % 4 > 1) raw[i][a] /= 1000;
            if (a == 2 && i % 4 == 0) raw[i][a] = 17;
        }
}

static void make_world(uint32_t count, const double centre[3], double width, uint64_t seed)
{
    uint64_t random = seed;
    for (uint32_t i = 0; i < count; i++)
        for (int a = 0; a < 3; a++)
            world[i][a] = centre[a] + width * (core_unit(&random) - 0.5);
}

static char *scan_path(const char *name)
{
    return core_path(scans, "%s", name);
}

static void write_las(const char *name, uint32_t count, const core_las *as)
{
    char *path = scan_path(name);
    core_las las = *as;
    las.xyz = raw, las.count = count;
    core_las_write(path, &las);
    free(path);
}

static const core_las millimetres = {.scale = {0.001, 0.001, 0.001},
                                     .offset = {500000, -5000000, 100}};

static void add_las_points(points *list, uint32_t count, const core_las *las, uint32_t scan)
{
    for (uint32_t i = 0; i < count; i++) {
        double at[3];
        for (int a = 0; a < 3; a++)
            at[a] = raw[i][a] * las->scale[a] + las->offset[a];
        add_point(list, at, scan);
    }
}

static void write_ply(const char *name, uint32_t count)
{
    char *path = scan_path(name);
    core_ply_write(path, (const double(*)[3])world, count);
    free(path);
}

static void write_bytes(const char *name, const char *bytes)
{
    char *path = scan_path(name);
    core_file_write(path, bytes, strlen(bytes));
    free(path);
}

static void empty_scans(void)
{
    core_folder_remove(scans);
    scans = core_path(folder, "scans");
    assert_int_equal(mkdir(scans, 0777), 0);
}

static void remove_path(const char *path)
{
    core_folder_remove(strdup(path));
}

/* ---- building ---- */

static bool build_with(const prep_build_options *options, prep_build_result *result, mospt_err *err)
{
    const char *inputs[] = {scans};
    prep_build_options o = *options;
    if (o.inputs == NULL) o.inputs = inputs, o.input_count = 1;
    if (o.output == NULL) o.output = output;
    if (o.threads == 0) o.threads = 2;
    if (o.memory == 0) o.memory = (uint64_t)512 << 20;
    return prep_build(&o, result, err);
}

/* Builds, checks, and leaves the dataset at `output`. */
static void build_good(const prep_build_options *options, prep_build_result *result)
{
    mospt_err err = {0};
    prep_build_result own;
    CORE_NEED(build_with(options, result != NULL ? result : &own, &err));
    if (result == NULL) prep_build_result_fini(&own);
    if (core_findings(options->output != NULL ? options->output : output, &err) > 0)
        CORE_NEED(false);
}

/* A build that takes long enough leaves an unfinished dataset, which is as good as any; nothing
 * else may be there. Removes it. */
static void assert_nothing_half_done(uint32_t entries_before)
{
    for (int beside = 0; beside < 2; beside++) {
        char *left = core_path(folder, beside ? "site.ipts.building" : "site.ipts");
        if (mospt_dataset_is_unfinished(left)) {
            assert_int_equal(core_findings(left, NULL), 0);
            core_folder_remove(left);
        } else {
            free(left);
        }
    }
    assert_int_equal(core_entries(folder), entries_before);
}

static void build_fails(const prep_build_options *options, mospt_code code, mospt_err *said)
{
    mospt_err err = {0};
    prep_build_result result;
    uint32_t before = core_entries(folder);
    CORE_FAILS(build_with(options, &result, &err), code);
    prep_build_result_fini(&result);
    assert_nothing_half_done(before);
    if (said != NULL) *said = err;
}

static const prep_build_options defaults;

static void las_positions_are_kept_bit_for_bit(void **state)
{
    static const core_las places[] = {
        {.scale = {0.001, 0.001, 0.001}, .offset = {500000, -5000000, 100}},
        {.scale = {0.01, 0.01, 0.01}, .offset = {0, 0, 0}},
        {.scale = {0.0001, 0.0001, 0.0001}, .offset = {1e7, -1e7, 1e7}},
        {.scale = {0.00025, 0.00025, 0.00025}, .offset = {1234567.8912, 0.5, -3}},
        {.scale = {1, 1, 1}, .offset = {0, 0, 0}},
        {.scale = {1e-6, 1e-6, 1e-6}, .offset = {2600000.123, 1200000, 500}},
    };
    (void)state;
    for (size_t k = 0; k < sizeof places / sizeof places[0]; k++) {
        points wanted = {0};
        prep_build_result result;
        make_raw(5000, 1000000000, k);
        write_las("a.las", 5000, &places[k]);
        add_las_points(&wanted, 5000, &places[k], 0);
        build_good(&defaults, &result);
        assert_int_equal(result.metadata.point_count, 5000);
        assert_true(result.metadata.position_error == 0);
        assert_true(result.metadata.grid.step == places[k].scale[0]);
        assert_holds(output, &wanted, 0);
        for (int a = 0; a < 3; a++) {
            double low = INFINITY, high = -INFINITY;
            for (uint32_t i = 0; i < wanted.count; i++)
                low = fmin(low, wanted.at[i].xyz[a]), high = fmax(high, wanted.at[i].xyz[a]);
            assert_true(result.metadata.low[a] == low && result.metadata.high[a] == high);
            assert_true(result.metadata.sources[0].low[a] == low &&
                        result.metadata.sources[0].high[a] == high);
        }
        prep_build_result_fini(&result);
        free(wanted.at);
        remove_path(output);
    }
    empty_scans();
}

static void scans_of_all_formats_come_together(void **state)
{
    points wanted = {0};
    prep_build_result result;
    (void)state;
    make_raw(20000, 100000, 1);
    write_las("a.las", 20000, &millimetres);
    add_las_points(&wanted, 20000, &millimetres, 0);
    make_world(15000, millimetres.offset, 90, 2);
    write_ply("b.ply", 15000);
    for (uint32_t i = 0; i < 15000; i++)
        add_point(&wanted, world[i], 1);
    make_world(10000, millimetres.offset, 90, 3);
    char *path = scan_path("c.xyz");
    core_text_write(path, (const double(*)[3])world, 10000);
    free(path);
    for (uint32_t i = 0; i < 10000; i++)
        add_point(&wanted, world[i], 2);

    build_good(&defaults, &result);
    const mospt_metadata *m = &result.metadata;
    assert_int_equal(m->source_count, 3);
    assert_string_equal(m->sources[0].name, "a.las");
    assert_string_equal(m->sources[1].name, "b.ply");
    assert_string_equal(m->sources[2].name, "c.xyz");
    assert_int_equal(m->sources[0].points, 20000);
    assert_int_equal(m->sources[1].points, 15000);
    assert_int_equal(m->sources[2].points, 10000);
    assert_int_equal(m->point_count, 45000);
    assert_true(m->sources[2].has_rgb && !m->sources[0].has_rgb && m->sources[0].has_intensity);
    assert_true(mospt_schema_find(&m->schema, "intensity") >= 0 &&
                mospt_schema_find(&m->schema, "tag") >= 0);
    assert_false(prep_build_left_something_out(&result));
    /* An error within the rounding of the coordinates themselves is none of the grid's. */
    assert_true(m->position_error <= m->grid.step / 2 + 5e6 * 0x1p-51);
    assert_holds(output, &wanted, m->grid.step / 2 + 5e6 * 0x1p-51);
    prep_build_result_fini(&result);
    free(wanted.at);
    remove_path(output);
    empty_scans();
}

static void coordinates_far_from_zero_keep_their_precision(void **state)
{
    static const double widths[] = {0.01, 1, 1000};
    (void)state;
    for (int k = 0; k < 3; k++) {
        points wanted = {0};
        prep_build_result result;
        make_world(5000, (const double[3]){1e7, -1e7, 1e7}, widths[k], (uint64_t)k);
        write_ply("far.ply", 5000);
        for (uint32_t i = 0; i < 5000; i++)
            add_point(&wanted, world[i], 0);
        build_good(&defaults, &result);
        assert_true(result.metadata.position_error <= result.metadata.grid.step / 2);
        assert_true(result.metadata.position_error <= fmax(ldexp(widths[k], -29), 4e-9));
        assert_holds(output, &wanted, result.metadata.grid.step / 2);
        prep_build_result_fini(&result);
        free(wanted.at);
        remove_path(output);
    }
    empty_scans();
}

/* Header bounds of a LAS file, whatever they claim, must not change what is kept. */
static void lying_header_bounds_do_no_harm(void **state)
{
    static const double zero[3],
        small_high[3] = {500001, -4999999, 101}, far_low[3] = {-9e8, -9e8, -9e8},
        far_high[3] = {9e8, 9e8, 9e8}, mad_low[3] = {-1.7e308, -1.7e308, -1.7e308},
        mad_high[3] = {1.7e308, 1.7e308, 1.7e308}, elsewhere[3] = {1e6, 1e6, 1e6},
        beyond[3] = {1e300, 1e300, 1e300};
    static const struct {
        const double *low, *high;
    } lies[] = {{zero, zero},        {millimetres.offset, small_high}, {far_low, far_high},
                {mad_low, mad_high}, {elsewhere, elsewhere},           {zero, beyond}};
    char *honest = core_path(folder, "honest.ipts");
    (void)state;
    make_raw(30000, 30000, 5);
    write_las("a.las", 30000, &millimetres);
    write_las("b.las", 10000, &millimetres);
    prep_build_options o = {.output = honest};
    build_good(&o, NULL);
    alarm(120);
    for (size_t k = 0; k < sizeof lies / sizeof lies[0]; k++)
        for (int both = 0; both < 2; both++) {
            core_las las = millimetres;
            las.low = lies[k].low, las.high = lies[k].high;
            write_las("a.las", 30000, &las);
            write_las("b.las", 10000, both ? &las : &millimetres);
            build_good(&defaults, NULL);
            core_assert_same_folders(honest, output);
            remove_path(output);
        }
    alarm(0);
    core_folder_remove(honest);
    empty_scans();
}

static void header_bounds_a_little_too_wide_keep_every_bit(void **state)
{
    static const double low[3] = {499000, -5001000, -1000}, high[3] = {501000, -4999000, 3000};
    points wanted = {0};
    prep_build_result result;
    core_las las = millimetres;
    (void)state;
    las.low = low, las.high = high;
    make_raw(5000, 30000, 5);
    write_las("a.las", 5000, &las);
    add_las_points(&wanted, 5000, &las, 0);
    build_good(&defaults, &result);
    assert_true(result.metadata.position_error == 0);
    assert_true(result.metadata.low[0] > 499900); /* the bounds told are those of the points */
    assert_holds(output, &wanted, 0);
    prep_build_result_fini(&result);
    free(wanted.at);
    remove_path(output);
    empty_scans();
}

static void memory_and_threads_do_not_show_in_the_bytes(void **state)
{
    static const struct {
        uint64_t mebibytes;
        uint32_t threads;
        bool compress_scratch;
    } ways[] = {{64, 1, false}, {64, 7, false}, {80, 2, false}, {2048, 7, false}, {64, 2, true}};
    char *first = core_path(folder, "first.ipts");
    (void)state;
    make_raw(LARGE, 2000000, 6);
    write_las("a.las", LARGE, &millimetres);
    prep_build_options o = {.output = first, .memory = (uint64_t)1 << 30, .threads = 1};
    prep_build_result result;
    build_good(&o, &result);
    assert_true(result.node_count > 9 && result.level_count > 2);
    prep_build_result_fini(&result);
    for (size_t k = 0; k < sizeof ways / sizeof ways[0]; k++) {
        mospt_err err = {0};
        o = (prep_build_options){.memory = ways[k].mebibytes << 20,
                                 .threads = ways[k].threads,
                                 .compress_scratch = ways[k].compress_scratch};
        CORE_NEED(build_with(&o, &result, &err));
        prep_build_result_fini(&result);
        core_assert_same_folders(first, output);
        remove_path(output);
    }
    core_folder_remove(first);
    empty_scans();
}

static void every_inner_depth_can_be_built(void **state)
{
    (void)state;
    make_raw(20000, 2000000, 6);
    write_las("a.las", 20000, &millimetres);
    for (uint32_t depth = 1; depth <= 9; depth++) {
        prep_build_options o = {.inner_depth = depth, .memory = (uint64_t)2 << 30};
        prep_build_result result;
        build_good(&o, &result);
        assert_int_equal(result.metadata.inner_depth, depth);
        prep_build_result_fini(&result);
        remove_path(output);
    }
    empty_scans();
}

static void too_little_memory_is_refused(void **state)
{
    (void)state;
    make_raw(10, 2000000, 6);
    write_las("a.las", 10, &millimetres);
    build_fails(&(prep_build_options){.memory = 1 << 20}, MOSPT_EINVAL, NULL);
    build_fails(&(prep_build_options){.memory = (64 << 20) - 1}, MOSPT_EINVAL, NULL);
    empty_scans();
}

static void one_point_is_a_dataset(void **state)
{
    static const core_las at_zero = {.scale = {0.001, 0.001, 0.001}};
    points wanted = {0};
    (void)state;
    raw[0][0] = raw[0][1] = raw[0][2] = 0;
    write_las("a.las", 1, &at_zero);
    build_good(&defaults, NULL);
    add_las_points(&wanted, 1, &at_zero, 0);
    assert_holds(output, &wanted, 0);
    remove_path(output);
    empty_scans();
    for (int k = 0; k < 2; k++) {
        static const double places[2][3] = {{0, 0, 0}, {1e7, -0.1, 1e-9}};
        memcpy(world[0], places[k], sizeof places[k]);
        char *path = scan_path("one.xyz");
        if (k) core_text_write(path, (const double(*)[3])world, 1);
        else write_ply("one.ply", 1);
        free(path);
        build_good(&defaults, NULL);
        wanted.count = 0;
        free(wanted.at), wanted.at = NULL;
        add_point(&wanted, world[0], 0);
        assert_holds(output, &wanted, 1e-8);
        remove_path(output);
        empty_scans();
    }
    free(wanted.at);
}

static void many_points_at_one_position_are_all_kept(void **state)
{
    points wanted = {0};
    (void)state;
    memset(raw, 0, sizeof raw);
    for (uint32_t i = 0; i < 10; i++)
        raw[i][0] = (int32_t)i;
    write_las("a.las", 50000, &millimetres);
    add_las_points(&wanted, 50000, &millimetres, 0);
    build_good(&defaults, NULL);
    assert_holds(output, &wanted, 0);
    free(wanted.at);
    remove_path(output);
    empty_scans();
}

static void no_point_is_an_error(void **state)
{
    mospt_err err;
    (void)state;
    build_fails(&defaults, MOSPT_EEMPTY, NULL); /* an empty folder */
    write_las("a.las", 0, &millimetres);
    build_fails(&defaults, MOSPT_EEMPTY, &err);
    assert_non_null(strstr(err.file, "a.las"));
    write_ply("b.ply", 0);
    build_fails(&defaults, MOSPT_EEMPTY, NULL);
    empty_scans();
    write_bytes("nan.xyz", "nan nan nan\nnan 1 2\n");
    build_fails(&defaults, MOSPT_EEMPTY, &err);
    empty_scans();
    char *missing = core_path(folder, "missing.las");
    const char *inputs[] = {missing};
    build_fails(&(prep_build_options){.inputs = inputs, .input_count = 1}, MOSPT_EIO, &err);
    assert_string_equal(err.file, missing);
    free(missing);
}

static void points_that_are_not_finite_are_dropped_and_counted(void **state)
{
    prep_build_result result;
    (void)state;
    make_world(1000, (const double[3]){0, 0, 0}, 10, 4);
    for (uint32_t i = 0; i < 1000; i += 10)
        world[i][i / 10 % 3] = i % 20 ? NAN : -INFINITY;
    world[5][1] = 1e300;
    write_ply("a.ply", 1000);
    build_good(&defaults, &result);
    const mospt_source *s = &result.metadata.sources[0];
    assert_int_equal(result.metadata.point_count, 899);
    assert_int_equal(s->points, 899);
    assert_int_equal(s->dropped, 101);
    assert_int_equal(s->reason_count, 2);
    assert_string_equal(s->drop_reason[0], "not finite");
    assert_int_equal(s->drop_count[0], 100);
    assert_string_equal(s->drop_reason[1], "out of range");
    assert_int_equal(s->drop_count[1], 1);
    assert_false(prep_build_left_something_out(&result)); /* dropped points are no lost input */
    prep_build_result_fini(&result);
    remove_path(output);
    empty_scans();
}

static void bad_files_are_left_out_and_the_good_ones_built(void **state)
{
    points wanted = {0};
    prep_build_result result;
    (void)state;
    make_raw(3000, 20000, 3);
    write_bytes("0-garbage.las", "LASF, but nothing more");
    write_las("1-empty.las", 0, &millimetres);
    write_las("2-good.las", 3000, &millimetres);
    add_las_points(&wanted, 3000, &millimetres, 0);
    core_las cut = millimetres;
    cut.missing = 20 * 100 + 7; /* the last 101 records are not whole */
    write_las("3-cut.las", 1000, &cut);
    add_las_points(&wanted, 899, &millimetres, 1);
    write_bytes("4-nothing.xyz", "");
    write_las("5-good.las", 10, &millimetres);
    add_las_points(&wanted, 10, &millimetres, 2);
    build_good(&defaults, &result);
    assert_true(prep_build_left_something_out(&result));
    assert_int_equal(result.source.left_out_count, 3);
    assert_string_equal(result.source.left_out[0].name, "0-garbage.las");
    assert_string_equal(result.source.left_out[1].name, "1-empty.las");
    assert_int_equal(result.source.left_out[1].err.code, MOSPT_EEMPTY);
    assert_string_equal(result.source.left_out[2].name, "4-nothing.xyz");
    assert_int_equal(result.metadata.source_count, 3);
    assert_null(result.metadata.sources[0].damage);
    assert_non_null(result.metadata.sources[1].damage);
    assert_ptr_equal(strstr(result.metadata.sources[1].damage, "3-cut.las: "),
                     result.metadata.sources[1].damage);
    assert_null(strstr(result.metadata.sources[1].damage,
                       folder)); /* a dataset does not say where it was made */
    assert_holds(output, &wanted, 0);
    prep_build_result_fini(&result);
    free(wanted.at);
    remove_path(output);
    empty_scans();
}

static void a_damaged_file_with_lying_bounds_is_read_once_more_with_the_same_result(void **state)
{
    static const double zero[3];
    points wanted = {0};
    prep_build_result result;
    core_las cut = millimetres;
    (void)state;
    make_raw(1000, 20000, 3);
    cut.missing = 20 * 100 + 7;
    cut.low = cut.high = zero;
    write_las("cut.las", 1000, &cut);
    add_las_points(&wanted, 899, &millimetres, 0);
    build_good(&defaults, &result);
    assert_non_null(result.metadata.sources[0].damage);
    assert_holds(output, &wanted, 0);
    prep_build_result_fini(&result);
    free(wanted.at);
    remove_path(output);
    empty_scans();
}

/* ---- what is there already ---- */

typedef struct {
    uint32_t left;
} countdown;

static bool count_down(void *context, const prep_progress *progress)
{
    countdown *c = context;
    assert_true(progress->points_total == 0 || progress->points <= progress->points_total);
    assert_true(progress->share <= 1);
    return c->left-- > 0;
}

static void stopping_at_any_moment_leaves_nothing_half_done(void **state)
{
    mospt_err err;
    prep_build_result result;
    uint32_t stopped = 0;
    (void)state;
    make_raw(30000, 2000000, 6);
    write_las("a.las", 30000, &millimetres);
    make_world(30000, millimetres.offset, 100, 1);
    char *path = scan_path("b.xyz");
    core_text_write(path, (const double(*)[3])world, 30000);
    free(path);
    uint32_t before = core_entries(folder);
    for (uint32_t n = 0;; n = n < 20 ? n + 1 : n * 2) {
        countdown c = {n};
        err = (mospt_err){0};
        prep_build_options o = {.progress = count_down, .context = &c};
        bool ok = build_with(&o, &result, &err);
        prep_build_result_fini(&result);
        if (ok) break;
        assert_int_equal(err.code, MOSPT_ECANCELLED);
        assert_nothing_half_done(before);
        stopped++;
    }
    assert_true(stopped > 3);
    remove_path(output);
    empty_scans();
}

static void an_output_that_exists_is_replaced_only_by_force(void **state)
{
    points first = {0}, second = {0};
    mospt_err err;
    (void)state;
    make_raw(2000, 20000, 1);
    write_las("a.las", 2000, &millimetres);
    add_las_points(&first, 2000, &millimetres, 0);
    build_good(&defaults, NULL);
    make_raw(3000, 20000, 2);
    write_las("a.las", 3000, &millimetres);
    add_las_points(&second, 3000, &millimetres, 0);

    build_fails(&defaults, MOSPT_EINVAL, &err);
    assert_non_null(strstr(err.message, "--force"));
    assert_holds(output, &first, 0);
    /* A forced build that is stopped keeps the old one. */
    for (uint32_t n = 0; n < 2; n++) {
        countdown c = {n};
        build_fails(&(prep_build_options){.force = true, .progress = count_down, .context = &c},
                    MOSPT_ECANCELLED, NULL);
        assert_holds(output, &first, 0);
    }
    uint32_t before = core_entries(folder);
    build_good(&(prep_build_options){.force = true}, NULL);
    assert_holds(output, &second, 0);
    assert_int_equal(core_entries(folder), before);
    /* A slash at the end names the same folder. */
    char *slashed = core_path(folder, "site.ipts///");
    build_fails(&(prep_build_options){.output = slashed}, MOSPT_EINVAL, NULL);
    build_good(&(prep_build_options){.output = slashed, .force = true}, NULL);
    assert_int_equal(core_entries(folder), before);
    free(slashed), free(first.at), free(second.at);
    remove_path(output);
    empty_scans();
}

static void force_touches_nothing_but_the_output(void **state)
{
    static const char *const neighbours[] = {"site.ipts.old", "site.ipts.bak", "site"};
    (void)state;
    make_raw(2000, 20000, 1);
    write_las("a.las", 2000, &millimetres);
    build_good(&defaults, NULL);
    for (int k = 0; k < 3; k++) {
        char *other = core_path(folder, "%s", neighbours[k]), *note = core_path(other, "note");
        assert_int_equal(mkdir(other, 0777), 0);
        core_file_write(note, "x", 1);
        build_good(&(prep_build_options){.force = true}, NULL);
        if (!core_exists(note)) fail_msg("%s is gone", note);
        core_folder_remove(other);
        free(note);
    }
    remove_path(output);
    empty_scans();
}

static void an_output_whose_name_ends_in_new_is_like_any_other(void **state)
{
    char *fresh = core_path(folder, "site.new"), *site = core_path(folder, "site"),
         *note = core_path(site, "note");
    (void)state;
    make_raw(2000, 20000, 1);
    write_las("a.las", 2000, &millimetres);
    assert_int_equal(mkdir(site, 0777), 0);
    core_file_write(note, "x", 1);
    build_good(&(prep_build_options){.output = fresh}, NULL);
    assert_true(core_exists(note));
    build_good(&(prep_build_options){.output = fresh, .force = true}, NULL);
    assert_true(core_exists(note));
    core_folder_remove(fresh), core_folder_remove(site);
    free(note);
    empty_scans();
}

static void a_folder_with_other_things_is_refused(void **state)
{
    mospt_err err;
    char *note = core_path(output, "note.txt");
    (void)state;
    make_raw(10, 20000, 1);
    write_las("a.las", 10, &millimetres);
    assert_int_equal(mkdir(output, 0777), 0);
    core_file_write(note, "x", 1);
    for (int force = 0; force < 2; force++) {
        build_fails(&(prep_build_options){.force = force}, MOSPT_EINVAL, &err);
        assert_non_null(strstr(err.message, "note.txt"));
        assert_true(core_exists(note));
    }
    remove_path(output);
    /* A file in the place is no folder at all. */
    core_file_write(output, "x", 1);
    build_fails(&defaults, MOSPT_EIO, NULL);
    assert_true(core_exists(output));
    unlink(output);
    /* An empty folder is welcome. */
    assert_int_equal(mkdir(output, 0777), 0);
    build_good(&defaults, NULL);
    remove_path(output);
    free(note);
    empty_scans();
}

static void folders_that_are_not_there_are_named(void **state)
{
    mospt_err err;
    char *nowhere = core_path(folder, "nowhere"), *inside = core_path(nowhere, "site.ipts");
    (void)state;
    make_raw(10, 20000, 1);
    write_las("a.las", 10, &millimetres);
    build_fails(&(prep_build_options){.output = inside}, MOSPT_EIO, &err);
    assert_string_equal(err.file, nowhere);
    build_fails(&(prep_build_options){.temp_dir = nowhere}, MOSPT_EIO, &err);
    assert_string_equal(err.file, nowhere);
    free(nowhere), free(inside);
    empty_scans();
}

static void a_read_only_folder_is_an_error(void **state)
{
    int status = 0;
    (void)state;
    make_raw(10, 20000, 1);
    write_las("a.las", 10, &millimetres);
    chmod(folder, 0555);
    pid_t child = fork();
    if (child == 0) {
        mospt_err err = {0};
        prep_build_result result;
        if (geteuid() == 0 && setuid(65534) != 0) _exit(77); /* root may write anywhere */
        bool ok = build_with(&defaults, &result, &err);
        _exit(!ok && err.code == MOSPT_EIO && strcmp(err.file, folder) == 0 ? 0 : 1);
    }
    waitpid(child, &status, 0);
    chmod(folder, 0755);
    empty_scans();
    assert_true(WIFEXITED(status));
    if (WEXITSTATUS(status) == 77) skip();
    assert_int_equal(WEXITSTATUS(status), 0);
}

static void a_full_disk_is_an_error_and_leaves_nothing_behind(void **state)
{
    struct rlimit old, small;
    mospt_err err;
    (void)state;
    make_raw(30000, 2000000, 6);
    write_las("a.las", 30000, &millimetres);
    make_world(2000, millimetres.offset, 100, 1);
    char *path = scan_path("b.xyz");
    core_text_write(path, (const double(*)[3])world, 2000);
    free(path);
    build_good(&defaults, NULL);
    size_t size;
    char *largest = core_path(output, "points-01.bin");
    free(core_file_read(largest, &size));
    free(largest);
    remove_path(output);
    getrlimit(RLIMIT_FSIZE, &old);
    /* too small for what text says, and for payloads, up to the last byte of the last of them */
    const rlim_t limits[] = {0, 1000, 50000, size / 2, size - 1};
    for (size_t k = 0; k < sizeof limits / sizeof limits[0]; k++) {
        small = old;
        small.rlim_cur = limits[k];
        setrlimit(RLIMIT_FSIZE, &small);
        mospt_err what = {0};
        prep_build_result result;
        bool ok = build_with(&defaults, &result, &what);
        setrlimit(RLIMIT_FSIZE, &old);
        prep_build_result_fini(&result);
        err = what;
        assert_false(ok);
        assert_int_equal(err.code, MOSPT_EIO);
        assert_true(err.sys_errno != 0 && err.file[0] != '\0');
        assert_nothing_half_done(1); /* the scans stay */
    }
    empty_scans();
}

static void progress_ends_where_the_points_do(void **state)
{
    prep_build_result result;
    (void)state;
    make_raw(30000, 2000000, 6);
    write_las("a.las", 30000, &millimetres);
    countdown c = {UINT32_MAX};
    build_good(&(prep_build_options){.progress = count_down, .context = &c}, &result);
    assert_true(c.left < UINT32_MAX - 1);
    assert_true(result.peak_memory > 0 && result.total_seconds > 0);
    assert_int_equal(result.payload_bytes, mospt_payload_size(&result.metadata.schema, 30000));
    prep_build_result_fini(&result);
    remove_path(output);
    empty_scans();
}

#define CASE(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        CASE(las_positions_are_kept_bit_for_bit),
        CASE(scans_of_all_formats_come_together),
        CASE(coordinates_far_from_zero_keep_their_precision),
        CASE(lying_header_bounds_do_no_harm),
        CASE(header_bounds_a_little_too_wide_keep_every_bit),
        CASE(memory_and_threads_do_not_show_in_the_bytes),
        CASE(every_inner_depth_can_be_built),
        CASE(too_little_memory_is_refused),
        CASE(one_point_is_a_dataset),
        CASE(many_points_at_one_position_are_all_kept),
        CASE(no_point_is_an_error),
        CASE(points_that_are_not_finite_are_dropped_and_counted),
        CASE(bad_files_are_left_out_and_the_good_ones_built),
        CASE(a_damaged_file_with_lying_bounds_is_read_once_more_with_the_same_result),
        CASE(stopping_at_any_moment_leaves_nothing_half_done),
        CASE(an_output_that_exists_is_replaced_only_by_force),
        CASE(force_touches_nothing_but_the_output),
        CASE(an_output_whose_name_ends_in_new_is_like_any_other),
        CASE(a_folder_with_other_things_is_refused),
        CASE(folders_that_are_not_there_are_named),
        CASE(a_read_only_folder_is_an_error),
        CASE(a_full_disk_is_an_error_and_leaves_nothing_behind),
        CASE(progress_ends_where_the_points_do),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
