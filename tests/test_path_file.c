#include "render/path_file.h"
#include "tests/core_tools.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char HEAD[] = "{\"format\": \"instantpoints camera path\", \"version\": 1, ";

static bool read_text(const char *text, rend_path *out, mospt_err *err)
{
    char *folder = core_folder_make(), *file = core_path(folder, "path.json");
    core_file_write(file, text, strlen(text));
    bool ok = rend_path_read(file, out, err);
    free(file);
    core_folder_remove(folder);
    return ok;
}

static void assert_near(double a, double b)
{
    assert_true(fabs(a - b) <= 1e-12 * fmax(fabs(a), 1));
}

static void a_path_comes_back_as_it_was_written(void **unused)
{
    (void)unused;
    uint64_t state = 1;
    mospt_err err = {0};
    rend_path path = {.abrupt = true}, back = {0};
    char *folder = core_folder_make(), *file = core_path(folder, "path.json");
    for (int i = 0; i < 40; i++) {
        rend_key key = {.time_s = i + core_unit(&state) / 2,
                        .camera = {.up = {0, 0.125, 1}, .fov_rad = 0.5 + core_unit(&state)}};
        for (int a = 0; a < 3; a++)
            key.camera.eye[a] = 5e6 * core_unit(&state), key.camera.target[a] = core_unit(&state);
        if (i % 3 == 1) key.budget_points = 1 + core_below(&state, 1000000);
        if (i % 3 == 2) key.budget_points = REND_ALL;
        key.has_clip = i % 5 > 2;
        for (int a = 0; key.has_clip && a < 3; a++)
            key.clip.low[a] = i % 5 == 3 ? -INFINITY : 5e6 * core_unit(&state),
            key.clip.high[a] = a == 1 ? INFINITY : 6e6;
        if (i % 4 == 0) strcpy(key.colour, i == 0 ? "an \"odd\" name:2" : "elevation");
        CORE_NEED(rend_path_add(&path, &key, NULL, &err));
    }
    CORE_NEED(rend_path_write(&path, file, &err));
    CORE_NEED(rend_path_read(file, &back, &err));
    assert_int_equal(back.count, path.count);
    assert_true(back.abrupt);
    for (uint32_t i = 0; i < path.count; i++) {
        const rend_key *a = &path.keys[i], *b = &back.keys[i];
        assert_true(fabs(a->time_s - b->time_s) < 1e-6);
        for (int x = 0; x < 3; x++) {
            assert_near(a->camera.eye[x], b->camera.eye[x]);
            assert_near(a->camera.target[x], b->camera.target[x]);
            assert_near(a->camera.up[x], b->camera.up[x]);
        }
        assert_true(fabs(a->camera.fov_rad - b->camera.fov_rad) < 1e-8);
        assert_true(a->budget_points == b->budget_points);
        assert_string_equal(a->colour, b->colour);
        assert_true(a->has_clip == b->has_clip);
        for (int x = 0; a->has_clip && x < 3; x++) {
            if (isinf(a->clip.low[x])) assert_true(a->clip.low[x] == b->clip.low[x]);
            else assert_near(a->clip.low[x], b->clip.low[x]);
            if (isinf(a->clip.high[x])) assert_true(a->clip.high[x] == b->clip.high[x]);
            else assert_near(a->clip.high[x], b->clip.high[x]);
        }
    }
    rend_path_fini(&path);
    rend_path_fini(&back);
    free(file);
    core_folder_remove(folder);
}

static void what_is_left_out_has_a_default(void **unused)
{
    (void)unused;
    mospt_err err = {0};
    rend_path path = {0};
    char text[512];
    snprintf(text, sizeof text,
             "%s\"keys\": [{\"time\": 0, \"eye\": [1, 2, 3], \"target\": [4, 5, 6]}]}", HEAD);
    CORE_NEED(read_text(text, &path, &err));
    assert_true(path.keys[0].camera.up[2] == 1 && path.keys[0].budget_points == 0);
    assert_true(fabs(path.keys[0].camera.fov_rad - acos(-1) / 3) < 1e-12);
    assert_false(path.abrupt);
    rend_path_fini(&path);
}

static void every_malformed_member_is_a_format_error(void **unused)
{
    (void)unused;
    static const char *const bad[] = {
        "\"keys\": []",
        "\"keys\": 3",
        "\"keys\": [4]",
        "\"keyz\": [{}]",
        "\"abrupt\": 1, \"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6]}]",
        "\"keys\": [{\"eye\": [1,2,3], \"target\": [4,5,6]}]",
        "\"keys\": [{\"time\": \"0\", \"eye\": [1,2,3], \"target\": [4,5,6]}]",
        "\"keys\": [{\"time\": -1, \"eye\": [1,2,3], \"target\": [4,5,6]}]",
        "\"keys\": [{\"time\": 0, \"target\": [4,5,6]}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2], \"target\": [4,5,6]}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,\"3\"], \"target\": [4,5,6]}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [1,2,3]}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"up\": [0,0,0]}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"up\": 1}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"fov\": 0.5}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"fov\": \"60\"}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"budget\": 0}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"budget\": 1.5}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"budget\": \"most\"}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"colour\": \"\"}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"color\": \"rgb\"}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"clip\": [1,2,3]}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], \"clip\": null}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], "
        "\"clip\": [1,2,3,4,5,\"6\"]}]",
        "\"keys\": [{\"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6], "
        "\"clip\": [1,2,3,4,5,2]}]",
        "\"keys\": [{\"time\": 1, \"eye\": [1,2,3], \"target\": [4,5,6]},"
        " {\"time\": 1, \"eye\": [1,2,3], \"target\": [4,5,6]}]",
        "\"keys\": [{\"time\": 0, \"time\": 0, \"eye\": [1,2,3], \"target\": [4,5,6]}]",
    };
    mospt_err err = {0};
    rend_path path = {0};
    char text[1024];
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        snprintf(text, sizeof text, "%s%s}", HEAD, bad[i]);
        CORE_FAILS(read_text(text, &path, &err), MOSPT_EFORMAT);
        assert_null(path.keys);
    }
    CORE_FAILS(
        read_text("{\"format\": \"instantpoints camera path\", \"version\": 2, \"keys\": []}",
                  &path, &err),
        MOSPT_EFORMAT);
    CORE_FAILS(read_text("{\"format\": \"something\"}", &path, &err), MOSPT_EFORMAT);
    CORE_FAILS(read_text("", &path, &err), MOSPT_EFORMAT);
    CORE_FAILS(read_text("[1, 2]", &path, &err), MOSPT_EFORMAT);
    CORE_FAILS(rend_path_read("/nowhere/at/all.json", &path, &err), MOSPT_EIO);
}

