#include "render/strip.h"

#include "render/path_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MARKS_MAX = 500, LINES = 2 };
#define STEP_S 0.5     /* a keyframe is moved by */
#define APPEND_S 3.0   /* after the last one comes the next */
#define GRIP_PX 8      /* around a mark */
#define MARGIN_PX 16.0 /* beside the outermost marks */

static const float SHADE[4] = {0.05f, 0.06f, 0.07f, 0.72f}, MARK[4] = {0.75f, 0.78f, 0.82f, 1},
                   CHOSEN[4] = {1, 0.75f, 0.35f, 1}, LINE[4] = {0.4f, 0.43f, 0.47f, 1};

bool rend_strip_init(const char *file, rend_strip *out, mospt_err *err)
{
    rend_strip s = {.chosen = REND_STRIP_NONE};
    s.file = strdup(file != NULL ? file : "walk.json");
    bool ok = s.file != NULL || mospt_err_nomem(err, 0);
    if (ok && file != NULL && access(file, F_OK) == 0) ok = rend_path_read(file, &s.path, err);
    s.shown = s.path.count > 0;
    if (ok) *out = s;
    else rend_strip_fini(&s);
    return ok;
}

void rend_strip_fini(rend_strip *strip)
{
    rend_path_fini(&strip->path);
    rend_curve_destroy(strip->playing);
    free(strip->file);
    *strip = (rend_strip){.chosen = REND_STRIP_NONE};
}

static void tell_error(rend_strip *s, const mospt_err *err)
{
    mospt_err_text(err, s->notice, sizeof s->notice);
}

static void stop(rend_strip *s)
{
    rend_curve_destroy(s->playing);
    s->playing = NULL;
}

/* A path without keyframes is no file. */
static void save(rend_strip *s, const char *what)
{
    mospt_err err = {0};
    s->shown = true;
    stop(s);
    if (s->path.count == 0) snprintf(s->notice, sizeof s->notice, "no keyframes left");
    else if (!rend_path_write(&s->path, s->file, &err)) tell_error(s, &err);
    else
        snprintf(s->notice, sizeof s->notice, "keyframe %d of %u %s, saved in %s", s->chosen + 1,
                 s->path.count, what, s->file);
}

/* ---- keys ---- */

/* Behind the last comes the first. */
static void choose(rend_strip *s, int32_t index, rend_key *now)
{
    int32_t last = (int32_t)s->path.count - 1;
    stop(s);
    if (last < 0) return;
    s->chosen = index < 0 ? last : index > last ? 0 : index;
    *now = s->path.keys[s->chosen];
}

/* Behind the chosen one: in the middle of the way to the next, or after the last. */
static double time_of_next(const rend_strip *s)
{
    const rend_key *keys = s->path.keys;
    uint32_t count = s->path.count, after = s->chosen >= 0 ? (uint32_t)s->chosen + 1 : count;
    if (count == 0) return 0;
    if (after >= count) return keys[count - 1].time_s + APPEND_S;
    return 0.5 * (keys[after - 1].time_s + keys[after].time_s);
}

static void add(rend_strip *s, bool replace, const rend_key *now)
{
    mospt_err err = {0};
    uint32_t at;
    rend_key key = *now;
    bool is_chosen = s->chosen >= 0;
    key.time_s = replace && is_chosen ? s->path.keys[s->chosen].time_s : time_of_next(s);
    if (!rend_path_add(&s->path, &key, &at, &err)) {
        tell_error(s, &err);
        return;
    }
    s->chosen = (int32_t)at;
    save(s, replace && is_chosen ? "replaced" : "added");
}

static void delete_chosen(rend_strip *s)
{
    if (s->chosen < 0) return;
    rend_path_remove(&s->path, (uint32_t)s->chosen);
    if (s->chosen >= (int32_t)s->path.count) s->chosen = (int32_t)s->path.count - 1;
    save(s, "is next");
}

static void move_chosen(rend_strip *s, double by_s)
{
    if (s->chosen < 0) return;
    const rend_key *key = &s->path.keys[s->chosen];
    rend_path_move(&s->path, (uint32_t)s->chosen, key->time_s + by_s);
    save(s, "moved");
}

