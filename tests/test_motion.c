#include "render/motion.h"
#include "tests/core_tools.h"

#include <math.h>

static rend_motion start(void)
{
    rend_motion m;
    rend_motion_init(&m, 30);
    return m;
}

static rend_view_of view_of(double x, uint64_t budget_points)
{
    return (rend_view_of){.camera = {.eye = {x, 2, 3}, .target = {x, 9, 3}, .up = {0, 0, 1}},
                          .budget_points = budget_points};
}

/* What the next frame may draw of all points, at rest. */
static uint64_t rest_budget(rend_motion *m)
{
    rend_view_of view = view_of(0, REND_ALL);
    rend_allowance allowed;
    assert_true(rend_motion_plan(m, false, 50, &view, &allowed));
    assert_int_equal(allowed.points, rend_pace_points(&m->pace)); /* in as many parts as it takes */
    assert_int_equal(allowed.upload_bytes, rend_pace_bytes(&m->pace));
    assert_null(allowed.ahead);
    return view.budget_points;
}

/* The picture at rest is done, and spent its budget. */
static bool grow(rend_motion *m, uint64_t budget_points)
{
    const rend_figures spent = {.budget_spent = true};
    return rend_motion_grow(m, &spent, budget_points);
}

static void a_camera_rests_shortly_after_it_was_touched(void **unused)
{
    (void)unused;
    rend_motion m = start();
    assert_true(rend_motion_wait(&m, 10) < 0);
    assert_false(rend_motion_settle(&m, false, 10));
    rend_motion_touch(&m, 10);
    rend_motion_touch(&m, 10.1);
    assert_true(fabs(rend_motion_wait(&m, 10.2) - 0.1) < 1e-9);
    assert_false(rend_motion_settle(&m, false, 10.29));
    assert_true(rend_motion_wait(&m, 10.29) > 0);
    assert_true(rend_motion_wait(&m, 12) > 0); /* due, but nobody has asked */
    assert_true(rend_motion_settle(&m, false, 10.31));
    assert_true(rend_motion_wait(&m, 10.31) < 0);
    assert_false(rend_motion_settle(&m, false, 10.4)); /* only once */
    rend_motion_touch(&m, 11);
    assert_true(rend_motion_settle(&m, false, 12));
}

static void a_hand_that_holds_still_is_waited_for_but_not_for_ever(void **unused)
{
    (void)unused;
    rend_motion m = start();
    rend_motion_touch(&m, 10);
    assert_false(rend_motion_settle(&m, true, 10.3));
    rend_motion_touch(&m, 10.4);
    assert_false(rend_motion_settle(&m, true, 10.9));
    assert_true(rend_motion_settle(&m, true, 11.1));
}

static void a_moving_frame_is_as_much_as_fits(void **unused)
{
    (void)unused;
    rend_motion m = start();
    rend_allowance allowed;
    uint64_t fits = rend_pace_points(&m.pace);
    const uint64_t budgets[] = {1, fits - 1, fits, fits + 1, REND_ALL};
    rend_motion_touch(&m, 10);
    for (int i = 0; i < 5; i++) {
        rend_view_of view = view_of(0, budgets[i]);
        assert_false(rend_motion_plan(&m, false, 10.1, &view, &allowed));
        assert_int_equal(view.budget_points, budgets[i] < fits ? budgets[i] : fits);
        assert_int_equal(allowed.points, 0); /* in one part */
        assert_int_equal(allowed.upload_bytes, rend_pace_bytes(&m.pace));
    }
}

static void the_last_frame_is_whole_whether_it_moves_or_rests(void **unused)
{
    (void)unused;
    rend_motion m = start();
    rend_allowance allowed;
    for (int moves = 0; moves < 2; moves++) {
        rend_view_of view = view_of(0, REND_ALL);
        if (moves) rend_motion_touch(&m, 10);
        assert_false(rend_motion_plan(&m, true, 10.1, &view, &allowed));
        assert_true(view.budget_points == REND_ALL && allowed.points == 0);
        assert_null(allowed.ahead);
    }
}

