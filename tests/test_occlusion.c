#include "render/occlusion.h"
#include "tests/render_tools.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 640, HEIGHT = 360, PIXELS = WIDTH * HEIGHT };

typedef struct {
    mospt_grid grid;
    rend_camera camera;
    rend_frame frame;
    rend_occlusion *occlusion;
    float *depths;
} fixture;

/* Looks along x from the low side of the root cube, which is 64 m wide. */
static void start(fixture *f)
{
    *f = (fixture){.grid = render_grid(16), .occlusion = rend_occlusion_create()};
    f->camera = (rend_camera){.fov_rad = 1, .up = {0, 0, 1}};
    for (int a = 0; a < 3; a++) {
        double low = mospt_grid_axis_to_world(&f->grid, a, f->grid.root[a]);
        f->camera.eye[a] = low + (a == 0 ? 1 : 32);
        f->camera.target[a] = low + 32;
    }
    render_frame_make(&f->camera, &f->grid, &f->frame);
    f->depths = rend_occlusion_depths(f->occlusion, WIDTH, HEIGHT);
    assert_non_null(f->depths);
}

static void stop(fixture *f)
{
    rend_occlusion_destroy(f->occlusion);
}

static float depth_of(const rend_frame *f, float w)
{
    return logf(w / f->near_w) / logf(f->far_w / f->near_w);
}

/* The lowest corner of a cube `metres` away from the low side of the root, and aside of its middle.
 */
static void corner_at(const fixture *f, const double metres[3], uint32_t out[3])
{
    for (int a = 0; a < 3; a++)
        out[a] = f->grid.root[a] + (uint32_t)((metres[a] + (a == 0 ? 0 : 32)) * 1024);
}

static bool hides(const fixture *f, double x, double y, double z, double width)
{
    uint32_t corner[3];
    corner_at(f, (const double[3]){x, y, z}, corner);
    return rend_occlusion_hides(f->occlusion, corner, (uint64_t)(width * 1024));
}

static void fill(fixture *f, float depth)
{
    for (size_t i = 0; i < PIXELS; i++)
        f->depths[i] = depth;
}

static void learn(fixture *f)
{
    rend_occlusion_learn(f->occlusion, &f->frame, false);
}

static void what_was_not_learnt_hides_nothing(void **unused)
{
    (void)unused;
    fixture f;
    start(&f);
    assert_false(hides(&f, 30, 0, 0, 1));
    fill(&f, 0.01f);
    learn(&f);
    assert_true(hides(&f, 30, 0, 0, 1));
    rend_occlusion_forget(f.occlusion);
    assert_false(hides(&f, 30, 0, 0, 1));
    stop(&f);
}

static void a_wall_hides_what_is_behind_it_and_nothing_else(void **unused)
{
    (void)unused;
    fixture f;
    start(&f);
    fill(&f, depth_of(&f.frame, 10 * 1024)); /* 11 m from the low side */
    learn(&f);
    assert_true(hides(&f, 12, 0, 0, 2));
    assert_true(hides(&f, 40, -8, -8, 16));
    assert_false(hides(&f, 8, 0, 0, 2));     /* in front */
    assert_false(hides(&f, 10.5, 0, 0, 1));  /* in it */
    assert_false(hides(&f, 11.05, 0, 0, 1)); /* not clearly behind */
    assert_false(hides(&f, 0.5, 0, 0, 1));   /* around the eye */
    stop(&f);
}

/* Half of each tile's pixels. */
static void half_a_wall_hides_unless_gaps_are_to_be_seen_through(void **unused)
{
    (void)unused;
    fixture f;
    start(&f);
    for (size_t i = 0; i < PIXELS; i++)
        f.depths[i] = i % 2 ? 1 : depth_of(&f.frame, 10 * 1024);
    learn(&f);
    assert_true(hides(&f, 40, -8, -8, 16));
    rend_occlusion_learn(f.occlusion, &f.frame, true);
    assert_false(hides(&f, 40, -8, -8, 16));
    fill(&f, depth_of(&f.frame, 10 * 1024));
    rend_occlusion_learn(f.occlusion, &f.frame, true);
    assert_true(hides(&f, 40, -8, -8, 16));
    stop(&f);
}

/* The left half of the picture. */
static void nothing_hides_beyond_its_silhouette(void **unused)
{
    (void)unused;
    fixture f;
    start(&f);
    fill(&f, 1);
    for (size_t i = 0; i < PIXELS; i++)
        if (i % WIDTH < WIDTH / 2) f.depths[i] = depth_of(&f.frame, 10 * 1024);
    learn(&f);
    assert_true(hides(&f, 31, 2, 0, 4)); /* y is to the left */
    assert_false(hides(&f, 31, -6, 0, 4));
    assert_false(hides(&f, 31, -2, 0, 4));   /* half of it */
    assert_false(hides(&f, 31, -0.1, 0, 4)); /* two pixels of it */
    stop(&f);
}

