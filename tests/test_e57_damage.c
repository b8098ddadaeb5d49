#include "preprocess/e57_pages.h"
#include "tests/e57_tools.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static void more_records_than_there_are_is_damage(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    static const uint64_t claims[] = {E57_COUNT + 500, UINT64_C(1) << 62, UINT64_MAX};
    for (int i = 0; i < 3; i++) {
        m.scan.declared = claims[i];
        e57_loaded l;
        e57_load_file(&(write_e57_file){.scans = &m.scan, .scan_count = 1}, 0, &l);
        e57_check_xyz(&l);
        assert_true(l.info.point_count >= E57_COUNT && l.info.point_count < E57_COUNT + 600);
        assert_int_equal(l.damage.code, MOSPT_EFORMAT);
        assert_int_equal(l.damage.place_kind, MOSPT_AT_BYTE);
        assert_non_null(strstr(l.damage.message, "3000 of "));
        e57_unload(&l);
    }
}

static void records_without_bits_do_not_go_on_for_ever(void **state)
{
    (void)state;
    static int64_t five[E57_COUNT];
    for (uint32_t i = 0; i < E57_COUNT; i++)
        five[i] = 5;
    e57_made m;
    e57_begin(&m);
    for (int a = 0; a < 3; a++)
        m.field[a] = e57_whole(m.field[a].name, five, 5, 5);
    e57_loaded l;
    e57_load_made(&m, &l);
    assert_int_equal(l.batch.count, E57_COUNT);
    assert_true(l.batch.xyz[0] == 5 && l.batch.xyz[3 * E57_COUNT - 1] == 5);
    e57_unload(&l);
    m.scan.declared = UINT64_C(1) << 40;
    assert_int_equal(e57_refuse_file(&(write_e57_file){.scans = &m.scan, .scan_count = 1}).code,
                     MOSPT_EFORMAT);
}

static uint8_t *make_plain(size_t *size, bool is_xml_first)
{
    e57_made m;
    e57_begin(&m);
    e57_add_rgb(&m, 255);
    m.scan.count = 1000;
    m.scan.piece = 400;
    return write_e57(
        &(write_e57_file){.scans = &m.scan, .scan_count = 1, .is_xml_first = is_xml_first}, size);
}

static void a_damaged_page_takes_only_its_own_points(void **state)
{
    (void)state;
    size_t size;
    uint8_t *bytes = make_plain(&size, true);
    uint64_t total = 0;
    for (size_t page = 1; page < size / 1024; page++) {
        bytes[1024 * page + 500] ^= 4;
        const char *path = scan_points_file("a.e57", bytes, size);
        e57_loaded l;
        mospt_err err = {0};
        if (e57_load_scan(path, 0, NULL, 2000, &l, &err)) {
            assert_int_equal(l.damage.code, MOSPT_EFORMAT);
            assert_int_equal(l.damage.place_kind, MOSPT_AT_BYTE);
            assert_true(l.batch.count < 1000);
            for (uint32_t i = 0; i < l.batch.count;
                 i++) { /* z is the index, so that each can be checked */
                uint32_t k = (uint32_t)(l.batch.xyz[3 * i + 2] * 64 + 0.5);
                assert_true(k < 1000 && l.batch.xyz[3 * i] == e57_v.x[k] &&
                            l.batch.xyz[3 * i + 1] == e57_v.y[k]);
            }
            if (l.dropped[PREP_DROP_UNREADABLE] > 0) assert_int_equal(l.damage.place, 1024 * page);
            total += l.batch.count;
            e57_unload(&l);
        } else {
            assert_int_equal(err.code, MOSPT_EFORMAT);
            assert_int_equal(err.place, 1024 * page);
        }
        bytes[1024 * page + 500] ^= 4;
    }
    assert_true(total > 1000 * (size / 1024) / 4);
    free(bytes);
}

