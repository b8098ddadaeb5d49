#include "preprocess/text.h"
#include "tests/scan_points.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include <cmocka.h>

static void read_as(const char *name, const char *text, const char *columns, scan_points *out)
{
    mospt_err err;
    prep_scan_options options = {.columns = columns};
    const char *path = scan_points_file(name, text, strlen(text));
    if (!scan_points_read(path, &options, 3, out, &err)) fail_msg("%s: `%s`", err.message, text);
}

static void read_text(const char *text, scan_points *out)
{
    read_as("a.txt", text, NULL, out);
}

static mospt_err refuse(const char *text, const char *columns)
{
    scan_points points;
    mospt_err err = {0};
    prep_scan_options options = {.columns = columns};
    const char *path = scan_points_file("a.txt", text, strlen(text));
    if (scan_points_read(path, &options, 100, &points, &err)) fail_msg("read: `%s`", text);
    assert_string_equal(err.file, path);
    return err;
}

/* Reads text whose points are (1, 2, 3), (4, 5, 6.5) and nothing else. */
static void check_two(const char *text)
{
    scan_points p;
    read_text(text, &p);
    static const double expected[6] = {1, 2, 3, 4, 5, 6.5};
    if (p.count != 2 || memcmp(p.xyz, expected, sizeof expected) != 0 || p.is_damaged)
        fail_msg("`%s`", text);
    assert_true(p.info.is_text && !p.info.has_bounds);
    scan_points_fini(&p);
}

