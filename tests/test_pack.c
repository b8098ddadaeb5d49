/* Records made of points as their file has them are those made of planes. */
#include "preprocess/pack.h"
#include "preprocess/scan.h"
#include "tests/scan_points.h"
#include "tests/write_las.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { COUNT = 1000, BATCH = 700 };

typedef struct {
    uint8_t *records; /* [COUNT][stride] */
    size_t stride;
    prep_pack_sums sums;
    bool was_packed;
} packed;

static write_las_options options_of(uint8_t format)
{
    return (write_las_options){.minor = 4,
                               .format = format,
                               .count = COUNT,
                               .scale = {0.001, 0.001, 0.001},
                               .offset = {500000.125, -4e6, 0.1},
                               .rgb_step = 200,
                               .intensity_step = 3,
                               .extra_size = 3};
}

static const char *write_file(const write_las_options *o)
{
    size_t size;
    uint8_t *bytes = write_las(o, &size);
    const char *path = scan_points_file("a.las", bytes, size);
    free(bytes);
    return path;
}

/* Reads a file and packs all of its points.
 * schema   of the dataset */
static packed pack(const char *path, const prep_scan_options *options, bool takes_packed,
                   const mospt_grid *grid, const mospt_schema *schema)
{
    prep_scan *scan = NULL;
    prep_batch batch;
    mospt_err err = {0};
    packed p = {.stride = mospt_record_size(schema), .sums = prep_pack_sums_empty};
    uint32_t done = 0;
    p.records = calloc(COUNT, p.stride);
    assert_non_null(p.records);
    assert_true(prep_scan_open(path, 0, options, &scan, &err));
    const prep_scan_info *info = prep_scan_describe(scan);
    assert_true(prep_batch_init(&batch, &info->attributes, BATCH, &err));
    batch.takes_packed = takes_packed;
    prep_packer packer = {.grid = grid, .schema = schema, .planes = &info->attributes, .scan = 7};
    for (;;) {
        assert_true(prep_scan_read(scan, &batch, &err));
        if (batch.count == 0) break;
        p.was_packed = p.was_packed || batch.packed.unpack != NULL;
        assert_true(done + batch.count <= COUNT);
        prep_pack(&packer, &batch, 0, batch.count, p.records + done * p.stride, &p.sums);
        done += batch.count;
    }
    prep_batch_fini(&batch);
    prep_scan_close(scan);
    return p;
}

static mospt_grid grid_for(const write_las_options *o, double step, double shift)
{
    mospt_grid grid;
    double low[3], high[3], offset[3];
    for (int a = 0; a < 3; a++) {
        double first = write_las_xyz(0, a) * o->scale[a] + o->offset[a],
               last = write_las_xyz(COUNT - 1, a) * o->scale[a] + o->offset[a];
        low[a] = fmin(first, last);
        high[a] = fmax(first, last);
        offset[a] = o->offset[a] + shift;
    }
    assert_true(mospt_grid_make(low, high, step, offset, &grid, NULL));
    return grid;
}

static mospt_schema schema_of(const char *path)
{
    prep_scan *scan = NULL;
    assert_true(prep_scan_open(path, 0, NULL, &scan, NULL));
    mospt_schema schema = prep_scan_describe(scan)->attributes;
    prep_scan_close(scan);
    return schema;
}

static void assert_same(const packed *a, const packed *b)
{
    assert_memory_equal(a->records, b->records, COUNT * a->stride);
    assert_true(a->sums.hash == b->sums.hash && a->sums.outside == b->sums.outside);
    assert_true(a->sums.position_error == b->sums.position_error);
    assert_memory_equal(a->sums.low, b->sums.low, sizeof a->sums.low);
    assert_memory_equal(a->sums.high, b->sums.high, sizeof a->sums.high);
    assert_true(a->sums.differs.in_value == b->sums.differs.in_value);
    assert_true(a->sums.differs.from_colour == b->sums.differs.from_colour);
}

static void check(const char *path, const mospt_grid *grid, const mospt_schema *schema)
{
    packed plain = pack(path, NULL, false, grid, schema),
           direct = pack(path, NULL, true, grid, schema);
    assert_false(plain.was_packed);
    assert_true(direct.was_packed && !direct.sums.outside);
    assert_same(&plain, &direct);
    free(plain.records), free(direct.records);
}

static void packed_records_are_those_of_planes(void **state)
{
    (void)state;
    for (uint8_t format = 0; format <= 10; format++) {
        write_las_options o = options_of(format);
        const char *path = write_file(&o);
        mospt_schema all = schema_of(path), few = {0}, wide = {0};
        assert_true(mospt_schema_add(&few, "scan", MOSPT_U16, 1, NULL));
        assert_true(mospt_schema_add(&few, "intensity", MOSPT_U16, 1, NULL));
        for (uint32_t k = 0; k < all.count; k++)
            assert_true(mospt_schema_add(&wide, all.at[k].name, k % 2 ? all.at[k].type : MOSPT_F64,
                                         all.at[k].components, NULL));
        const mospt_grid grids[] = {grid_for(&o, 0.001, 0), grid_for(&o, 0.0015, 0),
                                    grid_for(&o, 0.001, 0.0004)};
        for (int g = 0; g < 3; g++) {
            check(path, &grids[g], &all);
            check(path, &grids[g], &few);
            check(path, &grids[g], &wide);
        }
    }
}

static void a_point_outside_the_root_is_seen(void **state)
{
    (void)state;
    write_las_options o = options_of(2);
    const char *path = write_file(&o);
    const mospt_schema all = schema_of(path);
    double low[3], high[3];
    for (int a = 0; a < 3; a++) {
        low[a] = o.offset[a];
        high[a] = o.offset[a] + 1;
    }
    mospt_grid grid;
    assert_true(mospt_grid_make(low, high, 0.001, o.offset, &grid, NULL));
    packed p = pack(path, NULL, true, &grid, &all);
    assert_true(p.was_packed && p.sums.outside);
    free(p.records);
}

static void points_to_be_cropped_or_out_of_range_come_in_planes(void **state)
{
    (void)state;
    write_las_options o = options_of(2);
    const char *path = write_file(&o);
    const mospt_schema all = schema_of(path);
    mospt_grid grid = grid_for(&o, 0.001, 0);
    prep_scan_options crop = {.has_crop = true}, range = {.has_range = true};
    for (int a = 0; a < 3; a++) {
        crop.crop_low[a] = range.range_low[a] = -5e6;
        crop.crop_high[a] = range.range_high[a] = 2e6;
    }
    const prep_scan_options *cases[] = {&crop, &range};
    for (int i = 0; i < 2; i++) {
        packed p = pack(path, cases[i], true, &grid, &all);
        assert_false(p.was_packed);
        free(p.records);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(packed_records_are_those_of_planes),
        cmocka_unit_test(a_point_outside_the_root_is_seen),
        cmocka_unit_test(points_to_be_cropped_or_out_of_range_come_in_planes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
