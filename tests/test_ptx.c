#include "preprocess/ptx.h"
#include "tests/scan_points.h"

#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

#include <cmocka.h>

#define IDENTITY "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
/* A quarter turn about z, and 10 20 30. */
#define TURNED "10 20 30\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n"

static void read_text(const char *text, scan_points *out)
{
    mospt_err err;
    if (!scan_points_read(scan_points_file("a.ptx", text, strlen(text)), NULL, 3, out, &err))
        fail_msg("%s", err.message);
}

static mospt_err refuse_text(const char *text)
{
    scan_points points;
    mospt_err err = {0};
    const char *path = scan_points_file("a.ptx", text, strlen(text));
    if (scan_points_read(path, NULL, 100, &points, &err)) fail_msg("read: %s", text);
    assert_string_equal(err.file, path);
    assert_true(err.message[0] != '\0');
    return err;
}

/* One scan of a file. */
typedef struct {
    prep_scan_info info;
    uint64_t count, dropped[PREP_DROP_REASONS];
    double first[3], last[3];
    bool is_damaged;
    mospt_err damage;
} one_scan;

static one_scan read_scan_with(const char *path, uint32_t index, const prep_scan_options *options)
{
    one_scan out = {.count = 0};
    prep_scan *scan;
    prep_batch batch;
    mospt_err err;
    if (!prep_scan_open(path, index, options, &scan, &err)) fail_msg("%s", err.message);
    out.info = *prep_scan_describe(scan);
    assert_true(prep_batch_init(&batch, &out.info.attributes, 2, &err));
    for (;;) {
        assert_true(prep_scan_read(scan, &batch, &err));
        if (batch.count == 0) break;
        if (out.count == 0) memcpy(out.first, batch.xyz, sizeof out.first);
        memcpy(out.last, batch.xyz + 3 * (batch.count - 1), sizeof out.last);
        out.count += batch.count;
    }
    memcpy(out.dropped, prep_scan_dropped(scan), sizeof out.dropped);
    out.is_damaged = prep_scan_damage(scan) != NULL;
    if (out.is_damaged) out.damage = *prep_scan_damage(scan);
    prep_batch_fini(&batch);
    prep_scan_close(scan);
    return out;
}

static one_scan read_scan(const char *path, uint32_t index)
{
    return read_scan_with(path, index, NULL);
}

static void a_scan_is_read_and_moved_to_the_world(void **state)
{
    (void)state;
    scan_points p;
    read_text("2\n3\n" TURNED "1 2 3 0.25 10 20 30\n0 0 0 0.5 0 0 0\n4 5 6 0.5 11 21 31\n"
              "7 8 9 0.75 12 22 32\n1 1 1 1 255 254 253\n2 2 2 0 1 2 3\n",
              &p);
    assert_int_equal(p.count, 5);
    assert_int_equal(p.dropped[PREP_DROP_NO_RETURN], 1);
    assert_false(p.is_damaged);
    assert_true(p.xyz[0] == 8 && p.xyz[1] == 21 && p.xyz[2] == 33);
    static const double pose[16] = {0, -1, 0, 10, 1, 0, 0, 20, 0, 0, 1, 30, 0, 0, 0, 1};
    assert_true(p.info.has_pose && p.info.has_rgb && p.info.has_intensity && p.info.is_text);
    assert_memory_equal(p.info.pose, pose, sizeof pose);
    assert_string_equal(p.info.format, "PTX, 2 x 3");
    assert_string_equal(p.info.name, "a.ptx");
    assert_int_equal(p.info.point_count, 6);
    assert_int_equal(p.rgbi[0], 10);
    assert_int_equal(p.rgbi[4 * 3 + 2], 253);
    assert_int_equal(p.rgbi[4 * 3 + 3], 255);
    assert_string_equal(scan_points_type(&p, "intensity"), "f32");
    assert_string_equal(scan_points_type(&p, "row_index"), "u16");
    assert_true(scan_points_value(&p, "intensity", 0, 0) == 0.25);
    static const int place[5][2] = {{0, 0}, {2, 0}, {0, 1}, {1, 1}, {2, 1}};
    for (uint32_t i = 0; i < 5; i++) {
        assert_true(scan_points_value(&p, "row_index", i, 0) == place[i][0]);
        assert_true(scan_points_value(&p, "column_index", i, 0) == place[i][1]);
    }
    scan_points_fini(&p);
}

