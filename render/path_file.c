#include "render/path_file.h"

#include "mospt/file.h"
#include "render/path_import.h"

#include <jansson.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TEXT_SIZE_MAX = 16 << 20, VERSION = 1 };
#define RAD_PER_DEG (3.14159265358979323846 / 180)
#define FOV_DEFAULT_DEG 60

static const char FORMAT[] = "instantpoints camera path";

/* Where in the file something is wrong. */
typedef struct {
    const char *file;
    size_t key; /* counted from 1; 0: none */
    mospt_err *err;
} reader;

static bool fault(const reader *r, const char *what, const char *name)
{
    char place[48] = "";
    if (r->key > 0) snprintf(place, sizeof place, "keyframe %zu: ", r->key);
    return mospt_err_set(r->err, MOSPT_EFORMAT, mospt_at_file(r->file), "%s\"%.40s\" %s", place,
                         name, what);
}

static bool knows_all(const reader *r, json_t *object, const char *const *names)
{
    const char *name;
    json_t *value;
    json_object_foreach(object, name, value)
    {
        size_t i = 0;
        while (names[i] != NULL && strcmp(names[i], name) != 0)
            i++;
        if (names[i] == NULL) return fault(r, "is not known here", name);
    }
    return true;
}

static bool read_real(const reader *r, json_t *object, const char *name, double *out)
{
    json_t *value = json_object_get(object, name);
    if (!json_is_number(value)) return fault(r, "must be a number", name);
    *out = json_number_value(value);
    return true;
}

static bool read_triple(const reader *r, json_t *object, const char *name, double out[3])
{
    json_t *value = json_object_get(object, name);
    if (json_array_size(value) != 3) return fault(r, "must be three numbers", name);
    for (size_t a = 0; a < 3; a++) {
        json_t *number = json_array_get(value, a);
        if (!json_is_number(number)) return fault(r, "must be three numbers", name);
        out[a] = json_number_value(number);
    }
    return true;
}

static bool read_budget(const reader *r, json_t *object, uint64_t *out)
{
    json_t *value = json_object_get(object, "budget");
    const char *text = json_string_value(value);
    if (value == NULL) return true;
    if (text != NULL && strcmp(text, "all") == 0) *out = REND_ALL;
    else if (json_is_integer(value) && json_integer_value(value) > 0)
        *out = (uint64_t)json_integer_value(value);
    else return fault(r, "must be a number of points, or \"all\"", "budget");
    return true;
}

static bool read_colour(const reader *r, json_t *object, rend_key *out)
{
    json_t *value = json_object_get(object, "colour");
    const char *text = json_string_value(value);
    if (value == NULL) return true;
    if (text == NULL || text[0] == '\0' || strlen(text) >= sizeof out->colour)
        return fault(r, "must be the name of what colours show", "colour");
    strcpy(out->colour, text);
    return true;
}

static bool read_clip(const reader *r, json_t *object, rend_key *out)
{
    json_t *value = json_object_get(object, "clip");
    if (value == NULL) return true;
    bool ok = json_array_size(value) == 6;
    for (size_t i = 0; ok && i < 6; i++) {
        json_t *side = json_array_get(value, i);
        double *to = i < 3 ? &out->clip.low[i] : &out->clip.high[i - 3];
        ok = json_is_number(side) || json_is_null(side);
        *to = json_is_null(side) ? (i < 3 ? -INFINITY : INFINITY) : json_number_value(side);
    }
    out->has_clip = ok;
    return ok || fault(r, "must be six numbers, or null where a side is open", "clip");
}

static bool read_key(const reader *r, json_t *object, rend_key *out)
{
    static const char *const names[] = {"time",   "eye",    "target", "up", "fov",
                                        "budget", "colour", "clip",   NULL};
    double fov = FOV_DEFAULT_DEG;
    rend_key key = {.camera.up = {0, 0, 1}};
    if (!json_is_object(object)) return fault(r, "must be an object", "keys");
    if (!knows_all(r, object, names) || !read_real(r, object, "time", &key.time_s) ||
        !read_triple(r, object, "eye", key.camera.eye) ||
        !read_triple(r, object, "target", key.camera.target) ||
        !read_budget(r, object, &key.budget_points) || !read_colour(r, object, &key) ||
        !read_clip(r, object, &key))
        return false;
    if (json_object_get(object, "up") != NULL && !read_triple(r, object, "up", key.camera.up))
        return false;
    if (json_object_get(object, "fov") != NULL && !read_real(r, object, "fov", &fov)) return false;
    key.camera.fov_rad = fov * RAD_PER_DEG;
    *out = key;
    return true;
}

static bool read_keys(reader *r, json_t *keys, rend_path *out)
{
    size_t count = json_array_size(keys);
    if (!json_is_array(keys)) return fault(r, "must be a list", "keys");
    if (count > REND_KEYS_MAX) return fault(r, "are too many", "keys");
    out->keys = calloc(count + 1, sizeof *out->keys);
    if (out->keys == NULL) return mospt_err_nomem(r->err, count * sizeof *out->keys);
    for (out->count = 0; out->count < count; out->count++) {
        r->key = out->count + 1;
        if (!read_key(r, json_array_get(keys, out->count), &out->keys[out->count])) return false;
    }
    return true;
}

