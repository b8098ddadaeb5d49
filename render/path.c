#include "render/path.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FOV_MIN_RAD 0.0174
#define FOV_MAX_RAD 2.9671

void rend_path_fini(rend_path *path)
{
    free(path->keys);
    *path = (rend_path){0};
}

static bool is_finite3(const double v[3])
{
    return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
}

/* NULL: nothing is wrong with it. */
static const char *fault_of(const rend_key *key)
{
    const rend_camera *c = &key->camera;
    if (!(key->time_s >= 0 && key->time_s <= REND_TIME_MAX_S)) return "its time is out of range";
    if (!is_finite3(c->eye) || !is_finite3(c->target) || !is_finite3(c->up))
        return "eye, target and up must be finite numbers";
    if (memcmp(c->eye, c->target, sizeof c->eye) == 0) return "the eye is on its target";
    if (c->up[0] == 0 && c->up[1] == 0 && c->up[2] == 0) return "the up direction is zero";
    if (!(c->fov_rad >= FOV_MIN_RAD && c->fov_rad <= FOV_MAX_RAD))
        return "the field of view is not between 1 and 170 degrees";
    for (int a = 0; key->has_clip && a < 3; a++)
        if (!(key->clip.low[a] <= key->clip.high[a])) return "its clip box ends before it begins";
    return NULL;
}

bool rend_path_is_valid(const rend_path *path, mospt_err *err)
{
    if (path->count == 0 || path->count > REND_KEYS_MAX)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "a camera path has 1 to %d keyframes, this one has %u", REND_KEYS_MAX,
                             path->count);
    for (uint32_t i = 0; i < path->count; i++) {
        const char *fault = fault_of(&path->keys[i]);
        if (fault == NULL && i > 0 &&
            path->keys[i].time_s < path->keys[i - 1].time_s + 0.999 * REND_KEY_GAP_S)
            fault = "its time is not after that of the one before";
        if (fault != NULL)
            return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(), "keyframe %u: %s", i + 1,
                                 fault);
    }
    return true;
}

bool rend_path_add(rend_path *path, const rend_key *key, uint32_t *at, mospt_err *err)
{
    uint32_t i = 0;
    while (i < path->count && path->keys[i].time_s <= key->time_s - REND_KEY_GAP_S)
        i++;
    bool is_there = i < path->count && path->keys[i].time_s < key->time_s + REND_KEY_GAP_S;
    if (at != NULL) *at = i;
    if (is_there) {
        double time_s = path->keys[i].time_s; /* so that neighbours stay apart */
        path->keys[i] = *key;
        path->keys[i].time_s = time_s;
        return true;
    }
    if (path->count == REND_KEYS_MAX)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "a camera path has at most %d keyframes", REND_KEYS_MAX);
    rend_key *keys = realloc(path->keys, (path->count + 1) * sizeof *keys);
    if (keys == NULL) return mospt_err_nomem(err, (path->count + 1) * sizeof *keys);
    memmove(keys + i + 1, keys + i, (path->count - i) * sizeof *keys);
    keys[i] = *key;
    path->keys = keys;
    path->count++;
    return true;
}

void rend_path_remove(rend_path *path, uint32_t index)
{
    rend_key *keys = path->keys;
    memmove(keys + index, keys + index + 1, (path->count - index - 1) * sizeof *keys);
    path->count--;
}

void rend_path_move(rend_path *path, uint32_t index, double time_s)
{
    rend_key *keys = path->keys;
    double low = index > 0 ? keys[index - 1].time_s + REND_KEY_GAP_S : 0;
    double high =
        index + 1 < path->count ? keys[index + 1].time_s - REND_KEY_GAP_S : REND_TIME_MAX_S;
    keys[index].time_s = fmin(fmax(time_s, low), high);
}

void rend_path_fit(rend_path *path, double duration_s)
{
    if (path->count == 0) return;
    double from = path->keys[0].time_s, span = path->keys[path->count - 1].time_s - from;
    double gap = REND_KEY_GAP_S, last = -gap;
    for (uint32_t i = 0; i < path->count; i++) {
        double t = span > 0 ? (path->keys[i].time_s - from) / span * duration_s : 0;
        last = path->keys[i].time_s = fmax(t, last + gap);
    }
}

double rend_path_duration(const rend_path *path)
{
    return path->count > 0 ? path->keys[path->count - 1].time_s : 0;
}
