#include "preprocess/bytes.h"
#include "preprocess/pcd.h"
#include "tests/scan_points.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include <cmocka.h>

/* A packer as simple as one can be: the last place where the same three bytes stood, or none. */
static size_t pack(const uint8_t *in, size_t size, uint8_t *out)
{
    static size_t seen[1 << 16];
    size_t at = 0, to = 0, literals = 0;
    memset(seen, 0, sizeof seen);
    while (at < size) {
        size_t length = 0, from = 0;
        if (at + 3 <= size) {
            uint32_t key =
                ((uint32_t)in[at] << 16 | (uint32_t)in[at + 1] << 8 | in[at + 2]) * 2654435761u >>
                16;
            from = seen[key];
            seen[key] = at + 1;
            if (from > 0 && at - --from <= PREP_PCD_LZF_REACH && from < at) {
                while (at + length < size && length < PREP_PCD_LZF_STEP &&
                       in[from + length] == in[at + length])
                    length++;
            }
        }
        if (length < 3) {
            literals++;
            at++;
            if (literals < 32 && at < size) continue;
            length = 0;
        }
        if (literals > 0) {
            size_t start = at - literals;
            out[to++] = (uint8_t)(literals - 1);
            memcpy(out + to, in + start, literals);
            to += literals;
            literals = 0;
        }
        if (length == 0) continue;
        size_t distance = at - from - 1, code = length - 2;
        out[to++] = (uint8_t)((code < 7 ? code : 7) << 5 | distance >> 8);
        if (code >= 7) out[to++] = (uint8_t)(code - 7);
        out[to++] = (uint8_t)distance;
        at += length;
    }
    return to;
}

/* A file under construction. */
typedef struct {
    uint8_t *bytes; /* owned */
    size_t size, header_size;
} pcd_file;

typedef struct {
    const char *name;
    mospt_type type;
    uint32_t count;
    double first, step, by_component; /* value = first + step * point + by_component * component */
} pcd_column;

static const char *const encodings[] = {"ascii", "binary", "binary_compressed"};

static void put_value(const pcd_column *c, uint32_t i, uint32_t component, uint8_t *out)
{
    double value = c->first + c->step * i + c->by_component * component;
    if (c->type == MOSPT_U64) { /* times, which a double does not hold */
        uint64_t time = 1700000000123456789u + i;
        memcpy(out, &time, sizeof time);
    } else {
        mospt_type_write(c->type, value, out);
    }
}

static void print(pcd_file *f, const char *format, ...) __attribute__((format(printf, 2, 3)));

static void print(pcd_file *f, const char *format, ...)
{
    char text[400];
    va_list args;
    va_start(args, format);
    int n = vsnprintf(text, sizeof text, format, args);
    va_end(args);
    assert_true(n >= 0 && (size_t)n < sizeof text);
    memcpy(f->bytes + f->size, text, (size_t)n);
    f->size += (size_t)n;
}

static void add_header(pcd_file *f, prep_pcd_encoding e, const pcd_column *c, uint32_t columns,
                       const char *totals)
{
    static const char letters[MOSPT_TYPE_COUNT] = {'U', 'I', 'U', 'I', 'U',
                                                   'I', 'U', 'I', 'F', 'F'};
    print(f, "# .PCD v.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS");
    for (uint32_t k = 0; k < columns; k++)
        print(f, " %s", c[k].name);
    print(f, "\nSIZE");
    for (uint32_t k = 0; k < columns; k++)
        print(f, " %zu", mospt_type_size(c[k].type));
    print(f, "\nTYPE");
    for (uint32_t k = 0; k < columns; k++)
        print(f, " %c", letters[c[k].type]);
    print(f, "\nCOUNT");
    for (uint32_t k = 0; k < columns; k++)
        print(f, " %u", c[k].count);
    print(f, "\n%s\nDATA %s\n", totals, encodings[e]);
}

static void add_text(pcd_file *f, const pcd_column *c, uint32_t columns, uint32_t points)
{
    for (uint32_t i = 0; i < points; i++) {
        for (uint32_t k = 0; k < columns; k++) {
            for (uint32_t n = 0; n < c[k].count; n++) {
                uint8_t value[8];
                put_value(&c[k], i, n, value);
                if (c[k].type == MOSPT_U64) print(f, "%llu ", (unsigned long long)prep_le64(value));
                else print(f, "%.17g ", mospt_type_read(c[k].type, value));
            }
        }
        f->bytes[f->size - 1] = '\n';
    }
}

