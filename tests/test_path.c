#include "render/path.h"
#include "tests/core_tools.h"

#include <string.h>

static rend_key key_at(double time_s)
{
    return (rend_key){
        .time_s = time_s,
        .camera = {.eye = {time_s, 0, 0}, .target = {time_s, 1, 0}, .up = {0, 0, 1}, .fov_rad = 1}};
}

static rend_path path_of(const double *times, uint32_t count)
{
    rend_path path = {0};
    mospt_err err = {0};
    for (uint32_t i = 0; i < count; i++) {
        rend_key key = key_at(times[i]);
        CORE_NEED(rend_path_add(&path, &key, NULL, &err));
    }
    return path;
}

static void keyframes_are_kept_by_time(void **unused)
{
    (void)unused;
    uint64_t state = 1;
    rend_path path = {0};
    mospt_err err = {0};
    for (int i = 0; i < 200; i++) {
        rend_key key = key_at(100 * core_unit(&state));
        uint32_t at;
        CORE_NEED(rend_path_add(&path, &key, &at, &err));
        assert_true(path.keys[at].camera.eye[0] == key.camera.eye[0]);
        CORE_NEED(rend_path_is_valid(&path, &err));
    }
    while (path.count > 1) {
        rend_path_remove(&path, core_below(&state, path.count));
        CORE_NEED(rend_path_is_valid(&path, &err));
    }
    rend_path_fini(&path);
}

static void a_keyframe_at_the_same_time_takes_the_place_of_the_old_one(void **unused)
{
    (void)unused;
    const double times[] = {0, 5, 10};
    mospt_err err = {0};
    rend_path path = path_of(times, 3);
    rend_key key = key_at(5);
    key.camera.eye[2] = 7;
    uint32_t at;
    CORE_NEED(rend_path_add(&path, &key, &at, &err));
    assert_int_equal(path.count, 3);
    assert_int_equal(at, 1);
    assert_true(path.keys[1].camera.eye[2] == 7);
    rend_path_fini(&path);
}

static void a_keyframe_moves_no_further_than_to_its_neighbours(void **unused)
{
    (void)unused;
    const double times[] = {0, 5, 10};
    mospt_err err = {0};
    rend_path path = path_of(times, 3);
    rend_path_move(&path, 1, 7);
    assert_true(path.keys[1].time_s == 7);
    rend_path_move(&path, 1, 70);
    assert_true(path.keys[1].time_s < 10 && path.keys[1].time_s > 9.9);
    rend_path_move(&path, 1, -3);
    assert_true(path.keys[1].time_s > 0 && path.keys[1].time_s < 0.1);
    rend_path_move(&path, 2, 20);
    assert_true(rend_path_duration(&path) == 20);
    CORE_NEED(rend_path_is_valid(&path, &err));
    rend_path_fini(&path);
}

static void fitting_keeps_the_proportions(void **unused)
{
    (void)unused;
    const double times[] = {10, 15, 30};
    rend_path path = path_of(times, 3);
    rend_path_fit(&path, 40);
    assert_true(path.keys[0].time_s == 0 && path.keys[1].time_s == 10 && path.keys[2].time_s == 40);
    rend_path_fini(&path);
}

static void every_wrong_keyframe_is_named(void **unused)
{
    (void)unused;
    const double times[] = {0, 5, 10};
    mospt_err err = {0};
    for (int fault = 0; fault < 7; fault++) {
        rend_path path = path_of(times, 3);
        rend_key *key = &path.keys[1];
        if (fault == 0) key->time_s = 0;
        if (fault == 1) key->time_s = 0.0 / 0.0;
        if (fault == 2) key->camera.eye[1] = 1.0 / 0.0;
        if (fault == 3) key->camera.target[1] = 0;
        if (fault == 4) key->camera.up[2] = 0;
        if (fault == 5) key->camera.fov_rad = 0;
        if (fault == 6) key->camera.fov_rad = 3.1;
        CORE_FAILS(rend_path_is_valid(&path, &err), MOSPT_EINVAL);
        assert_non_null(strstr(err.message, "keyframe 2"));
        rend_path_fini(&path);
    }
    const rend_path none = {0};
    CORE_FAILS(rend_path_is_valid(&none, &err), MOSPT_EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(keyframes_are_kept_by_time),
        cmocka_unit_test(a_keyframe_at_the_same_time_takes_the_place_of_the_old_one),
        cmocka_unit_test(a_keyframe_moves_no_further_than_to_its_neighbours),
        cmocka_unit_test(fitting_keeps_the_proportions),
        cmocka_unit_test(every_wrong_keyframe_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
