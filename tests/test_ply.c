#include "preprocess/ply.h"
#include "tests/scan_points.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include <cmocka.h>

/* A file under construction, in one of the three encodings. */
typedef struct {
    char bytes[65536];
    size_t size;
    prep_ply_encoding encoding;
} ply_file;

static const char *const encodings[] = {"ascii", "binary_little_endian", "binary_big_endian"};

static void add_text(ply_file *f, const char *text)
{
    size_t n = strlen(text);
    assert_true(f->size + n < sizeof f->bytes);
    memcpy(f->bytes + f->size, text, n);
    f->size += n;
}

/* Writes one value as the encoding has it. */
static void add(ply_file *f, mospt_type type, double value)
{
    if (f->encoding == PREP_PLY_ASCII) {
        char text[40];
        snprintf(text, sizeof text, "%.17g ", value);
        add_text(f, text);
        return;
    }
    uint8_t bytes[8];
    size_t size = mospt_type_size(type);
    mospt_type_write(type, value, bytes);
    bool swap = (f->encoding == PREP_PLY_BIG) != (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__);
    for (size_t i = 0; i < size; i++)
        f->bytes[f->size++] = (char)bytes[swap ? size - 1 - i : i];
}

static void end_row(ply_file *f)
{
    if (f->encoding == PREP_PLY_ASCII) add_text(f, "\n");
}

static void start(ply_file *f, prep_ply_encoding encoding, const char *header)
{
    f->size = 0;
    f->encoding = encoding;
    add_text(f, "ply\nformat ");
    add_text(f, encodings[encoding]);
    add_text(f, " 1.0\n");
    add_text(f, header);
    add_text(f, "end_header\n");
}

static void read_file(const ply_file *f, scan_points *out)
{
    mospt_err err;
    if (!scan_points_read(scan_points_file("a.ply", f->bytes, f->size), NULL, 3, out, &err))
        fail_msg("%s", err.message);
}

static void read_text(const char *text, scan_points *out)
{
    ply_file f = {.size = 0};
    add_text(&f, text);
    read_file(&f, out);
}

static mospt_err refuse_text(const char *text)
{
    scan_points points;
    mospt_err err = {0};
    const char *path = scan_points_file("a.ply", text, strlen(text));
    if (scan_points_read(path, NULL, 100, &points, &err)) fail_msg("read: %s", text);
    assert_string_equal(err.file, path);
    assert_true(err.message[0] != '\0');
    return err;
}

/* Everything at once: elements before and behind, lists before, inside and behind, all types, odd
 * order. */
static void make_rich(ply_file *f, prep_ply_encoding encoding)
{
    start(f, encoding,
          "comment made by hand\nobj_info nothing\nremark is no keyword\n"
          "element camera 2\nproperty float px\nproperty list uchar short things\n"
          "element vertex 5\nproperty double z\nproperty list uint8 float weights\nproperty uchar "
          "blue\n"
          "property int8 c\nproperty uint8 red\nproperty ushort s\nproperty int16 t\nproperty "
          "float32 y\n"
          "property uint u\nproperty int i\nproperty list ushort uchar names\nproperty float64 x\n"
          "property uchar green\nproperty uchar alpha\nproperty float nx\nproperty float "
          "nz\nproperty float ny\n"
          "property short intensity\n"
          "element face 1\nproperty list uchar int vertex_indices\n");
    for (int k = 0; k < 2; k++) {
        add(f, MOSPT_F32, 1.5);
        add(f, MOSPT_U8, k * 2);
        for (int i = 0; i < k * 2; i++)
            add(f, MOSPT_I16, -i);
        end_row(f);
    }
    for (int i = 0; i < 5; i++) {
        add(f, MOSPT_F64, 300.1 + i);
        add(f, MOSPT_U8, i % 3);
        for (int k = 0; k < i % 3; k++)
            add(f, MOSPT_F32, 0.25);
        add(f, MOSPT_U8, 30 + i);
        add(f, MOSPT_I8, -100 + i);
        add(f, MOSPT_U8, 10 + i);
        add(f, MOSPT_U16, 60000 + i);
        add(f, MOSPT_I16, -30000 + i);
        add(f, MOSPT_F32, 200.5 + i);
        add(f, MOSPT_U32, 4000000000.0 + i);
        add(f, MOSPT_I32, -2000000000.0 + i);
        add(f, MOSPT_U16, i);
        for (int k = 0; k < i; k++)
            add(f, MOSPT_U8, 65);
        add(f, MOSPT_F64, 100.7 + i);
        add(f, MOSPT_U8, 20 + i);
        add(f, MOSPT_U8, 255);
        add(f, MOSPT_F32, 0.5);
        add(f, MOSPT_F32, 0.25);
        add(f, MOSPT_F32, -1);
        add(f, MOSPT_I16, -1000 + 100 * i);
        end_row(f);
    }
    add(f, MOSPT_U8, 3);
    for (int i = 0; i < 3; i++)
        add(f, MOSPT_I32, i);
    end_row(f);
}

