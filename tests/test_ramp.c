#include "render/ramp.h"
#include "render/asprs.h"
#include "tests/core_tools.h"

#include <math.h>
#include <stdlib.h>

static double brightness(const uint8_t rgb[3])
{
    return 0.2126 * pow(rgb[0] / 255.0, 2.2) + 0.7152 * pow(rgb[1] / 255.0, 2.2) +
           0.0722 * pow(rgb[2] / 255.0, 2.2);
}

static double difference(const uint8_t a[3], const uint8_t b[3])
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

static void names_lead_to_maps_and_back(void **unused)
{
    (void)unused;
    rend_map map;
    for (int m = REND_MAP_USUAL + 1; m < REND_MAP_COUNT; m++) {
        assert_true(rend_ramp_from_name(rend_ramp_name((rend_map)m), &map));
        assert_int_equal(map, m);
    }
    assert_null(rend_ramp_name(REND_MAP_USUAL));
    assert_false(rend_ramp_from_name("rainbow", &map));
    assert_false(rend_ramp_from_name("", &map));
}

static void maps_are_smooth(void **unused)
{
    (void)unused;
    for (int m = REND_MAP_USUAL + 1; m < REND_MAP_COUNT; m++) {
        rend_ramp ramp;
        rend_ramp_fill((rend_map)m, &ramp);
        for (int i = 1; i < REND_RAMP_STEPS; i++)
            assert_true(difference(ramp.rgb[i - 1], ramp.rgb[i]) < 8);
        assert_true(difference(ramp.rgb[0], ramp.rgb[REND_RAMP_STEPS - 1]) > 100);
    }
}

/* What is printed in grey must still say which value is higher. */
static void even_maps_grow_brighter_throughout(void **unused)
{
    (void)unused;
    const rend_map maps[] = {REND_MAP_VIRIDIS, REND_MAP_INFERNO, REND_MAP_GREY};
    for (size_t m = 0; m < sizeof maps / sizeof *maps; m++) {
        rend_ramp ramp;
        rend_ramp_fill(maps[m], &ramp);
        for (int i = 4; i < REND_RAMP_STEPS; i++)
            assert_true(brightness(ramp.rgb[i]) > brightness(ramp.rgb[i - 4]));
    }
}

static void grey_shows_bytes_as_they_are(void **unused)
{
    (void)unused;
    rend_ramp ramp;
    rend_ramp_fill(REND_MAP_GREY, &ramp);
    for (int i = 0; i < REND_RAMP_STEPS; i++)
        for (int c = 0; c < 3; c++)
            assert_true(abs(ramp.rgb[i][c] - i) <= 1);
}

static void a_curve_scales_and_bends(void **unused)
{
    (void)unused;
    rend_ramp ramp;
    rend_ramp_curve(1, 1, &ramp);
    for (int i = 0; i < REND_RAMP_STEPS; i++)
        assert_int_equal(ramp.rgb[i][1], i);
    rend_ramp_curve(0.5, 1, &ramp);
    assert_int_equal(ramp.rgb[200][0], 100);
    rend_ramp_curve(1, 2, &ramp);
    assert_int_equal(ramp.rgb[0][2], 0);
    assert_int_equal(ramp.rgb[64][2], 128); /* a quarter becomes a half */
    assert_int_equal(ramp.rgb[255][2], 255);
    rend_ramp_curve(100, 1, &ramp);
    assert_int_equal(ramp.rgb[3][0], 255);
}

static void the_first_hues_are_far_apart(void **unused)
{
    (void)unused;
    uint8_t hues[12][3];
    for (uint32_t i = 0; i < 12; i++) {
        rend_ramp_hue(i, hues[i]);
        assert_true(brightness(hues[i]) > 0.1); /* eye-dome lighting has something to darken */
        for (uint32_t k = 0; k < i; k++)
            assert_true(difference(hues[i], hues[k]) > (i < 8 ? 55 : 30));
    }
}

static void classes_have_names_and_different_colours(void **unused)
{
    (void)unused;
    assert_string_equal(rend_asprs_name(2), "ground");
    assert_string_equal(rend_asprs_name(6), "building");
    assert_null(rend_asprs_name(23));
    assert_null(rend_asprs_name(64));
    assert_null(rend_asprs_name(UINT32_MAX));
    for (uint32_t a = 0; a < 23; a++)
        for (uint32_t b = 0; b < a; b++) {
            uint8_t x[3], y[3];
            rend_asprs_colour(a, x);
            rend_asprs_colour(b, y);
            assert_true(difference(x, y) > 25);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_lead_to_maps_and_back),
        cmocka_unit_test(maps_are_smooth),
        cmocka_unit_test(even_maps_grow_brighter_throughout),
        cmocka_unit_test(grey_shows_bytes_as_they_are),
        cmocka_unit_test(a_curve_scales_and_bends),
        cmocka_unit_test(the_first_hues_are_far_apart),
        cmocka_unit_test(classes_have_names_and_different_colours),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