/* is_planar    one column after the other, as the compressed data have it */
static size_t put_data(const pcd_column *c, uint32_t columns, uint32_t points, bool is_planar,
                       uint8_t *out)
{
    size_t at = 0;
    for (uint32_t outer = 0; outer < (is_planar ? columns : points); outer++) {
        for (uint32_t inner = 0; inner < (is_planar ? points : columns); inner++) {
            uint32_t k = is_planar ? outer : inner, i = is_planar ? inner : outer;
            for (uint32_t n = 0; n < c[k].count; n++, at += mospt_type_size(c[k].type))
                put_value(&c[k], i, n, out + at);
        }
    }
    return at;
}

static void put32(uint8_t *out, size_t value)
{
    for (int i = 0; i < 4; i++)
        out[i] = (uint8_t)(value >> 8 * i);
}

static void make(pcd_file *f, prep_pcd_encoding e, const pcd_column *c, uint32_t columns,
                 uint32_t points, const char *totals)
{
    size_t record = 0;
    for (uint32_t k = 0; k < columns; k++)
        record += mospt_type_size(c[k].type) * c[k].count;
    f->bytes = malloc(4096 + 24 * record * points);
    if (f->bytes == NULL) abort();
    f->size = 0;
    add_header(f, e, c, columns, totals);
    f->header_size = f->size;
    if (e == PREP_PCD_ASCII) {
        add_text(f, c, columns, points);
    } else if (e == PREP_PCD_BINARY) {
        f->size += put_data(c, columns, points, false, f->bytes + f->size);
    } else {
        uint8_t *planes = malloc(record * points);
        size_t size = put_data(c, columns, points, true, planes);
        size_t packed = pack(planes, size, f->bytes + f->size + 8);
        put32(f->bytes + f->size, packed);
        put32(f->bytes + f->size + 4, size);
        f->size += 8 + packed;
        free(planes);
    }
}

/* Everything at once: odd order, all types, several values, padding in between and at the end. */
static const pcd_column rich[] = {{"z", MOSPT_F64, 1, 300.1, 1, 0},
                                  {"_", MOSPT_U8, 3, 9, 0, 0},
                                  {"Intensity", MOSPT_F32, 1, -2048, 500, 0},
                                  {"rgb", MOSPT_U32, 1, 0xff010203, 0x010101, 0},
                                  {"ring", MOSPT_U16, 1, 60000, 1, 0},
                                  {"t", MOSPT_U64, 1, 0, 0, 0},
                                  {"normal_x", MOSPT_F32, 1, 0.5, 0, 0},
                                  {"normal_z", MOSPT_F32, 1, 0.25, 0, 0},
                                  {"normal_y", MOSPT_F32, 1, -1, 0, 0},
                                  {"X", MOSPT_F32, 1, 100.5, 1, 0},
                                  {"hist", MOSPT_F32, 5, 1, 10, 0.125},
                                  {"Y", MOSPT_F32, 1, 200.25, 1, 0},
                                  {"pair", MOSPT_I8, 2, -100, 1, 50},
                                  {"i16", MOSPT_I16, 1, -30000, 1, 0},
                                  {"i32", MOSPT_I32, 1, -2e9, 1, 0},
                                  {"curvature", MOSPT_F64, 1, 0.1, 1, 0},
                                  {"_", MOSPT_F32, 1, 7, 0, 0}};
enum { RICH_COLUMNS = sizeof rich / sizeof rich[0] };
#define RICH_TOTALS "WIDTH 8\nHEIGHT 1\nVIEWPOINT 1 2 3 0 1 0 0\nPOINTS 8"

static void read_bytes(const void *bytes, size_t size, scan_points *out)
{
    mospt_err err;
    if (!scan_points_read(scan_points_file("a.pcd", bytes, size), NULL, 3, out, &err))
        fail_msg("%s", err.message);
}

static void read_text(const char *text, scan_points *out)
{
    read_bytes(text, strlen(text), out);
}

static mospt_err refuse_bytes(const void *bytes, size_t size)
{
    scan_points points;
    mospt_err err = {0};
    const char *path = scan_points_file("a.pcd", bytes, size);
    if (scan_points_read(path, NULL, 100, &points, &err))
        fail_msg("read: %.300s", (const char *)bytes);
    assert_string_equal(err.file, path);
    assert_true(err.message[0] != '\0');
    return err;
}

static mospt_err refuse_text(const char *text)
{
    return refuse_bytes(text, strlen(text));
}

