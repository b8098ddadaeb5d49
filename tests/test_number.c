#include "preprocess/number.h"
#include "tests/scan_points.h"

#include <locale.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static void check(const char *text)
{
    char *stop;
    double expected = strtod(text, &stop), value = -12345;
    const char *end = prep_number_parse(text, text + strlen(text), &value);
    if (end != stop) fail_msg("`%s`: stops at %td, strtod at %td", text, end - text, stop - text);
    if (memcmp(&value, &expected, sizeof value) != 0)
        fail_msg("`%s`: %.17g, strtod says %.17g", text, value, expected);
}

static void known_numbers_are_as_strtod_reads_them(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "0",
        "-0",
        "+0",
        "1",
        "-1",
        "+1",
        ".5",
        "5.",
        "-.5",
        "0.1",
        "1e5",
        "1E-5",
        "1e+5",
        "123456789012345678",
        "1e22",
        "1e23",
        "1e-22",
        "1e-23",
        "9007199254740991",
        "9007199254740992",
        "9007199254740993",
        "9007199254740993.0",
        "18446744073709551615",
        "18446744073709551616",
        "99999999999999999999999",
        "4.9e-324",
        "2.2250738585072014e-308",
        "1.7976931348623157e308",
        "1e309",
        "-1e309",
        "1e-400",
        "1e99999999",
        "471.39",
        "6143496.73",
        "0.000000000000000000000000000001",
        "00000000000000000000012.5",
        "3.141592653589793238462643383279502884197",
        "1e",
        "1e+",
        "1ex",
        "1.5.2",
        "7,5",
        "1 2",
        "0x",
        "1e5e5",
        "100000000000000000000000000000000000000000000000000000000000e-60",
        "8.5e-7",
        "512345.12345678901234",
        "0.00000000000000000000000000000",
        "-0.0000000000000000000e77",
        "9999999999999999999",
        "9999999999999999999.9e-27",
        "9007199254740993e-27",
        "9007199254740993e27",
        "1000000000000000000000000001e-27",
        "9223372036854775808",
        "9223372036854776832",
        "9223372036854776833",
        "18446744073709550591.99999999999999",
        "000000000000000000000000000000000000123.4567890123456789012345",
        "1630577758.569490"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        check(texts[i]);
}

static void random_numbers_are_as_strtod_reads_them(void **state)
{
    (void)state;
    uint64_t seed = 7;
    char text[128];
    for (int i = 0; i < 1000000; i++) {
        uint64_t bits = (uint64_t)scan_points_random(&seed) << 33 ^
                        (uint64_t)scan_points_random(&seed) << 11 ^ scan_points_random(&seed);
        double value;
        memcpy(&value, &bits, sizeof value);
        if (!isfinite(value)) continue;
        int digits = (int)(scan_points_random(&seed) % 22);
        double small = (double)(int64_t)bits / (double)(1ull << (scan_points_random(&seed) % 63));
        switch (i % 4) {
        case 0:
            snprintf(text, sizeof text, "%.*g", digits, value);
            break;
        case 1:
            snprintf(text, sizeof text, "%.*f", digits % 10, small);
            break;
        case 2:
            snprintf(text, sizeof text, "%.*e", digits, small);
            break;
        default:
            snprintf(text, sizeof text, "%llu.%ue%d", (unsigned long long)(bits >> (bits % 64)),
                     scan_points_random(&seed) % 100000,
                     (int)(scan_points_random(&seed) % 60) - 30);
        }
        check(text);
    }
}

/* `count` digits with a point somewhere among them, or before or behind all. */
static size_t write_digits(uint64_t *seed, int count, char *out)
{
    int point = (int)(scan_points_random(seed) % (uint32_t)(count + 4)) - 2;
    size_t n = 0;
    if (scan_points_random(seed) % 8 == 0) out[n++] = '-';
    if (point <= 0) n += (size_t)sprintf(out + n, "0.%.*s", -point, "00");
    for (int i = 0; i < count; i++) {
        if (i == point && i > 0) out[n++] = '.';
        out[n++] = (char)('0' + scan_points_random(seed) % 10);
    }
    out[n] = '\0';
    return n;
}

static void numbers_with_many_digits_are_as_strtod_reads_them(void **state)
{
    (void)state;
    uint64_t seed = 11;
    char text[128];
    for (int i = 0; i < 4000000; i++) {
        size_t n = write_digits(&seed, 15 + (int)(scan_points_random(&seed) % 11), text);
        if (i % 4 == 0) sprintf(text + n, "e%d", (int)(scan_points_random(&seed) % 80) - 45);
        check(text);
    }
}