static void separators_and_line_ends_vary(void **state)
{
    (void)state;
    static const char *const texts[] = {"1 2 3\n4 5 6.5\n",
                                        "1,2,3\n4,5,6.5\n",
                                        "1;2;3\n4;5;6.5\n",
                                        "1\t2\t3\n4\t5\t6.5\n",
                                        "1 2 3\r\n4 5 6.5\r\n",
                                        "1 , 2 ,3\n4 ,5 , 6.5\n",
                                        "1, 2; 3\n4\t, 5  6.5\n",
                                        "  1   2  3  \n\t4 5 6.5\t\n",
                                        "1 2 3\n4 5 6.5",
                                        "1,2,3,\n4,5,6.5,\n",
                                        "\n\n1 2 3\n\n\n4 5 6.5\n\n",
                                        "# hello\n1 2 3\n# there\n4 5 6.5\n",
                                        "; hello\n;\n1 2 3\n; there\n4 5 6.5\n",
                                        "1 2 3 # first\n4 5 6.5 // second\n",
                                        "1 2 3\r\r\n4 5 6.5\r\r\n\032",
                                        "a title of it\n1 2 3\n4 5 6.5\n",
                                        "made on 2024-05-06 by me\n\n1 2 3\n4 5 6.5\n",
                                        "Punkte f\374r die H\366he\n1 2 3\n4 5 6.5\n",
                                        "P1,1,2,3\nP2,4,5,6.5\n",
                                        "1;2;3;tree\n4;5;6.5;house\n",
                                        "// hello\n1 2 3\n% there\n4 5 6.5\n",
                                        "1e0 +2.0 .3e1\n40e-1 5. 0.65E+1\n",
                                        "\"1\",\"2\",\"3\"\n\"4\",\"5\",\" 6.5 \"\n",
                                        "\357\273\2771 2 3\n4 5 6.5\n",
                                        "2\n1 2 3\n4 5 6.5\n",
                                        "1\n1 2 3\n1\n4 5 6.5\n"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        check_two(texts[i]);
}

static void names_give_columns_their_meaning(void **state)
{
    (void)state;
    static const char *const texts[] = {"x y z\n1 2 3\n4 5 6.5\n",
                                        "\"X\",\"Y\",\"Z\"\n1,2,3\n4,5,6.5\n",
                                        "Z;Y;X\n3;2;1\n6.5;5;4\n",
                                        "//X Y Z\n1 2 3\n4 5 6.5\n",
                                        "# z y x\n3 2 1\n6.5 5 4\n",
                                        "X [m],Y [m],Z [m]\n1,2,3\n4,5,6.5\n",
                                        "Easting,Northing,Elevation\n1,2,3\n4,5,6.5\n",
                                        "id east north height\n7 1 2 3\n8 4 5 6.5\n",
                                        "LAT LON ELEV\n2 1 3\n5 4 6.5\n",
                                        "x,east,y,z\n1,9,2,3\n4,9,5,6.5\n",
                                        "x y z\n2\n1 2 3\n4 5 6.5\n",
                                        "some title\nx y z\nm m m\n1 2 3\n4 5 6.5\n",
                                        "z y x\n[m] [m] [m]\n3 2 1\n6.5 5 4\n"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        check_two(texts[i]);

    scan_points p;
    read_text("\"Red\",\"Green\",\"X\",\"Y\",\"Blue\",\"Z\",\"Classification\",\"GpsTime\","
              "\"Return Number\",\"odd name!\"\n"
              "10,20,1,2,30,3,5,12345.678,2,0.25\n11,21,4,5,31,6.5,6,12345.679,1,0.5\n",
              &p);
    assert_true(p.xyz[2] == 3 && p.info.has_rgb);
    assert_int_equal(p.rgbi[0], 10);
    assert_int_equal(p.rgbi[4 + 2], 31);
    assert_true(scan_points_value(&p, "classification", 1, 0) == 6);
    assert_string_equal(scan_points_type(&p, "classification"), "u8");
    assert_true(scan_points_value(&p, "gps_time", 1, 0) == 12345.679);
    assert_string_equal(scan_points_type(&p, "return_number"), "u8");
    assert_true(scan_points_value(&p, "odd_name!", 1, 0) == 0.5);
    scan_points_fini(&p);
}

static void columns_without_names_are_guessed(void **state)
{
    (void)state;
    scan_points p;
    read_text("1 2 3 -2048\n4 5 6 2047\n", &p);
    assert_true(p.info.has_intensity && !p.info.has_rgb);
    assert_string_equal(scan_points_type(&p, "intensity"), "i16");
    assert_int_equal(p.rgbi[3], 0);
    assert_int_equal(p.rgbi[7], 255);
    scan_points_fini(&p);
    read_text("1 2 3 255 0 7\n4 5 6 1 2 3\n", &p);
    assert_true(p.info.has_rgb);
    assert_int_equal(p.rgbi[2], 7);
    assert_int_equal(p.info.attributes.count, 0);
    scan_points_fini(&p);
    read_text("1 2 3 0.6 0.8 0\n4 5 6 0 -1 0\n", &p);
    assert_true(scan_points_value(&p, "normal", 1, 1) == -1);
    assert_string_equal(scan_points_type(&p, "normal"), "f32");
    scan_points_fini(&p);
    read_text("1 2 3 100 0.8 0\n4 5 6 0 -1 0\n", &p);
    assert_true(scan_points_value(&p, "column_4", 0, 0) == 100);
    scan_points_fini(&p);
    read_text("1 2 3 0.25 10 20 30\n4 5 6 0.75 40 50 60\n", &p);
    assert_true(scan_points_value(&p, "intensity", 1, 0) == 0.75);
    assert_string_equal(scan_points_type(&p, "intensity"), "f32");
    assert_int_equal(p.rgbi[4], 40);
    scan_points_fini(&p);
    read_text("1 2 3 10 20 30 0.25\n4 5 6 40 50 60 0.75\n", &p);
    assert_true(scan_points_value(&p, "intensity", 1, 0) == 0.75);
    assert_int_equal(p.rgbi[4], 40);
    scan_points_fini(&p);
    read_text("1 2 3 10 20 30 0 0 1\n4 5 6 40 50 60 0 1 0\n", &p);
    assert_true(p.info.has_rgb && scan_points_value(&p, "normal", 0, 2) == 1);
    scan_points_fini(&p);
    read_text("1 2 3 -5 10 20 30 0 0 1\n4 5 6 5 40 50 60 0 1 0\n", &p);
    assert_true(p.info.has_rgb && p.info.has_intensity &&
                scan_points_value(&p, "normal", 1, 1) == 1);
    scan_points_fini(&p);
    read_text("1 2 3 4 5\n4 5 6 7 8.5\n", &p);
    assert_true(scan_points_value(&p, "column_5", 1, 0) == 8.5);
    scan_points_fini(&p);
    read_text("1 2 3 65535 300 0\n4 5 6 1 2 257\n", &p);
    assert_true(p.info.has_rgb && scan_points_value(&p, "rgb", 0, 0) == 65535);
    assert_int_equal(p.rgbi[4 + 2], 1);
    scan_points_fini(&p);
    read_text("1 2 3 65535 300 0\n4 5 6 1 2 255\n", &p);
    assert_false(p.info.has_rgb);
    scan_points_fini(&p);
    read_text("a 1 2 3 0.5 0.25 0.125\nb 4 5 6 1.0 0.75 0\n", &p);
    assert_true(p.info.has_rgb && scan_points_value(&p, "rgb_float", 1, 1) == 0.75);
    assert_int_equal(p.rgbi[0], 128);
    scan_points_fini(&p);
    read_text("1 2 3 0.6 0 0.8\n4 5 6 0.6 0 0.8\n", &p); /* a plane that faces one way */
    assert_true(scan_points_value(&p, "normal", 1, 2) == (double)0.8f);
    scan_points_fini(&p);
}

/* What Cyclone writes where only some of the scans were photographed. */
static void blocks_may_differ_in_their_columns(void **state)
{
    (void)state;
    scan_points p;
    read_text("2\n1 2 3 -100\n4 5 6 100\n3\n7 8 9 50 10 20 30\n1 1 1 60 40 50 60\n"
              "2 2 2 70 70 80 90\n",
              &p);
    assert_int_equal(p.count, 5);
    assert_false(p.is_damaged);
    assert_true(p.info.has_rgb && p.info.has_intensity);
    assert_true(scan_points_value(&p, "intensity", 1, 0) == 100);
    assert_int_equal(p.rgbi[4], 255); /* as bright as its intensity */
    assert_int_equal(p.rgbi[4 * 2], 10);
    assert_int_equal(p.rgbi[4 * 4 + 2], 90);
    scan_points_fini(&p);
}

static void a_short_file_is_looked_at_up_to_its_end(void **state)
{
    (void)state;
    enum { LINES = 5000 };
    char *text = malloc(LINES * 32);
    size_t size = 0;
    for (int i = 0; i < LINES; i++)
        size += (size_t)sprintf(text + size, "%d %d 1 %d 0 0\n", i, i % 7, i > 4000 ? 200 : 0);
    scan_points p;
    mospt_err err;
    assert_true(scan_points_read(scan_points_file("a.txt", text, size), NULL, 999, &p, &err));
    assert_int_equal(p.count, LINES);
    assert_false(p.is_damaged);
    assert_true(p.info.has_rgb);
    assert_int_equal(p.rgbi[4 * 4500], 200);
    scan_points_fini(&p);
    free(text);
}

static void wide_and_floating_colours_are_scaled(void **state)
{
    (void)state;
    scan_points p;
    read_text("x y z r g b\n1 2 3 65535 0 257\n4 5 6 1 2 3\n", &p);
    assert_int_equal(p.rgbi[0], 255);
    assert_int_equal(p.rgbi[2], 1);
    assert_true(scan_points_value(&p, "rgb", 0, 2) == 257);
    scan_points_fini(&p);
    read_text("x y z Rf Gf Bf\n1 2 3 1.0 0.5 0\n4 5 6 0.1 0.2 0.3\n", &p);
    assert_int_equal(p.rgbi[0], 255);
    assert_int_equal(p.rgbi[1], 128);
    assert_true(scan_points_value(&p, "rgb_float", 0, 1) == 0.5);
    scan_points_fini(&p);
    read_text("x y z r g b\n1 2 3 0 0 0\n4 5 6 0 0 0\n", &p);
    assert_false(p.info.has_rgb);
    assert_int_equal(p.rgbi[0], 255);
    scan_points_fini(&p);
}

static void the_option_overrides_everything(void **state)
{
    (void)state;
    scan_points p;
    read_as("a.txt", "9 3 2 1 7\n9 6.5 5 4 8\n", "-,z,y,x,intensity", &p);
    assert_true(p.xyz[0] == 1 && p.xyz[5] == 6.5);
    assert_true(scan_points_value(&p, "intensity", 1, 0) == 8);
    assert_int_equal(p.info.attributes.count, 1);
    scan_points_fini(&p);
    read_as("a.txt", "x y z\n1 2 3\n4 5 6\n", "y,x,z", &p);
    assert_true(p.xyz[0] == 2 && p.count == 2 && !p.is_damaged);
    scan_points_fini(&p);
    assert_int_equal(refuse("1 2 3\n", "x,y,intensity").code, MOSPT_EINVAL);
    assert_int_equal(refuse("1 2 3\n", "x,y,z,intensity").code, MOSPT_EFORMAT);
}

static void letters_of_the_extension_count(void **state)
{
    (void)state;
    scan_points p;
    read_as("a.xyzcirn", "1 2 3 2 88 1 3\n4 5 6 5 99 2 3\n", NULL, &p);
    assert_true(scan_points_value(&p, "classification", 1, 0) == 5);
    assert_true(scan_points_value(&p, "intensity", 1, 0) == 99);
    assert_true(scan_points_value(&p, "return_number", 1, 0) == 2);
    assert_true(scan_points_value(&p, "number_of_returns", 1, 0) == 3);
    scan_points_fini(&p);
    read_as("a.xyzrgb", "1 2 3 2 88 1\n4 5 6 5 99 2\n", NULL, &p);
    assert_int_equal(p.rgbi[1], 88);
    scan_points_fini(&p);
    read_as("a.xyzi", "1 2 3 2 88 1\n4 5 6 5 99 2\n", NULL,
            &p); /* not as many columns as letters */
    assert_true(p.info.has_rgb);
    scan_points_fini(&p);
}

static void labels_are_left_out(void **state)
{
    (void)state;
    scan_points p;
    read_text("x,y,z,label,v\n1,2,3,tree,7\n4,5,6.5,\"a house\",8\n", &p);
    assert_int_equal(p.count, 2);
    assert_false(p.is_damaged);
    assert_string_equal(scan_points_type(&p, "label"), "");
    assert_true(scan_points_value(&p, "v", 1, 0) == 8);
    scan_points_fini(&p);
}

static void more_names_than_columns_do_no_harm(void **state)
{
    (void)state;
    scan_points p;
    read_text("x y z r g b nx\n1 2 3 10\n4 5 6 20\n", &p);
    assert_int_equal(p.count, 2);
    assert_false(p.info.has_rgb);
    scan_points_fini(&p);
}

static void values_that_are_missing_are_nan(void **state)
{
    (void)state;
    scan_points p;
    read_text("x,y,z,v,w\n1,2,3,,5\n4,5,,6,5\n7,8,9,1,5\n", &p);
    assert_int_equal(p.count, 2);
    assert_true(isnan(scan_points_value(&p, "v", 0, 0)));
    assert_int_equal(p.dropped[PREP_DROP_NOT_FINITE], 1);
    scan_points_fini(&p);
    read_text("1 2 3\nnan 5 6\n7 inf 9\n1.#QNAN 1 1\n1 2 -nan(ind)\n4 5 6\n", &p);
    assert_int_equal(p.count, 2);
    assert_int_equal(p.dropped[PREP_DROP_NOT_FINITE], 4);
    assert_false(p.is_damaged);
    scan_points_fini(&p);
}

static void bad_lines_are_counted_and_named(void **state)
{
    (void)state;
    char text[8192] = "";
    for (int i = 0; i < 100; i++)
        strcat(text, i == 49   ? "what is this\n"
                     : i == 70 ? "1 2\n"
                     : i == 71 ? "1 2 3 4 5\n"
                               : "1 2 3 4\n");
    scan_points p;
    read_text(text, &p);
    assert_int_equal(p.count, 98);
    assert_int_equal(p.dropped[PREP_DROP_UNREADABLE], 2);
    assert_true(p.is_damaged);
    assert_int_equal(p.damage.place_kind, MOSPT_AT_LINE);
    assert_int_equal(p.damage.place, 50);
    scan_points_fini(&p);
    read_text("1 2\n1 2 3\n4 5 6\n", &p); /* numbers are no title */
    assert_int_equal(p.count, 2);
    assert_int_equal(p.damage.place, 1);
    assert_int_equal(p.dropped[PREP_DROP_UNREADABLE], 1);
    scan_points_fini(&p);
}

static void announced_points_are_counted(void **state)
{
    (void)state;
    scan_points p;
    read_text("1000000\n1 2 3\n4 5 6\n", &p);
    assert_int_equal(p.count, 2);
    assert_true(p.is_damaged);
    assert_int_equal(p.damage.place, 1);
    assert_non_null(strstr(p.damage.message, "1000000"));
    scan_points_fini(&p);
    read_text("2\n1 2 3\n4 5 6\n7 8 9\n", &p); /* more than announced is fine */
    assert_int_equal(p.count, 3);
    assert_false(p.is_damaged);
    assert_int_equal(p.info.point_count, 2);
    scan_points_fini(&p);
}

static void what_is_no_point_file_is_refused(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "1 2\n3 4\n",
        "1\n2\n3\n",
        "This is a file with text in it\n",
        "This\nis\nprose\n",
        "\n\n",
        "# only a comment\n",
        "reading, g00, g01\ncloud.csv, 1, 0\nother.csv, 1, 0\n",
        "a b c\n1 2 3\n",
        "x y\n1 2\n",
        "boundary : MULTIPOLYGON (((1.6 -0.5, 2.0 0.0)))\nlength : 0.6\n",
        "1,5;2,5;3,5\n2,5;3,5;4,5\n",
        "1,5 2,5 3,5\n2,5 3,5 4,5\n",
        "<html>\n<body>1 2 3</body>\n</html>\n",
        "{\"a\": [1, 2, 3]}\n"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        mospt_err err = refuse(texts[i], NULL);
        if (err.code != MOSPT_EFORMAT) fail_msg("`%s`: %s", texts[i], err.message);
    }
    assert_non_null(
        strstr(refuse("1 2\n3 4\n", NULL).message, "2 columns, a point needs x, y and z"));
    static const char *const commas[] = {"1,5;2,5;3,5\n",
                                         "x;y;z\n1,5;-2,5;3,5\n",
                                         "1,5E+00\t2,5E+00\t3,5E-1\n",
                                         "12;34;5,25\n13;35;6,5\n14;36;7\n",
                                         "1,5;2,5;3,5;12.03.2024\n",
                                         "\"1,5\",\"2,5\",\"3,5\"\n",
                                         "\"1,5\";\"2,5\";\"3,5\"\n",
                                         "1,5 2,5 3,5 255 0 0\n"};
    for (size_t i = 0; i < sizeof commas / sizeof commas[0]; i++) {
        mospt_err err = refuse(commas[i], NULL);
        if (strstr(err.message, "decimal commas") == NULL)
            fail_msg("`%s`: %s", commas[i], err.message);
    }
    assert_non_null(strstr(refuse("1 2 3\r4 5 6\r7 8 9\r", NULL).message, "CR alone"));
    assert_non_null(strstr(refuse("1 2 3\n4 5\n7 8\n9 9\n1 2 3\n1 2 3\n1 2 3\n", NULL).message,
                           "3 of 7 lines"));
    assert_int_equal(refuse("x y z\n", NULL).code, MOSPT_EEMPTY);
    assert_int_equal(refuse("0\n", NULL).code, MOSPT_EEMPTY);
    scan_points p;
    mospt_err err;
    const char binary[] = "1 2 3\n\0\1\2\3";
    assert_false(
        scan_points_read(scan_points_file("a.txt", binary, sizeof binary), NULL, 9, &p, &err));
    assert_int_equal(err.code, MOSPT_EFORMAT);
}

static void the_content_decides_not_the_name(void **state)
{
    (void)state;
    static const char ptx[] =
        "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5\n";
    prep_scan *scan = NULL;
    mospt_err err;
    assert_true(prep_scan_open(scan_points_file("a.txt", ptx, strlen(ptx)), 0, NULL, &scan, &err));
    assert_non_null(strstr(prep_scan_describe(scan)->format, "PTX"));
    prep_scan_close(scan);
    assert_false(prep_scan_open(scan_points_file("a.txt", "ASTM-E57", 8), 0, NULL, &scan, &err));
    assert_non_null(strstr(err.message, "the file's header"));

    static const char points[] = "4\n1 2 3 -7\n4 5 6 8\n1 1 1 1\n2 2 2 2\n";
    static const char *const names[] = {"a.las", "a.laz", "a.ply", "a.pcd", "a.e57", "a.ptx", "a"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        scan_points p;
        read_as(names[i], points, NULL, &p);
        assert_int_equal(p.count, 4);
        assert_string_equal(p.info.format, "text, 4 columns");
        scan_points_fini(&p);
    }
    static const char pcd[] = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n";
    assert_true(prep_scan_open(scan_points_file("a", pcd, strlen(pcd)), 0, NULL, &scan, &err));
    assert_non_null(strstr(prep_scan_describe(scan)->format, "PCD"));
    prep_scan_close(scan);
}

static void wide_characters_are_named(void **state)
{
    (void)state;
    static const char *const texts[] = {"\377\3761\0 \0002\0 \0003\0\n\0",
                                        "\376\377\0001\0 \0002\0 \0003\0\n",
                                        "1\0 \0002\0 \0003\0\n\0001\0"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        prep_scan *scan;
        mospt_err err;
        assert_false(prep_scan_open(scan_points_file("a.txt", texts[i], 14), 0, NULL, &scan, &err));
        assert_non_null(strstr(err.message, "UTF-16"));
    }
}

static void long_lines_take_no_memory(void **state)
{
    (void)state;
    size_t size = 8 << 20;
    char *text = malloc(size);
    memset(text, '1', size);
    scan_points_survive("long.txt", text, size, NULL);
    for (size_t i = 0; i < size; i += 2)
        text[i] = ' ';
    scan_points_survive("long.txt", text, size, NULL);
    for (size_t i = 0; i < 1 << 20; i++)
        text[i] = "1 2 3\n"[i % 6]; /* points, then one endless line */
    uint64_t count;
    assert_true(scan_points_survive("long.txt", text, size, &count));
    assert_in_range(count, (1 << 20) / 6 - 1, (1 << 20) / 6 + 1);
    free(text);
}

static void late_surprises_do_not_stop_reading(void **state)
{
    (void)state;
    size_t size = 6 * 400000;
    char *text = malloc(size);
    for (size_t i = 0; i < size; i++)
        text[i] = "1 2 3\n"[i % 6];
    memcpy(text + 6 * 100001, "a b c\n", 6);
    memcpy(text + 6 * 300001, "n d e\n", 6);
    scan_points p;
    mospt_err err;
    assert_true(scan_points_read(scan_points_file("late.xyz", text, size), NULL, 65536, &p, &err));
    assert_int_equal(p.count, 399998);
    assert_int_equal(p.dropped[PREP_DROP_UNREADABLE], 2);
    assert_int_equal(p.damage.place, 100002);
    scan_points_fini(&p);
    free(text);
}

static void every_truncation_is_an_error_or_fewer_points(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "3\n1.5 2 3 -100 1 2 3\n4 5 6 7 8 9 10\n7 8 9 10 11 12 13\n",
        "\"X\",\"Y\",\"Z\",\"Intensity\"\r\n1,2,3,4\r\n5,6,7,8\r\n9,1e1,11,12\r\n"};
    for (size_t k = 0; k < 2; k++) {
        for (size_t n = 0; n <= strlen(texts[k]); n++) {
            uint64_t count;
            scan_points_survive("cut.txt", texts[k], n, &count);
            assert_true(count <= 3);
            if (n == strlen(texts[k])) assert_int_equal(count, 3);
        }
    }
}

