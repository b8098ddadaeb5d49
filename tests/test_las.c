#include "preprocess/las.h"
#include "tests/scan_points.h"
#include "tests/write_las.h"

#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const write_las_options plain = {
    .minor = 2,
    .format = 2,
    .count = 300,
    .scale = {0.001, 0.01, 0.0005},
    .offset = {500000.125, -4e6, 0.1},
    .rgb_step = 200,
    .intensity_step = 3,
};

static void read_bytes(uint8_t *bytes, size_t size, scan_points *out)
{
    mospt_err err;
    if (!scan_points_read(scan_points_file("a.las", bytes, size), NULL, 77, out, &err))
        fail_msg("%s", err.message);
}

static void read_made(const write_las_options *o, scan_points *out)
{
    size_t size;
    uint8_t *bytes = write_las(o, &size);
    read_bytes(bytes, size, out);
    free(bytes);
}

static mospt_err refuse_bytes(const uint8_t *bytes, size_t size)
{
    scan_points points;
    mospt_err err = {0};
    const char *path = scan_points_file("a.las", bytes, size);
    assert_false(scan_points_read(path, NULL, 100, &points, &err));
    assert_string_equal(err.file, path);
    return err;
}

static double cut(const char *field, uint32_t i, uint32_t mask)
{
    return write_las_value(field, i) & mask;
}

static void check_positions(const write_las_options *o, const scan_points *p)
{
    assert_int_equal(p->count, o->count);
    for (uint32_t i = 0; i < o->count; i++) {
        for (int a = 0; a < 3; a++) {
            volatile double product = write_las_xyz(i, a) * o->scale[a];
            double expected = product + o->offset[a];
            assert_memory_equal(&p->xyz[3 * i + (uint32_t)a], &expected, sizeof expected);
        }
    }
}

static void check_fields(const write_las_options *o, const scan_points *p)
{
    bool is_old = o->format < 6;
    for (uint32_t i = 0; i < o->count; i++) {
        uint32_t angle = write_las_value("scan_angle", i);
        assert_true(scan_points_value(p, "intensity", i, 0) == (uint16_t)(i * o->intensity_step));
        assert_true(scan_points_value(p, "return_number", i, 0) ==
                    cut("return_number", i, is_old ? 7 : 15));
        assert_true(scan_points_value(p, "number_of_returns", i, 0) ==
                    cut("number_of_returns", i, is_old ? 7 : 15));
        assert_true(scan_points_value(p, "classification", i, 0) ==
                    cut("classification", i, is_old ? 31 : 255));
        assert_true(scan_points_value(p, "flags", i, 0) == cut("flags", i, is_old ? 0x37 : 0x3f));
        assert_true(scan_points_value(p, "scan_angle", i, 0) ==
                    (is_old ? (int8_t)angle : (int16_t)angle));
        assert_true(scan_points_value(p, "user_data", i, 0) == cut("user_data", i, 255));
        assert_true(scan_points_value(p, "point_source", i, 0) == cut("point_source", i, 65535));
        if (!is_old)
            assert_true(scan_points_value(p, "scanner_channel", i, 0) ==
                        cut("scanner_channel", i, 3));
        if (o->format != 0 && o->format != 2)
            assert_true(scan_points_value(p, "gps_time", i, 0) == write_las_gps(i));
        if (o->format == 8 || o->format == 10)
            assert_true(scan_points_value(p, "nir", i, 0) == cut("nir", i, 65535));
    }
}

static bool has_rgb(uint8_t format)
{
    return format == 2 || format == 3 || format == 5 || format == 7 || format == 8 || format == 10;
}

static void check_colours(const write_las_options *o, const scan_points *p)
{
    assert_int_equal(p->info.has_rgb, has_rgb(o->format));
    for (uint32_t i = 0; i < o->count && has_rgb(o->format); i++) {
        for (uint32_t c = 0; c < 3; c++) {
            uint32_t raw = (uint16_t)(i * o->rgb_step + c);
            assert_true(scan_points_value(p, "rgb", i, c) == raw);
            assert_int_equal(p->rgbi[4 * i + c], (raw * 255 + 32767) / 65535);
        }
    }
}

