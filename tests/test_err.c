/* One sentence, with its place. */
#include "tests/core_tools.h"

#include <errno.h>
#include <string.h>

static void text_names_file_and_place(void **state)
{
    mospt_err err;
    char text[256];
    (void)state;
    assert_false(mospt_err_set(&err, MOSPT_EFORMAT, mospt_at_byte("a.las", UINT64_C(18234000000)),
                               "claims %d bytes", 26));
    mospt_err_text(&err, text, sizeof text);
    assert_string_equal(text, "a.las: byte 18234000000: claims 26 bytes");
    mospt_err_set(&err, MOSPT_EFORMAT, mospt_at_line("a.xyz", 7), "is no number");
    mospt_err_text(&err, text, sizeof text);
    assert_string_equal(text, "a.xyz: line 7: is no number");
    mospt_err_set(&err, MOSPT_EINVAL, mospt_at_file("out"), "exists");
    mospt_err_text(&err, text, sizeof text);
    assert_string_equal(text, "out: exists");
    mospt_err_set(&err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
    mospt_err_text(&err, text, sizeof text);
    assert_string_equal(text, "stopped");
}

static void system_errors_carry_the_words_of_the_system(void **state)
{
    mospt_err err;
    (void)state;
    errno = ENOSPC;
    mospt_err_set(&err, MOSPT_EIO, mospt_at_file("f"), "cannot be written");
    assert_int_equal(err.sys_errno, ENOSPC);
    assert_non_null(strstr(err.message, strerror(ENOSPC)));
    errno = ENOSPC;
    mospt_err_set(&err, MOSPT_EFORMAT, mospt_at_file("f"), "is wrong");
    assert_int_equal(err.sys_errno, 0);
    assert_string_equal(err.message, "is wrong");
}

static void what_is_too_long_is_cut(void **state)
{
    mospt_err err;
    char name[5000], text[100], small[8];
    (void)state;
    memset(name, 'n', sizeof name);
    name[sizeof name - 1] = '\0';
    errno = EIO;
    mospt_err_set(&err, MOSPT_EIO, mospt_at_file(name), "%s", name);
    assert_int_equal(strlen(err.file), sizeof err.file - 1);
    assert_int_equal(strlen(err.message), sizeof err.message - 1);
    mospt_err_text(&err, text, sizeof text);
    assert_int_equal(strlen(text), sizeof text - 1);
    mospt_err_text(&err, small, sizeof small);
    assert_string_equal(small, "nnnnnnn");
}

static void details_may_be_unwanted(void **state)
{
    (void)state;
    assert_false(mospt_err_set(NULL, MOSPT_EIO, mospt_nowhere(), "x"));
    assert_false(mospt_err_nomem(NULL, 5));
}

static void no_memory_says_how_much(void **state)
{
    mospt_err err;
    (void)state;
    assert_false(mospt_err_nomem(&err, 12345));
    assert_int_equal(err.code, MOSPT_ENOMEM);
    assert_non_null(strstr(err.message, "12345"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(text_names_file_and_place),
        cmocka_unit_test(system_errors_carry_the_words_of_the_system),
        cmocka_unit_test(what_is_too_long_is_cut),
        cmocka_unit_test(details_may_be_unwanted),
        cmocka_unit_test(no_memory_says_how_much),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