static void pages_are_checked_alike_with_and_without_the_instruction(void **state)
{
    (void)state;
    size_t size, got[2];
    uint8_t *bytes = make_plain(&size, true), *out[2];
    prep_input *input;
    prep_e57_pages pages;
    bytes[5 * 1024 + 1023] ^= 1;
    assert_true(prep_input_open(scan_points_file("a.e57", bytes, size), &input, NULL));
    prep_e57_pages_init(&pages, input);
    for (int i = 0; i < 2; i++) {
        out[i] = calloc(1, size);
        assert_non_null(out[i]);
        assert_true(prep_e57_pages_read(&pages, 0, out[i], size, &got[i], NULL));
        assert_int_equal(got[i], 5 * 1020);
        assert_true(prep_e57_pages_read(&pages, 6 * 1020, out[i] + 6 * 1020, size, &got[i], NULL));
        assert_int_equal(got[i], (size / 1024 - 6) * 1020);
        prep_e57_pages_release(&pages);
        pages.uses_sse42 = false;
    }
    assert_memory_equal(out[0], out[1], size);
    assert_memory_equal(out[0] + 1020, bytes + 1024, 1020);
    for (int i = 0; i < 2; i++)
        free(out[i]);
    prep_input_close(input);
    free(bytes);
}

static void a_wrong_checksum_in_the_first_page_is_refused(void **state)
{
    (void)state;
    size_t size;
    uint8_t *bytes = make_plain(&size, false);
    bytes[700] ^= 1;
    mospt_err err = e57_refuse_bytes(bytes, size);
    assert_int_equal(err.code, MOSPT_EFORMAT);
    assert_int_equal(err.place, 0);
    assert_non_null(strstr(err.message, "checksum"));
    free(bytes);
}

static mospt_err refuse_changed(size_t at, uint64_t value, size_t width)
{
    size_t size;
    uint8_t *bytes = make_plain(&size, false);
    for (size_t i = 0; i < width; i++)
        bytes[at + i] = (uint8_t)(value >> 8 * i);
    write_e57_seal(bytes, size);
    mospt_err err = e57_refuse_bytes(bytes, size);
    assert_int_equal(err.code, MOSPT_EFORMAT);
    free(bytes);
    return err;
}

static void impossible_headers_are_refused(void **state)
{
    (void)state;
    refuse_changed(8, 2, 4);                  /* major version */
    refuse_changed(24, UINT64_C(1) << 45, 8); /* XML offset */
    refuse_changed(24, UINT64_MAX, 8);
    refuse_changed(24, 1022, 8); /* in a checksum */
    refuse_changed(24, 48, 8);   /* in the points */
    refuse_changed(32, 0, 8);    /* XML size */
    refuse_changed(32, UINT64_C(1) << 45, 8);
    refuse_changed(32, UINT64_MAX, 8);
    refuse_changed(40, 4096, 8);    /* page size */
    refuse_changed(48, 7, 1);       /* kind of section */
    refuse_changed(48 + 8, 245, 8); /* size of the section */
    refuse_changed(48 + 8, 8, 8);
    refuse_changed(48 + 16, UINT64_MAX, 8); /* first packet */
    refuse_changed(48 + 16, 0, 8);
    refuse_changed(48 + 32, 9, 1);     /* kind of the first packet */
    refuse_changed(48 + 34, 2, 2);     /* its size */
    refuse_changed(48 + 36, 3, 2);     /* bytestreams in it */
    refuse_changed(48 + 38, 65535, 2); /* bytes of the first of them */
}

static void xml_that_grows_is_refused(void **state)
{
    (void)state;
    static const char bomb[] =
        "<!DOCTYPE b [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;\">"
        "<!ENTITY c \"&b;&b;&b;&b;&b;&b;&b;&b;\"><!ENTITY d \"&c;&c;&c;&c;&c;&c;&c;&c;\">]>\n";
    e57_made m;
    e57_begin(&m);
    m.scan.name = "]]>&d;<![CDATA[";
    const write_e57_file file = {.scans = &m.scan, .scan_count = 1, .doctype = bomb};
    mospt_err err = e57_refuse_file(&file);
    assert_int_equal(err.code, MOSPT_EFORMAT);
    assert_non_null(strstr(err.message, "document type"));
}

static char *repeat(const char *text, size_t count)
{
    size_t n = strlen(text);
    char *out = malloc(n * count + 1);
    assert_non_null(out);
    for (size_t i = 0; i < count; i++)
        memcpy(out + i * n, text, n);
    out[n * count] = '\0';
    return out;
}