static void check_rich(const scan_points *p)
{
    assert_int_equal(p->count, 5);
    assert_false(p->is_damaged);
    assert_true(p->info.has_rgb && p->info.has_intensity);
    for (uint32_t i = 0; i < 5; i++) {
        assert_true(p->xyz[3 * i] == 100.7 + i && p->xyz[3 * i + 1] == 200.5 + i &&
                    p->xyz[3 * i + 2] == 300.1 + i);
        for (uint32_t c = 0; c < 3; c++)
            assert_int_equal(p->rgbi[4 * i + c], 10 * (c + 1) + i);
        assert_true(scan_points_value(p, "c", i, 0) == -100.0 + i);
        assert_true(scan_points_value(p, "s", i, 0) == 60000.0 + i);
        assert_true(scan_points_value(p, "t", i, 0) == -30000.0 + i);
        assert_true(scan_points_value(p, "u", i, 0) == 4000000000.0 + i);
        assert_true(scan_points_value(p, "i", i, 0) == -2000000000.0 + i);
        assert_true(scan_points_value(p, "alpha", i, 0) == 255);
        assert_true(scan_points_value(p, "normal", i, 0) == 0.5 &&
                    scan_points_value(p, "normal", i, 1) == -1 &&
                    scan_points_value(p, "normal", i, 2) == 0.25);
        assert_true(scan_points_value(p, "intensity", i, 0) == -1000.0 + 100 * i);
    }
    assert_int_equal(p->rgbi[3], 0);
    assert_int_equal(p->rgbi[4 * 4 + 3], 255);
    static const char *const types[][2] = {
        {"c", "i8"},     {"s", "u16"},      {"t", "i16"},         {"u", "u32"}, {"i", "i32"},
        {"alpha", "u8"}, {"normal", "f32"}, {"intensity", "i16"}, {"red", ""},  {"weights", ""}};
    for (size_t k = 0; k < sizeof types / sizeof types[0]; k++)
        assert_string_equal(scan_points_type(p, types[k][0]), types[k][1]);
}

static void all_encodings_give_the_same_points(void **state)
{
    (void)state;
    static const char *const names[] = {"PLY ascii", "PLY binary little endian",
                                        "PLY binary big endian"};
    for (int e = 0; e < 3; e++) {
        ply_file f;
        scan_points p;
        make_rich(&f, (prep_ply_encoding)e);
        read_file(&f, &p);
        check_rich(&p);
        assert_string_equal(p.info.format, names[e]);
        assert_int_equal(p.info.is_text, e == 0);
        assert_false(p.info.has_bounds);
        scan_points_fini(&p);
    }
}

static void make_packed(ply_file *f, prep_ply_encoding encoding, int count)
{
    char header[300];
    snprintf(header, sizeof header,
             "element vertex %d\nproperty float x\nproperty float y\nproperty float z\nproperty "
             "ushort red\n"
             "property ushort green\nproperty ushort blue\n",
             count);
    start(f, encoding, header);
    for (int i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++)
            add(f, MOSPT_F32, i + 0.5 * a);
        for (int c = 0; c < 3; c++)
            add(f, MOSPT_U16, 257 * i + c);
        end_row(f);
    }
}

