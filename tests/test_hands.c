#include "render/hands.h"
#include "render/orbit.h"
#include "tests/core_tools.h"

#include <math.h>

enum { WIDTH = 1280, HEIGHT = 720 };

static rend_camera looking_north(void)
{
    return (rend_camera){.eye = {3, -20, 5}, .target = {3, 0, 5}, .up = {0, 0, 1}, .fov_rad = 1};
}

static rend_spot spot_at(const rend_camera *camera, double x, double y, double w)
{
    rend_spot spot = {.is_point = true, .w = w};
    rend_orbit_unproject(camera, x, y, w, WIDTH, HEIGHT, spot.at);
    return spot;
}

static double distance(const double a[3], const double b[3])
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

static void assert_same_camera(const rend_camera *a, const rend_camera *b)
{
    assert_true(distance(a->eye, b->eye) == 0 && distance(a->target, b->target) == 0);
    assert_true(a->fov_rad == b->fov_rad);
}

static void a_cursor_that_holds_nothing_moves_nothing(void **unused)
{
    (void)unused;
    rend_camera c = looking_north(), before = c;
    rend_spot spot = spot_at(&c, 100, 100, 8);
    rend_hands hands = {0};
    assert_false(rend_hands_move(&hands, 100, 100, HEIGHT, &c));
    assert_same_camera(&c, &before);
    rend_hands_grip(&hands, false, &spot, &c);
    assert_true(rend_hands_move(&hands, 100, 100, HEIGHT, &c)); /* held, but not moved */
    assert_true(distance(c.eye, before.eye) < 1e-9);
    rend_hands_release(&hands);
    before = c;
    assert_false(rend_hands_move(&hands, 300, 200, HEIGHT, &c));
    assert_same_camera(&c, &before);
}

/* What was gripped stays under the cursor. */
static void a_pan_takes_along_what_it_grips(void **unused)
{
    (void)unused;
    rend_camera c = looking_north();
    rend_spot spot = spot_at(&c, 400, 300, 8);
    rend_hands hands = {.cursor = {400, 300}};
    rend_hands_grip(&hands, true, &spot, &c);
    rend_hands_move(&hands, 450, 280, HEIGHT, &c);
    rend_hands_move(&hands, 700, 500, HEIGHT, &c);
    rend_spot there = spot_at(&c, 700, 500, 8);
    assert_true(distance(there.at, spot.at) < 1e-9);
    assert_true(c.eye[1] == -20);
}

static void an_orbit_is_around_the_point_or_the_target(void **unused)
{
    (void)unused;
    for (int is_point = 0; is_point < 2; is_point++) {
        rend_camera c = looking_north(), before = c;
        rend_spot spot = spot_at(&c, 400, 300, 8);
        rend_hands hands = {.cursor = {400, 300}};
        const double *pivot = is_point ? spot.at : before.target;
        const double *other = is_point ? before.target : spot.at;
        spot.is_point = is_point;
        rend_hands_grip(&hands, false, &spot, &c);
        rend_hands_move(&hands, 300, 320, HEIGHT, &c);
        assert_true(distance(c.eye, before.eye) > 1);
        assert_true(fabs(distance(c.eye, pivot) - distance(before.eye, pivot)) < 1e-9);
        assert_true(fabs(distance(c.eye, other) - distance(before.eye, other)) > 0.1);
    }
}

/* The same share of a picture turns as far, however many pixels it has. */
static void an_orbit_does_not_depend_on_the_size_of_the_picture(void **unused)
{
    (void)unused;
    rend_camera small = looking_north(), large = small;
    rend_spot spot = {.w = 20};
    rend_hands a = {0}, b = {0};
    rend_hands_grip(&a, false, &spot, &small);
    rend_hands_grip(&b, false, &spot, &large);
    rend_hands_move(&a, 100, 30, 360, &small);
    rend_hands_move(&b, 600, 180, 2160, &large);
    assert_true(distance(small.eye, large.eye) < 1e-9);
}

static void the_wheel_goes_there_and_back_and_no_nearer_than_allowed(void **unused)
{
    (void)unused;
    rend_camera c = looking_north(), before = c;
    rend_spot spot = spot_at(&c, 400, 300, 8);
    rend_hands_zoom(3, &spot, 0.1, &c);
    assert_true(distance(c.eye, spot.at) < 0.7 * distance(before.eye, spot.at));
    assert_true(distance(spot_at(&c, 400, 300, 8 * pow(0.85, 3)).at, spot.at) < 1e-9);
    rend_hands_zoom(-3, &spot, 0.1, &c);
    assert_true(distance(c.eye, before.eye) < 1e-9);
    rend_hands_zoom(1000, &spot, 0.1, &c);
    assert_true(fabs(rend_orbit_distance(&c) - 0.1) < 1e-9);
}

static double flown(rend_hands *hands, bool fast, double now, double nearest)
{
    rend_camera c = looking_north();
    const int forward[3] = {0, 0, 1};
    assert_true(rend_hands_fly(hands, forward, fast, now, nearest, &c));
    assert_true(fabs(rend_orbit_distance(&c) - 20) < 1e-9 && c.eye[0] == 3);
    return c.eye[1] + 20;
}

static void flying_takes_its_speed_from_the_distance_and_the_time(void **unused)
{
    (void)unused;
    rend_hands hands = {0};
    const int none[3] = {0}, up_left[3] = {-1, 1, 0};
    double first = flown(&hands, false, 100, 0);
    assert_true(first > 0 && first < 1); /* a frame's worth, not the time since the clock began */
    assert_true(fabs(flown(&hands, false, 100.1, 0) - 0.6 * 20 * 0.1) < 1e-9);
    assert_true(fabs(flown(&hands, true, 100.2, 0) - 4 * 0.6 * 20 * 0.1) < 1e-9);
    assert_true(fabs(flown(&hands, false, 100.3, 50) - 0.6 * 50 * 0.1) < 1e-9);
    assert_true(fabs(flown(&hands, false, 160, 0) - 0.6 * 20 * 0.25) < 1e-9); /* a long frame */
    rend_camera c = looking_north(), before = c;
    assert_false(rend_hands_fly(&hands, none, true, 161, 0, &c));
    assert_same_camera(&c, &before);
    assert_true(flown(&hands, false, 170, 0) == first); /* begins anew */
    assert_true(rend_hands_fly(&hands, up_left, false, 170.1, 0, &c));
    assert_true(c.eye[0] < 3 && c.eye[2] > 5 && c.eye[1] == -20);
}

static void a_lens_has_its_limits(void **unused)
{
    (void)unused;
    rend_camera c = looking_north();
    assert_true(fabs(rend_hands_lens(0.5, &c) - 28.648) < 0.001);
    assert_true(c.fov_rad == 0.5);
    assert_true(fabs(rend_hands_lens(1e-9, &c) - 5) < 1e-9);
    assert_true(fabs(rend_hands_lens(1e9, &c) - 120) < 1e-9);
    assert_true(fabs(c.fov_rad - 2 * acos(-1) / 3) < 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cursor_that_holds_nothing_moves_nothing),
        cmocka_unit_test(a_pan_takes_along_what_it_grips),
        cmocka_unit_test(an_orbit_is_around_the_point_or_the_target),
        cmocka_unit_test(an_orbit_does_not_depend_on_the_size_of_the_picture),
        cmocka_unit_test(the_wheel_goes_there_and_back_and_no_nearer_than_allowed),
        cmocka_unit_test(flying_takes_its_speed_from_the_distance_and_the_time),
        cmocka_unit_test(a_lens_has_its_limits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
