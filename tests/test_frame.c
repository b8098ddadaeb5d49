/* The grid of a site: its step, and what is too far away for it. */
#include "tests/core_tools.h"

#include "preprocess/frame.h"

#include <math.h>
#include <string.h>

enum { SAMPLES = 200 };

/* A measured scan whose points lie in a cube of `width` metres around `centre`, and one at `far` on
 * the x axis, if that is not 0. */
typedef struct {
    prep_source source;
    prep_source_scan scans[2];
    double samples[2][SAMPLES][3];
} site;

static void make_scan(site *s, uint32_t i, double centre, double width, double far, double step)
{
    uint64_t random = i + 1;
    prep_source_scan *scan = &s->scans[i];
    *scan = (prep_source_scan){.measured = true, .points = 1000, .sample_count = SAMPLES};
    scan->samples = s->samples[i];
    scan->info.step = step;
    for (int a = 0; a < 3; a++) {
        scan->info.low[a] = centre - width / 2, scan->info.high[a] = centre + width / 2;
        for (int k = 0; k < SAMPLES; k++)
            s->samples[i][k][a] = centre + width * (core_unit(&random) - 0.5);
    }
    if (far < scan->info.low[0] && far != 0) scan->info.low[0] = far;
    if (far > scan->info.high[0] && far != 0) scan->info.high[0] = far;
    s->source.scans = s->scans;
    s->source.scan_count = i + 1;
}

static double step_of(const site *s)
{
    mospt_grid grid;
    mospt_err err = {0};
    bool doubtful;
    CORE_NEED(prep_frame_grid(&s->source, &grid, &doubtful, &err));
    return grid.step;
}

static void floats_get_their_extent_over_2_to_the_30(void **state)
{
    static const double widths[] = {1e-3, 1, 100, 1e4, 1e5};
    (void)state;
    for (size_t k = 0; k < sizeof widths / sizeof widths[0]; k++) {
        site s = {.source = {0}};
        double low[3], high[3];
        make_scan(&s, 0, 0, widths[k], 0, 0);
        assert_true(step_of(&s) <= ldexp(widths[k], -30) && step_of(&s) > ldexp(widths[k], -31));
        assert_false(prep_frame_range(&s.source, low, high));
    }
}

static void las_keeps_its_step_also_beside_floats(void **state)
{
    (void)state;
    site s = {.source = {0}};
    make_scan(&s, 0, 500000, 300, 0, 0.001);
    assert_true(step_of(&s) == 0.001);
    make_scan(&s, 1, 500000, 300, 0, 0);
    assert_true(step_of(&s) <= ldexp(300, -30));
    assert_true(frexp(0.001 / step_of(&s), &(int){0}) == 0.5); /* a power of two */
}

static void a_stray_point_that_the_grid_holds_is_in_range(void **state)
{
    static const double far[] = {1e4, -1e4, 2e5};
    (void)state;
    for (size_t k = 0; k < sizeof far / sizeof far[0]; k++) {
        site s = {.source = {0}};
        double low[3], high[3];
        make_scan(&s, 0, 10, 100, far[k], 0);
        assert_false(prep_frame_range(&s.source, low, high));
        assert_true(step_of(&s) <= 0x1p-12);
    }
}

static void a_point_further_away_does_not_cost_the_others_their_resolution(void **state)
{
    static const double far[] = {1e6, -1e6, 1e9, -1e9, 1e14}, steps[] = {0, 0.001};
    (void)state;
    for (size_t k = 0; k < sizeof far / sizeof far[0]; k++)
        for (int las = 0; las < 2; las++) {
            site s = {.source = {0}};
            double low[3], high[3];
            if (las && fabs(far[k]) < 1e7) continue; /* steps of a millimetre reach that far */
            make_scan(&s, 0, 500, 100, 0, steps[las]);
            make_scan(&s, 1, 500, 100, far[k], steps[las]);
            assert_true(prep_frame_range(&s.source, low, high));
            for (int a = 0; a < 3; a++) {
                assert_true(low[a] < 450 - 2e5 && high[a] > 550 + 2e5);
                assert_true(low[a] > -2e6 && high[a] < 2e6);
            }
            s.source.options.has_range = true; /* and then no more is cut off */
            assert_false(prep_frame_range(&s.source, low, high));
        }
}

static void a_large_site_is_no_stray(void **state)
{
    (void)state;
    double low[3], high[3];
    site s = {.source = {0}};
    make_scan(&s, 0, 0, 100, 0, 0);
    make_scan(&s, 1, 3e6, 100, 0, 0); /* half of all points is over there */
    assert_false(prep_frame_range(&s.source, low, high));
    make_scan(&s, 0, 0, 1e7, 0, 0);
    assert_false(prep_frame_range(&s.source, low, high));
}

static void bounds_that_were_not_measured_are_doubted(void **state)
{
    (void)state;
    for (int measured = 0; measured < 2; measured++) {
        site s = {.source = {0}};
        mospt_grid grid;
        mospt_err err = {0};
        bool doubtful;
        double low[3], high[3];
        make_scan(&s, 0, 0, 100, 1e9, 0);
        s.scans[0].measured = measured;
        CORE_NEED(prep_frame_grid(&s.source, &grid, &doubtful, &err));
        assert_int_equal(doubtful, !measured);
        assert_int_equal(prep_frame_range(&s.source, low, high), measured);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(floats_get_their_extent_over_2_to_the_30),
        cmocka_unit_test(las_keeps_its_step_also_beside_floats),
        cmocka_unit_test(a_stray_point_that_the_grid_holds_is_in_range),
        cmocka_unit_test(a_point_further_away_does_not_cost_the_others_their_resolution),
        cmocka_unit_test(a_large_site_is_no_stray),
        cmocka_unit_test(bounds_that_were_not_measured_are_doubted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