static void every_version_and_point_format_is_read(void **state)
{
    (void)state;
    for (uint8_t minor = 0; minor <= 4; minor++) {
        for (uint8_t format = 0; format <= 10; format++) {
            write_las_options o = plain;
            o.minor = minor;
            o.format = format;
            if (format >= 6 && minor < 4) continue;
            scan_points p;
            read_made(&o, &p);
            check_positions(&o, &p);
            check_fields(&o, &p);
            check_colours(&o, &p);
            char name[64];
            snprintf(name, sizeof name, "LAS 1.%u, point format %u", minor, format);
            assert_string_equal(p.info.format, name);
            assert_false(p.is_damaged);
            assert_true(p.info.has_intensity);
            scan_points_fini(&p);
        }
    }
}

static void attribute_types_are_those_of_the_format(void **state)
{
    (void)state;
    write_las_options o = plain;
    o.minor = 4;
    o.format = 8;
    scan_points p;
    read_made(&o, &p);
    static const char *const expected[][2] = {
        {"intensity", "u16"},     {"return_number", "u8"}, {"number_of_returns", "u8"},
        {"classification", "u8"}, {"flags", "u8"},         {"scanner_channel", "u8"},
        {"scan_angle", "i16"},    {"user_data", "u8"},     {"point_source", "u16"},
        {"gps_time", "f64"},      {"rgb", "u16"},          {"nir", "u16"}};
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++)
        assert_string_equal(scan_points_type(&p, expected[i][0]), expected[i][1]);
    scan_points_fini(&p);
    o.format = 3;
    read_made(&o, &p);
    assert_string_equal(scan_points_type(&p, "scan_angle"), "i8");
    assert_string_equal(scan_points_type(&p, "scanner_channel"), "");
    scan_points_fini(&p);
}

static void the_header_gives_step_offset_and_bounds(void **state)
{
    (void)state;
    scan_points p;
    read_made(&plain, &p);
    assert_true(p.info.step == 0.0005);
    assert_true(p.info.offset[0] == plain.offset[0] && p.info.offset[1] == plain.offset[1]);
    assert_true(p.info.has_bounds && p.info.low[2] == -1000 && p.info.high[0] == 1000);
    assert_int_equal(p.info.point_count, 300);
    assert_false(p.info.is_text);
    scan_points_fini(&p);

    size_t size;
    uint8_t *bytes = write_las(&plain, &size);
    write_las_f64(bytes + 187, 2000); /* the low x above the high x */
    read_bytes(bytes, size, &p);
    assert_false(p.info.has_bounds);
    scan_points_fini(&p);
    write_las_f64(bytes + 187, (double)NAN);
    read_bytes(bytes, size, &p);
    assert_false(p.info.has_bounds);
    scan_points_fini(&p);
    free(bytes);
}

static void bytes_in_16_bit_colours_are_bytes(void **state)
{
    (void)state;
    write_las_options o = plain;
    o.count = 250;
    o.rgb_step = 1;
    scan_points p;
    read_made(&o, &p);
    for (uint32_t i = 0; i < o.count; i++)
        assert_int_equal(p.rgbi[4 * i], i);
    scan_points_fini(&p);
}

static void black_is_no_colour(void **state)
{
    (void)state;
    write_las_options o = plain;
    o.count = 200;
    o.rgb_step = 0;
    o.intensity_step = 1;
    scan_points p;
    read_made(&o, &p);
    assert_false(p.info.has_rgb);
    assert_string_equal(scan_points_type(&p, "rgb"), "");
    for (uint32_t i = 0; i < o.count; i++) {
        for (uint32_t c = 0; c < 4; c++)
            assert_int_equal(p.rgbi[4 * i + c], p.rgbi[4 * i]);
        assert_true(i == 0 || p.rgbi[4 * i] >= p.rgbi[4 * i - 4]);
    }
    assert_true(p.rgbi[0] == 0 && p.rgbi[4 * 199] == 255); /* stretched */
    scan_points_fini(&p);
}

