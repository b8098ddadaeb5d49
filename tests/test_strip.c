#include "render/path_file.h"
#include "render/strip.h"
#include "tests/core_tools.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 1000, HEIGHT = 500 };

static rend_key at(double x)
{
    return (rend_key){
        .camera = {.eye = {x, 0, 0}, .target = {x, 1, 0}, .up = {0, 0, 1}, .fov_rad = 1}};
}

static void add(rend_strip *s, double x)
{
    rend_key now = at(x);
    assert_true(rend_strip_press(s, 'T', false, 0, &now));
    assert_non_null(strstr(s->notice, "added"));
}

static rend_strip three_keyframes(const char *file)
{
    rend_strip s;
    mospt_err err = {0};
    CORE_NEED(rend_strip_init(file, &s, &err));
    for (int i = 0; i < 3; i++)
        add(&s, i);
    return s;
}

static void assert_saved(const rend_strip *s)
{
    rend_path path;
    mospt_err err = {0};
    CORE_NEED(rend_path_read(s->file, &path, &err));
    assert_int_equal(path.count, s->path.count);
    for (uint32_t i = 0; i < path.count; i++) {
        assert_true(fabs(path.keys[i].time_s - s->path.keys[i].time_s) < 1e-6);
        assert_true(path.keys[i].camera.eye[0] == s->path.keys[i].camera.eye[0]);
    }
    rend_path_fini(&path);
}

static void keys_add_choose_move_replace_and_delete(void **unused)
{
    (void)unused;
    char *folder = core_folder_make(), *file = core_path(folder, "walk.json");
    rend_strip s = three_keyframes(file);
    rend_key now = at(9);
    assert_int_equal(s.path.count, 3);
    assert_saved(&s);
    rend_strip_press(&s, 'N', true, 0, &now); /* from the third to the second */
    assert_true(s.chosen == 1 && now.camera.eye[0] == 1);
    add(&s, 1.5); /* between the second and the third */
    assert_true(s.chosen == 2 && s.path.keys[2].camera.eye[0] == 1.5);
    assert_true(s.path.keys[2].time_s > s.path.keys[1].time_s);
    double before = s.path.keys[2].time_s;
    rend_strip_press(&s, '>', false, 0, &now);
    assert_true(s.path.keys[2].time_s == before + 0.5);
    rend_strip_press(&s, '<', false, 0, &now);
    assert_true(s.path.keys[2].time_s == before);
    now = at(7);
    rend_strip_press(&s, 'T', true, 0, &now);
    assert_true(s.path.count == 4 && s.path.keys[2].camera.eye[0] == 7);
    assert_saved(&s);
    for (int left = 3; left > 0; left--) {
        rend_strip_press(&s, 'X', false, 0, &now);
        assert_int_equal(s.path.count, left);
        assert_saved(&s);
    }
    rend_strip_press(&s, 'X', false, 0, &now);
    rend_strip_press(&s, 'X', false, 0, &now); /* none is left */
    assert_true(s.path.count == 0 && s.chosen == REND_STRIP_NONE);
    assert_false(rend_strip_press(&s, 'Q', false, 0, &now));
    rend_strip_fini(&s);
    free(file);
    core_folder_remove(folder);
}

static void a_mark_is_chosen_by_a_click_and_moved_by_dragging(void **unused)
{
    (void)unused;
    char *folder = core_folder_make(), *file = core_path(folder, "walk.json");
    rend_strip s = three_keyframes(file);
    rend_key now = at(9);
    assert_false(rend_strip_grip(&s, 500, 100, WIDTH, HEIGHT, 16, &now)); /* above the strip */
    assert_true(rend_strip_grip(&s, 500, HEIGHT - 10, WIDTH, HEIGHT, 16, &now));
    assert_true(s.chosen == 1 && now.camera.eye[0] == 1);
    assert_true(rend_strip_drag(&s, 700, WIDTH));
    rend_strip_release(&s);
    assert_true(fabs(s.path.keys[1].time_s - 6 * (700 - 16.0) / (WIDTH - 32)) < 1e-9);
    assert_saved(&s);
    assert_false(rend_strip_drag(&s, 100, WIDTH));
    rend_strip_fini(&s);
    free(file);
    core_folder_remove(folder);
}

static void playing_goes_from_the_chosen_one_to_the_end(void **unused)
{
    (void)unused;
    char *folder = core_folder_make(), *file = core_path(folder, "walk.json");
    rend_strip s = three_keyframes(file);
    rend_key now = at(9);
    rend_moment m;
    assert_false(rend_strip_play(&s, 0, &m));
    rend_strip_press(&s, 'J', false, 100, &now); /* the last is chosen: from the start */
    assert_true(rend_strip_play(&s, 100, &m) && m.camera.eye[0] == 0);
    assert_true(rend_strip_play(&s, 103, &m) && fabs(m.camera.eye[0] - 1) < 1e-6);
    assert_true(rend_strip_play(&s, 107, &m) && m.camera.eye[0] == 2);
    assert_false(rend_strip_play(&s, 108, &m));
    rend_strip_press(&s, 'N', true, 0, &now);
    rend_strip_press(&s, 'J', false, 200, &now);
    assert_true(rend_strip_play(&s, 200, &m) && fabs(m.camera.eye[0] - 1) < 1e-6);
    rend_strip_press(&s, 'J', false, 201, &now); /* stops it */
    assert_false(rend_strip_play(&s, 201, &m));
    rend_strip_fini(&s);
    free(file);
    core_folder_remove(folder);
}

static void a_file_that_is_there_is_read_and_a_bad_one_is_an_error(void **unused)
{
    (void)unused;
    char *folder = core_folder_make(), *file = core_path(folder, "walk.json");
    mospt_err err = {0};
    rend_strip s = three_keyframes(file), again;
    CORE_NEED(rend_strip_init(file, &again, &err));
    assert_true(again.path.count == 3 && again.shown && again.chosen == REND_STRIP_NONE);
    rend_strip_fini(&s);
    rend_strip_fini(&again);
    core_file_write(file, "{", 1);
    CORE_FAILS(rend_strip_init(file, &s, &err), MOSPT_EFORMAT);
    free(file);
    core_folder_remove(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(keys_add_choose_move_replace_and_delete),
        cmocka_unit_test(a_mark_is_chosen_by_a_click_and_moved_by_dragging),
        cmocka_unit_test(playing_goes_from_the_chosen_one_to_the_end),
        cmocka_unit_test(a_file_that_is_there_is_read_and_a_bad_one_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
