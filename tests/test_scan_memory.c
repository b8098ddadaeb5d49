#include "preprocess/scan_memory.h"
#include "tests/scan_points.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static void free_number(void *index)
{
    free(index);
}

/* For another reader's knowledge. */
static void free_other(void *index)
{
    free(index);
}

static int *make_number(int value)
{
    int *number = malloc(sizeof *number);
    assert_non_null(number);
    *number = value;
    return number;
}

static prep_input *open_file(const char *name, const char *text)
{
    prep_input *input;
    mospt_err err;
    if (!prep_input_open(scan_points_file(name, text, strlen(text)), &input, &err))
        fail_msg("%s", err.message);
    return input;
}

static void the_last_file_is_remembered(void **state)
{
    (void)state;
    prep_scan_memory *memory;
    prep_input *a = open_file("a", "12345"), *b = open_file("b", "12345");
    assert_true(prep_scan_memory_create(&memory, NULL));
    assert_null(prep_scan_memory_recall(memory, a, free_number));
    prep_scan_memory_keep(memory, a, make_number(1), free_number);
    const int *known = prep_scan_memory_recall(memory, a, free_number);
    assert_int_equal(*known, 1);
    assert_null(prep_scan_memory_recall(memory, b, free_number));
    prep_scan_memory_keep(memory, b, make_number(2), free_number);
    known = prep_scan_memory_recall(memory, b, free_number);
    assert_int_equal(*known, 2);
    assert_null(prep_scan_memory_recall(memory, a, free_number));
    prep_input_close(a);
    prep_input_close(b);
    prep_scan_memory_destroy(memory);
}

static void a_file_that_grew_is_another_one(void **state)
{
    (void)state;
    prep_scan_memory *memory;
    prep_input *input = open_file("a", "12345");
    assert_true(prep_scan_memory_create(&memory, NULL));
    prep_scan_memory_keep(memory, input, make_number(1), free_number);
    prep_input_close(input);
    input = open_file("a", "123456");
    assert_null(prep_scan_memory_recall(memory, input, free_number));
    prep_input_close(input);
    prep_scan_memory_destroy(memory);
}

static void readers_do_not_get_what_others_kept(void **state)
{
    (void)state;
    prep_scan_memory *memory;
    prep_input *input = open_file("a", "12345");
    assert_true(prep_scan_memory_create(&memory, NULL));
    prep_scan_memory_keep(memory, input, make_number(1), free_number);
    assert_null(prep_scan_memory_recall(memory, input, free_other));
    prep_input_close(input);
    prep_scan_memory_destroy(memory);
}

/* A leak would be found by the sanitizers. */
static void without_a_memory_nothing_is_kept(void **state)
{
    (void)state;
    prep_input *input = open_file("a", "12345");
    prep_scan_memory_keep(NULL, input, make_number(1), free_number);
    assert_null(prep_scan_memory_recall(NULL, input, free_number));
    prep_scan_memory_destroy(NULL);
    prep_input_close(input);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_last_file_is_remembered),
        cmocka_unit_test(a_file_that_grew_is_another_one),
        cmocka_unit_test(readers_do_not_get_what_others_kept),
        cmocka_unit_test(without_a_memory_nothing_is_kept),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