static void colours_of_16_bits_keep_their_raw_values(void **state)
{
    (void)state;
    for (int e = 0; e < 3; e++) {
        ply_file f;
        scan_points p;
        make_packed(&f, (prep_ply_encoding)e, 200);
        read_file(&f, &p);
        assert_int_equal(p.count, 200);
        assert_string_equal(scan_points_type(&p, "rgb"), "u16");
        for (uint32_t i = 0; i < 200; i++) {
            assert_int_equal(p.rgbi[4 * i], i);
            assert_true(scan_points_value(&p, "rgb", i, 2) == 257 * i + 2);
        }
        scan_points_fini(&p);
    }
}

#define XYZ "property float x\nproperty float y\nproperty float z\n"

static void colours_come_in_many_ways(void **state)
{
    (void)state;
    scan_points p;
    read_text("ply\nformat ascii 1.0\nelement vertex 2\n" XYZ
              "property float r\nproperty float g\nproperty float b\n"
              "end_header\n1 2 3 0 0.5 1\n4 5 6 1 1 0\n",
              &p);
    assert_int_equal(p.rgbi[1], 128);
    assert_int_equal(p.rgbi[2], 255);
    assert_true(scan_points_value(&p, "rgb_float", 0, 1) == 0.5);
    scan_points_fini(&p);
    read_text(
        "ply\nformat ascii 1.0\nelement vertex 2\n" XYZ
        "property float diffuse_red\nproperty float diffuse_green\nproperty float diffuse_blue\n"
        "end_header\n1 2 3 0 128 255\n4 5 6 7 8 9\n",
        &p);
    assert_int_equal(p.rgbi[1], 128);
    assert_int_equal(p.rgbi[4 + 2], 9);
    scan_points_fini(&p);
    read_text("ply\nformat ascii 1.0\nelement vertex 2\n" XYZ
              "property ushort red\nproperty ushort green\n"
              "property ushort blue\nend_header\n1 2 3 0 128 255\n4 5 6 7 8 9\n",
              &p);
    assert_int_equal(p.rgbi[1], 128);
    scan_points_fini(&p);
    read_text("ply\nformat ascii 1.0\nelement vertex 2\n" XYZ
              "property uchar red\nproperty uchar green\n"
              "property uchar blue\nend_header\n1 2 3 0 0 0\n4 5 6 0 0 0\n",
              &p);
    assert_false(p.info.has_rgb); /* black everywhere is no colour */
    assert_int_equal(p.rgbi[0], 255);
    scan_points_fini(&p);
}

static void sloppy_headers_are_read(void **state)
{
    (void)state;
    scan_points p;
    read_text(
        "ply \r\nformat ascii 1.0 \r\ncomment hello\r\n\r\nelement vertex 2  \r\nproperty  float   "
        "x\r\n"
        "property float\ty\r\nproperty float z \r\nend_header\r\n 1  2\t3 \r\n\r\n4 5 6 7\r\n",
        &p);
    assert_int_equal(p.count, 2);
    assert_true(p.xyz[5] == 6);
    scan_points_fini(&p);
    read_text("ply\nformat ascii 1.0\nelement vertex_position 2\n" XYZ
              "element vertex_color 2\nproperty uint8 r\n"
              "property uint8 g\nproperty uint8 b\nend_header\n1 2 3\n4 5 6\n7 7 7\n8 8 8\n",
              &p);
    assert_int_equal(p.count, 2);
    scan_points_fini(&p);
    read_text("ply\nformat ascii 1.0\nelement nothing 1000000000000\nelement vertex 1\n" XYZ
              "end_header\n1 2 3\n",
              &p);
    assert_int_equal(p.count, 1);
    scan_points_fini(&p);
}

static void normals_that_are_not_float_keep_their_names(void **state)
{
    (void)state;
    scan_points p;
    read_text("ply\nformat ascii 1.0\nelement vertex 1\n" XYZ
              "property double nx\nproperty double ny\n"
              "property double nz\nproperty float x\nend_header\n1 2 3 0.1 0.2 0.3 9\n",
              &p);
    assert_true(scan_points_value(&p, "ny", 0, 0) == 0.2);
    assert_string_equal(scan_points_type(&p, "nx"), "f64");
    assert_true(scan_points_value(&p, "x", 0, 0) == 9); /* a second x is an attribute */
    scan_points_fini(&p);
}

