/* World to grid and back: LAS bit for bit, everything else within half a step. */
#include "tests/core_tools.h"

#include <math.h>
#include <unistd.h>

static void las_positions_come_back_bit_for_bit(void **state)
{
    static const double scales[] = {0.001, 0.01,    0.1,     1,      0.0001, 1e-6,
                                    1e-7,  0.00025, 1.0 / 3, 0.0005, 0.3048};
    static const double offsets[] = {0,   0.5,  100,   -123456.789, 500000, 5e6,
                                     1e7, -1e7, 0.001, 2600000.123, 1e9};
    uint64_t random = 11;
    (void)state;
    for (size_t s = 0; s < sizeof scales / sizeof scales[0]; s++)
        for (size_t o = 0; o < sizeof offsets / sizeof offsets[0]; o++)
            for (int spread = 2; spread <= 31; spread++) {
                const double offset[3] = {offsets[o], -offsets[o], offsets[(o + 1) % 11]};
                int32_t raw[60][3];
                double low[3] = {INFINITY, INFINITY, INFINITY},
                       high[3] = {-INFINITY, -INFINITY, -INFINITY}, world[60][3];
                mospt_grid grid;
                mospt_err err = {0};
                for (int i = 0; i < 60; i++)
                    for (int a = 0; a < 3; a++) {
                        int64_t centre = (int64_t)core_below(&random, 2) * 1000000 - 500000,
                                half = INT64_C(1) << (spread - 1);
                        raw[i][a] =
                            (int32_t)((spread < 30 ? centre : 0) +
                                      (int64_t)(core_random(&random) % (uint64_t)(2 * half)) -
                                      half);
                        world[i][a] = raw[i][a] * scales[s] + offset[a];
                        low[a] = fmin(low[a], world[i][a]), high[a] = fmax(high[a], world[i][a]);
                    }
                CORE_NEED(mospt_grid_make(low, high, scales[s], offset, &grid, &err));
                assert_true(mospt_grid_is_valid(&grid));
                assert_true(grid.step == scales[s]);
                for (int i = 0; i < 60; i++) {
                    uint32_t g[3];
                    double back[3];
                    assert_true(mospt_grid_from_world(&grid, world[i], g));
                    mospt_grid_to_world(&grid, g, back);
                    for (int a = 0; a < 3; a++) {
                        if (back[a] != world[i][a])
                            fail_msg("scale %g offset %g raw %d: %.17g came back as %.17g",
                                     scales[s], offset[a], raw[i][a], world[i][a], back[a]);
                        /* ... and so do the integers, unless a double is coarser than they are. */
                        if (fabs(world[i][a]) * 0x1p-51 < scales[s])
                            assert_true((int64_t)g[a] + grid.base[a] == raw[i][a]);
                    }
                }
            }
}

static void positions_are_never_off_by_more_than_half_a_step(void **state)
{
    static const double places[] = {0, 1, 1000, 1e7, -1e7, 1e12, 5e-9};
    uint64_t random = 12;
    (void)state;
    for (size_t p = 0; p < sizeof places / sizeof places[0]; p++)
        for (int exponent = -12; exponent <= 9; exponent++) {
            double extent = pow(10, exponent) * (1 + core_unit(&random)), low[3], high[3];
            mospt_grid grid;
            mospt_err err = {0};
            for (int a = 0; a < 3; a++)
                low[a] = places[p] + a, high[a] = low[a] + extent;
            CORE_NEED(mospt_grid_make(low, high, 0, NULL, &grid, &err));
            assert_true(mospt_grid_is_valid(&grid));
            assert_true(grid.bits <= 32);
            for (int i = 0; i < 300; i++) {
                uint32_t g[3];
                double world[3];
                for (int a = 0; a < 3; a++)
                    world[a] = i < 2 ? (i ? high : low)[a]
                                     : low[a] + core_unit(&random) * (high[a] - low[a]);
                assert_true(mospt_grid_from_world(&grid, world, g));
                for (int a = 0; a < 3; a++)
                    assert_true(fabs(mospt_grid_axis_to_world(&grid, a, g[a]) - world[a]) <=
                                grid.step / 2);
            }
        }
}

static void step_of_floating_point_sites_is_at_most_the_extent_over_2_to_the_30(void **state)
{
    uint64_t random = 13;
    (void)state;
    for (int i = 0; i < 2000; i++) {
        double extent =
                   ldexp(1 + (i % 3 ? core_unit(&random) : 0), (int)core_below(&random, 40) - 20),
               low[3], high[3];
        mospt_grid grid;
        mospt_err err = {0};
        for (int a = 0; a < 3; a++)
            low[a] = core_unit(&random) - 0.5,
            high[a] = low[a] + extent * (a == i % 3 ? 1 : core_unit(&random));
        CORE_NEED(mospt_grid_make(low, high, 0, NULL, &grid, &err));
        double widest = fmax(fmax(high[0] - low[0], high[1] - low[1]), high[2] - low[2]);
        if (widest > 1e-6) assert_true(grid.step <= ldexp(widest, -30) && grid.bits <= 32);
        assert_true(frexp(grid.step, &(int){0}) ==
                    0.5); /* a power of two: arithmetic with it is exact */
    }
}