static const char two_scans[] =
    "2\n2\n" IDENTITY "1 1 1 0.1\n2 2 2 0.2\n3 3 3 0.3\n4 4 4 0.4\n"
    "1\n3\n" TURNED "1 0 0 0.1 1 2 3\n0 0 0 0.5 0 0 0\n0 1 0 0.2 4 5 6\n";

static void a_file_holds_several_scans(void **state)
{
    (void)state;
    const char *path = scan_points_file("a.ptx", two_scans, strlen(two_scans));
    one_scan a = read_scan(path, 0), b = read_scan(path, 1);
    assert_int_equal(a.info.scan_count, 2);
    assert_int_equal(b.info.scan_count, 2);
    assert_int_equal(a.count, 4);
    assert_int_equal(b.count, 2);
    assert_false(a.info.has_rgb);
    assert_true(b.info.has_rgb);
    assert_string_equal(a.info.name, "scan 1");
    assert_string_equal(b.info.name, "scan 2");
    assert_true(b.first[0] == 10 && b.first[1] == 21 && b.first[2] == 30);
    assert_true(b.last[0] == 9 && b.last[1] == 20);
    prep_scan *scan;
    mospt_err err;
    assert_false(prep_scan_open(path, 2, NULL, &scan, &err));
    assert_int_equal(err.code, MOSPT_EINVAL);
}

static void scans_without_points_do_not_count(void **state)
{
    (void)state;
    static const char text[] = "0\n0\n" IDENTITY "1\n1\n" IDENTITY "1 2 3 4\n0\n0\n" IDENTITY;
    const char *path = scan_points_file("a.ptx", text, strlen(text));
    one_scan a = read_scan(path, 0);
    assert_int_equal(a.info.scan_count, 1);
    assert_int_equal(a.count, 1);
    assert_false(a.is_damaged);
    assert_int_equal(refuse_text("0\n0\n" IDENTITY).code, MOSPT_EEMPTY);
    assert_int_equal(refuse_text("5\n5\n" IDENTITY).code, MOSPT_EFORMAT);
}

static void colour_may_be_on_some_lines_only(void **state)
{
    (void)state;
    scan_points p;
    read_text("1\n4\n" IDENTITY "1 2 3 0 7 8 9\n4 5 6 1\n7 8 9 0.5 1\n7 8 9 0.5 1 2 3 4\n", &p);
    assert_int_equal(p.count, 4);
    assert_true(p.info.has_rgb);
    assert_int_equal(p.rgbi[2], 9);
    for (int c = 0; c < 4; c++)
        assert_int_equal(p.rgbi[4 + c], 255);
    assert_int_equal(p.rgbi[12], 1);
    scan_points_fini(&p);
}

static void intensity_comes_in_any_range(void **state)
{
    (void)state;
    scan_points p;
    read_text("1\n4\n" IDENTITY "1 2 3 -2048\n4 5 6 2047\n7 8 9 0\n0 0 0 0\n", &p);
    assert_true(scan_points_value(&p, "intensity", 0, 0) == -2048);
    assert_int_equal(p.rgbi[3], 0);
    assert_int_equal(p.rgbi[7], 255);
    assert_int_equal(p.rgbi[8], 128);
    scan_points_fini(&p);
    read_text("1\n2\n" IDENTITY "1 2 3 0.5\n4 5 6 0.5\n", &p);
    assert_false(p.info.has_intensity);
    assert_int_equal(p.rgbi[3], 255);
    scan_points_fini(&p);
    read_text("1\n2\n" IDENTITY "1 2 3\n4 5 6\n", &p);
    assert_int_equal(p.count, 2);
    assert_string_equal(scan_points_type(&p, "intensity"), "");
    scan_points_fini(&p);
}

static void colours_of_16_bits_keep_their_raw_values(void **state)
{
    (void)state;
    scan_points p;
    read_text("1\n2\n" IDENTITY "1 2 3 0 65535 32768 0\n4 5 6 1 0 257 514\n", &p);
    assert_int_equal(p.rgbi[0], 255);
    assert_int_equal(p.rgbi[5], 1);
    assert_string_equal(scan_points_type(&p, "rgb"), "u16");
    assert_true(scan_points_value(&p, "rgb", 1, 2) == 514);
    scan_points_fini(&p);
}

