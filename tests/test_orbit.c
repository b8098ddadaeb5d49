#include "render/orbit.h"
#include "tests/core_tools.h"

#include <math.h>

static double distance(const double a[3], const double b[3])
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

static void assert_near(double a, double b, double tolerance)
{
    assert_true(fabs(a - b) <= tolerance);
}

static rend_camera random_camera(uint64_t *state)
{
    rend_camera c = {.up = {0, 0, 2}, .fov_rad = 0.5 + core_unit(state)};
    for (int a = 0; a < 3; a++)
        c.eye[a] = 20 * core_unit(state), c.target[a] = 100 + 10 * core_unit(state);
    return c;
}

/* Pixel at which a world position is seen: by trying, the inverse of unproject. */
static void see(const rend_camera *c, const double p[3], double *x, double *y)
{
    double right[3], up[3], back[3], e[3] = {0, 0, 0}, t = tan(c->fov_rad / 2);
    rend_camera_axes(c, right, up, back);
    for (int a = 0; a < 3; a++) {
        double d = p[a] - c->eye[a];
        e[0] += right[a] * d, e[1] += up[a] * d, e[2] -= back[a] * d;
    }
    *x = (e[0] / (e[2] * t * 1280 / 720) + 1) * 640, *y = (1 - e[1] / (e[2] * t)) * 360;
}

static void turning_keeps_all_distances_and_the_horizon(void **unused)
{
    (void)unused;
    uint64_t state = 1;
    for (int i = 0; i < 300; i++) {
        rend_camera c = random_camera(&state), before = c;
        double pivot[3] = {50 * core_unit(&state), 50, 3}, right[3], up[3], back[3];
        rend_orbit_turn(&c, pivot, 6 * core_unit(&state) - 3, 6 * core_unit(&state) - 3);
        assert_near(distance(c.eye, pivot), distance(before.eye, pivot), 1e-9);
        assert_near(rend_orbit_distance(&c), rend_orbit_distance(&before), 1e-9);
        rend_camera_axes(&c, right, up, back);
        assert_near(right[2], 0, 1e-9); /* the horizon stays level */
        assert_true(fabs(back[2]) < 1 - 1e-5 && up[2] > 0);
    }
}

static void a_full_turn_comes_back(void **unused)
{
    (void)unused;
    uint64_t state = 2;
    rend_camera c = random_camera(&state), before = c;
    const double pivot[3] = {1, 2, 3};
    for (int i = 0; i < 360; i++)
        rend_orbit_turn(&c, pivot, acos(-1) / 180, 0);
    for (int a = 0; a < 3; a++)
        assert_near(c.eye[a], before.eye[a], 1e-8);
}

static void a_drag_down_makes_the_eye_rise(void **unused)
{
    (void)unused;
    rend_camera c = {.eye = {0, -10, 1}, .up = {0, 0, 1}, .fov_rad = 1};
    const double pivot[3] = {0, 0, 0};
    rend_orbit_turn(&c, pivot, 0, 0.3);
    assert_true(c.eye[2] > 1);
    c = (rend_camera){.eye = {0, -10, 0}, .up = {0, 0, 1}, .fov_rad = 1};
    rend_orbit_turn(&c, pivot, 0.3, 0);
    assert_true(c.eye[0] < 0); /* the site turns to the right: the eye goes left */
    for (int i = 0; i < 100; i++)
        rend_orbit_turn(&c, pivot, 0, 0.3);
    assert_true(c.eye[2] > 9.9 && c.eye[2] < 10);
}

static void panning_keeps_the_point_under_the_cursor(void **unused)
{
    (void)unused;
    uint64_t state = 3;
    for (int i = 0; i < 200; i++) {
        rend_camera c = random_camera(&state);
        double p[3], x, y, w = 1 + 100 * core_unit(&state);
        rend_orbit_unproject(&c, 300, 500, w, 1280, 720, p);
        see(&c, p, &x, &y);
        assert_near(x, 300, 1e-6);
        assert_near(y, 500, 1e-6);
        rend_orbit_pan(&c, 40, -70, w, 720);
        see(&c, p, &x, &y);
        assert_near(x, 340, 1e-6);
        assert_near(y, 430, 1e-6);
    }
}

static void zooming_keeps_the_point_under_the_cursor(void **unused)
{
    (void)unused;
    uint64_t state = 4;
    for (int i = 0; i < 200; i++) {
        rend_camera c = random_camera(&state);
        double p[3], x, y, before = rend_orbit_distance(&c);
        rend_orbit_unproject(&c, 900, 100, 30, 1280, 720, p);
        rend_orbit_zoom(&c, p, 0.7, 0.01);
        assert_near(rend_orbit_distance(&c), 0.7 * before, 1e-9);
        see(&c, p, &x, &y);
        assert_near(x, 900, 1e-6);
        assert_near(y, 100, 1e-6);
    }
}

static void zooming_ends_before_the_target(void **unused)
{
    (void)unused;
    uint64_t state = 5;
    rend_camera c = random_camera(&state);
    for (int i = 0; i < 1000; i++)
        rend_orbit_zoom(&c, c.target, 0.5, 0.25);
    assert_near(rend_orbit_distance(&c), 0.25, 1e-6);
    rend_orbit_zoom(&c, c.target, 2, 0.25);
    assert_near(rend_orbit_distance(&c), 0.5, 1e-6);
}

static void flying_takes_the_target_along(void **unused)
{
    (void)unused;
    rend_camera c = {.eye = {0, 0, 0}, .target = {0, 10, 0}, .up = {0, 0, 1}, .fov_rad = 1};
    const double by[3] = {1, 2, 3};
    rend_orbit_fly(&c, by);
    const double eye[3] = {1, 3, 2}, target[3] = {1, 13, 2};
    for (int a = 0; a < 3; a++) {
        assert_near(c.eye[a], eye[a], 1e-12);
        assert_near(c.target[a], target[a], 1e-12);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(turning_keeps_all_distances_and_the_horizon),
        cmocka_unit_test(a_full_turn_comes_back),
        cmocka_unit_test(a_drag_down_makes_the_eye_rise),
        cmocka_unit_test(panning_keeps_the_point_under_the_cursor),
        cmocka_unit_test(zooming_keeps_the_point_under_the_cursor),
        cmocka_unit_test(zooming_ends_before_the_target),
        cmocka_unit_test(flying_takes_the_target_along),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