static void check_rich(const scan_points *p)
{
    static const char *const types[][2] = {
        {"intensity", "f32"}, {"ring", "u16"}, {"t", "u64"},   {"normal", "f32"},
        {"hist", "f32"},      {"pair", "i8"},  {"i16", "i16"}, {"i32", "i32"},
        {"curvature", "f64"}, {"_", ""},       {"rgb", ""},    {"alpha", ""}};
    for (size_t k = 0; k < sizeof types / sizeof types[0]; k++)
        assert_string_equal(scan_points_type(p, types[k][0]), types[k][1]);
    assert_int_equal(p->count, 8);
    assert_false(p->is_damaged);
    assert_true(p->info.has_rgb && p->info.has_intensity);
    int t = mospt_schema_find(&p->info.attributes, "t");
    for (uint32_t i = 0; i < 8; i++) {
        assert_true(p->xyz[3 * i] == 100.5 + i && p->xyz[3 * i + 1] == 200.25 + i &&
                    p->xyz[3 * i + 2] == 300.1 + i);
        for (uint32_t c = 0; c < 3; c++)
            assert_int_equal(p->rgbi[4 * i + c], c + 1 + i);
        assert_true(scan_points_value(p, "intensity", i, 0) == -2048.0 + 500 * i);
        assert_true(scan_points_value(p, "ring", i, 0) == 60000.0 + i);
        assert_true(prep_le64(p->plane[t] + 8 * i) == 1700000000123456789u + i);
        assert_true(scan_points_value(p, "normal", i, 1) == -1 &&
                    scan_points_value(p, "normal", i, 2) == 0.25);
        for (uint32_t c = 0; c < 5; c++)
            assert_true(scan_points_value(p, "hist", i, c) == 1 + 10 * i + 0.125 * c);
        assert_true(scan_points_value(p, "pair", i, 1) == -50.0 + i);
        assert_true(scan_points_value(p, "i16", i, 0) == -30000.0 + i);
        assert_true(scan_points_value(p, "i32", i, 0) == -2e9 + i);
        assert_true(scan_points_value(p, "curvature", i, 0) == 0.1 + i);
    }
    assert_int_equal(p->rgbi[3], 0);
    assert_int_equal(p->rgbi[4 * 7 + 3], 255);
}

static void all_encodings_give_the_same_points(void **state)
{
    (void)state;
    static const char *const names[] = {"PCD 0.7 ascii", "PCD 0.7 binary",
                                        "PCD 0.7 binary compressed"};
    for (int e = 0; e < 3; e++) {
        pcd_file f;
        scan_points p;
        make(&f, (prep_pcd_encoding)e, rich, RICH_COLUMNS, 8, RICH_TOTALS);
        read_bytes(f.bytes, f.size, &p);
        check_rich(&p);
        assert_string_equal(p.info.format, names[e]);
        assert_int_equal(p.info.is_text, e == 0);
        scan_points_fini(&p);
        free(f.bytes);
    }
}

static void the_viewpoint_is_kept_but_not_applied(void **state)
{
    (void)state;
    static const double pose[16] = {1, 0, 0,  1, 0, -1, 0, 2,
                                    0, 0, -1, 3, 0, 0,  0, 1}; /* half a turn about x */
    pcd_file f;
    scan_points p;
    make(&f, PREP_PCD_BINARY, rich, RICH_COLUMNS, 8, RICH_TOTALS);
    read_bytes(f.bytes, f.size, &p);
    assert_true(p.info.has_pose);
    for (int i = 0; i < 16; i++)
        assert_true(p.info.pose[i] == pose[i]);
    assert_true(p.xyz[1] == 200.25);
    scan_points_fini(&p);
    free(f.bytes);
    static const char *const none[] = {"0 0 0 1 0 0 0", "0 0 0 0 0 0 0", "nan 0 0 1 0 0 0",
                                       "1 2 3 0 0 0 0"};
    for (size_t i = 0; i < sizeof none / sizeof none[0]; i++) {
        char text[300];
        snprintf(text, sizeof text,
                 "VERSION .7\nFIELDS x y z\nVIEWPOINT %s\nPOINTS 1\nDATA ascii\n1 2 3\n", none[i]);
        read_text(text, &p);
        assert_false(p.info.has_pose);
        scan_points_fini(&p);
    }
}