static void pictures_at_rest_grow_up_to_the_budget(void **unused)
{
    (void)unused;
    rend_motion m = start();
    rend_allowance allowed;
    uint64_t first = rest_budget(&m), budget = 9 * first;
    assert_true(first > rend_pace_points(&m.pace));
    for (int i = 0; i < 3; i++) {
        const uint64_t wanted[] = {first, 4 * first, 9 * first};
        rend_view_of view = view_of(0, budget);
        rend_motion_plan(&m, false, 50, &view, &allowed);
        assert_int_equal(view.budget_points, wanted[i]);
        assert_int_equal(grow(&m, budget), i < 2);
    }
    for (int i = 0; i < 100 && grow(&m, REND_ALL); i++) /* without running over */
        assert_true(rest_budget(&m) > budget);
    assert_true(rest_budget(&m) == REND_ALL && !grow(&m, REND_ALL));
}

static void a_picture_that_is_not_done_or_has_all_is_not_followed(void **unused)
{
    (void)unused;
    rend_motion m = start();
    uint64_t first = rest_budget(&m);
    const rend_figures misses = {.budget_spent = true, .pending = 1}, has_all = {.pending = 0};
    assert_false(rend_motion_grow(&m, &misses, REND_ALL));
    assert_false(rend_motion_grow(&m, &has_all, REND_ALL));
    assert_int_equal(rest_budget(&m), first);
}

static void pictures_begin_anew_only_after_a_long_way(void **unused)
{
    (void)unused;
    rend_motion m = start();
    uint64_t first = rest_budget(&m);
    assert_true(grow(&m, REND_ALL));
    uint64_t fuller = rest_budget(&m);
    assert_int_equal(fuller, 4 * first);
    for (double now = 10; now < 10.9; now += 0.1)
        rend_motion_touch(&m, now);
    assert_true(rend_motion_settle(&m, false, 15)); /* the rest is no part of the way */
    assert_int_equal(rest_budget(&m), fuller);
    for (double now = 20; now < 21.3; now += 0.1)
        rend_motion_touch(&m, now);
    assert_true(rend_motion_settle(&m, false, 25));
    assert_int_equal(rest_budget(&m), first);
    assert_true(grow(&m, REND_ALL));
    rend_motion_restart(&m);
    assert_int_equal(rest_budget(&m), first);
}

/* Where the camera is thought to be when it moves on from x at a time; NAN: nobody knows. */
static double ahead(rend_motion *m, bool whole, double x, double now)
{
    rend_view_of view = view_of(x, REND_ALL);
    rend_allowance allowed;
    rend_motion_plan(m, whole, now, &view, &allowed);
    assert_true(view.camera.eye[0] == x);
    if (allowed.ahead == NULL) return (double)NAN;
    assert_true(fabs(allowed.ahead->target[0] - allowed.ahead->eye[0]) < 1e-9);
    assert_true(allowed.ahead->eye[1] == 2 && allowed.ahead->target[1] == 9);
    assert_true(allowed.ahead->up[2] == 1);
    return allowed.ahead->eye[0];
}

static void a_motion_is_thought_on_for_half_a_second(void **unused)
{
    (void)unused;
    rend_motion m = start();
    assert_true(isnan(ahead(&m, false, 0, 9.9))); /* at rest, and so is the frame before the next */
    rend_motion_touch(&m, 10);
    assert_true(isnan(ahead(&m, false, 0, 10)));
    assert_true(fabs(ahead(&m, false, 1, 10.1) - 6) < 1e-9);
    assert_true(fabs(ahead(&m, false, 0, 10.3) + 2.5) < 1e-9); /* back, and slower */
    assert_true(isnan(ahead(&m, false, 1, 10.3)));             /* no time has passed */
    assert_true(isnan(ahead(&m, false, 2, 10.9)));             /* too much has */
    assert_true(isnan(ahead(&m, true, 3, 11)));
    assert_true(isnan(ahead(&m, false, 4, 11.1))); /* the last frame is not moved on from */
    assert_true(fabs(ahead(&m, false, 4, 11.2) - 4) < 1e-9);
    rend_motion_settle(&m, false, 12);
    assert_true(isnan(ahead(&m, false, 5, 11.3)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_camera_rests_shortly_after_it_was_touched),
        cmocka_unit_test(a_hand_that_holds_still_is_waited_for_but_not_for_ever),
        cmocka_unit_test(a_moving_frame_is_as_much_as_fits),
        cmocka_unit_test(the_last_frame_is_whole_whether_it_moves_or_rests),
        cmocka_unit_test(pictures_at_rest_grow_up_to_the_budget),
        cmocka_unit_test(a_picture_that_is_not_done_or_has_all_is_not_followed),
        cmocka_unit_test(pictures_begin_anew_only_after_a_long_way),
        cmocka_unit_test(a_motion_is_thought_on_for_half_a_second),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
