/* A LAZ file and its LAS twin become the same dataset, but for what they are called. */
#include "preprocess/build.h"
#include "tests/core_tools.h"
#include "tests/laz_twins.h"
#include "tests/write_las.h"
#include "tests/write_laz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static char *build(const char *scan, const char *name)
{
    char *output = core_path(core_folder, "%s.ipts", name);
    const prep_build_options options = {.inputs = &scan,
                                        .input_count = 1,
                                        .output = output,
                                        .force = true,
                                        .threads = 2,
                                        .inner_depth = 3};
    prep_build_result result;
    mospt_err err = {0};
    if (!prep_build(&options, &result, &err)) fail_msg("%s: %s", scan, err.message);
    assert_false(prep_build_left_something_out(&result));
    prep_build_result_fini(&result);
    return output;
}

static void assert_same_file(const char *a, const char *b, const char *name)
{
    char *paths[2] = {core_path(a, "%s", name), core_path(b, "%s", name)};
    size_t sizes[2];
    uint8_t *x = core_file_read(paths[0], &sizes[0]), *y = core_file_read(paths[1], &sizes[1]);
    if (sizes[0] != sizes[1] || memcmp(x, y, sizes[0]) != 0)
        fail_msg("%s and %s differ", paths[0], paths[1]);
    free(x), free(y);
    free(paths[0]), free(paths[1]);
}

static void assert_same_sources(const mospt_metadata *a, const mospt_metadata *b)
{
    assert_int_equal(a->source_count, b->source_count);
    for (uint32_t i = 0; i < a->source_count; i++) {
        const mospt_source *s = &a->sources[i], *t = &b->sources[i];
        assert_int_equal(s->points, t->points);
        assert_int_equal(s->dropped, t->dropped);
        assert_int_equal(s->has_rgb, t->has_rgb);
        assert_int_equal(s->has_intensity, t->has_intensity);
        assert_memory_equal(s->low, t->low, sizeof s->low);
        assert_memory_equal(s->high, t->high, sizeof s->high);
    }
}

static void assert_same_datasets(const char *a, const char *b)
{
    mospt_metadata x, y;
    mospt_err err = {0};
    CORE_NEED(mospt_metadata_read(a, &x, &err));
    CORE_NEED(mospt_metadata_read(b, &y, &err));
    assert_int_equal(core_entries(a), core_entries(b));
    assert_int_equal(core_entries(a), x.file_count + 2); /* hierarchy and metadata.json */
    assert_same_file(a, b, x.hierarchy_name);
    for (uint32_t i = 0; i < x.file_count; i++)
        assert_same_file(a, b, x.files[i].name);
    assert_int_equal(x.points_hash, y.points_hash);
    assert_memory_equal(&x.grid, &y.grid, sizeof x.grid);
    assert_memory_equal(&x.low, &y.low, sizeof x.low);
    assert_memory_equal(&x.high, &y.high, sizeof x.high);
    assert_true(x.position_error == y.position_error);
    assert_string_equal(x.crs, y.crs);
    assert_same_sources(&x, &y);
    mospt_metadata_fini(&x), mospt_metadata_fini(&y);
}

static void check_twins(const char *laz, const char *las)
{
    char *a = build(laz, "a"), *b = build(las, "b");
    assert_same_datasets(a, b);
    core_folder_remove(a), core_folder_remove(b);
}

/* A file whose header tells the bounds of its points. */
static uint8_t *make_las(const write_las_options *o, size_t *size)
{
    uint8_t *bytes = write_las(o, size);
    for (int a = 0; a < 3; a++) {
        int32_t first = write_las_xyz(0, a), last = write_las_xyz(o->count - 1, a);
        int32_t low = first < last ? first : last, high = first < last ? last : first;
        write_las_f64(bytes + 179 + 16 * a, high * o->scale[a] + o->offset[a]);
        write_las_f64(bytes + 187 + 16 * a, low * o->scale[a] + o->offset[a]);
    }
    return bytes;
}

static void twins_become_the_same_dataset(void **state)
{
    (void)state;
    /* chunks as most writers make them, others, and one that is all of the file */
    static const write_laz_options kinds[] = {{.chunk_points = 50000},
                                              {.chunk_points = 7000},
                                              {.chunk_points = 20000, .varies = true},
                                              {.chunk_points = 120000}};
    char *las = core_path(core_folder, "scan.las"), *laz = core_path(core_folder, "scan.laz");
    for (uint8_t format = 1; format <= 7; format += 3) {
        const write_las_options options = {.minor = 4,
                                           .format = format,
                                           .count = 120000,
                                           .scale = {0.001, 0.001, 0.01},
                                           .offset = {690000, 5330000, 0},
                                           .rgb_step = 7,
                                           .intensity_step = 3,
                                           .extra_size = 2};
        size_t size;
        uint8_t *bytes = make_las(&options, &size);
        core_file_write(las, bytes, size);
        for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; k++) {
            size_t packed_size;
            uint8_t *packed = write_laz(bytes, size, &kinds[k], &packed_size);
            core_file_write(laz, packed, packed_size);
            check_twins(laz, las);
            free(packed);
        }
        free(bytes);
    }
    unlink(las), unlink(laz);
    free(las), free(laz);
}

static void real_twins_become_the_same_dataset(void **state)
{
    (void)state;
    char laz[2048], las[2048];
    if (!laz_twins_path(0, 0, laz, sizeof laz)) skip();
    for (size_t i = 0; i < laz_twins_count; i++) {
        assert_true(laz_twins_path(i, 0, laz, sizeof laz) && laz_twins_path(i, 1, las, sizeof las));
        check_twins(laz, las);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(twins_become_the_same_dataset),
        cmocka_unit_test(real_twins_become_the_same_dataset),
    };
    return cmocka_run_group_tests(tests, core_folder_set_up, core_folder_tear_down);
}