static void without_colour_and_intensity_points_are_white(void **state)
{
    (void)state;
    write_las_options o = plain;
    o.rgb_step = 0;
    o.intensity_step = 0;
    scan_points p;
    read_made(&o, &p);
    assert_false(p.info.has_rgb || p.info.has_intensity);
    for (uint32_t i = 0; i < 4 * o.count; i++)
        assert_int_equal(p.rgbi[i], 255);
    scan_points_fini(&p);
}

static void wide_intensities_are_stretched(void **state)
{
    (void)state;
    write_las_options o = plain;
    o.format = 0;
    o.count = 1000;
    o.intensity_step = 50;
    scan_points p;
    read_made(&o, &p);
    assert_int_equal(p.rgbi[3], 0);
    assert_int_equal(p.rgbi[4 * 999 + 3], 255);
    assert_in_range(p.rgbi[4 * 500 + 3], 126, 129);
    assert_true(scan_points_value(&p, "intensity", 999, 0) == 49950);
    scan_points_fini(&p);
}

static void described_extra_bytes_become_attributes(void **state)
{
    (void)state;
    static const struct {
        uint8_t type, components;
        const char *name, *type_name;
    } entry[] = {
        {1, 1, "Amplitude", "u8"}, {4, 1, "Pulse width", "i16"}, {9, 1, "f", "f32"},
        {10, 1, "d", "f64"},       {8, 1, "l", "i64"},           {13, 2, "pair", "u16"},
        {25, 3, "three", "u32"},   {0, 5, "raw", "u8"},          {1, 1, "intensity", "u8"}};
    enum { COUNT = sizeof entry / sizeof entry[0] };
    uint8_t description[COUNT * 192];
    uint32_t at = 0, offset[COUNT], total = 0;
    for (uint32_t k = 0; k < COUNT; k++) {
        mospt_type type;
        write_las_extra(description + 192 * k, entry[k].type, entry[k].components, entry[k].name);
        assert_true(mospt_type_from_name(entry[k].type_name, &type));
        offset[k] = at;
        at += entry[k].components * (uint32_t)mospt_type_size(type);
        total = at;
    }
    write_las_options o = plain;
    o.extra_size = total + 3; /* three bytes more than are described */
    o.extra_description = description;
    o.extra_description_size = sizeof description;
    scan_points p;
    read_made(&o, &p);
    check_positions(&o, &p);
    for (uint32_t k = 0; k < COUNT; k++) {
        char name[48];
        snprintf(name, sizeof name, "%s",
                 strcmp(entry[k].name, "Pulse width") == 0 ? "Pulse_width"
                 : k == 8                                  ? "intensity_2"
                                                           : entry[k].name);
        int plane = mospt_schema_find(&p.info.attributes, name);
        assert_true(plane >= 0);
        const mospt_attribute *a = &p.info.attributes.at[plane];
        assert_string_equal(mospt_type_name(a->type), entry[k].type_name);
        assert_int_equal(a->components, entry[k].components);
        for (uint32_t i = 0; i < o.count; i++) {
            for (uint32_t b = 0; b < mospt_attribute_size(a); b++)
                assert_int_equal(p.plane[plane][i * mospt_attribute_size(a) + b],
                                 (uint8_t)(write_las_value("extra", i) + offset[k] + b));
        }
    }
    assert_true(scan_points_value(&p, "extra_bytes", 7, 2) ==
                (uint8_t)(write_las_value("extra", 7) + total + 2));
    scan_points_fini(&p);
}