static void xml_that_is_too_deep_or_too_long_is_refused(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    const write_e57_file file = {.scans = &m.scan, .scan_count = 1};
    char *deep = repeat("<a>", 100000);
    m.scan.xml = deep;
    mospt_err err = e57_refuse_file(&file);
    assert_int_equal(err.code, MOSPT_EFORMAT);
    assert_non_null(strstr(err.message, "nested"));
    free(deep);

    char *name = repeat("abcdefgh", 300000);
    char *element = malloc(strlen(name) + 16);
    assert_non_null(element);
    snprintf(element, strlen(name) + 16, "<%s/>", name);
    m.scan.xml = element;
    err = e57_refuse_file(&file);
    assert_int_equal(err.code, MOSPT_EFORMAT);
    assert_non_null(strstr(err.message, "too long"));
    free(element);
    free(name);
}

static void names_need_not_be_utf8_nor_short(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    m.scan.name = "B\xfchne"; /* Latin-1 */
    e57_loaded l;
    e57_load_made(&m, &l);
    assert_string_equal(l.info.name, "B\xc3\xbchne");
    e57_check_xyz(&l);
    e57_unload(&l);

    char *name = repeat("\xc3\xbc", 200);
    m.scan.name = name;
    e57_load_made(&m, &l);
    assert_int_equal(strlen(l.info.name), 254); /* no half character at the end */
    e57_unload(&l);
    free(name);
}

static void damage_behind_the_scans_is_only_told(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    e57_loaded l;
    e57_load_file(&(write_e57_file){.scans = &m.scan,
                                    .scan_count = 1,
                                    .xml = "<images2D type=\"Vector\"><&>"},
                  0, &l);
    e57_check_xyz(&l);
    assert_int_equal(l.damage.code, MOSPT_EFORMAT);
    assert_non_null(strstr(l.damage.message, "XML"));
    e57_unload(&l);
}

static void every_truncation_is_an_error_or_fewer_points(void **state)
{
    (void)state;
    for (int is_xml_first = 0; is_xml_first < 2; is_xml_first++) {
        size_t size;
        uint8_t *bytes = make_plain(&size, is_xml_first);
        uint64_t last = 0, most = 0;
        for (size_t n = 0; n < size; n += n < 100 ? 1 : 61) {
            if (scan_points_survive("cut.e57", bytes, n, &last) && last > most) most = last;
            assert_true(last < 1000);
        }
        if (is_xml_first) assert_true(most > 500);
        free(bytes);
    }
}

static void no_flipped_bytes_do_harm(void **state)
{
    (void)state;
    uint64_t seed = 7, accepted = 0;
    size_t size;
    uint8_t *bytes = make_plain(&size, true), *copy = malloc(size);
    assert_non_null(copy);
    for (int round = 0; round < 1500; round++) {
        memcpy(copy, bytes, size);
        uint32_t flips = 1 + scan_points_random(&seed) % 4;
        size_t reach = round % 2 == 0 ? size : 4000; /* the headers and the XML more often */
        for (uint32_t i = 0; i < flips; i++)
            copy[scan_points_random(&seed) % reach] ^=
                (uint8_t)(1u << scan_points_random(&seed) % 8);
        if (round % 3 != 0) write_e57_seal(copy, size); /* else the pages are damaged, too */
        accepted += scan_points_survive("flip.e57", copy, size, NULL);
    }
    assert_true(accepted > 150);
    free(copy);
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(more_records_than_there_are_is_damage),
        cmocka_unit_test(records_without_bits_do_not_go_on_for_ever),
        cmocka_unit_test(a_damaged_page_takes_only_its_own_points),
        cmocka_unit_test(pages_are_checked_alike_with_and_without_the_instruction),
        cmocka_unit_test(a_wrong_checksum_in_the_first_page_is_refused),
        cmocka_unit_test(impossible_headers_are_refused),
        cmocka_unit_test(xml_that_grows_is_refused),
        cmocka_unit_test(xml_that_is_too_deep_or_too_long_is_refused),
        cmocka_unit_test(names_need_not_be_utf8_nor_short),
        cmocka_unit_test(damage_behind_the_scans_is_only_told),
        cmocka_unit_test(every_truncation_is_an_error_or_fewer_points),
        cmocka_unit_test(no_flipped_bytes_do_harm),
    };
    e57_tools_init();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