static void sloppy_files_are_read(void **state)
{
    (void)state;
    scan_points p;
    read_text("\xef\xbb\xbf\n 2 \r\n\r\n2\r\n0 0 0\r\n1 0 0\r\n0 1 0 \r\n\t0 0 1\r\n1 0 0 0\r\n"
              "0 1 0 0\r\n0 0 1 0\r\n1e1 2.0E1 30 1\r\n\r\n1 2 3 0.5\r\n\r\n   \r\n4 5 6 0.25\r\n"
              "  7\t8  9 1 \r\n0 0 0 0\r\n\r\n",
              &p);
    assert_int_equal(p.count, 3);
    assert_false(p.is_damaged);
    assert_true(p.xyz[0] == 11 && p.xyz[8] == 39);
    assert_true(scan_points_value(&p, "row_index", 2, 0) == 0);
    assert_true(scan_points_value(&p, "column_index", 2, 0) == 1);
    scan_points_fini(&p);
}

static void bad_lines_are_counted_and_named(void **state)
{
    (void)state;
    scan_points p;
    read_text("1\n6\n" IDENTITY "1 2 3 4\nabc def ghi jkl\n1 2\n1 2 3 4 five\nnan 1 2 3\n9 9 9 9\n",
              &p);
    assert_int_equal(p.count, 2);
    assert_int_equal(p.dropped[PREP_DROP_UNREADABLE], 3);
    assert_int_equal(p.dropped[PREP_DROP_NOT_FINITE], 1);
    assert_true(p.is_damaged);
    assert_int_equal(p.damage.place_kind, MOSPT_AT_LINE);
    assert_int_equal(p.damage.place, 12);
    assert_true(scan_points_value(&p, "row_index", 1, 0) == 5);
    scan_points_fini(&p);
}

static void a_grid_that_is_not_there_is_damage(void **state)
{
    (void)state;
    scan_points p;
    read_text("4000000000\n4000000000\n" IDENTITY "1 2 3 4\n5 6 7 8\n", &p);
    assert_int_equal(p.count, 2);
    assert_true(p.is_damaged);
    assert_int_equal(p.info.point_count, 2);
    scan_points_fini(&p);
    read_text("999999999999999999\n999999999999999999\n" IDENTITY "1 2 3 4\n", &p);
    assert_int_equal(p.count, 1);
    assert_true(p.is_damaged);
    scan_points_fini(&p);
    read_text("1\n2\n" IDENTITY "1 2 3 4\n5 6 7 8\n9 9 9 9\n", &p); /* more points than declared */
    assert_int_equal(p.count, 3);
    assert_true(p.is_damaged);
    scan_points_fini(&p);
}

static void a_scan_that_ends_early_leaves_the_next_one_whole(void **state)
{
    (void)state;
    static const char text[] = "100\n100\n" IDENTITY "1 1 1 0.1\n2 2 2 0.2\n3 3\n"
                               "1\n1\n" TURNED "1 0 0 0.1\n";
    const char *path = scan_points_file("a.ptx", text, strlen(text));
    one_scan a = read_scan(path, 0), b = read_scan(path, 1);
    assert_int_equal(a.count, 2);
    assert_int_equal(a.dropped[PREP_DROP_UNREADABLE], 1);
    assert_true(a.is_damaged);
    assert_int_equal(b.count, 1);
    assert_false(b.is_damaged);
}

/* Points whose matrix is not known would be put in the wrong place. */
static void points_behind_a_damaged_header_are_left_out(void **state)
{
    (void)state;
    static const char text[] =
        "1\n1\n" IDENTITY "1 1 1 0.1\n"
        "1\n2\n0 0 0\n1 0 0\n0 1 zero\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
        "5 5 5 5\n6 6 6 6\n"
        "1\n1\n" TURNED "1 0 0 0.1\n";
    const char *path = scan_points_file("a.ptx", text, strlen(text));
    one_scan a = read_scan(path, 0), b = read_scan(path, 1);
    assert_int_equal(a.info.scan_count, 2);
    assert_int_equal(a.count, 1);
    assert_int_equal(a.dropped[PREP_DROP_UNREADABLE], 12);
    assert_int_equal(a.damage.place, 12);
    assert_int_equal(b.count, 1);
    assert_true(b.first[1] == 21);
}

static void matrices_may_be_wrong(void **state)
{
    (void)state;
    scan_points p;
    read_text("1\n1\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0 0\n0 0 0 0\n0 0 0 0\n0 0 0 0\n1 2 3 4\n",
              &p);
    assert_true(p.xyz[0] == 1 && p.xyz[2] == 3);
    assert_true(p.is_damaged);
    assert_false(p.info.has_pose);
    scan_points_fini(&p);
    read_text("1\n1\n" IDENTITY "500000 5000000 3 4\n", &p); /* world coordinates already */
    assert_false(p.info.has_pose);
    assert_false(p.is_damaged);
    scan_points_fini(&p);
    read_text("1\n1\n" IDENTITY "5 5 3 4\n", &p);
    assert_true(p.info.has_pose);
    scan_points_fini(&p);
}

