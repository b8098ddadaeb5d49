#include "render/curve.h"
#include "tests/core_tools.h"

#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846

static double distance(const double a[3], const double b[3])
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

static void add(rend_path *path, double time_s, const double eye[3], const double target[3])
{
    mospt_err err = {0};
    rend_key key = {.time_s = time_s, .camera = {.up = {0, 0, 1}, .fov_rad = 1}};
    memcpy(key.camera.eye, eye, sizeof key.camera.eye);
    memcpy(key.camera.target, target, sizeof key.camera.target);
    CORE_NEED(rend_path_add(path, &key, NULL, &err));
}

static rend_curve *curve_of(rend_path *path)
{
    rend_curve *curve = NULL;
    mospt_err err = {0};
    CORE_NEED(rend_path_is_valid(path, &err));
    CORE_NEED(rend_curve_create(path, &curve, &err));
    return curve;
}

static rend_path random_path(uint64_t *state, uint32_t count, double pace_s)
{
    rend_path path = {0};
    for (uint32_t i = 0; i < count; i++) {
        double eye[3], target[3];
        for (int a = 0; a < 3; a++)
            eye[a] = 20 * core_unit(state), target[a] = eye[a] + 4 * core_unit(state) - 2;
        target[0] += 3; /* never straight up */
        add(&path, pace_s * (i + 0.8 * core_unit(state)), eye, target);
    }
    return path;
}

static void the_curve_goes_through_every_keyframe(void **unused)
{
    (void)unused;
    uint64_t state = 1;
    for (int round = 0; round < 50; round++) {
        rend_path path = random_path(&state, 1 + core_below(&state, 8), 1);
        rend_curve *curve = curve_of(&path);
        for (uint32_t i = 0; i < path.count; i++) {
            const rend_camera *wanted = &path.keys[i].camera;
            for (int side = -1; side <= 1; side++) {
                rend_moment m;
                rend_curve_at(curve, path.keys[i].time_s + 1e-9 * side, &m);
                assert_true(distance(m.camera.eye, wanted->eye) < 1e-6);
                assert_true(distance(m.camera.target, wanted->target) < 1e-5);
            }
        }
        rend_curve_destroy(curve);
        rend_path_fini(&path);
    }
}

/* One segment, eased: the way is the cubic 3 f^2 - 2 f^3 of the time. */
static void a_straight_line_is_eased_by_a_cubic(void **unused)
{
    (void)unused;
    rend_path path = {0};
    const double from[3] = {1, 2, 3}, to[3] = {11, 2, 3}, far[3] = {100, 2, 3};
    add(&path, 2, from, far);
    add(&path, 6, to, far);
    rend_curve *curve = curve_of(&path);
    for (double t = 2; t <= 6; t += 0.125) {
        rend_moment m;
        double f = (t - 2) / 4, x = 1 + 10 * f * f * (3 - 2 * f);
        rend_curve_at(curve, t, &m);
        assert_true(fabs(m.camera.eye[0] - x) < 1e-9);
        assert_true(fabs(m.camera.eye[1] - 2) < 1e-12 && fabs(m.camera.eye[2] - 3) < 1e-12);
        assert_true(fabs(rend_curve_way(curve, t) - (x - 1)) < 1e-9);
    }
    rend_curve_destroy(curve);
    path.abrupt = true;
    curve = curve_of(&path);
    for (double t = 2; t <= 6; t += 0.125) {
        rend_moment m;
        rend_curve_at(curve, t, &m);
        assert_true(fabs(m.camera.eye[0] - (1 + 2.5 * (t - 2))) < 1e-9);
    }
    rend_curve_destroy(curve);
    rend_path_fini(&path);
}

static void a_turn_in_one_place_is_a_turn_about_one_axis(void **unused)
{
    (void)unused;
    rend_path path = {0};
    const double eye[3] = {5, 5, 5}, first[3] = {5, 15, 5}, second[3] = {15, 5, 5};
    add(&path, 0, eye, first);
    add(&path, 1, eye, second);
    rend_curve *curve = curve_of(&path);
    for (double t = 0; t <= 1; t += 0.0625) {
        rend_moment m;
        double angle = PI / 2 * t * t * (3 - 2 * t);
        rend_curve_at(curve, t, &m);
        assert_true(distance(m.camera.eye, eye) == 0);
        assert_true(fabs(m.camera.target[0] - (5 + 10 * sin(angle))) < 1e-6);
        assert_true(fabs(m.camera.target[1] - (5 + 10 * cos(angle))) < 1e-6);
        assert_true(fabs(m.camera.target[2] - 5) < 1e-6);
    }
    rend_curve_destroy(curve);
    rend_path_fini(&path);
}