static void old_and_sloppy_headers_are_read(void **state)
{
    (void)state;
    scan_points p;
    read_text("# .PCD v.5\r\nVERSION .5\r\nCOLUMNS x y z \r\n\r\nSIZE 4 4 4\r\nTYPE F F F\r\nWIDTH "
              "2\r\nHEIGHT 1\r\n"
              "POINTS 2\r\nDATA ascii\r\n 1, 2,3 \r\n\r\n4\t5 6 7 8\r\n",
              &p);
    assert_int_equal(p.count, 2);
    assert_true(p.xyz[5] == 6);
    assert_false(p.is_damaged);
    assert_string_equal(p.info.format, "PCD 0.5 ascii");
    scan_points_fini(&p);
    read_text("VERSION 0.7\nfields X Y Z\nfuture 1 2 3\nWIDTH 2\nDATA ASCII\n1 2 3\n4 5 6", &p);
    assert_int_equal(p.count, 2);
    scan_points_fini(&p);
    read_text("VERSION .7\nFIELDS x y z _ a _\nSIZE 4 4 4 1 4 1\nTYPE F F F U F U\nCOUNT 1 1 1 2 1 "
              "4\nWIDTH 2\n"
              "HEIGHT 1\nPOINTS 2\nDATA ascii\n289814.15 4320978.61 3 0 0 8\n4 5 6 0 0 9 1 2 3 4\n",
              &p);
    assert_int_equal(p.count, 2);
    assert_true(p.xyz[0] == 289814.15 && p.xyz[1] == 4320978.61); /* all digits of the text */
    assert_true(scan_points_value(&p, "a", 1, 0) == 9);
    scan_points_fini(&p);
}

static void colours_come_in_many_ways(void **state)
{
    (void)state;
    scan_points p;
    read_text(
        "VERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 1\nHEIGHT "
        "1\nPOINTS 1\n"
        "DATA ascii\n0.93773 0.33763 0 2.3418052e-38\n", /* the float whose bits are 0x00ff0000 */
        &p);
    assert_true(p.rgbi[0] >= 254 && p.rgbi[1] <= 1);
    scan_points_fini(&p);
    const pcd_column alpha[] = {{"x", MOSPT_F32, 1, 1, 1, 0},
                                {"y", MOSPT_F32, 1, 2, 1, 0},
                                {"z", MOSPT_F32, 1, 3, 1, 0},
                                {"rgba", MOSPT_U32, 1, 0x80ff0102, 0x01000000, 0}};
    for (int e = 0; e < 3; e++) {
        pcd_file f;
        make(&f, (prep_pcd_encoding)e, alpha, 4, 5, "WIDTH 5\nHEIGHT 1\nPOINTS 5");
        read_bytes(f.bytes, f.size, &p);
        assert_int_equal(p.rgbi[4 * 4], 255);
        assert_int_equal(p.rgbi[4 * 4 + 2], 2);
        assert_true(scan_points_value(&p, "alpha", 4, 0) == 0x84);
        scan_points_fini(&p);
        free(f.bytes);
    }
    read_text("VERSION .7\nFIELDS x y z r g b\nSIZE 4 4 4 1 1 1\nTYPE F F F U U U\nPOINTS 1\nDATA "
              "ascii\n1 2 3 4 5 6\n",
              &p);
    assert_int_equal(p.rgbi[2], 6);
    scan_points_fini(&p);
    read_text(
        "VERSION .7\nFIELDS x y z r g b\nSIZE 4 4 4 2 2 2\nTYPE F F F U U U\nPOINTS 1\nDATA ascii\n"
        "1 2 3 65535 257 0\n",
        &p);
    assert_int_equal(p.rgbi[1], 1);
    assert_true(scan_points_value(&p, "rgb", 0, 1) == 257);
    scan_points_fini(&p);
    read_text("VERSION .7\nFIELDS x y z red green blue\nPOINTS 1\nDATA ascii\n1 2 3 0 0.5 1\n", &p);
    assert_int_equal(p.rgbi[1], 128);
    assert_true(scan_points_value(&p, "rgb_float", 0, 1) == 0.5);
    scan_points_fini(&p);
    read_text("VERSION .7\nFIELDS x y z rgb\nPOINTS 1\nDATA ascii\n1 2 3 0\n", &p);
    assert_false(p.info.has_rgb); /* black everywhere is no colour */
    assert_int_equal(p.rgbi[0], 255);
    scan_points_fini(&p);
}