static void what_is_no_ptx_is_refused(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "\n\n\n",
        "1 2 3 4\n",
        "hello\n",
        "-1\n2\n" IDENTITY "1 2 3 4\n",
        "1\n",
        "1\n1\n0 0 0\n",
        "1\n1\n0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 4\n",
        "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 nan\n0 0 1 0\n0 0 0 1\n1 2 3 4\n",
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        assert_int_equal(refuse_text(texts[i]).code, MOSPT_EFORMAT);
    mospt_err err = refuse_text(texts[6]);
    assert_int_equal(err.place_kind, MOSPT_AT_LINE);
    assert_int_equal(err.place, 3);
}

static void every_truncation_is_an_error_or_fewer_points(void **state)
{
    (void)state;
    uint64_t last = 0;
    for (size_t n = 0; n < strlen(two_scans); n++) {
        uint64_t count;
        scan_points_survive("cut.ptx", two_scans, n, &count);
        assert_true(count >= last && count <= 4);
        last = count;
    }
    assert_int_equal(last, 4);
}

static void a_file_that_ends_inside_a_line_says_so(void **state)
{
    (void)state;
    scan_points p;
    read_text("1\n3\n" IDENTITY "1 2 3 4\n5 6 7 8\n9 9", &p);
    assert_int_equal(p.count, 2);
    assert_int_equal(p.dropped[PREP_DROP_UNREADABLE], 1);
    assert_int_equal(p.damage.place, 13);
    scan_points_fini(&p);
}

static void no_bit_flip_does_harm(void **state)
{
    (void)state;
    uint64_t seed = 5;
    for (int round = 0; round < 4000; round++) {
        char text[sizeof two_scans];
        memcpy(text, two_scans, sizeof text);
        uint32_t flips = 1 + scan_points_random(&seed) % 4;
        for (uint32_t k = 0; k < flips; k++)
            text[scan_points_random(&seed) % (sizeof text - 1)] ^=
                (char)(1u << scan_points_random(&seed) % 8);
        scan_points_survive("flip.ptx", text, sizeof text - 1, NULL);
    }
}

/* Larger than every buffer, with a line longer than any in the middle. */
static char *make_large(size_t *size, uint32_t scans, uint32_t points, bool has_long_line)
{
    size_t capacity = scans * (points * 40u + 200u) + 2000000u;
    char *text = malloc(capacity);
    *size = 0;
    for (uint32_t s = 0; s < scans; s++) {
        *size += (size_t)snprintf(text + *size, 200, "10\n%u\n" IDENTITY, points / 10);
        for (uint32_t i = 0; i < points; i++) {
            if (has_long_line && s == 1 && i == 7) {
                memset(text + *size, 'x', 1000000);
                *size += 1000000;
                text[(*size)++] = '\n';
                continue;
            }
            *size += (size_t)snprintf(text + *size, 60, "%u.5 %u 1 0.%03u\n", s, i, i % 1000);
        }
    }
    return text;
}

static void scans_longer_than_the_buffers_are_read(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        size_t size;
        char *text = make_large(&size, 4, 30000, k == 1);
        const char *path = scan_points_file("large.ptx", text, size);
        for (uint32_t s = 0; s < 4; s++) {
            one_scan p = read_scan(path, s);
            bool is_hit = k == 1 && s == 1;
            assert_int_equal(p.info.scan_count, 4);
            assert_int_equal(p.count, is_hit ? 29999 : 30000);
            assert_int_equal(p.dropped[PREP_DROP_UNREADABLE], is_hit);
            assert_true(p.first[0] == s + 0.5 && p.last[0] == s + 0.5 && p.last[1] == 29999);
            if (is_hit) assert_int_equal(p.damage.place, 30010 + 10 + 8);
        }
        free(text);
    }
}

static const char *file_of_year_1970(const char *text)
{
    const char *path = scan_points_file("old.ptx", text, strlen(text));
    const struct timespec old[2] = {{.tv_sec = 1000}, {.tv_sec = 1000}};
    assert_int_equal(utimensat(AT_FDCWD, path, old, 0), 0);
    return path;
}

/* That there is no second walk shows in a file whose headers are gone by then, and whose size and
 * times are what they were. */