static void every_truncation_is_a_format_error(void **unused)
{
    (void)unused;
    mospt_err err = {0};
    rend_path path = {0};
    char text[512];
    snprintf(text, sizeof text,
             "%s\"keys\": [{\"time\": 0, \"eye\": [1, 2, 3], \"target\": [4, 5, 6]}]}", HEAD);
    for (size_t size = strlen(text) - 1; size > 0; size--) {
        text[size] = '\0';
        CORE_FAILS(read_text(text, &path, &err), MOSPT_EFORMAT);
    }
}

static void a_potree_project_becomes_a_path(void **unused)
{
    (void)unused;
    static const char project[] =
        "{\n\ttype: \"Potree\",\n\tversion: 1.7, // comment\n\tview: {position: [1, 2, 3], target: "
        "[4, 5, 6,],},\n\tname: 'it\\'s',\n\tcameraAnimations: [\n\t\t{name: \"a\", duration: 8, "
        "controlPoints: [\n\t\t\t{position: [0, 0, +1.5e0], target: [0, 9, 1]},\n"
        "\t\t\t{position: [10, 0, -1], target: [0, 9, 1]},\n"
        "\t\t\t{position: [10, 30, 1], target: [0, 9, 1]},\n\t\t],},\n\t],\n}";
    static const char without[] = "{type: \"Potree\", view: {position: [1, 2, 3], target: [4, 5, "
                                  "6]}, cameraAnimations: []}";
    static const char broken[] = "{type: \"Potree\", view: {position: [1, 2], target: [4, 5, 6]}}";
    mospt_err err = {0};
    rend_path path = {0};
    CORE_NEED(read_text(project, &path, &err));
    assert_int_equal(path.count, 3);
    assert_true(path.keys[0].time_s == 0 && path.keys[2].time_s == 8);
    assert_true(path.keys[1].time_s > 1.5 && path.keys[1].time_s < 2.5); /* by the way gone */
    assert_true(path.keys[0].camera.eye[2] == 1.5 && path.keys[1].camera.target[1] == 9);
    rend_path_fini(&path);
    CORE_NEED(read_text(without, &path, &err));
    assert_int_equal(path.count, 1);
    rend_path_fini(&path);
    CORE_FAILS(read_text(broken, &path, &err), MOSPT_EFORMAT);
}

static void a_bundler_file_becomes_a_path(void **unused)
{
    (void)unused;
    /* The second camera stands at (1, 2, 3), is not turned, and so looks along -z. */
    static const char list[] = "# Bundle file v0.3\n3 0\n"
                               "0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n"
                               "1000 0 0\n1 0 0\n0 1 0\n0 0 1\n-1 -2 -3\n"
                               "1000 0 0\n1 0 0\n0 0 1\n0 -1 0\n-1 0 0\n";
    mospt_err err = {0};
    rend_path path = {0};
    CORE_NEED(read_text(list, &path, &err));
    assert_int_equal(path.count, 2);
    const rend_camera *c = &path.keys[0].camera;
    assert_true(c->eye[0] == 1 && c->eye[1] == 2 && c->eye[2] == 3);
    assert_true(c->target[0] == 1 && c->target[1] == 2 && c->target[2] < 3);
    assert_true(c->up[1] == 1);
    /* The third one's y axis is the world's z, and it looks along +y. */
    c = &path.keys[1].camera;
    assert_true(c->up[2] == 1 && c->target[1] > c->eye[1]);
    rend_path_fini(&path);
    char cut[sizeof list];
    for (size_t size = sizeof list - 8; size > 19; size -= 7) {
        memcpy(cut, list, size);
        cut[size] = '\0';
        CORE_FAILS(read_text(cut, &path, &err), MOSPT_EFORMAT);
    }
    CORE_FAILS(read_text("# Bundle file v0.3\n1e9 0\n", &path, &err), MOSPT_EFORMAT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_path_comes_back_as_it_was_written),
        cmocka_unit_test(what_is_left_out_has_a_default),
        cmocka_unit_test(every_malformed_member_is_a_format_error),
        cmocka_unit_test(every_truncation_is_a_format_error),
        cmocka_unit_test(a_potree_project_becomes_a_path),
        cmocka_unit_test(a_bundler_file_becomes_a_path),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