static bool read_path(reader *r, json_t *json, rend_path *out)
{
    static const char *const names[] = {"format", "version", "abrupt", "keys", NULL};
    json_t *abrupt = json_object_get(json, "abrupt");
    if (!knows_all(r, json, names)) return false;
    if (json_integer_value(json_object_get(json, "version")) != VERSION)
        return fault(r, "must be 1", "version");
    if (abrupt != NULL && !json_is_boolean(abrupt))
        return fault(r, "must be true or false", "abrupt");
    out->abrupt = json_is_true(abrupt);
    return read_keys(r, json_object_get(json, "keys"), out);
}

/* What is wrong with the path as a whole is wrong with the file. */
static bool is_right(const reader *r, const rend_path *path)
{
    mospt_err what = {0};
    return rend_path_is_valid(path, &what) ||
           mospt_err_set(r->err, MOSPT_EFORMAT, mospt_at_file(r->file), "%s", what.message);
}

static bool is_ours(const json_t *json)
{
    const char *format = json_string_value(json_object_get(json, "format"));
    return format != NULL && strcmp(format, FORMAT) == 0;
}

static bool read_text(const char *file, const char *text, size_t size, rend_path *out,
                      mospt_err *err)
{
    reader r = {.file = file, .err = err};
    json_error_t why;
    json_t *json = json_loadb(text, size, JSON_REJECT_DUPLICATES, &why);
    bool ok;
    if (is_ours(json)) ok = read_path(&r, json, out) && is_right(&r, out);
    else if (rend_path_is_foreign(text)) {
        ok = rend_path_import(file, text, out, err) && is_right(&r, out);
    } else if (json == NULL) {
        int line = why.line > 0 ? why.line : 1;
        ok = mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(file, (uint64_t)line), "%s", why.text);
    } else ok = fault(&r, "must be \"instantpoints camera path\"", "format");
    json_decref(json);
    return ok;
}

bool rend_path_read(const char *file, rend_path *out, mospt_err *err)
{
    char *text;
    size_t size;
    rend_path path = {0};
    if (!mospt_file_read_whole(file, TEXT_SIZE_MAX, &text, &size, err)) return false;
    bool ok = read_text(file, text, size, &path, err);
    free(text);
    if (ok) *out = path;
    else rend_path_fini(&path);
    return ok;
}

/* ---- writing ---- */

static void print_triple(FILE *f, const char *name, const double v[3])
{
    fprintf(f, ", \"%s\": [%.13g, %.13g, %.13g]", name, v[0], v[1], v[2]);
}

/* Names of attributes may hold anything. */
static void print_text(FILE *f, const char *name, const char *text)
{
    json_t *json = json_string(text);
    fprintf(f, ", \"%s\": ", name);
    json_dumpf(json, f, JSON_ENCODE_ANY);
    json_decref(json);
}

static void print_clip(FILE *f, const rend_box *clip)
{
    for (int i = 0; i < 6; i++) {
        double side = i < 3 ? clip->low[i] : clip->high[i - 3];
        fprintf(f, i == 0 ? ", \"clip\": [" : ", ");
        fprintf(f, isfinite(side) ? "%.13g" : "null", side);
    }
    fputc(']', f);
}

static void print_key(FILE *f, const rend_key *key)
{
    const rend_camera *c = &key->camera;
    fprintf(f, "  {\"time\": %.9g", key->time_s);
    print_triple(f, "eye", c->eye);
    print_triple(f, "target", c->target);
    print_triple(f, "up", c->up);
    fprintf(f, ", \"fov\": %.9g", c->fov_rad / RAD_PER_DEG);
    if (key->budget_points == REND_ALL) fprintf(f, ", \"budget\": \"all\"");
    else if (key->budget_points > 0) fprintf(f, ", \"budget\": %" PRIu64, key->budget_points);
    if (key->colour[0] != '\0') print_text(f, "colour", key->colour);
    if (key->has_clip) print_clip(f, &key->clip);
    fprintf(f, "}");
}

bool rend_path_write(const rend_path *path, const char *file, mospt_err *err)
{
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);
    if (f == NULL) return mospt_err_nomem(err, 0);
    fprintf(f, "{\"format\": \"%s\", \"version\": %d, \"abrupt\": %s, \"keys\": [\n", FORMAT,
            VERSION, path->abrupt ? "true" : "false");
    for (uint32_t i = 0; i < path->count; i++) {
        print_key(f, &path->keys[i]);
        fprintf(f, "%s\n", i + 1 < path->count ? "," : "");
    }
    fprintf(f, "]}\n");
    bool ok = fclose(f) == 0 || mospt_err_nomem(err, size);
    ok = ok && mospt_file_replace(file, text, size, err);
    free(text);
    return ok;
}