static bool hides_with_gaps(uint32_t percent_of_gaps)
{
    fixture f;
    uint64_t state = 3;
    start(&f);
    for (size_t i = 0; i < PIXELS; i++)
        f.depths[i] = core_below(&state, 100) < percent_of_gaps ? 1 : depth_of(&f.frame, 10 * 1024);
    learn(&f);
    bool hidden = hides(&f, 31, 0, 0, 4);
    stop(&f);
    return hidden;
}

static void a_wall_of_points_hides_and_a_tree_does_not(void **unused)
{
    (void)unused;
    assert_true(hides_with_gaps(0));
    assert_true(hides_with_gaps(15));
    assert_false(hides_with_gaps(50));
    assert_false(hides_with_gaps(80));
}

static void one_hole_of_a_door_is_seen_through(void **unused)
{
    (void)unused;
    fixture f;
    start(&f);
    fill(&f, depth_of(&f.frame, 10 * 1024));
    for (size_t y = 180; y < 196; y++)
        for (size_t x = 310; x < 320; x++)
            f.depths[y * WIDTH + x] = depth_of(&f.frame, 60 * 1024);
    learn(&f);
    assert_false(hides(&f, 30, -1, -2, 4));
    assert_true(hides(&f, 30, 8, -2, 4));
    assert_true(hides(&f, 62.5, 0, -0.5, 0.5)); /* behind what is seen through it */
    stop(&f);
}

/* ---- twins ---- */

/* Depths of balls and one wall, by rays. */
typedef struct {
    double centre[3], radius; /* metres, relative to the low corner of the root */
} ball;

enum { BALLS = 12 };

/* Distance along a ray of unit length, INFINITY for a miss. */
static double meet(const ball *b, const double eye[3], const double ray[3])
{
    double along = 0, square = 0;
    for (int a = 0; a < 3; a++)
        along += (b->centre[a] - eye[a]) * ray[a];
    for (int a = 0; a < 3; a++)
        square += pow(b->centre[a] - eye[a] - along * ray[a], 2);
    double half = b->radius * b->radius - square;
    return half < 0 || along - sqrt(half) < 0 ? INFINITY : along - sqrt(half);
}

static void eye_of(const fixture *f, double out[3])
{
    for (int a = 0; a < 3; a++)
        out[a] = f->camera.eye[a] - mospt_grid_axis_to_world(&f->grid, a, f->grid.root[a]);
}

static void draw(fixture *f, const ball balls[BALLS])
{
    double eye[3], right[3], up[3], back[3];
    eye_of(f, eye);
    rend_camera_axes(&f->camera, right, up, back);
    for (size_t i = 0; i < PIXELS; i++) {
        double x = (double)(i % WIDTH) + 0.5 - WIDTH / 2,
               y = HEIGHT / 2 - (double)(i / WIDTH) - 0.5;
        double ray[3], nearest = INFINITY, length = 0, forward = 0;
        for (int a = 0; a < 3; a++)
            ray[a] = x / f->frame.focal_px * right[a] + y / f->frame.focal_px * up[a] - back[a];
        for (int a = 0; a < 3; a++)
            length += ray[a] * ray[a];
        for (int a = 0; a < 3; a++)
            ray[a] /= sqrt(length), forward -= ray[a] * back[a];
        for (int b = 0; b < BALLS; b++)
            nearest = fmin(nearest, meet(&balls[b], eye, ray));
        f->depths[i] = isinf(nearest) ? 1 : depth_of(&f->frame, (float)(nearest * forward * 1024));
    }
}

/* True if a point is in the picture and no ball stands before it. */
static bool sees(const fixture *f, const ball balls[BALLS], const double point[3])
{
    double eye[3], ray[3], length = 0, right[3], up[3], back[3], at[3] = {0, 0, 0};
    eye_of(f, eye);
    rend_camera_axes(&f->camera, right, up, back);
    for (int a = 0; a < 3; a++)
        ray[a] = point[a] - eye[a], length += ray[a] * ray[a];
    for (int a = 0; a < 3; a++) {
        at[0] += ray[a] * right[a], at[1] += ray[a] * up[a], at[2] -= ray[a] * back[a];
        ray[a] /= sqrt(length);
    }
    if (at[2] <= 0 || fabs(at[0] / at[2]) * f->frame.focal_px > WIDTH / 2 ||
        fabs(at[1] / at[2]) * f->frame.focal_px > HEIGHT / 2)
        return false;
    for (int b = 0; b < BALLS; b++)
        if (meet(&balls[b], eye, ray) < sqrt(length)) return false;
    return true;
}