static void fields_that_cannot_be_kept_are_named(void **state)
{
    (void)state;
    const pcd_column wide[] = {{"x", MOSPT_F32, 1, 1, 1, 0},     {"y", MOSPT_F32, 1, 2, 1, 0},
                               {"vfh", MOSPT_F32, 308, 5, 1, 1}, {"x", MOSPT_F32, 1, 8, 1, 0},
                               {"z", MOSPT_F32, 1, 3, 1, 0},     {"none", MOSPT_F32, 0, 0, 0, 0}};
    for (int e = 0; e < 3; e++) {
        pcd_file f;
        scan_points p;
        make(&f, (prep_pcd_encoding)e, wide, 6, 3, "WIDTH 3\nHEIGHT 1\nPOINTS 3");
        read_bytes(f.bytes, f.size, &p);
        assert_int_equal(p.count, 3);
        assert_true(p.is_damaged);
        assert_true(strstr(p.damage.message, "vfh") != NULL);
        assert_true(p.xyz[3 * 2] == 3 && p.xyz[3 * 2 + 2] == 5);
        assert_true(scan_points_value(&p, "x", 2, 0) == 10);
        scan_points_fini(&p);
        free(f.bytes);
    }
}

static void what_is_no_pcd_is_refused(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "",
        "# .PCD v.7\n",
        "# .PCD v.7\nVERSION .7\nFIELDS x y z\nPOINTS 1\n1 2 3\n",
        "# .PCD v.7\nFIELDS x y\nPOINTS 1\nDATA ascii\n1 2\n",
        "# .PCD v.7\nFIELDS x y z\nCOUNT 1 1 2\nPOINTS 1\nDATA ascii\n1 2 3 4\n",
        "# .PCD v.7\nPOINTS 1\nDATA ascii\n1 2 3\n",
        "# .PCD v.7\nFIELDS x y z\nDATA ascii\n1 2 3\n",
        "# .PCD v.7\nFIELDS x y z\nPOINTS 1\nDATA text\n1 2 3\n",
        "# .PCD v.7\nFIELDS x y z\nPOINTS many\nDATA ascii\n1 2 3\n",
        "# .PCD v.7\nFIELDS x y z\nPOINTS\nDATA ascii\n1 2 3\n",
        "# .PCD v.7\nFIELDS x y z\nSIZE 4 4 3\nPOINTS 1\nDATA ascii\n1 2 3\n",
        "# .PCD v.7\nFIELDS x y z\nSIZE 4 4\nPOINTS 1\nDATA ascii\n1 2 3\n",
        "# .PCD v.7\nFIELDS x y z\nTYPE F F Q\nPOINTS 1\nDATA ascii\n1 2 3\n",
        "# .PCD v.7\nFIELDS x y z a\nCOUNT 1 1 1 4294967295\nPOINTS 1\nDATA ascii\n1 2 3 4\n",
        "# .PCD v.7\nFIELDS x y z a b\nCOUNT 1 1 1 262000 262000\nPOINTS 1\nDATA ascii\n1 2 3 4\n",
        "# .PCD v.7\nFIELDS x y z\nCOUNT 0 0 0\nPOINTS 1\nDATA binary\n123456789012",
        "# .PCD v.7\nFIELDS x y z\nVIEWPOINT 1 2 3\nPOINTS 1\nDATA ascii\n1 2 3\n",
        "# .PCD v.7\nFIELDS x y z\nPOINTS 1000000000000\nDATA binary\n123456789012",
        "# .PCD v.7\nFIELDS x y z\nPOINTS 2\nDATA ascii\nnot a\npoint\n",
        "# .PCD v.7\nFIELDS x y z\nPOINTS 2\nDATA binary\n1234",
        "# .PCD v.7\nFIELDS x y z\nPOINTS 2\nDATA binary_compressed\n1234",
        "# .PCD v.7\nFIELDS x y z\nPOINTS 2\nDATA binary_compressed\n12341234",
        "# .PCD\nFIELDS x y z\nPOINTS 99999999999\nDATA binary_compressed\n12341234",
        "# .PCD\nFIELDS x y z\nWIDTH 4294967296\nHEIGHT 4294967296\nDATA ascii\n1 2 3\n",
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        assert_int_equal(refuse_text(texts[i]).code, MOSPT_EFORMAT);
    assert_int_equal(refuse_text("# .PCD v.7\nFIELDS x y z\nPOINTS 0\nDATA ascii\n").code,
                     MOSPT_EEMPTY);
    mospt_err err = refuse_text(texts[2]);
    assert_int_equal(err.place_kind, MOSPT_AT_LINE);
    assert_int_equal(err.place, 5);
}