static void undescribed_extra_bytes_are_kept(void **state)
{
    (void)state;
    write_las_options o = plain;
    o.extra_size = 7;
    scan_points p;
    read_made(&o, &p);
    assert_true(scan_points_value(&p, "extra_bytes", 5, 6) ==
                (uint8_t)(write_las_value("extra", 5) + 6));
    scan_points_fini(&p);
    o.extra_size = 60000; /* far too many: the points are read, and it is said what is missing */
    o.count = 20;
    read_made(&o, &p);
    assert_int_equal(p.count, 20);
    assert_true(p.is_damaged);
    assert_true(p.info.attributes.row_size < 1024);
    scan_points_fini(&p);
}

static void a_description_longer_than_the_record_is_cut(void **state)
{
    (void)state;
    uint8_t description[4 * 192];
    for (uint32_t k = 0; k < 4; k++)
        write_las_extra(description + 192 * k, 10, 0, "value");
    write_las_options o = plain;
    o.extra_size = 12; /* room for one and a half */
    o.extra_description = description;
    o.extra_description_size = sizeof description;
    scan_points p;
    read_made(&o, &p);
    assert_string_equal(scan_points_type(&p, "value"), "f64");
    assert_string_equal(scan_points_type(&p, "value_2"), "");
    assert_string_equal(scan_points_type(&p, "extra_bytes"), "u8");
    scan_points_fini(&p);
}

static void too_many_points_declared_is_damage(void **state)
{
    (void)state;
    write_las_options o = plain;
    o.declared = 4000000000u;
    scan_points p;
    read_made(&o, &p);
    assert_int_equal(p.count, 300);
    assert_true(p.is_damaged);
    assert_int_equal(p.damage.code, MOSPT_EFORMAT);
    assert_int_equal(p.damage.place, 227 + 300 * 26);
    assert_non_null(strstr(p.damage.message, "4000000000"));
    assert_non_null(strstr(p.damage.message, "300"));
    scan_points_fini(&p);
}

static void both_counts_of_version_4_are_understood(void **state)
{
    (void)state;
    static const struct {
        uint64_t count;
        uint32_t legacy;
    } cases[] = {{300, 0}, {300, 300}, {300, 7}, {300, 4000000000u}, {0, 300}, {1ull << 60, 300}};
    write_las_options o = plain;
    o.minor = 4;
    size_t size;
    uint8_t *bytes = write_las(&o, &size);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        write_las_u64(bytes + 247, cases[i].count);
        write_las_u32(bytes + 107, cases[i].legacy);
        scan_points p;
        read_bytes(bytes, size, &p);
        assert_int_equal(p.count, 300);
        assert_false(p.is_damaged);
        scan_points_fini(&p);
    }
    free(bytes);
}

static void wrong_vlr_counts_are_refused_or_ignored(void **state)
{
    (void)state;
    uint8_t description[192];
    write_las_extra(description, 1, 0, "a");
    write_las_options o = plain;
    o.extra_size = 1;
    o.extra_description = description;
    o.extra_description_size = sizeof description;
    size_t size;
    uint8_t *bytes = write_las(&o, &size);
    write_las_u32(bytes + 100, 4); /* fits, but is not true */
    scan_points p;
    read_bytes(bytes, size, &p);
    assert_int_equal(p.count, 300);
    assert_string_equal(scan_points_type(&p, "a"), "u8");
    scan_points_fini(&p);
    write_las_u32(bytes + 100, 1069128089);
    mospt_err err = refuse_bytes(bytes, size);
    assert_int_equal(err.code, MOSPT_EFORMAT);
    assert_int_equal(err.place, 100);
    free(bytes);
}