static void grid_positions_survive_the_way_to_the_world_and_back(void **state)
{
    uint64_t random = 14;
    (void)state;
    for (uint32_t bits = 0; bits <= 32; bits++)
        for (int i = 0; i < 200; i++) {
            mospt_grid grid = {.offset = {1e5, -7, 0},
                               .base = {-12345678901, 0, 999},
                               .step = i % 2 ? 0.001 : 0x1p-10,
                               .bits = bits};
            uint32_t g[3], back[3];
            double world[3];
            for (int a = 0; a < 3; a++) {
                grid.root[a] = bits < 32 ? (UINT32_C(1) << bits) : 0;
                g[a] = grid.root[a] + (bits < 32 ? core_below(&random, UINT32_C(1) << bits)
                                                 : (uint32_t)core_random(&random));
            }
            assert_true(mospt_grid_is_valid(&grid));
            mospt_grid_to_world(&grid, g, world);
            assert_true(mospt_grid_from_world(&grid, world, back));
            assert_memory_equal(g, back, sizeof g);
        }
}

static void what_lies_outside_the_root_cube_is_refused(void **state)
{
    const double low[3] = {10, 20, 30}, high[3] = {14, 24, 31};
    mospt_grid grid;
    mospt_err err = {0};
    uint32_t g[3];
    (void)state;
    CORE_NEED(mospt_grid_make(low, high, 0.001, NULL, &grid, &err));
    assert_true(mospt_grid_from_world(&grid, low, g));
    assert_true(mospt_grid_from_world(&grid, high, g));
    for (int a = 0; a < 3; a++) {
        static const double far[] = {-1, 0, 1e3, -1e300, 1e300};
        double world[3] = {11, 21, 30.5};
        for (int k = 0; k < 5; k++) {
            world[a] = far[k];
            assert_false(mospt_grid_from_world(&grid, world, g));
        }
        world[a] = NAN;
        assert_false(mospt_grid_from_world(&grid, world, g));
        world[a] = INFINITY;
        assert_false(mospt_grid_from_world(&grid, world, g));
    }
    /* The first step outside, on either side. */
    double width = ldexp(grid.step, (int)grid.bits),
           corner = mospt_grid_axis_to_world(&grid, 0, grid.root[0]);
    assert_true(mospt_grid_from_world(&grid, (double[3]){corner, 21, 30.5}, g));
    assert_false(mospt_grid_from_world(&grid, (double[3]){corner - grid.step, 21, 30.5}, g));
    assert_true(mospt_grid_from_world(&grid, (double[3]){corner + width - grid.step, 21, 30.5}, g));
    assert_false(mospt_grid_from_world(&grid, (double[3]){corner + width, 21, 30.5}, g));
}

static void bounds_that_are_no_range_are_refused(void **state)
{
    const double low[3] = {0, 0, 0};
    mospt_grid grid;
    mospt_err err = {0};
    (void)state;
    for (int a = 0; a < 3; a++) {
        static const double bad[] = {NAN, INFINITY, -1};
        for (int k = 0; k < 3; k++) {
            double high[3] = {1, 1, 1};
            high[a] = bad[k];
            CORE_FAILS(mospt_grid_make(low, high, 0.001, NULL, &grid, &err), MOSPT_EINVAL);
        }
    }
    /* Too far from zero for the step. */
    CORE_FAILS(
        mospt_grid_make((double[3]){1e15, 0, 0}, (double[3]){1e15, 0, 0}, 1e-9, NULL, &grid, &err),
        MOSPT_EINVAL);
}

static void a_step_too_fine_for_the_extent_is_doubled(void **state)
{
    mospt_grid grid;
    mospt_err err = {0};
    uint32_t g[3];
    const double low[3] = {-1e7, 0, 0}, high[3] = {1e7, 1, 1};
    (void)state;
    CORE_NEED(mospt_grid_make(low, high, 0.001, NULL, &grid, &err));
    assert_true(grid.step == 0.008);
    assert_true(mospt_grid_is_valid(&grid));
    assert_true(mospt_grid_from_world(&grid, low, g) && mospt_grid_from_world(&grid, high, g));
}

