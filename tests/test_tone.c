#include "preprocess/tone.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>

#include <cmocka.h>

/* Of 1000 values from `first` on, `step` apart. */
static prep_tone make(double first, double step)
{
    double values[1000];
    for (int i = 0; i < 1000; i++)
        values[i] = first + i * step;
    return prep_tone_make(values, 1000);
}

static void the_range_is_stretched_between_the_outermost_half_percents(void **state)
{
    (void)state;
    prep_tone tone = make(100, 1);
    assert_false(tone.is_flat);
    assert_int_equal(prep_tone_apply(&tone, 0), 0);
    assert_int_equal(prep_tone_apply(&tone, 105), 0);
    assert_int_equal(prep_tone_apply(&tone, 599.5), 128);
    assert_int_equal(prep_tone_apply(&tone, 1094), 255);
    assert_int_equal(prep_tone_apply(&tone, INFINITY), 255);
    assert_int_equal(prep_tone_apply(&tone, NAN), 0);
}

static void one_value_alone_is_bright(void **state)
{
    (void)state;
    prep_tone tone = make(7, 0);
    assert_true(tone.is_flat);
    assert_int_equal(prep_tone_apply(&tone, 7), 255);
}

static void many_at_once_are_shown_as_one_by_one(void **state)
{
    static uint16_t values[UINT16_MAX + 1];
    static uint8_t shown[UINT16_MAX + 1];
    const prep_tone tones[] = {make(0, 65),     make(300, 0.37), make(-2000, 4.1),
                               make(65000, 11), make(7, 0),      make(-9000, 1)};
    (void)state;
    for (uint32_t v = 0; v <= UINT16_MAX; v++)
        values[v] = (uint16_t)v;
    for (size_t t = 0; t < sizeof tones / sizeof tones[0]; t++) {
        prep_tone_apply_16(&tones[t], values, UINT16_MAX + 1, shown);
        for (uint32_t v = 0; v <= UINT16_MAX; v++)
            assert_int_equal(shown[v], prep_tone_apply(&tones[t], v));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_range_is_stretched_between_the_outermost_half_percents),
        cmocka_unit_test(one_value_alone_is_bright),
        cmocka_unit_test(many_at_once_are_shown_as_one_by_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
