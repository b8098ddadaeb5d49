#include "render/path_import.h"

#include "render/json5.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WALK_M_PER_S 1.4
#define LONGEST_S 600.0 /* of a path that does not say how long it lasts */
#define FOV_DEFAULT_RAD (60 * 3.14159265358979323846 / 180)

static const char BUNDLER[] = "# Bundle file v0.3";

static bool add(rend_path *path, const double eye[3], const double target[3], double fov_rad,
                mospt_err *err)
{
    rend_key key = {.time_s = path->count, .camera = {.up = {0, 0, 1}, .fov_rad = fov_rad}};
    memcpy(key.camera.eye, eye, sizeof key.camera.eye);
    memcpy(key.camera.target, target, sizeof key.camera.target);
    return rend_path_add(path, &key, NULL, err);
}

/* Times by the way gone; a camera that only turns takes as long as half a metre.
 * duration_s   0: at a walking pace */
static void set_times(rend_path *path, double duration_s)
{
    double way = 0;
    for (uint32_t i = 0; i < path->count; i++) {
        const double *here = path->keys[i].camera.eye;
        double d2 = 0;
        for (int a = 0; i > 0 && a < 3; a++)
            d2 += pow(here[a] - path->keys[i - 1].camera.eye[a], 2);
        if (i > 0) way += fmax(sqrt(d2), 0.5);
        path->keys[i].time_s = way / WALK_M_PER_S;
    }
    if (!(duration_s > 0) && way / WALK_M_PER_S > LONGEST_S) duration_s = LONGEST_S;
    if (duration_s > 0) rend_path_fit(path, duration_s);
}

/* ---- Potree ---- */

static bool get_triple(json_t *array, double out[3])
{
    for (size_t a = 0; a < 3; a++) {
        json_t *number = json_array_get(array, a);
        if (!json_is_number(number)) return false;
        out[a] = json_number_value(number);
    }
    return true;
}

static bool add_view(json_t *view, rend_path *path, const char *file, mospt_err *err)
{
    double eye[3], target[3];
    if (!get_triple(json_object_get(view, "position"), eye) ||
        !get_triple(json_object_get(view, "target"), target))
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(file),
                             "camera %u of the Potree project has no position and target",
                             path->count + 1);
    return add(path, eye, target, FOV_DEFAULT_RAD, err);
}

static bool import_potree(const char *file, json_t *project, rend_path *out, mospt_err *err)
{
    json_t *animation, *point, *animations = json_object_get(project, "cameraAnimations");
    size_t i, j;
    json_array_foreach(animations, i, animation)
    {
        json_t *points = json_object_get(animation, "controlPoints");
        if (json_array_size(points) < 2) continue;
        json_array_foreach(points, j, point)
        {
            if (!add_view(point, out, file, err)) return false;
        }
        set_times(out, json_number_value(json_object_get(animation, "duration")));
        return true;
    }
    return add_view(json_object_get(project, "view"), out, file, err);
}

static bool import_json(const char *file, const char *text, rend_path *out, mospt_err *err)
{
    json_error_t why;
    char *plain = rend_json5_to_json(text);
    if (plain == NULL) return mospt_err_nomem(err, strlen(text));
    json_t *json = json_loads(plain, 0, &why);
    free(plain);
    int line = why.line > 0 ? why.line : 1;
    bool ok = json != NULL || mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(file, (uint64_t)line),
                                            "%s", why.text);
    ok = ok && import_potree(file, json, out, err);
    json_decref(json);
    return ok;
}

/* ---- Bundler ---- */

static bool next_reals(const char **at, double *out, int count)
{
    for (int i = 0; i < count; i++) {
        char *end;
        out[i] = strtod(*at, &end);
        if (end == *at) return false;
        *at = end;
    }
    return true;
}

/* Bundler's cameras look along -z; x_eye = R x + t. */
static bool add_bundler_camera(const double v[15], rend_path *path, mospt_err *err)
{
    const double *r = v + 3, *t = v + 12;
    double eye[3], target[3];
    for (int a = 0; a < 3; a++) {
        eye[a] = -(r[a] * t[0] + r[3 + a] * t[1] + r[6 + a] * t[2]);
        target[a] = eye[a] - 10 * r[6 + a];
    }
    if (!add(path, eye, target, FOV_DEFAULT_RAD, err)) return false;
    for (int a = 0; a < 3; a++)
        path->keys[path->count - 1].camera.up[a] = r[3 + a];
    return true;
}

static bool import_bundler(const char *file, const char *text, rend_path *out, mospt_err *err)
{
    double head[2], camera[15];
    const char *at = text + strcspn(text, "\n");
    if (!next_reals(&at, head, 2) || !(head[0] >= 1 && head[0] <= REND_KEYS_MAX))
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(file, 2),
                             "there is no number of cameras between 1 and %d", REND_KEYS_MAX);
    for (int i = 0; i < (int)head[0]; i++) {
        if (!next_reals(&at, camera, 15))
            return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(file),
                                 "camera %d is not fifteen numbers", i + 1);
        if (camera[0] != 0 && !add_bundler_camera(camera, out, err)) return false;
    }
    set_times(out, 0);
    return true;
}

bool rend_path_is_foreign(const char *text)
{
    return strncmp(text, BUNDLER, sizeof BUNDLER - 1) == 0 ||
           (strchr(text, '{') != NULL && strstr(text, "Potree") != NULL &&
            strstr(text, "view") != NULL);
}

bool rend_path_import(const char *file, const char *text, rend_path *out, mospt_err *err)
{
    if (strncmp(text, BUNDLER, sizeof BUNDLER - 1) == 0)
        return import_bundler(file, text, out, err);
    return import_json(file, text, out, err);
}