static void a_single_position_gets_a_grid(void **state)
{
    static const double places[] = {0, 1, 1e7, -1e12, 1e-300, 0.1, 1e15};
    (void)state;
    for (size_t k = 0; k < sizeof places / sizeof places[0]; k++)
        for (int with_step = 0; with_step < 2; with_step++) {
            const double at[3] = {places[k], 0, -places[k]};
            mospt_grid grid;
            mospt_err err = {0};
            uint32_t g[3];
            CORE_NEED(mospt_grid_make(at, at, with_step ? 0.001 : 0, NULL, &grid, &err));
            assert_true(mospt_grid_is_valid(&grid));
            assert_true(mospt_grid_from_world(&grid, at, g));
        }
}

static void whatever_is_made_is_valid_and_holds_its_bounds(void **state)
{
    uint64_t random = 15;
    uint32_t made = 0;
    (void)state;
    alarm(60);
    for (int i = 0; i < 200000; i++) {
        double low[3], high[3], offset[3],
            step = core_below(&random, 3)
                       ? ldexp(core_unit(&random), (int)core_below(&random, 80) - 60)
                       : 0;
        mospt_grid grid;
        uint32_t g[3];
        for (int a = 0; a < 3; a++) {
            int size = (int)core_below(&random, i % 50 ? 120 : 2040) - (i % 50 ? 60 : 1020);
            low[a] = ldexp(core_unit(&random) - 0.5, size);
            high[a] = low[a] + ldexp(core_unit(&random), size - (int)core_below(&random, 60));
            offset[a] = core_below(&random, 2)
                            ? ldexp(core_unit(&random) - 0.5, (int)core_below(&random, 50))
                            : 0;
        }
        mospt_err err = {0};
        if (!mospt_grid_make(low, high, step, offset, &grid, &err)) {
            assert_int_equal(err.code, MOSPT_EINVAL);
            continue;
        }
        made++;
        if (!mospt_grid_is_valid(&grid)) fail_msg("case %d is not valid", i);
        if (!mospt_grid_from_world(&grid, low, g)) fail_msg("case %d: low is outside", i);
        if (!mospt_grid_from_world(&grid, high, g)) fail_msg("case %d: high is outside", i);
    }
    assert_true(made > 50000);
    alarm(0);
}

static void bounds_wider_than_a_double_are_refused(void **state)
{
    const double low[3] = {-1.5e308, 0, 0}, high[3] = {1.5e308, 1, 1};
    mospt_grid grid;
    mospt_err err = {0};
    (void)state;
    alarm(20);
    CORE_FAILS(mospt_grid_make(low, high, 0.001, NULL, &grid, &err), MOSPT_EINVAL);
    CORE_FAILS(mospt_grid_make(low, high, 0, NULL, &grid, &err), MOSPT_EINVAL);
    alarm(0);
}

static void every_field_out_of_range_is_not_valid(void **state)
{
    const mospt_grid good = {
        .step = 0.001, .bits = 20, .root = {0x500000, 0x500000, 0x500000}, .base = {-1, -2, -3}};
    (void)state;
    mospt_grid g = good;
    assert_true(mospt_grid_is_valid(&g));
    static const double steps[] = {0, -1, NAN, INFINITY};
    for (int k = 0; k < 4; k++)
        g = good, g.step = steps[k], assert_false(mospt_grid_is_valid(&g));
    g = good, g.bits = 33, assert_false(mospt_grid_is_valid(&g));
    g = good, g.bits = UINT32_MAX, assert_false(mospt_grid_is_valid(&g));
    for (int a = 0; a < 3; a++) {
        g = good, g.offset[a] = NAN, assert_false(mospt_grid_is_valid(&g));
        g = good, g.base[a] = INT64_MAX, assert_false(mospt_grid_is_valid(&g));
        g = good, g.base[a] = INT64_MIN, assert_false(mospt_grid_is_valid(&g));
        g = good, g.root[a]++, assert_false(mospt_grid_is_valid(&g));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(las_positions_come_back_bit_for_bit),
        cmocka_unit_test(positions_are_never_off_by_more_than_half_a_step),
        cmocka_unit_test(step_of_floating_point_sites_is_at_most_the_extent_over_2_to_the_30),
        cmocka_unit_test(grid_positions_survive_the_way_to_the_world_and_back),
        cmocka_unit_test(what_lies_outside_the_root_cube_is_refused),
        cmocka_unit_test(bounds_that_are_no_range_are_refused),
        cmocka_unit_test(a_step_too_fine_for_the_extent_is_doubled),
        cmocka_unit_test(a_single_position_gets_a_grid),
        cmocka_unit_test(whatever_is_made_is_valid_and_holds_its_bounds),
        cmocka_unit_test(bounds_wider_than_a_double_are_refused),
        cmocka_unit_test(every_field_out_of_range_is_not_valid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