static void a_header_without_end_is_refused(void **state)
{
    (void)state;
    size_t size = 3 << 20;
    char *text = malloc(size);
    memset(text, 'c', size);
    memcpy(text, "# .PCD v.7\nFIELDS x y z\n", 24);
    assert_int_equal(refuse_bytes(text, size).code, MOSPT_EFORMAT); /* one long line */
    for (size_t i = 80; i < size; i += 80)
        text[i] = '\n';
    assert_int_equal(refuse_bytes(text, size).code, MOSPT_EFORMAT);
    free(text);
}

static void bad_lines_are_counted_and_named(void **state)
{
    (void)state;
    scan_points p;
    read_text("# .PCD\nFIELDS x y z\nPOINTS 4\nDATA ascii\n1 2 3\n4 five 6\n7 8\n7 8 9\n", &p);
    assert_int_equal(p.count, 2);
    assert_int_equal(p.dropped[PREP_DROP_UNREADABLE], 2);
    assert_int_equal(p.damage.place_kind, MOSPT_AT_LINE);
    assert_int_equal(p.damage.place, 6);
    scan_points_fini(&p);
    read_text(
        "# .PCD\nFIELDS x y z a\nPOINTS 3\nDATA ascii\n1 2 3 nan\nnan nan nan 0\n7 -inf 9 0\n", &p);
    assert_int_equal(p.count, 1);
    assert_int_equal(p.dropped[PREP_DROP_NOT_FINITE], 2);
    assert_false(p.is_damaged);
    scan_points_fini(&p);
}

static const pcd_column plain[] = {{"x", MOSPT_F32, 1, 1, 0.5, 0},
                                   {"y", MOSPT_F32, 1, 2, 0.25, 0},
                                   {"z", MOSPT_F32, 1, 3, 1, 0},
                                   {"intensity", MOSPT_F32, 1, 0, 1, 0}};

static void a_header_may_lie_about_the_points(void **state)
{
    (void)state;
    static const struct {
        const char *totals;
        uint64_t count[3];
    } lies[] = {{"WIDTH 500\nHEIGHT 1\nPOINTS 500", {50, 50, 50}},
                {"WIDTH 49\nHEIGHT 1\nPOINTS 49", {50, 49, 50}},
                {"WIDTH 50\nHEIGHT 7\nPOINTS 50", {50, 50, 50}},
                {"WIDTH 51\nHEIGHT 1\nPOINTS 51", {50, 50, 50}}};
    for (size_t k = 0; k < sizeof lies / sizeof lies[0]; k++) {
        for (int e = 0; e < 3; e++) {
            pcd_file f;
            scan_points p;
            make(&f, (prep_pcd_encoding)e, plain, 4, 50, lies[k].totals);
            read_bytes(f.bytes, f.size, &p);
            assert_int_equal(p.count, lies[k].count[e]);
            assert_true(p.is_damaged);
            assert_true(p.xyz[3 * 48 + 1] == 14 && scan_points_value(&p, "intensity", 48, 0) == 48);
            scan_points_fini(&p);
            free(f.bytes);
        }
    }
}

static void sizes_of_compressed_data_are_not_believed(void **state)
{
    (void)state;
    pcd_file f;
    scan_points p;
    make(&f, PREP_PCD_COMPRESSED, plain, 4, 5000, "WIDTH 5000\nHEIGHT 1\nPOINTS 5000");
    uint8_t *sizes = f.bytes + f.header_size, saved[8];
    memcpy(saved, sizes, 8);
    for (int k = 0; k < 3; k++) {
        memcpy(sizes, saved, 8);
        if (k != 1) put32(sizes, 0xfffffff0);
        if (k != 0) put32(sizes + 4, 0xfffffff0);
        read_bytes(f.bytes, f.size, &p);
        assert_int_equal(p.count, 5000);
        assert_true(p.is_damaged);
        assert_true(p.xyz[3 * 4999 + 2] == 5002);
        scan_points_fini(&p);
    }
    memcpy(sizes, saved, 8);
    put32(sizes, prep_le32(saved) - 40); /* too few codes, and the file says that these are all */
    assert_int_equal(refuse_bytes(f.bytes, f.size).code, MOSPT_EFORMAT);
    memcpy(sizes, saved, 8);
    memset(sizes + 8, 0xff, 10); /* refers to what was before the start */
    assert_int_equal(refuse_bytes(f.bytes, f.size).code, MOSPT_EFORMAT);
    free(f.bytes);
}

