/* Attributes of a whole build: what the first points have in common is not taken for granted. */
#include "tests/core_scans.h"
#include "tests/core_tools.h"

#include "preprocess/build.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum {
    COUNT = 40000, /* of a scan: several batches, and more than are looked at first */
    LAS_HEADER = 227,
    LAS_RECORD = 20,
    CLASS_AT = 15,
    ANGLE_AT = 16,
    USER_AT = 17,
    SOURCE_AT = 18,
};

static char *folder, *scans, *output;

static int set_up(void **state)
{
    (void)state;
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

static const core_las millimetres = {.scale = {0.001, 0.001, 0.001}};
static int32_t raw[COUNT][3];

/* Of all points, classification is 2, scan angle and user data 0, and point source 77. */
static void write_las(const char *name, uint64_t seed)
{
    char *path = core_path(scans, "%s", name);
    core_las las = millimetres;
    for (uint32_t i = 0; i < COUNT; i++)
        for (int a = 0; a < 3; a++)
            raw[i][a] = (int32_t)core_below(&seed, 100000) - 50000;
    las.xyz = (const int32_t(*)[3])raw, las.count = COUNT;
    core_las_write(path, &las);
    free(path);
}

/* Changes a byte of the record of a point. */
static void change(const char *name, uint32_t point, size_t at, uint8_t value)
{
    char *path = core_path(scans, "%s", name);
    FILE *f = fopen(path, "r+b");
    assert_non_null(f);
    assert_int_equal(fseek(f, (long)(LAS_HEADER + point * (size_t)LAS_RECORD + at), SEEK_SET), 0);
    assert_int_equal(fwrite(&value, 1, 1, f), 1);
    assert_int_equal(fclose(f), 0);
    free(path);
}

/* How often the points were read. */
typedef struct {
    uint64_t last; /* points of the last report */
    uint32_t readings;
} readings;

static bool note_reading(void *context, const prep_progress *progress)
{
    readings *r = context;
    if (progress->phase == PREP_PHASE_WRITE) return true;
    r->readings += progress->points <= r->last;
    r->last = progress->points;
    return true;
}

/* Builds the scans and checks the dataset. Returns how often they were read. */
static uint32_t build(const prep_build_options *more)
{
    const char *inputs[] = {scans};
    readings seen = {.last = UINT64_MAX};
    mospt_err err = {0};
    prep_build_options o = *more;
    prep_build_result result;
    o.inputs = inputs, o.input_count = 1;
    o.progress = note_reading, o.context = &seen;
    if (o.output == NULL) o.output = output;
    if (o.threads == 0) o.threads = 2;
    if (o.memory == 0) o.memory = (uint64_t)256 << 20;
    CORE_NEED(prep_build(&o, &result, &err));
    assert_true(result.scratch_bytes <= result.scratch_announced);
    prep_build_result_fini(&result);
    if (core_findings(o.output, &err) > 0) CORE_NEED(false);
    return seen.readings;
}

static const prep_build_options defaults;

static mospt_storage storage_of(const mospt_dataset *d, const char *name)
{
    int k = mospt_schema_find(&d->metadata.schema, name);
    assert_true(k >= 0);
    return d->metadata.schema.at[k].storage;
}

/* Points that have this value of an attribute, of all that the dataset has. */
static uint64_t count_points(const mospt_dataset *d, const char *name, double value)
{
    const mospt_attribute *a = &d->metadata.schema.at[mospt_schema_find(&d->metadata.schema, name)];
    mospt_err err = {0};
    uint64_t found = 0;
    for (uint32_t i = 0; i < d->hierarchy.count; i++) {
        uint32_t n = d->hierarchy.nodes[i].count;
        mospt_vertex *v = malloc(n * sizeof *v);
        uint8_t *planes = malloc((size_t)n * d->metadata.schema.row_size);
        assert_true(v != NULL && planes != NULL);
        CORE_NEED(mospt_dataset_read_vertices(d, i, v, &err));
        CORE_NEED(mospt_dataset_read_attributes(d, i, v, planes, &err));
        for (uint32_t j = 0; j < n; j++)
            found += mospt_type_read(a->type, planes + (size_t)n * a->offset +
                                                  j * mospt_attribute_size(a)) == value;
        free(v), free(planes);
    }
    return found;
}

static mospt_dataset *open_output(void)
{
    mospt_dataset *d = NULL;
    mospt_err err = {0};
    CORE_NEED(mospt_dataset_open(output, &d, &err));
    return d;
}

static void empty(void)
{
    core_folder_remove(strdup(output));
    core_folder_remove(strdup(scans));
    assert_int_equal(mkdir(scans, 0777), 0);
}

static void what_scans_have_in_common_is_known_before_they_are_read(void **state)
{
    (void)state;
    write_las("a.las", 1);
    write_las("b.las", 2);
    for (uint32_t i = 0; i < COUNT; i++) /* the same in a scan, and not in all */
        change("b.las", i, SOURCE_AT, 78);
    assert_int_equal(build(&defaults), 1);
    mospt_dataset *d = open_output();
    assert_int_equal(storage_of(d, "classification"), MOSPT_CONSTANT);
    assert_int_equal(storage_of(d, "user_data"), MOSPT_CONSTANT);
    assert_int_equal(storage_of(d, "intensity"), MOSPT_IN_PLANE);
    assert_int_equal(storage_of(d, "point_source"), MOSPT_IN_PLANE);
    assert_int_equal(storage_of(d, "scan"), MOSPT_IN_PLANE);
    assert_int_equal(count_points(d, "point_source", 77), COUNT);
    assert_int_equal(count_points(d, "point_source", 78), COUNT);
    assert_int_equal(count_points(d, "classification", 2), 2 * COUNT);
    assert_int_equal(count_points(d, "scan", 1), COUNT);
    mospt_dataset_close(d);
    empty();
}

/* However many attributes differ, and wherever. */
static void points_that_differ_late_cost_one_more_reading(void **state)
{
    static const uint32_t places[] = {1024, COUNT / 2, COUNT - 1};
    (void)state;
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        write_las("a.las", 1);
        write_las("b.las", 2);
        change("a.las", places[i], CLASS_AT, 6);
        change("b.las", places[i], ANGLE_AT, 0xff);
        change("b.las", COUNT - 1, SOURCE_AT + 1, 1);
        assert_int_equal(build(&defaults), 2);
        mospt_dataset *d = open_output();
        assert_int_equal(storage_of(d, "classification"), MOSPT_IN_PLANE);
        assert_int_equal(storage_of(d, "scan_angle"), MOSPT_IN_PLANE);
        assert_int_equal(storage_of(d, "point_source"), MOSPT_IN_PLANE);
        assert_int_equal(storage_of(d, "user_data"), MOSPT_CONSTANT);
        assert_int_equal(storage_of(d, "return_number"), MOSPT_CONSTANT);
        assert_int_equal(count_points(d, "classification", 6), 1);
        assert_int_equal(count_points(d, "classification", 2), 2 * COUNT - 1);
        assert_int_equal(count_points(d, "scan_angle", -1), 1);
        assert_int_equal(count_points(d, "point_source", 77 + 256), 1);
        mospt_dataset_close(d);
        empty();
    }
}