/* Once around: the speed is even between the ends, the distance that of the circle. */
static void a_circle_is_gone_around_evenly(void **unused)
{
    (void)unused;
    enum { KEYS = 24 };
    rend_path path = {0};
    const double middle[3] = {100, 200, 0};
    for (int i = 0; i <= KEYS; i++) {
        const double eye[3] = {100 + 30 * cos(2 * PI * i / KEYS), 200 + 30 * sin(2 * PI * i / KEYS),
                               10};
        add(&path, i, eye, middle);
    }
    path.abrupt = true;
    rend_curve *curve = curve_of(&path);
    double last[3] = {0};
    for (int i = 0; i <= 20 * (KEYS - 2); i++) {
        rend_moment m;
        double t = 1 + i / 20.0, right[3], up[3], back[3];
        rend_curve_at(curve, t, &m);
        const double flat[3] = {m.camera.eye[0], m.camera.eye[1], 0};
        assert_true(fabs(distance(flat, middle) - 30) < 0.01);
        if (i > 0)
            assert_true(fabs(distance(m.camera.eye, last) / (2 * PI * 30 / KEYS / 20) - 1) < 0.01);
        memcpy(last, m.camera.eye, sizeof last);
        assert_true(distance(m.camera.target, middle) < 0.02);
        rend_camera_axes(&m.camera, right, up, back);
        assert_true(fabs(right[2]) < 1e-9); /* the horizon is level */
    }
    assert_true(fabs(rend_curve_way(curve, KEYS) / (2 * PI * 30) - 1) < 0.001);
    rend_curve_destroy(curve);
    rend_path_fini(&path);
}

/* The largest change of velocity from one step of `h` seconds to the next. */
static double largest_jump(const rend_curve *curve, double from, double to, double h)
{
    double most = 0;
    for (double t = from + h; t < to - h; t += h) {
        rend_moment a, b, c;
        double jump[3], none[3] = {0, 0, 0};
        rend_curve_at(curve, t - h, &a), rend_curve_at(curve, t, &b);
        rend_curve_at(curve, t + h, &c);
        for (int x = 0; x < 3; x++)
            jump[x] = (c.camera.eye[x] - 2 * b.camera.eye[x] + a.camera.eye[x]) / h;
        most = fmax(most, distance(jump, none));
    }
    return most;
}

/* A velocity that jumped would do so in steps of any length. */
static void the_velocity_never_jumps_and_the_eye_never_goes_back(void **unused)
{
    (void)unused;
    uint64_t state = 7;
    for (int round = 0; round < 20; round++) {
        rend_path path = random_path(&state, 6, 10);
        rend_curve *curve = curve_of(&path);
        double start = path.keys[0].time_s, end = rend_path_duration(&path), way = 0;
        double coarse = largest_jump(curve, start, end, 4e-3);
        double fine = largest_jump(curve, start, end, 1e-3);
        assert_true(fine < 0.4 * coarse);
        for (double t = start; t < end; t += 1e-3) {
            assert_true(rend_curve_way(curve, t) >= way - 1e-12);
            way = rend_curve_way(curve, t);
        }
        rend_curve_destroy(curve);
        rend_path_fini(&path);
    }
}

static void a_pause_rests_and_speed_is_zero_around_it(void **unused)
{
    (void)unused;
    rend_path path = {0};
    const double a[3] = {0, 0, 0}, b[3] = {10, 0, 0}, c[3] = {20, 5, 0}, far[3] = {50, 40, 0};
    add(&path, 0, a, far);
    add(&path, 2, b, far);
    add(&path, 4, b, far);
    add(&path, 6, c, far);
    rend_curve *curve = curve_of(&path);
    rend_moment m;
    for (double t = 2; t <= 4; t += 0.1) {
        rend_curve_at(curve, t, &m);
        assert_true(distance(m.camera.eye, b) < 1e-9);
    }
    rend_curve_at(curve, 1.99, &m);
    assert_true(distance(m.camera.eye, b) < 0.002);
    rend_curve_at(curve, 4.01, &m);
    assert_true(distance(m.camera.eye, b) < 0.002);
    rend_curve_destroy(curve);
    rend_path_fini(&path);
}