static void what_is_no_ply_is_refused(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "ply\n",
        "plyx\nformat ascii 1.0\n",
        "ply\nformat ascii 1.0\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
        "y\nend_header\n1 2\n",
        "ply\nelement vertex 1\n" XYZ "end_header\n1 2 3\n",
        "ply\nformat utf8 1.0\nelement vertex 1\n" XYZ "end_header\n1 2 3\n",
        "ply\nformat ascii 1.0\nelement vertex many\n" XYZ "end_header\n1 2 3\n",
        "ply\nformat ascii 1.0\nelement vertex -1\n" XYZ "end_header\n1 2 3\n",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty quaternion q\n" XYZ
        "end_header\n1 2 3\n",
        "ply\nformat ascii 1.0\nproperty float x\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty list float x\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 1000000000000\n" XYZ "end_header\n1 2 3\n",
        "ply\nformat ascii 1.0\nelement face 9\nproperty list uchar int v\nelement vertex 1\n" XYZ
        "end_header\n1 0\n",
        "ply\nformat binary_little_endian 1.0\nelement face 18446744073709551615\nproperty double "
        "v\n"
        "element vertex 1\n" XYZ "end_header\n123456789012",
        "ply\nformat ascii 1.0\nelement vertex 2\n" XYZ "end_header\nnot a\npoint\n",
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        assert_int_equal(refuse_text(texts[i]).code, MOSPT_EFORMAT);
    assert_int_equal(refuse_text("").code, MOSPT_EFORMAT);
    mospt_err err = refuse_text("ply\nformat ascii 1.0\nelement vertex 0\n" XYZ "end_header\n");
    assert_int_equal(err.code, MOSPT_EEMPTY);
}

static void a_header_without_end_is_refused(void **state)
{
    (void)state;
    size_t size = 3 << 20;
    char *text = malloc(size);
    memset(text, 'c', size);
    memcpy(text, "ply\nformat ascii 1.0\n", 21);
    for (size_t i = 80; i < size; i += 80)
        text[i] = '\n';
    mospt_err err;
    scan_points p;
    assert_false(scan_points_read(scan_points_file("a.ply", text, size), NULL, 10, &p, &err));
    assert_int_equal(err.code, MOSPT_EFORMAT);
    free(text);
}

static void bad_lines_are_counted_and_named(void **state)
{
    (void)state;
    scan_points p;
    read_text("ply\nformat ascii 1.0\nelement vertex 4\n" XYZ
              "end_header\n1 2 3\n4 five 6\n7 8\n7 8 9\n",
              &p);
    assert_int_equal(p.count, 2);
    assert_int_equal(p.dropped[PREP_DROP_UNREADABLE], 2);
    assert_true(p.is_damaged);
    assert_int_equal(p.damage.place_kind, MOSPT_AT_LINE);
    assert_int_equal(p.damage.place, 9);
    scan_points_fini(&p);
    read_text("ply\nformat ascii 1.0\nelement vertex 3\n" XYZ
              "end_header\n1 2 3\nnan 5 6\n7 -inf 9\n",
              &p);
    assert_int_equal(p.count, 1);
    assert_int_equal(p.dropped[PREP_DROP_NOT_FINITE], 2);
    assert_false(p.is_damaged);
    scan_points_fini(&p);
}

static void truncated_data_is_damage_with_its_place(void **state)
{
    (void)state;
    ply_file f;
    scan_points p;
    make_packed(&f, PREP_PLY_LITTLE, 100);
    f.size -= 18 * 40 + 5;
    read_file(&f, &p);
    assert_int_equal(p.count, 59);
    assert_true(p.is_damaged);
    assert_int_equal(p.damage.place_kind, MOSPT_AT_BYTE);
    assert_int_equal(p.damage.place, f.size);
    assert_int_equal(p.info.point_count, 59);
    scan_points_fini(&p);
}

