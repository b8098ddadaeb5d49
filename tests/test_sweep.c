/* The points that a cell size takes, while it shrinks and for a budget, against plain sums. */
#include "render/sweep.h"
#include "tests/core_tools.h"

#include <math.h>
#include <stdlib.h>

enum { LEVELS = 300 };

static void make_levels(rend_growth *levels, uint64_t *state)
{
    for (int i = 0; i < LEVELS; i++)
        levels[i] = (rend_growth){.begin = (float)exp2(24 * core_unit(state) - 20),
                                  .points = core_below(state, 5000)};
}

static double sum_at(const rend_growth *levels, double x)
{
    double sum = 0;
    for (int i = 0; i < LEVELS; i++) {
        double begin = (double)levels[i].begin;
        if (x > 4 * begin) sum += levels[i].points;
        else if (x > begin) sum += levels[i].points * (x / begin - 1) / 3;
    }
    return sum;
}

static void the_running_sum_is_the_sum(void **unused)
{
    (void)unused;
    uint64_t state = 1;
    rend_growth levels[LEVELS];
    rend_sweep *sweep = calloc(1, sizeof *sweep);
    assert_non_null(sweep);
    make_levels(levels, &state);
    for (; rend_sweep_end(sweep->bucket) < 100; rend_sweep_advance(sweep)) {
        double end = rend_sweep_end(sweep->bucket);
        for (int i = 0; i < LEVELS; i++)
            if (rend_sweep_bucket(levels[i].begin) == sweep->bucket)
                rend_sweep_add(sweep, levels[i]);
        assert_true(fabs(rend_sweep_points(sweep) - sum_at(levels, end)) < 0.01);
        assert_true(rend_sweep_begin(sweep->bucket) < end);
    }
    free(sweep);
}

static void every_budget_is_met_from_below(void **unused)
{
    (void)unused;
    uint64_t state = 2;
    rend_growth levels[LEVELS];
    for (int round = 0; round < 200; round++) {
        make_levels(levels, &state);
        double whole = sum_at(levels, 1000), budget = whole * core_unit(&state);
        double x = rend_sweep_solve(levels, LEVELS, budget, 1e-9, 1000);
        assert_true(sum_at(levels, x) <= budget * (1 + 1e-12));
        assert_true(sum_at(levels, x) >= budget * (1 - 2e-6));
        uint64_t drawn = 0;
        for (int i = 0; i < LEVELS; i++)
            drawn += rend_growth_at(levels[i], x);
        assert_true(drawn <= budget && drawn + LEVELS >= budget * (1 - 2e-6));
    }
    assert_true(rend_sweep_solve(levels, LEVELS, 1e9, 1e-9, 7) == 7);
    assert_true(rend_sweep_solve(levels, LEVELS, -1, 1e-9, 7) == 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_running_sum_is_the_sum),
        cmocka_unit_test(every_budget_is_met_from_below),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