static void no_bit_flip_does_harm(void **state)
{
    (void)state;
    uint64_t seed = 5;
    for (int round = 0; round < 5000; round++) {
        char text[2000];
        int size = 0;
        if (round % 2 != 0) size += snprintf(text, sizeof text, "x;y;z;i;r;g;b\n");
        for (int i = 0; i < 20; i++)
            size +=
                snprintf(text + size, sizeof text - (size_t)size, "%d.%d;%d;%d.5e-1;%d;%d;%d;%d\n",
                         i, i * i, -i, i * 7, i * 100, i, i + 1, i + 2);
        uint32_t flips = 1 + scan_points_random(&seed) % 4;
        for (uint32_t k = 0; k < flips; k++)
            text[scan_points_random(&seed) % (uint32_t)size] ^=
                (char)(1u << scan_points_random(&seed) % 8);
        scan_points_survive("flip.txt", text, (size_t)size, NULL);
    }
}

static void write_gzip(const char *path, const char *mode, const char *text)
{
    gzFile gz = gzopen(path, mode);
    assert_int_equal(gzwrite(gz, text, (unsigned)strlen(text)), (int)strlen(text));
    gzclose(gz);
}

static void gzip_is_unpacked_on_the_way(void **state)
{
    (void)state;
    char path[1024];
    snprintf(path, sizeof path, "%s/a.xyzcirn.gz", scan_points_folder());
    write_gzip(path, "wb", "1 2 3 2 88 1 3\n");
    write_gzip(path, "ab", "4 5 6 5 99 2 3\n"); /* a second member */
    scan_points p;
    mospt_err err;
    assert_true(scan_points_read(path, NULL, 1, &p, &err));
    assert_int_equal(p.count, 2);
    assert_true(scan_points_value(&p, "classification", 1, 0) == 5);
    scan_points_fini(&p);
}