static void what_differs_among_the_first_is_known(void **state)
{
    (void)state;
    write_las("a.las", 1);
    change("a.las", 1023, USER_AT, 9);
    assert_int_equal(build(&defaults), 1);
    mospt_dataset *d = open_output();
    assert_int_equal(storage_of(d, "user_data"), MOSPT_IN_PLANE);
    assert_int_equal(count_points(d, "user_data", 9), 1);
    mospt_dataset_close(d);
    empty();
}

/* The other scans must not have them by accident. */
static void an_attribute_of_one_scan_only_is_zero_in_the_others(void **state)
{
    static double world[2][3] = {{1, 2, 3}, {4, 5, 6}};
    char *path = core_path(scans, "b.txt");
    (void)state;
    write_las("a.las", 1);
    core_text_write(path, (const double(*)[3])world, 2);
    assert_int_equal(build(&defaults), 1);
    mospt_dataset *d = open_output();
    assert_int_equal(storage_of(d, "classification"), MOSPT_IN_PLANE);
    assert_int_equal(storage_of(d, "user_data"), MOSPT_CONSTANT); /* zero as well */
    assert_int_equal(count_points(d, "classification", 0), 2);
    assert_int_equal(count_points(d, "user_data", 0), COUNT + 2);
    mospt_dataset_close(d);
    free(path);
    empty();
}

static void scans_without_bounds_are_measured_and_read_once(void **state)
{
    static double world[COUNT][3];
    char *path = core_path(scans, "a.ply");
    uint64_t random = 5;
    (void)state;
    for (uint32_t i = 0; i < COUNT; i++)
        for (int a = 0; a < 3; a++)
            world[i][a] = core_unit(&random);
    core_ply_write(path, (const double(*)[3])world, COUNT);
    assert_int_equal(build(&defaults), 2);
    mospt_dataset *d = open_output();
    assert_int_equal(storage_of(d, "tag"), MOSPT_IN_PLANE);
    assert_int_equal(storage_of(d, "scan"), MOSPT_CONSTANT);
    mospt_dataset_close(d);
    free(path);
    empty();
}

/* Also where the first try is given up. */
static void memory_and_threads_do_not_show_in_the_bytes(void **state)
{
    static const struct {
        uint64_t mebibytes;
        uint32_t threads;
        bool dedupe;
    } ways[] = {{64, 1, false}, {64, 7, false}, {2048, 2, false}, {64, 1, true}, {512, 2, true}};
    char *first[2] = {core_path(folder, "first.ipts"), core_path(folder, "dedupe.ipts")};
    (void)state;
    write_las("a.las", 3);
    change("a.las", COUNT - 1000, CLASS_AT, 5);
    change("a.las", COUNT - 10, USER_AT, 1);
    for (int dedupe = 0; dedupe < 2; dedupe++)
        assert_int_equal(build(&(prep_build_options){.output = first[dedupe], .dedupe = dedupe}),
                         2);
    for (size_t k = 0; k < sizeof ways / sizeof ways[0]; k++) {
        assert_int_equal(build(&(prep_build_options){.memory = ways[k].mebibytes << 20,
                                                     .threads = ways[k].threads,
                                                     .dedupe = ways[k].dedupe}),
                         2);
        core_assert_same_folders(first[ways[k].dedupe], output);
        core_folder_remove(strdup(output));
    }
    assert_int_equal(build(&defaults), 2);
    core_folder_remove(first[0]);
    core_folder_remove(first[1]);
    empty();
}

#define CASE(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        CASE(what_scans_have_in_common_is_known_before_they_are_read),
        CASE(points_that_differ_late_cost_one_more_reading),
        CASE(what_differs_among_the_first_is_known),
        CASE(an_attribute_of_one_scan_only_is_zero_in_the_others),
        CASE(scans_without_bounds_are_measured_and_read_once),
        CASE(memory_and_threads_do_not_show_in_the_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