static void a_memory_spares_the_walk_to_the_next_scan(void **state)
{
    (void)state;
    char text[sizeof two_scans];
    memcpy(text, two_scans, sizeof text);
    prep_scan_options options = {0};
    assert_true(prep_scan_memory_create(&options.memory, NULL));
    const char *path = file_of_year_1970(text);
    assert_int_equal(read_scan_with(path, 0, &options).count, 4);
    memcpy(text, "x\nx", 3);
    file_of_year_1970(text);
    one_scan b = read_scan_with(path, 1, &options);
    assert_int_equal(b.info.scan_count, 2);
    assert_int_equal(b.count, 2);
    assert_true(b.first[0] == 10 && b.last[0] == 9);
    prep_scan *scan;
    assert_false(prep_scan_open(path, 1, NULL, &scan, NULL));
    prep_scan_memory_destroy(options.memory);
}

static void what_is_remembered_of_a_file_ends_with_it(void **state)
{
    (void)state;
    prep_scan_options options = {0};
    assert_true(prep_scan_memory_create(&options.memory, NULL));
    const char *path = file_of_year_1970(two_scans);
    for (int i = 0; i < 3; i++)
        assert_int_equal(read_scan_with(path, 1, &options).count, 2);
    file_of_year_1970("1\n1\n" IDENTITY "1 1 1 0.1\n"); /* of another size */
    assert_int_equal(read_scan_with(path, 0, &options).info.scan_count, 1);
    const char *other = scan_points_file("other.ptx", two_scans, strlen(two_scans));
    assert_int_equal(read_scan_with(other, 0, &options).info.scan_count, 2);
    prep_scan_memory_destroy(options.memory);
}

static void gzip_is_unpacked_on_the_way(void **state)
{
    (void)state;
    char path[1024];
    size_t size;
    char *text = make_large(&size, 3, 20000, false);
    snprintf(path, sizeof path, "%s/packed.ptx.gz", scan_points_folder());
    gzFile gz = gzopen(path, "wb1");
    assert_int_equal(gzwrite(gz, text, (unsigned)size), (int)size);
    gzclose(gz);
    for (uint32_t s = 0; s < 3; s++) {
        one_scan p = read_scan(path, s);
        assert_int_equal(p.count, 20000);
        assert_false(p.is_damaged);
        assert_true(p.first[0] == s + 0.5);
    }
    free(text);
}

static void a_rewound_scan_reads_the_same(void **state)
{
    (void)state;
    prep_scan *scan;
    prep_batch batch;
    mospt_err err;
    const char *path = scan_points_file("a.ptx", two_scans, strlen(two_scans));
    assert_true(prep_scan_open(path, 1, NULL, &scan, &err));
    assert_true(prep_batch_init(&batch, &prep_scan_describe(scan)->attributes, 10, &err));
    for (int i = 0; i < 3; i++) {
        assert_true(prep_scan_read(scan, &batch, &err));
        assert_int_equal(batch.count, 2);
        assert_true(batch.xyz[1] == 21);
        assert_int_equal(prep_scan_dropped(scan)[PREP_DROP_NO_RETURN], 1);
        assert_true(prep_scan_rewind(scan, &err));
    }
    prep_batch_fini(&batch);
    prep_scan_close(scan);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scan_is_read_and_moved_to_the_world),
        cmocka_unit_test(a_file_holds_several_scans),
        cmocka_unit_test(scans_without_points_do_not_count),
        cmocka_unit_test(colour_may_be_on_some_lines_only),
        cmocka_unit_test(intensity_comes_in_any_range),
        cmocka_unit_test(colours_of_16_bits_keep_their_raw_values),
        cmocka_unit_test(sloppy_files_are_read),
        cmocka_unit_test(bad_lines_are_counted_and_named),
        cmocka_unit_test(a_grid_that_is_not_there_is_damage),
        cmocka_unit_test(a_scan_that_ends_early_leaves_the_next_one_whole),
        cmocka_unit_test(points_behind_a_damaged_header_are_left_out),
        cmocka_unit_test(matrices_may_be_wrong),
        cmocka_unit_test(what_is_no_ptx_is_refused),
        cmocka_unit_test(every_truncation_is_an_error_or_fewer_points),
        cmocka_unit_test(a_file_that_ends_inside_a_line_says_so),
        cmocka_unit_test(no_bit_flip_does_harm),
        cmocka_unit_test(scans_longer_than_the_buffers_are_read),
        cmocka_unit_test(a_memory_spares_the_walk_to_the_next_scan),
        cmocka_unit_test(what_is_remembered_of_a_file_ends_with_it),
        cmocka_unit_test(gzip_is_unpacked_on_the_way),
        cmocka_unit_test(a_rewound_scan_reads_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
