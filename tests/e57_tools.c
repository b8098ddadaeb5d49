#include "tests/e57_tools.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

e57_values e57_v;

void e57_tools_init(void)
{
    uint64_t seed = 1;
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        e57_v.x[i] = (double)((float)scan_points_random(&seed) / 1e7f - 100);
        e57_v.y[i] = (double)((float)scan_points_random(&seed) / 1e8f);
        e57_v.z[i] = (double)((float)i / 64);
        e57_v.unit[i] = (double)((float)(scan_points_random(&seed) % 1000) / 999);
        for (int c = 0; c < 3; c++)
            e57_v.number[c][i] = scan_points_random(&seed) % 256;
        e57_v.flag[i] = i % 5 == 0;
        e57_v.state3[i] = i % 7 == 0 ? 2 : i % 11 == 0 ? 1 : 0;
    }
}

write_e57_field e57_real(const char *name, write_e57_kind kind, const double *values)
{
    return (write_e57_field){.name = name, .kind = kind, .values = values};
}

write_e57_field e57_whole(const char *name, const int64_t *integers, int64_t low, int64_t high)
{
    return (write_e57_field){
        .name = name, .kind = WRITE_E57_INTEGER, .integers = integers, .low = low, .high = high};
}

void e57_begin(e57_made *m)
{
    *m = (e57_made){
        .scan = {
            .name = "a", .guid = "g", .fields = m->field, .field_count = 3, .count = E57_COUNT}};
    m->field[0] = e57_real("cartesianX", WRITE_E57_FLOAT, e57_v.x);
    m->field[1] = e57_real("cartesianY", WRITE_E57_FLOAT, e57_v.y);
    m->field[2] = e57_real("cartesianZ", WRITE_E57_FLOAT, e57_v.z);
}

void e57_add(e57_made *m, write_e57_field field)
{
    m->field[m->scan.field_count++] = field;
}

void e57_add_rgb(e57_made *m, int64_t high)
{
    static const char *const names[3] = {"colorRed", "colorGreen", "colorBlue"};
    for (int c = 0; c < 3; c++)
        e57_add(m, e57_whole(names[c], e57_v.number[c], 0, high));
}

bool e57_load_scan(const char *path, uint32_t index, prep_scan_memory *memory, uint32_t capacity,
                   e57_loaded *out, mospt_err *err)
{
    prep_scan *scan;
    const prep_scan_options options = {.memory = memory};
    *out = (e57_loaded){0};
    if (!prep_scan_open(path, index, &options, &scan, err)) return false;
    out->info = *prep_scan_describe(scan);
    assert_true(prep_batch_init(&out->batch, &out->info.attributes, capacity, err));
    assert_true(prep_scan_read(scan, &out->batch, err));
    memcpy(out->dropped, prep_scan_dropped(scan), sizeof out->dropped);
    if (prep_scan_damage(scan) != NULL) out->damage = *prep_scan_damage(scan);
    snprintf(out->crs, sizeof out->crs, "%.255s", prep_scan_describe(scan)->crs);
    prep_scan_close(scan);
    return true;
}

void e57_unload(e57_loaded *l)
{
    prep_batch_fini(&l->batch);
}

void e57_load_bytes(const uint8_t *bytes, size_t size, uint32_t index, e57_loaded *out)
{
    mospt_err err = {0};
    const char *path = scan_points_file("a.e57", bytes, size);
    if (!e57_load_scan(path, index, NULL, 2 * E57_COUNT, out, &err)) fail_msg("%s", err.message);
}

void e57_load_file(const write_e57_file *file, uint32_t index, e57_loaded *out)
{
    size_t size;
    uint8_t *bytes = write_e57(file, &size);
    e57_load_bytes(bytes, size, index, out);
    free(bytes);
}

void e57_load_made(const e57_made *m, e57_loaded *out)
{
    e57_load_file(&(write_e57_file){.scans = &m->scan, .scan_count = 1}, 0, out);
    assert_int_equal(out->damage.code, MOSPT_OK);
}

mospt_err e57_refuse_bytes(const uint8_t *bytes, size_t size)
{
    e57_loaded l;
    mospt_err err = {0};
    const char *path = scan_points_file("a.e57", bytes, size);
    assert_false(e57_load_scan(path, 0, NULL, 100, &l, &err));
    assert_string_equal(err.file, path);
    return err;
}

mospt_err e57_refuse_file(const write_e57_file *file)
{
    size_t size;
    uint8_t *bytes = write_e57(file, &size);
    mospt_err err = e57_refuse_bytes(bytes, size);
    free(bytes);
    return err;
}

const void *e57_plane(const e57_loaded *l, const char *name, mospt_type type, uint32_t components)
{
    int k = mospt_schema_find(&l->info.attributes, name);
    if (k < 0) fail_msg("no attribute %s", name);
    assert_int_equal(l->info.attributes.at[k].type, type);
    assert_int_equal(l->info.attributes.at[k].components, components);
    return l->batch.plane[k];
}

bool e57_has_plane(const e57_loaded *l, const char *name)
{
    return mospt_schema_find(&l->info.attributes, name) >= 0;
}

void e57_check_xyz(const e57_loaded *l)
{
    assert_int_equal(l->batch.count, E57_COUNT);
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        const double expected[3] = {e57_v.x[i], e57_v.y[i], e57_v.z[i]};
        assert_memory_equal(l->batch.xyz + 3 * i, expected, sizeof expected);
    }
}