static void impossible_headers_are_refused(void **state)
{
    (void)state;
    size_t size;
    uint8_t *good = write_las(&plain, &size);
    uint8_t *bytes = malloc(size);
    const double bad_scale[] = {0, -0.01, (double)NAN, (double)INFINITY};
    for (size_t i = 0; i < 4; i++) {
        for (uint32_t a = 0; a < 3; a++) {
            memcpy(bytes, good, size);
            write_las_f64(bytes + 131 + 8 * a, bad_scale[i]);
            mospt_err err = refuse_bytes(bytes, size);
            assert_int_equal(err.code, MOSPT_EFORMAT);
            assert_int_equal(err.place, 131 + 8 * a);
        }
    }
    static const struct {
        uint32_t at, bytes, value;
    } edits[] = {{24, 1, 2},           {25, 1, 77},    {94, 2, 226}, {96, 4, 100},
                 {96, 4, 0xf0000000u}, {104, 1, 11},   {104, 1, 99}, {105, 2, 25},
                 {105, 2, 0},          {104, 1, 0x82}, {0, 4, 0}};
    for (size_t i = 0; i < sizeof edits / sizeof edits[0]; i++) {
        memcpy(bytes, good, size);
        if (edits[i].bytes == 1) bytes[edits[i].at] = (uint8_t)edits[i].value;
        if (edits[i].bytes == 2) write_las_u16(bytes + edits[i].at, edits[i].value);
        if (edits[i].bytes == 4) write_las_u32(bytes + edits[i].at, edits[i].value);
        assert_int_equal(refuse_bytes(bytes, size).code, MOSPT_EFORMAT);
    }
    free(bytes);
    free(good);
}

static void no_points_is_empty(void **state)
{
    (void)state;
    write_las_options o = plain;
    o.count = 0;
    size_t size;
    uint8_t *bytes = write_las(&o, &size);
    assert_int_equal(refuse_bytes(bytes, size).code, MOSPT_EEMPTY);
    free(bytes);
}

static void every_truncation_is_an_error_or_fewer_points(void **state)
{
    (void)state;
    for (uint8_t format = 2; format <= 7; format += 5) {
        write_las_options o = plain;
        o.minor = 4;
        o.format = format;
        o.count = 12;
        size_t size;
        uint8_t *bytes = write_las(&o, &size);
        uint64_t record = write_las_record_size(format);
        for (size_t n = 0; n < size; n++) {
            uint64_t count;
            scan_points_survive("cut.las", bytes, n, &count);
            assert_int_equal(count, n < 375 ? 0 : (n - 375) / record);
        }
        free(bytes);
    }
}

static void no_bit_flip_does_harm(void **state)
{
    (void)state;
    uint8_t description[2 * 192];
    write_las_extra(description, 10, 0, "a");
    write_las_extra(description + 192, 0, 3, "b");
    write_las_options o = plain;
    o.minor = 4;
    o.format = 7;
    o.count = 20;
    o.extra_size = 12;
    o.extra_description = description;
    o.extra_description_size = sizeof description;
    o.evlr_size = 100;
    size_t size;
    uint8_t *good = write_las(&o, &size);
    uint8_t *bytes = malloc(size);
    uint64_t seed = 1;
    for (int round = 0; round < 4000; round++) {
        memcpy(bytes, good, size);
        uint32_t flips = 1 + scan_points_random(&seed) % 4;
        for (uint32_t k = 0; k < flips; k++)
            bytes[scan_points_random(&seed) % (round % 2 != 0 ? size : 1000)] ^=
                (uint8_t)(1u << scan_points_random(&seed) % 8);
        scan_points_survive("flip.las", bytes, size, NULL);
    }
    free(bytes);
    free(good);
}

static void points_do_not_depend_on_the_batch_size(void **state)
{
    (void)state;
    write_las_options o = plain;
    o.count = 30000; /* more than one block */
    size_t size;
    uint8_t *bytes = write_las(&o, &size);
    const char *path = scan_points_file("batch.las", bytes, size);
    scan_points a, b;
    assert_true(scan_points_read(path, NULL, 65536, &a, NULL));
    assert_true(scan_points_read(path, NULL, 1009, &b, NULL));
    assert_int_equal(a.count, 30000);
    assert_int_equal(b.count, a.count);
    assert_memory_equal(a.xyz, b.xyz, a.count * 24);
    assert_memory_equal(a.rgbi, b.rgbi, a.count * 4);
    check_fields(&o, &a);
    scan_points_fini(&a);
    scan_points_fini(&b);
    free(bytes);
}

