#include "render/clip.h"
#include "tests/core_tools.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const mospt_grid UTM = {
    .offset = {500000, 5300000, 0}, .base = {-250000, 12345, -4000}, .step = 0.001, .bits = 24};

static void coordinates_are_inside_of_their_own_box(void **unused)
{
    (void)unused;
    uint64_t state = 1;
    for (int i = 0; i < 100000; i++) {
        rend_box box;
        rend_clip clip;
        uint32_t g[3];
        for (int a = 0; a < 3; a++) {
            char text[32]; /* as a person types it */
            g[a] = core_below(&state, 1 << 24);
            snprintf(text, sizeof text, "%.3f", mospt_grid_axis_to_world(&UTM, a, g[a]));
            box.low[a] = box.high[a] = strtod(text, NULL);
        }
        rend_clip_make(&UTM, &box, &clip);
        assert_memory_equal(clip.low, g, sizeof g);
        assert_memory_equal(clip.high, g, sizeof g);
    }
}

static void open_sides_hold_everything_and_boxes_elsewhere_nothing(void **unused)
{
    (void)unused;
    const rend_box open = {{-INFINITY, -INFINITY, -INFINITY}, {INFINITY, INFINITY, INFINITY}};
    const uint32_t first[3] = {0, 0, 0}, last[3] = {UINT32_MAX, UINT32_MAX, UINT32_MAX};
    rend_clip clip;
    rend_clip_make(&UTM, &open, &clip);
    assert_false(rend_clip_misses(&clip, first, 1) || rend_clip_misses(&clip, last, 1));
    for (int a = 0; a < 3; a++)
        for (int side = 0; side < 2; side++) {
            rend_box away = open;
            if (side == 0) away.high[a] = -1e9;
            else away.low[a] = 1e9;
            rend_clip_make(&UTM, &away, &clip);
            assert_true(rend_clip_misses(&clip, first, UINT64_C(1) << 32));
        }
}

static void cubes_miss_a_box_by_one_step(void **unused)
{
    (void)unused;
    const rend_clip clip = {{100, 100, 100}, {200, 200, 200}};
    for (int a = 0; a < 3; a++) {
        uint32_t corner[3] = {150, 150, 150};
        corner[a] = 68;
        assert_true(rend_clip_misses(&clip, corner, 32));
        assert_false(rend_clip_misses(&clip, corner, 33));
        corner[a] = 200;
        assert_false(rend_clip_misses(&clip, corner, 1));
        corner[a] = 201;
        assert_true(rend_clip_misses(&clip, corner, 1));
    }
}

static void cutting_moves_the_side_that_faces_the_eye(void **unused)
{
    (void)unused;
    const double place[3] = {1, 2, 3};
    for (int a = 0; a < 3; a++)
        for (int sign = -1; sign <= 1; sign += 2) {
            double back[3] = {0.3, -0.3, 0.3};
            rend_box box = rend_clip_open();
            back[a] = sign;
            rend_clip_cut(back, place, &box);
            for (int b = 0; b < 3; b++) {
                assert_true(box.high[b] == (b == a && sign > 0 ? place[b] : INFINITY));
                assert_true(box.low[b] == (b == a && sign < 0 ? place[b] : -INFINITY));
            }
        }
    rend_box other = {{5, 5, 5}, {6, 6, 6}};
    const double back[3] = {0, 0, 1};
    rend_clip_cut(back, place, &other); /* all of it would be gone */
    assert_true(other.high[2] == 3 && isinf(other.low[2]));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(coordinates_are_inside_of_their_own_box),
        cmocka_unit_test(open_sides_hold_everything_and_boxes_elsewhere_nothing),
        cmocka_unit_test(cutting_moves_the_side_that_faces_the_eye),
        cmocka_unit_test(cubes_miss_a_box_by_one_step),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