/* Cubes at random: of a hidden one no corner, and not the middle, may be in sight. */
static uint32_t look_for_mistakes(fixture *f, const ball balls[BALLS], uint64_t *state,
                                  uint32_t *hidden)
{
    uint32_t mistakes = 0;
    for (int i = 0; i < 3000; i++) {
        double low[3], width = 0.25 * (1 << core_below(state, 4));
        uint32_t corner[3];
        for (int a = 0; a < 3; a++) {
            low[a] = (64 - width) * core_unit(state);
            corner[a] = f->grid.root[a] + (uint32_t)(low[a] * 1024);
        }
        if (!rend_occlusion_hides(f->occlusion, corner, (uint64_t)(width * 1024))) continue;
        ++*hidden;
        for (int c = 0; c < 9; c++) {
            double point[3];
            for (int a = 0; a < 3; a++)
                point[a] = low[a] + width * (c == 8 ? 0.5 : c >> a & 1);
            mistakes += sees(f, balls, point);
        }
    }
    return mistakes;
}

static void scatter(ball balls[BALLS], uint64_t *state)
{
    for (int b = 0; b < BALLS; b++) {
        for (int a = 0; a < 3; a++)
            balls[b].centre[a] = a == 0 ? 8 + 30 * core_unit(state) : 20 + 24 * core_unit(state);
        balls[b].radius = 1 + 4 * core_unit(state);
    }
}

static void what_is_hidden_cannot_be_seen(void **unused)
{
    (void)unused;
    uint32_t hidden = 0;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        fixture f;
        ball balls[BALLS];
        uint64_t state = seed;
        start(&f);
        scatter(balls, &state);
        draw(&f, balls);
        learn(&f);
        assert_true(rend_occlusion_aim(f.occlusion, &f.frame));
        assert_int_equal(look_for_mistakes(&f, balls, &state, &hidden), 0);
        stop(&f);
    }
    assert_true(hidden > 1000);
}

/* A step aside, or a turn: what the view before hides is hidden in this one, but for a corner now
 * and then that comes out from behind something. */
static void a_view_before_is_a_careful_guess(void **unused)
{
    (void)unused;
    uint32_t hidden = 0, mistakes = 0;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        fixture f;
        ball balls[BALLS];
        uint64_t state = seed;
        start(&f);
        scatter(balls, &state);
        draw(&f, balls);
        learn(&f);
        f.camera.eye[1] += seed % 2 ? 0.1 : 0;
        f.camera.target[2] += seed % 3 ? 2 : 0;
        f.camera.eye[0] += seed % 4 ? 0.2 : 0;
        render_frame_make(&f.camera, &f.grid, &f.frame);
        assert_false(rend_occlusion_aim(f.occlusion, &f.frame));
        mistakes += look_for_mistakes(&f, balls, &state, &hidden);
        stop(&f);
    }
    assert_true(hidden > 500);
    assert_true(mistakes <= hidden / 500);
}

/* Elsewhere nothing is known. */
static void what_the_view_before_did_not_see_is_not_hidden(void **unused)
{
    (void)unused;
    fixture f;
    start(&f);
    fill(&f, depth_of(&f.frame, 10 * 1024));
    learn(&f);
    assert_true(hides(&f, 31, 10, 0, 8)); /* the edge of the picture is in it */
    for (int a = 0; a < 2; a++)
        f.camera.target[a] += 20;
    render_frame_make(&f.camera, &f.grid, &f.frame);
    rend_occlusion_aim(f.occlusion, &f.frame);
    assert_false(hides(&f, 31, 24, 0, 6));
    assert_true(hides(&f, 31, 0, 0, 4));
    stop(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_not_learnt_hides_nothing),
        cmocka_unit_test(a_wall_hides_what_is_behind_it_and_nothing_else),
        cmocka_unit_test(half_a_wall_hides_unless_gaps_are_to_be_seen_through),
        cmocka_unit_test(nothing_hides_beyond_its_silhouette),
        cmocka_unit_test(a_wall_of_points_hides_and_a_tree_does_not),
        cmocka_unit_test(one_hole_of_a_door_is_seen_through),
        cmocka_unit_test(what_is_hidden_cannot_be_seen),
        cmocka_unit_test(a_view_before_is_a_careful_guess),
        cmocka_unit_test(what_the_view_before_did_not_see_is_not_hidden),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