/* Halfway between two doubles, and a last digit above or below: what a shortcut gets wrong first.
 */
static void halves_are_as_strtod_reads_them(void **state)
{
    (void)state;
    uint64_t seed = 13;
    char text[256];
    for (int i = 0; i < 300000; i++) {
        uint64_t bits = (uint64_t)scan_points_random(&seed) << 33 ^
                        (uint64_t)scan_points_random(&seed) << 11 ^ scan_points_random(&seed);
        int shift = (int)(scan_points_random(&seed) % 110) - 60;
        uint64_t odd =
            (bits >> 10 | 1ull << 53 | 1) & ((1ull << 54) - 1); /* 54 bits, the last set */
        long double half = ldexpl((long double)odd, -shift);
        int n = snprintf(text, sizeof text, "%.*Lf", shift > 0 ? shift : 0, half);
        check(text);
        if (shift <= 0) continue;
        text[n - 1]++; /* it was 5 */
        check(text);
        text[n - 1] = '4';
        check(text);
        snprintf(text + n, sizeof text - (size_t)n, "99999");
        check(text);
        snprintf(text, sizeof text, "%.*Lf00000000001", shift, half);
        check(text);
    }
}

static void what_is_no_number_is_named(void **state)
{
    (void)state;
    static const char *const nans[] = {"nan",       "NaN",     "-nan",    "NAN",     "nan(ind)",
                                       "-nan(ind)", "1.#QNAN", "-1.#IND", "1.#IND00"};
    static const char *const infs[] = {"inf", "Inf", "INFINITY", "1.#INF", "1.#INF00"};
    double value;
    for (size_t i = 0; i < sizeof nans / sizeof nans[0]; i++) {
        value = 0;
        assert_ptr_equal(prep_number_parse(nans[i], nans[i] + strlen(nans[i]), &value),
                         nans[i] + strlen(nans[i]));
        assert_true(isnan(value));
    }
    for (size_t i = 0; i < sizeof infs / sizeof infs[0]; i++) {
        value = 0;
        assert_ptr_equal(prep_number_parse(infs[i], infs[i] + strlen(infs[i]), &value),
                         infs[i] + strlen(infs[i]));
        assert_true(isinf(value) && value > 0);
    }
    value = 0;
    assert_non_null(prep_number_parse("-inf", &"-inf"[4], &value));
    assert_true(isinf(value) && value < 0);
}

static void other_text_is_refused(void **state)
{
    (void)state;
    static const char *const texts[] = {"",   "-", "+",   ".",  "-.", "e5", "x",
                                        " 1", ",", "--1", "na", "i",  "#",  "-e"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        double value = 42;
        assert_null(prep_number_parse(texts[i], texts[i] + strlen(texts[i]), &value));
        assert_true(value == 42);
    }
}

static void nothing_behind_the_end_is_read(void **state)
{
    (void)state;
    static const char text[] = "-123.456e-7";
    for (size_t n = 0; n <= sizeof text - 1; n++) {
        char *copy = malloc(n > 0 ? n : 1); /* the sanitizer watches its end */
        memcpy(copy, text, n);
        double value;
        const char *stop = prep_number_parse(copy, copy + n, &value);
        assert_true(stop == NULL || stop <= copy + n);
        free(copy);
    }
}

static void endless_numbers_are_refused(void **state)
{
    (void)state;
    char text[2000];
    memset(text, '7', sizeof text);
    double value;
    assert_null(prep_number_parse(text, text + sizeof text, &value));
}

static void the_locale_makes_no_difference(void **state)
{
    (void)state;
    static const char *const locales[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "de_DE"};
    size_t i = 0;
    while (i < 4 && setlocale(LC_NUMERIC, locales[i]) == NULL)
        i++;
    double value = 0;
    const char *text = "3.14159265358979323846";
    assert_ptr_equal(prep_number_parse(text, text + strlen(text), &value), text + strlen(text));
    setlocale(LC_NUMERIC, "C");
    assert_true(value == 3.14159265358979323846);
    if (i == 4) {
        print_message("no locale with decimal commas is installed\n");
        skip();
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_numbers_are_as_strtod_reads_them),
        cmocka_unit_test(random_numbers_are_as_strtod_reads_them),
        cmocka_unit_test(numbers_with_many_digits_are_as_strtod_reads_them),
        cmocka_unit_test(halves_are_as_strtod_reads_them),
        cmocka_unit_test(what_is_no_number_is_named),
        cmocka_unit_test(other_text_is_refused),
        cmocka_unit_test(nothing_behind_the_end_is_read),
        cmocka_unit_test(endless_numbers_are_refused),
        cmocka_unit_test(the_locale_makes_no_difference),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