static void a_rolled_camera_keeps_its_roll(void **unused)
{
    (void)unused;
    rend_path path = {0};
    const double a[3] = {0, 0, 0}, far[3] = {0, 50, 0};
    add(&path, 0, a, far);
    add(&path, 1, a, far);
    path.keys[1].camera.up[0] = 1, path.keys[1].camera.up[2] = 0; /* a quarter turn */
    rend_curve *curve = curve_of(&path);
    rend_moment m;
    rend_curve_at(curve, 0.5, &m);
    assert_true(fabs(m.camera.up[0] - sqrt(0.5)) < 1e-9 && fabs(m.camera.up[2] - sqrt(0.5)) < 1e-9);
    rend_curve_destroy(curve);
    rend_path_fini(&path);
}

static void what_a_keyframe_sets_holds_until_another_does(void **unused)
{
    (void)unused;
    rend_path path = {0};
    const double a[3] = {0, 0, 0}, b[3] = {1, 0, 0}, c[3] = {2, 0, 0}, far[3] = {9, 9, 0};
    add(&path, 1, a, far);
    add(&path, 2, b, far);
    add(&path, 3, c, far);
    strcpy(path.keys[1].colour, "elevation");
    path.keys[1].budget_points = 1000, path.keys[2].budget_points = 4000;
    path.keys[2].camera.fov_rad = 0.5;
    rend_curve *curve = curve_of(&path);
    rend_moment m;
    rend_curve_at(curve, 1.5, &m);
    assert_true(m.colour == NULL && m.budget_points == 0);
    rend_curve_at(curve, 2.5, &m);
    assert_string_equal(m.colour, "elevation");
    assert_true(m.budget_points >= 1999 && m.budget_points <= 2000);
    assert_true(fabs(m.camera.fov_rad - 0.75) < 1e-9);
    rend_curve_at(curve, 99, &m);
    assert_true(m.colour != NULL && m.budget_points == 4000 && m.camera.fov_rad == 0.5);
    rend_curve_at(curve, 0, &m);
    assert_true(distance(m.camera.eye, a) == 0);
    rend_curve_destroy(curve);
    rend_path_fini(&path);
}

static void clip_boxes_move_where_both_keyframes_have_an_end(void **unused)
{
    (void)unused;
    rend_path path = {0};
    const double far[3] = {99, 9, 0};
    for (int i = 0; i < 5; i++) {
        const double eye[3] = {i, 0, 0};
        add(&path, i, eye, far);
        path.keys[i].has_clip = i >= 1;
        path.keys[i].clip = (rend_box){{0, 0, 0}, {10 * i, INFINITY, i == 3 ? INFINITY : 1}};
    }
    rend_curve *curve = curve_of(&path);
    rend_moment m, later;
    rend_curve_at(curve, 0.99, &m);
    assert_false(m.has_clip);
    rend_curve_at(curve, 1, &m);
    assert_true(m.has_clip && m.clip.high[0] == 10);
    double before = 0;
    for (double t = 1; t <= 4; t += 0.01, before = m.clip.high[0]) {
        rend_curve_at(curve, t, &m);
        assert_true(m.has_clip && m.clip.high[0] >= before && isinf(m.clip.high[1]));
        assert_true(m.clip.low[0] == 0 &&
                    (t < 3 || t >= 4 ? m.clip.high[2] == 1 : isinf(m.clip.high[2])));
    }
    /* In the middle of a steady motion it does not halt at a keyframe. */
    rend_curve_at(curve, 2.01, &m);
    rend_curve_at(curve, 2.02, &later);
    assert_true(fabs(later.clip.high[0] - m.clip.high[0] - 0.1) < 0.02);
    rend_curve_destroy(curve);
    rend_path_fini(&path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_curve_goes_through_every_keyframe),
        cmocka_unit_test(a_straight_line_is_eased_by_a_cubic),
        cmocka_unit_test(a_turn_in_one_place_is_a_turn_about_one_axis),
        cmocka_unit_test(a_circle_is_gone_around_evenly),
        cmocka_unit_test(the_velocity_never_jumps_and_the_eye_never_goes_back),
        cmocka_unit_test(a_pause_rests_and_speed_is_zero_around_it),
        cmocka_unit_test(a_rolled_camera_keeps_its_roll),
        cmocka_unit_test(what_a_keyframe_sets_holds_until_another_does),
        cmocka_unit_test(clip_boxes_move_where_both_keyframes_have_an_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