static void every_truncation_is_an_error_or_fewer_points(void **state)
{
    (void)state;
    for (int e = 0; e < 3; e++) {
        ply_file f;
        make_rich(&f, (prep_ply_encoding)e);
        uint64_t last = 0;
        for (size_t n = 0; n < f.size; n++) {
            uint64_t count;
            scan_points_survive("cut.ply", f.bytes, n, &count);
            assert_true(count >= last && count <= 5);
            last = count;
        }
        assert_int_equal(last, 5); /* the faces behind the vertices do not matter */
        make_packed(&f, (prep_ply_encoding)e, 4);
        for (size_t n = 0; n < f.size; n++)
            scan_points_survive("cut.ply", f.bytes, n, NULL);
    }
}

static void no_bit_flip_does_harm(void **state)
{
    (void)state;
    uint64_t seed = 3;
    for (int round = 0; round < 6000; round++) {
        ply_file f;
        if (round % 2 == 0) make_rich(&f, (prep_ply_encoding)(round % 3));
        else make_packed(&f, (prep_ply_encoding)(round % 3), 20);
        uint32_t flips = 1 + scan_points_random(&seed) % 4;
        for (uint32_t k = 0; k < flips; k++)
            f.bytes[scan_points_random(&seed) % f.size] ^=
                (char)(1u << scan_points_random(&seed) % 8);
        scan_points_survive("flip.ply", f.bytes, f.size, NULL);
    }
}

static void gzip_is_unpacked_on_the_way(void **state)
{
    (void)state;
    for (int e = 0; e < 3; e++) {
        ply_file f;
        char path[1024];
        make_rich(&f, (prep_ply_encoding)e);
        snprintf(path, sizeof path, "%s/packed.ply.gz", scan_points_folder());
        gzFile gz = gzopen(path, "wb");
        assert_int_equal(gzwrite(gz, f.bytes, (unsigned)f.size), (int)f.size);
        gzclose(gz);
        scan_points p;
        mospt_err err;
        if (!scan_points_read(path, NULL, 2, &p, &err)) fail_msg("%s", err.message);
        check_rich(&p);
        assert_true(p.info.is_text);
        scan_points_fini(&p);
    }
}

/* Small enough that the lists and the vertices are in memory together. */
static void lists_may_come_before_vertices_without_any(void **state)
{
    (void)state;
    for (int e = 0; e < 3; e++) {
        ply_file f;
        scan_points p;
        start(&f, (prep_ply_encoding)e,
              "element face 7\nproperty list uchar int vertex_indices\n"
              "element vertex 100\nproperty float x\nproperty float y\nproperty float z\n"
              "property ushort red\nproperty ushort green\nproperty ushort blue\n");
        for (int i = 0; i < 7; i++) {
            add(&f, MOSPT_U8, 3);
            for (int k = 0; k < 3; k++)
                add(&f, MOSPT_I32, k + i);
            end_row(&f);
        }
        for (int i = 0; i < 100; i++) {
            for (int k = 0; k < 3; k++)
                add(&f, MOSPT_F32, i + k);
            for (int k = 0; k < 3; k++)
                add(&f, MOSPT_U16, i == 99 ? 65535 : i);
            end_row(&f);
        }
        read_file(&f, &p);
        assert_int_equal(p.count, 100);
        assert_true(p.xyz[0] == 0 && p.xyz[3 * 99 + 2] == 101);
        assert_int_equal(p.rgbi[4 * 99], 255);
        scan_points_fini(&p);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_encodings_give_the_same_points),
        cmocka_unit_test(lists_may_come_before_vertices_without_any),
        cmocka_unit_test(colours_of_16_bits_keep_their_raw_values),
        cmocka_unit_test(colours_come_in_many_ways),
        cmocka_unit_test(sloppy_headers_are_read),
        cmocka_unit_test(normals_that_are_not_float_keep_their_names),
        cmocka_unit_test(what_is_no_ply_is_refused),
        cmocka_unit_test(a_header_without_end_is_refused),
        cmocka_unit_test(bad_lines_are_counted_and_named),
        cmocka_unit_test(truncated_data_is_damage_with_its_place),
        cmocka_unit_test(every_truncation_is_an_error_or_fewer_points),
        cmocka_unit_test(no_bit_flip_does_harm),
        cmocka_unit_test(gzip_is_unpacked_on_the_way),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