static void damaged_gzip_gives_what_is_there(void **state)
{
    (void)state;
    char path[1024], packed[200000];
    snprintf(path, sizeof path, "%s/a.xyz.gz", scan_points_folder());
    gzFile gz = gzopen(path, "wb");
    uint64_t seed = 11;
    for (int i = 0; i < 10000; i++)
        gzprintf(gz, "%u %u %u\n", i, scan_points_random(&seed), scan_points_random(&seed));
    gzclose(gz);
    FILE *f = fopen(path, "rb");
    size_t size = fread(packed, 1, sizeof packed, f);
    fclose(f);
    scan_points p;
    mospt_err err;
    assert_true(
        scan_points_read(scan_points_file("cut.xyz.gz", packed, size / 2), NULL, 1000, &p, &err));
    assert_in_range(p.count, 2000, 9000);
    assert_true(p.is_damaged);
    assert_non_null(strstr(p.damage.message, "gzip"));
    scan_points_fini(&p);
    for (size_t n = 0; n < size; n += 997)
        scan_points_survive("cut.xyz.gz", packed, n, NULL);
    for (int round = 0; round < 200; round++) {
        size_t at = scan_points_random(&seed) % size;
        packed[at] ^= 16;
        scan_points_survive("flip.xyz.gz", packed, size, NULL);
        packed[at] ^= 16;
    }
}