static void rewinding_reads_the_same_again(void **state)
{
    (void)state;
    size_t size;
    uint8_t *bytes = write_las(&plain, &size);
    prep_scan *scan;
    prep_batch batch;
    assert_true(prep_scan_open(scan_points_file("again.las", bytes, size), 0, NULL, &scan, NULL));
    assert_true(prep_batch_init(&batch, &prep_scan_describe(scan)->attributes, 200, NULL));
    for (int round = 0; round < 3; round++) {
        assert_true(prep_scan_read(scan, &batch, NULL));
        assert_int_equal(batch.count, 200);
        double x = batch.xyz[0];
        assert_true(prep_scan_read(scan, &batch, NULL));
        assert_int_equal(batch.count, 100);
        assert_true(prep_scan_read(scan, &batch, NULL));
        assert_int_equal(batch.count, 0);
        assert_true(prep_scan_rewind(scan, NULL));
        assert_true(x == write_las_xyz(0, 0) * plain.scale[0] + plain.offset[0]);
    }
    prep_batch_fini(&batch);
    prep_scan_close(scan);
    free(bytes);
}

static void unusable_coordinates_are_dropped_and_counted(void **state)
{
    (void)state;
    write_las_options o = plain;
    o.scale[0] = 1e300; /* x reaches 2e309: infinite, or far out of any grid */
    scan_points p;
    read_made(&o, &p);
    assert_int_equal(p.count, 0);
    assert_int_equal(p.dropped[PREP_DROP_NOT_FINITE] + p.dropped[PREP_DROP_OUT_OF_RANGE], 300);
    assert_true(p.dropped[PREP_DROP_NOT_FINITE] > 0);
    scan_points_fini(&p);
}

/* Puts a variable length record between header and points. Takes `bytes`. */
static uint8_t *add_record(uint8_t *bytes, size_t *size, uint16_t id, const void *payload,
                           size_t payload_size)
{
    size_t header = 227, record = 54 + payload_size;
    uint8_t *out = calloc(1, *size + record);
    memcpy(out, bytes, header);
    memcpy(out + header + 2, "LASF_Projection", 15);
    write_las_u16(out + header + 18, id);
    write_las_u16(out + header + 20, (uint32_t)payload_size);
    memcpy(out + header + 54, payload, payload_size);
    memcpy(out + header + record, bytes + header, *size - header);
    write_las_u32(out + 96, (uint32_t)(out[96] | out[97] << 8) + (uint32_t)record);
    write_las_u32(out + 100, out[100] + 1u);
    *size += record;
    free(bytes);
    return out;
}

static void check_crs(uint8_t *bytes, size_t size, const char *expected)
{
    scan_points p;
    read_bytes(bytes, size, &p);
    assert_string_equal(p.info.crs, expected);
    assert_int_equal(p.count, plain.count);
    scan_points_fini(&p);
    free(bytes);
}

static void the_reference_system_is_kept(void **state)
{
    (void)state;
    static const char wkt[] = "PROJCS[\"a b\",\r\n    GEOGCS[\"c\"]]\r\n";
    static const char text[] = "Some system|NAD83 / UTM zone 10N|";
    static const uint16_t coded[] = {1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 25832};
    static const uint16_t named[] = {1,  1, 0,    4,     1024, 0,  1,    1, 1026, 34737,
                                     12, 0, 3073, 34737, 21,   12, 3072, 0, 1,    32767};
    static const uint16_t beyond[] = {1, 1, 0, 1, 1026, 34737, 60000, 65000};
    size_t size;
    uint8_t *bytes = write_las(&plain, &size);
    bytes = add_record(bytes, &size, 2112, wkt, sizeof wkt);
    check_crs(bytes, size, "PROJCS[\"a b\", GEOGCS[\"c\"]]");
    bytes = write_las(&plain, &size);
    bytes = add_record(bytes, &size, 34735, coded, sizeof coded);
    check_crs(bytes, size, "EPSG:25832");
    const struct {
        const uint16_t *keys;
        size_t size;
        const char *expected;
    } texts[] = {{named, sizeof named, "NAD83 / UTM zone 10N"}, {beyond, sizeof beyond, ""}};
    for (int i = 0; i < 2; i++) {
        bytes = write_las(&plain, &size);
        bytes = add_record(bytes, &size, 34737, text, sizeof text);
        bytes = add_record(bytes, &size, 34735, texts[i].keys, texts[i].size);
        check_crs(bytes, size, texts[i].expected);
    }
}