/* Data with little to pack, so that a cut leaves a known part. */
static void compressed_data_that_are_cut_give_whole_points(void **state)
{
    (void)state;
    enum { COUNT = 30000 };
    pcd_file f;
    make(&f, PREP_PCD_COMPRESSED, plain, 4, COUNT, "WIDTH 300\nHEIGHT 100\nPOINTS 30000");
    uint64_t last = 0;
    for (uint32_t part = 0; part <= 40; part++) {
        size_t size = f.header_size + 8 + (f.size - f.header_size - 8) * part / 40;
        scan_points p;
        mospt_err err;
        if (!scan_points_read(scan_points_file("a.pcd", f.bytes, size), NULL, 1000, &p, &err)) {
            assert_int_equal(last, 0);
            continue;
        }
        assert_true(p.count >= last && p.count <= COUNT);
        assert_int_equal(p.is_damaged, part < 40);
        last = p.count;
        for (uint64_t i = 0; i < p.count; i++) {
            double shown = scan_points_value(&p, "intensity", i, 0);
            assert_true(p.xyz[3 * i] == 1 + 0.5 * (double)i &&
                        p.xyz[3 * i + 1] == 2 + 0.25 * (double)i &&
                        p.xyz[3 * i + 2] == 3.0 + (double)i);
            /* an attribute that is cut is zero, in the middle of one some of its bytes are */
            assert_true(shown == (double)i || part < 40);
        }
        scan_points_fini(&p);
    }
    assert_int_equal(last, COUNT);
    free(f.bytes);
}

static void every_truncation_is_an_error_or_fewer_points(void **state)
{
    (void)state;
    for (int e = 0; e < 3; e++) {
        pcd_file f;
        make(&f, (prep_pcd_encoding)e, rich, RICH_COLUMNS, 8, RICH_TOTALS);
        uint64_t last = 0;
        for (size_t n = 0; n < f.size; n++) {
            uint64_t count;
            scan_points_survive("cut.pcd", f.bytes, n, &count);
            assert_true(count >= last && count <= 8);
            last = count;
        }
        assert_true(last >= 7);
        free(f.bytes);
    }
}

static void no_bit_flip_does_harm(void **state)
{
    (void)state;
    uint64_t seed = 7;
    for (int round = 0; round < 6000; round++) {
        pcd_file f;
        if (round % 2 == 0)
            make(&f, (prep_pcd_encoding)(round % 3), rich, RICH_COLUMNS, 8, RICH_TOTALS);
        else
            make(&f, (prep_pcd_encoding)(round % 3), plain, 4, 40, "WIDTH 40\nHEIGHT 1\nPOINTS 40");
        uint32_t flips = 1 + scan_points_random(&seed) % 4;
        for (uint32_t k = 0; k < flips; k++)
            f.bytes[scan_points_random(&seed) % f.size] ^=
                (uint8_t)(1u << scan_points_random(&seed) % 8);
        scan_points_survive("flip.pcd", f.bytes, f.size, NULL);
        free(f.bytes);
    }
}

static void gzip_is_unpacked_on_the_way(void **state)
{
    (void)state;
    for (int e = 0; e < 3; e++) {
        pcd_file f;
        char path[1024];
        make(&f, (prep_pcd_encoding)e, rich, RICH_COLUMNS, 8, RICH_TOTALS);
        snprintf(path, sizeof path, "%s/packed.pcd.gz", scan_points_folder());
        gzFile gz = gzopen(path, "wb");
        assert_int_equal(gzwrite(gz, f.bytes, (unsigned)f.size), (int)f.size);
        gzclose(gz);
        scan_points p;
        mospt_err err;
        bool ok = scan_points_read(path, NULL, 2, &p, &err);
        assert_int_equal(ok, e != 2);
        if (ok) check_rich(&p);
        if (ok) assert_true(p.info.is_text);
        if (ok) scan_points_fini(&p);
        if (!ok) assert_int_equal(err.code, MOSPT_EFORMAT);
        free(f.bytes);
    }
}

static void a_rewound_scan_reads_the_same(void **state)
{
    (void)state;
    for (int e = 0; e < 3; e++) {
        pcd_file f;
        prep_scan *scan;
        prep_batch batch;
        mospt_err err;
        make(&f, (prep_pcd_encoding)e, plain, 4, 20000, "WIDTH 20000\nHEIGHT 1\nPOINTS 20000");
        assert_true(
            prep_scan_open(scan_points_file("a.pcd", f.bytes, f.size), 0, NULL, &scan, &err));
        assert_true(prep_batch_init(&batch, &prep_scan_describe(scan)->attributes, 7000, &err));
        for (int i = 0; i < 3; i++) {
            uint64_t count = 0;
            for (int k = 0; k <= i * 2; k++) {
                assert_true(prep_scan_read(scan, &batch, &err));
                for (uint32_t n = 0; n < batch.count; n++)
                    assert_true(batch.xyz[3 * n + 2] == 3.0 + (double)(count + n));
                count += batch.count;
            }
            assert_int_equal(count, i == 0 ? 7000 : 20000);
            assert_true(prep_scan_rewind(scan, &err));
        }
        prep_batch_fini(&batch);
        prep_scan_close(scan);
        free(f.bytes);
    }
}