static void reading_again_gives_the_same(void **state)
{
    (void)state;
    const char *text = "3\n1 2 3\nbad\n4 5 6\nnan 2 1\n7 8 9\n";
    prep_scan *scan;
    prep_batch batch;
    assert_true(
        prep_scan_open(scan_points_file("again.pts", text, strlen(text)), 0, NULL, &scan, NULL));
    assert_true(prep_batch_init(&batch, &prep_scan_describe(scan)->attributes, 100, NULL));
    for (int round = 0; round < 3; round++) {
        assert_null(prep_scan_damage(scan));
        assert_true(prep_scan_read(scan, &batch, NULL));
        assert_int_equal(batch.count, 3);
        assert_int_equal(prep_scan_dropped(scan)[PREP_DROP_NOT_FINITE], 1);
        assert_int_equal(prep_scan_dropped(scan)[PREP_DROP_UNREADABLE], 1);
        assert_int_equal(prep_scan_damage(scan)->place, 3);
        assert_true(prep_scan_read(scan, &batch, NULL));
        assert_int_equal(batch.count, 0);
        assert_true(prep_scan_rewind(scan, NULL));
    }
    prep_batch_fini(&batch);
    prep_scan_close(scan);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(separators_and_line_ends_vary),
        cmocka_unit_test(names_give_columns_their_meaning),
        cmocka_unit_test(columns_without_names_are_guessed),
        cmocka_unit_test(blocks_may_differ_in_their_columns),
        cmocka_unit_test(a_short_file_is_looked_at_up_to_its_end),
        cmocka_unit_test(wide_and_floating_colours_are_scaled),
        cmocka_unit_test(the_option_overrides_everything),
        cmocka_unit_test(letters_of_the_extension_count),
        cmocka_unit_test(labels_are_left_out),
        cmocka_unit_test(more_names_than_columns_do_no_harm),
        cmocka_unit_test(values_that_are_missing_are_nan),
        cmocka_unit_test(bad_lines_are_counted_and_named),
        cmocka_unit_test(announced_points_are_counted),
        cmocka_unit_test(what_is_no_point_file_is_refused),
        cmocka_unit_test(the_content_decides_not_the_name),
        cmocka_unit_test(wide_characters_are_named),
        cmocka_unit_test(long_lines_take_no_memory),
        cmocka_unit_test(late_surprises_do_not_stop_reading),
        cmocka_unit_test(every_truncation_is_an_error_or_fewer_points),
        cmocka_unit_test(no_bit_flip_does_harm),
        cmocka_unit_test(gzip_is_unpacked_on_the_way),
        cmocka_unit_test(damaged_gzip_gives_what_is_there),
        cmocka_unit_test(reading_again_gives_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