static void the_step_divides_all_three_scales(void **state)
{
    (void)state;
    static const double scales[][4] = {{0.001, 0.001, 0.001, 0.001},
                                       {0.001, 0.01, 0.0005, 0.0005},
                                       {0.001, 0.0025, 0.01, 0.0005},
                                       {1e-7, 1e-7, 0.001, 1e-7},
                                       {0.001, 0.00314159, 0.001, 0}};
    for (size_t k = 0; k < sizeof scales / sizeof scales[0]; k++) {
        scan_points p;
        write_las_options o = plain;
        memcpy(o.scale, scales[k], sizeof o.scale);
        read_made(&o, &p);
        assert_true(fabs(p.info.step - scales[k][3]) < 1e-12);
        scan_points_fini(&p);
    }
}

static void points_that_the_header_does_not_claim_are_told(void **state)
{
    (void)state;
    size_t size;
    scan_points p;
    uint8_t *bytes = write_las(&plain, &size);
    write_las_u32(bytes + 107, plain.count - 20);
    read_bytes(bytes, size, &p);
    assert_int_equal(p.count, plain.count - 20);
    assert_true(p.is_damaged);
    assert_non_null(strstr(p.damage.message, "room for 20 more"));
    assert_int_equal(p.damage.place, size - 20 * 26);
    scan_points_fini(&p);
    read_bytes(bytes, size - 5, &p); /* whatever that is, it is no points */
    assert_false(p.is_damaged);
    scan_points_fini(&p);
    write_las_u32(bytes + 107, 0);
    mospt_err err = refuse_bytes(bytes, size - 5);
    assert_int_equal(err.code, MOSPT_EFORMAT);
    assert_non_null(strstr(err.message, "room for 299"));
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_reference_system_is_kept),
        cmocka_unit_test(the_step_divides_all_three_scales),
        cmocka_unit_test(points_that_the_header_does_not_claim_are_told),
        cmocka_unit_test(every_version_and_point_format_is_read),
        cmocka_unit_test(attribute_types_are_those_of_the_format),
        cmocka_unit_test(the_header_gives_step_offset_and_bounds),
        cmocka_unit_test(bytes_in_16_bit_colours_are_bytes),
        cmocka_unit_test(black_is_no_colour),
        cmocka_unit_test(without_colour_and_intensity_points_are_white),
        cmocka_unit_test(wide_intensities_are_stretched),
        cmocka_unit_test(described_extra_bytes_become_attributes),
        cmocka_unit_test(undescribed_extra_bytes_are_kept),
        cmocka_unit_test(a_description_longer_than_the_record_is_cut),
        cmocka_unit_test(too_many_points_declared_is_damage),
        cmocka_unit_test(both_counts_of_version_4_are_understood),
        cmocka_unit_test(wrong_vlr_counts_are_refused_or_ignored),
        cmocka_unit_test(impossible_headers_are_refused),
        cmocka_unit_test(no_points_is_empty),
        cmocka_unit_test(every_truncation_is_an_error_or_fewer_points),
        cmocka_unit_test(no_bit_flip_does_harm),
        cmocka_unit_test(points_do_not_depend_on_the_batch_size),
        cmocka_unit_test(rewinding_reads_the_same_again),
        cmocka_unit_test(unusable_coordinates_are_dropped_and_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