static void toggle_play(rend_strip *s, double seconds)
{
    mospt_err err = {0};
    bool was_playing = s->playing != NULL;
    stop(s);
    if (was_playing || s->path.count < 2) return;
    bool last = s->chosen < 0 || s->chosen + 1 == (int32_t)s->path.count;
    s->played_from_s = last ? 0 : s->path.keys[s->chosen].time_s;
    s->started_s = seconds;
    if (!rend_curve_create(&s->path, &s->playing, &err)) tell_error(s, &err);
}

bool rend_strip_press(rend_strip *strip, int key, bool shift, double seconds, rend_key *now)
{
    if (key == 'T') add(strip, shift, now);
    else if (key == 'X') delete_chosen(strip);
    else if (key == 'J') toggle_play(strip, seconds);
    else if (key == '<') move_chosen(strip, -STEP_S);
    else if (key == '>') move_chosen(strip, STEP_S);
    else if (key == 'N') choose(strip, strip->chosen + (shift ? -1 : 1), now);
    else return false;
    return true;
}

/* ---- the mouse ---- */

static double span_of(const rend_strip *s)
{
    return fmax(rend_path_duration(&s->path), 1);
}

static double place_of(const rend_strip *s, double time_s, uint32_t width)
{
    return MARGIN_PX + time_s / span_of(s) * (width - 2 * MARGIN_PX);
}

bool rend_strip_grip(rend_strip *strip, double x, double y, uint32_t width, uint32_t height,
                     float line, rend_key *now)
{
    double nearest = GRIP_PX;
    int32_t found = REND_STRIP_NONE;
    if (!strip->shown || y < height - (double)(LINES * line)) return false;
    for (uint32_t i = 0; i < strip->path.count; i++) {
        double away = fabs(place_of(strip, strip->path.keys[i].time_s, width) - x);
        if (away < nearest) nearest = away, found = (int32_t)i;
    }
    if (found >= 0) choose(strip, found, now);
    strip->dragging = found >= 0;
    return true;
}

bool rend_strip_drag(rend_strip *strip, double x, uint32_t width)
{
    if (!strip->dragging) return false;
    double share = (x - MARGIN_PX) / (width - 2 * MARGIN_PX);
    rend_path_move(&strip->path, (uint32_t)strip->chosen, share * span_of(strip));
    return true;
}

void rend_strip_release(rend_strip *strip)
{
    if (strip->dragging) save(strip, "moved");
    strip->dragging = false;
}

/* ---- playing and drawing ---- */

bool rend_strip_play(rend_strip *strip, double seconds, rend_moment *out)
{
    if (strip->playing == NULL) return false;
    double time_s = strip->played_from_s + seconds - strip->started_s;
    rend_curve_at(strip->playing, time_s, out);
    if (time_s >= rend_path_duration(&strip->path)) stop(strip);
    return true;
}

static rgl_label panel(float x, float y, float width, float height, const float colour[4])
{
    rgl_label p = {.x = x, .y = y, .panel_size = {width, height}};
    memcpy(p.colour, colour, sizeof p.colour);
    return p;
}

bool rend_strip_draw(const rend_strip *strip, rgl_text *text, uint32_t width, uint32_t height,
                     mospt_err *err)
{
    rgl_label labels[MARKS_MAX + 4];
    char words[128];
    uint32_t count = 0, marks = strip->path.count < MARKS_MAX ? strip->path.count : MARKS_MAX;
    float line = rgl_text_metrics(text).line, top = (float)height - LINES * line;
    if (!strip->shown) return true;
    labels[count++] = panel(0, top, (float)width, LINES * line, SHADE);
    labels[count++] =
        panel((float)MARGIN_PX, top + 0.45f * line, (float)width - 2 * (float)MARGIN_PX, 2, LINE);
    for (uint32_t i = 0; i < marks; i++) {
        bool chosen = (int32_t)i == strip->chosen;
        float x = (float)place_of(strip, strip->path.keys[i].time_s, width), w = chosen ? 8 : 4;
        labels[count++] =
            panel(x - w / 2, top + 0.1f * line, w, 0.75f * line, chosen ? CHOSEN : MARK);
    }
    snprintf(words, sizeof words, "%u keyframes, %.1f s   T take  N next  X delete  < > move  J %s",
             strip->path.count, rend_path_duration(&strip->path),
             strip->playing != NULL ? "stop" : "play");
    labels[count] = (rgl_label){.x = (float)MARGIN_PX, .y = top + line, .words = words};
    memcpy(labels[count++].colour, MARK, sizeof MARK);
    return rgl_text_draw(text, width, height, labels, count, err);
}