/* Runs, noise, long and short repetitions, near and as far back as can be. */
static void fill(uint8_t *bytes, size_t size, uint64_t *seed)
{
    for (size_t at = 0; at < size;) {
        size_t n = 1 + scan_points_random(seed) % 700;
        uint32_t kind = scan_points_random(seed) % 4;
        size_t back = 1 + scan_points_random(seed) % (kind == 1 ? 20 : 9000);
        if (n > size - at) n = size - at;
        for (size_t i = 0; i < n; i++) {
            bool is_noise = kind == 0 || back > at + i;
            bytes[at + i] = is_noise ? (uint8_t)scan_points_random(seed) : bytes[at + i - back];
        }
        at += n;
    }
}

static void lzf_gives_back_what_was_packed(void **state)
{
    (void)state;
    enum { SIZE = 400000, MARKS = 20 };
    static uint8_t bytes[SIZE], packed[SIZE + SIZE / 16 + 16];
    static prep_pcd_lzf_mark marks[MARKS];
    uint64_t seed = 11;
    for (int round = 0; round < 6; round++) {
        fill(bytes, SIZE, &seed);
        size_t size = pack(bytes, SIZE, packed);
        prep_input *input;
        prep_pcd_lzf z;
        assert_true(prep_input_open(scan_points_file("packed", packed, size), &input, NULL));
        assert_true(prep_pcd_lzf_init(&z, input, 0, size, 5000, NULL));
        for (size_t at = 0; at < SIZE;) {
            size_t n = 1 + scan_points_random(&seed) % 5000;
            if (n > SIZE - at) n = SIZE - at;
            assert_true(prep_pcd_lzf_need(&z, n, NULL));
            assert_memory_equal(z.out + z.begin, bytes + at, n);
            prep_pcd_lzf_take(&z, n);
            at += n;
        }
        assert_true(z.is_finished && !z.is_broken && z.made == SIZE);
        prep_pcd_lzf_fini(&z);

        assert_true(prep_pcd_lzf_init(&z, input, 0, size, 5000, NULL));
        for (int k = 0; k < MARKS; k++) {
            assert_true(prep_pcd_lzf_advance(&z, (uint64_t)(k * (SIZE / MARKS)), NULL));
            prep_pcd_lzf_save(&z, &marks[k]);
        }
        for (int k = MARKS - 1; k >= 0; k--) {
            prep_pcd_lzf_restore(&z, &marks[k]);
            assert_true(marks[k].made >= (uint64_t)(k * (SIZE / MARKS)));
            assert_true(marks[k].made < (uint64_t)(k * (SIZE / MARKS)) + PREP_PCD_LZF_STEP);
            size_t left = SIZE - (size_t)marks[k].made, n = left < 5000 ? left : 5000;
            assert_true(prep_pcd_lzf_need(&z, n, NULL));
            assert_memory_equal(z.out + z.begin, bytes + marks[k].made, n);
        }
        prep_pcd_lzf_fini(&z);
        prep_input_close(input);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_encodings_give_the_same_points),
        cmocka_unit_test(the_viewpoint_is_kept_but_not_applied),
        cmocka_unit_test(old_and_sloppy_headers_are_read),
        cmocka_unit_test(colours_come_in_many_ways),
        cmocka_unit_test(fields_that_cannot_be_kept_are_named),
        cmocka_unit_test(what_is_no_pcd_is_refused),
        cmocka_unit_test(a_header_without_end_is_refused),
        cmocka_unit_test(bad_lines_are_counted_and_named),
        cmocka_unit_test(a_header_may_lie_about_the_points),
        cmocka_unit_test(sizes_of_compressed_data_are_not_believed),
        cmocka_unit_test(compressed_data_that_are_cut_give_whole_points),
        cmocka_unit_test(every_truncation_is_an_error_or_fewer_points),
        cmocka_unit_test(no_bit_flip_does_harm),
        cmocka_unit_test(gzip_is_unpacked_on_the_way),
        cmocka_unit_test(a_rewound_scan_reads_the_same),
        cmocka_unit_test(lzf_gives_back_what_was_packed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
