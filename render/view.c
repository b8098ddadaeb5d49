#include "render/view.h"

#include "render/engine.h"
#include "render/gl/text.h"
#include "render/gl/window.h"
#include "render/hands.h"
#include "render/hud.h"
#include "render/image.h"
#include "render/look.h"
#include "render/motion.h"
#include "render/orbit.h"
#include "render/stage.h"
#include "render/strip.h"
#include "render/watch.h"

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { TEXT_PX = 14, PICK_RADIUS_PX = 6, NOTICE_S = 4 };
#define BUDGET_MIN UINT64_C(10000)
#define STOP_ASKED_S 0.25 /* between two looks at whether to stop */
#define WATCH_S 1.0       /* between two looks at whether the dataset has changed */

typedef struct {
    const mospt_dataset *dataset;
    mospt_dataset *newer; /* owned; NULL: the dataset is the one that was given */
    rend_watch watch;
    double watched_at;
    uint32_t gpu_halved, resets;
    const rend_view_options *options;
    rgl_window *window;
    rend_engine engine;
    rgl_text *text; /* NULL: no font */
    float text_scale;
    rend_stage *stage;
    rend_view_of view;
    rend_camera home;
    rend_choice choices[REND_CHOICES_MAX]; /* what colours can show */
    uint32_t choice_count;
    bool help, no_legend, quit, dirty;
    rend_strip strip;
    bool budget_changed;
    rend_hands hands;

    atomic_bool loaded; /* set by the loader's threads: the next frame shows more */
    rend_progress progress;
    rend_motion motion;
    double frame_ms, notice_until;
    char notice[1200];
    rend_view_result result;
} viewer;

static void on_loaded(void *user)
{
    viewer *v = user;
    atomic_store(&v->loaded, true);
    rgl_window_wake(v->window);
}

static void tell(viewer *v, const char *what)
{
    snprintf(v->notice, sizeof v->notice, "%s", what);
    v->notice_until = rgl_window_seconds() + NOTICE_S;
    v->dirty = true;
}

/* ---- where things are ---- */

/* The nearest point around the cursor. */
static rend_spot spot_at(viewer *v, double x, double y)
{
    float depths[(2 * PICK_RADIUS_PX + 1) * (2 * PICK_RADIUS_PX + 1)], nearest = 1;
    if (rgl_read_depth(v->engine.gl, (int)x, (int)y, PICK_RADIUS_PX, depths, NULL))
        for (size_t i = 0; i < sizeof depths / sizeof *depths; i++)
            nearest = fminf(nearest, depths[i]);
    rend_spot spot = {.is_point = nearest < 1, .w = rend_orbit_distance(&v->view.camera)};
    if (spot.is_point)
        spot.w = (double)rend_frame_depth_to_w(rend_stage_last_frame(v->stage), nearest) *
                 v->dataset->metadata.grid.step;
    rend_orbit_unproject(&v->view.camera, x, y, spot.w, v->view.width, v->view.height, spot.at);
    return spot;
}

static double nearest_distance(const viewer *v)
{
    return 16 * v->dataset->metadata.grid.step;
}

/* ---- hands ---- */

static void touch_camera(viewer *v)
{
    rend_motion_touch(&v->motion, rgl_window_seconds());
    v->dirty = true;
}

static void start_drag(viewer *v, const rgl_event *e)
{
    rend_spot spot = spot_at(v, e->x, e->y);
    rend_hands_grip(&v->hands, e->button != RGL_BUTTON_LEFT || e->shift, &spot, &v->view.camera);
}

/* What is seen, as a keyframe: with what was changed since the window opened. */
static rend_key key_of_view(const viewer *v)
{
    rend_key key = {.camera = v->view.camera,
                    .budget_points = v->budget_changed ? v->view.budget_points : 0};
    rend_look_keep(&v->view.look, &v->options->look, &key);
    return key;
}

static void tell_of_strip(viewer *v)
{
    if (v->strip.notice[0] != '\0') tell(v, v->strip.notice);
    v->strip.notice[0] = '\0';
    v->dirty = true;
}

/* As rend_look_recall(). */
static void look_through(viewer *v, const rend_camera *camera, const char *colour,
                         const rend_box *clip)
{
    if (memcmp(camera, &v->view.camera, sizeof *camera) != 0) touch_camera(v);
    v->view.camera = *camera;
    rend_look_recall(&v->view.look, &v->options->look, colour, clip, v->dataset);
    tell_of_strip(v);
}

static bool press_strip_key(viewer *v, const rgl_event *e)
{
    rend_key key = key_of_view(v);
    if (!rend_strip_press(&v->strip, e->key, e->shift, rgl_window_seconds(), &key)) return false;
    look_through(v, &key.camera, key.colour, key.has_clip ? &key.clip : NULL);
    return true;
}

/* True if the button is on the strip. */
static bool grip_strip(viewer *v, const rgl_event *e)
{
    rend_key key = key_of_view(v);
    float line = v->text != NULL ? rgl_text_metrics(v->text).line : TEXT_PX;
    if (!rend_strip_grip(&v->strip, e->x, e->y, v->view.width, v->view.height, line, &key))
        return false;
    look_through(v, &key.camera, key.colour, key.has_clip ? &key.clip : NULL);
    return true;
}

static void release_strip(viewer *v)
{
    rend_strip_release(&v->strip);
    tell_of_strip(v);
}

static void move_cursor(viewer *v, const rgl_event *e)
{
    if (rend_strip_drag(&v->strip, e->x, v->view.width)) v->dirty = true;
    if (rend_hands_move(&v->hands, e->x, e->y, v->view.height, &v->view.camera)) touch_camera(v);
}

static void scroll(viewer *v, const rgl_event *e)
{
    rend_spot spot = spot_at(v, e->x, e->y);
    rend_hands_zoom(e->dy, &spot, nearest_distance(v), &v->view.camera);
    touch_camera(v);
}

static void scale_budget(viewer *v, double factor)
{
    uint64_t total = v->dataset->metadata.point_count;
    double budget =
        v->view.budget_points == REND_ALL ? (double)total : (double)v->view.budget_points;
    budget = fmax(budget * factor, (double)BUDGET_MIN);
    v->view.budget_points = budget >= (double)total && factor > 1 ? REND_ALL : (uint64_t)budget;
    v->budget_changed = true;
    rend_motion_restart(&v->motion);
}

/* What was drawn last.
 * shown    with the words, as the window has it */
static bool write_picture(viewer *v, bool shown, const char *path, mospt_err *err)
{
    size_t size = (size_t)v->view.width * v->view.height * 3;
    uint8_t *rgb = malloc(size);
    bool ok = rgb != NULL || mospt_err_nomem(err, size);
    ok = ok && rgl_read_pixels(v->engine.gl, shown, v->view.width, v->view.height, rgb, err) &&
         rend_image_write(path, rgb, v->view.width, v->view.height, err);
    free(rgb);
    return ok;
}

static void save_picture(viewer *v)
{
    char name[64], text[1100];
    time_t now = time(NULL);
    struct tm local;
    mospt_err err = {0};
    rend_view_of still = v->view;
    rend_progress ignored;
    still.parts = 0;
    localtime_r(&now, &local);
    strftime(name, sizeof name, "instantpoints-%Y%m%d-%H%M%S.png", &local);
    if (rend_stage_frame(v->stage, &still, NULL, &ignored, &err) &&
        write_picture(v, false, name, &err))
        snprintf(text, sizeof text, "saved %s", name);
    else mospt_err_text(&err, text, sizeof text);
    tell(v, text);
}

/* Other colours, if the dataset has them; else a sentence that says why not. */
static void show_colours(viewer *v, const rend_look *look)
{
    mospt_err err = {0};
    if (rend_scheme_fits(v->dataset, look, &err)) v->view.look = *look;
    else tell(v, err.message);
}

/* Keys that change how points look and what their colours show. */
static void press_look_key(viewer *v, int key, bool shift)
{
    rend_look look = v->view.look;
    if (key == 'K') v->no_legend = !v->no_legend;
    else if (rend_look_press(&v->view.look, key, shift)) return;
    else if (rend_look_press_colour(&look, key, shift, v->choices, v->choice_count))
        show_colours(v, &look);
}

static void cut(viewer *v, bool undo)
{
    rend_spot spot = {0};
    if (!undo) spot = spot_at(v, v->hands.cursor[0], v->hands.cursor[1]);
    if (!undo && !spot.is_point) tell(v, "nothing to cut at under the cursor");
    else rend_look_cut(&v->view.look, &v->view.camera, undo ? NULL : spot.at);
}

static void change_lens(viewer *v, double factor)
{
    char text[64];
    snprintf(text, sizeof text, "field of view %.0f degrees",
             rend_hands_lens(factor, &v->view.camera));
    tell(v, text);
    touch_camera(v);
}

static void press_key(viewer *v, const rgl_event *e)
{
    v->dirty = true;
    if (press_strip_key(v, e)) return;
    if (e->key == RGL_KEY_ESCAPE || (e->key == 'W' && e->control)) v->quit = true;
    else if (e->key == 'H' || e->key == RGL_KEY_F1 || e->key == '?') v->help = !v->help;
    else if (e->key == 'R') v->view.camera = v->home, touch_camera(v);
    else if (e->key == 'B') scale_budget(v, e->shift ? 0.5 : 2);
    else if (e->key == ']') scale_budget(v, 1.25);
    else if (e->key == '[') scale_budget(v, 0.8);
    else if (e->key == 'V') cut(v, e->shift);
    else if (e->key == 'Z') change_lens(v, e->shift ? 1.25 : 0.8);
    else if (e->key == 'P') save_picture(v);
    else if (e->key == 'F') rgl_window_toggle_fullscreen(v->window);
    else press_look_key(v, e->key, e->shift);
}

static void handle(viewer *v, const rgl_event *e)
{
    switch (e->kind) {
    case RGL_EVENT_KEY:
        press_key(v, e);
        break;
    case RGL_EVENT_BUTTON:
        v->hands.cursor[0] = e->x, v->hands.cursor[1] = e->y;
        if (!e->down) rend_hands_release(&v->hands), release_strip(v);
        else if (!grip_strip(v, e)) start_drag(v, e);
        break;
    case RGL_EVENT_MOVE:
        move_cursor(v, e);
        break;
    case RGL_EVENT_SCROLL:
        scroll(v, e);
        break;
    case RGL_EVENT_REFRESH:
        v->dirty = true;
        break;
    case RGL_EVENT_CLOSE:
        v->quit = true;
        break;
    }
}

static int is_held(const rgl_window *window, int key, int other)
{
    return rgl_window_is_down(window, key) || rgl_window_is_down(window, other);
}

static void fly(viewer *v)
{
    const rgl_window *w = v->window;
    const int held[3] = {is_held(w, 'D', RGL_KEY_RIGHT) - is_held(w, 'A', RGL_KEY_LEFT),
                         is_held(w, 'E', 0) - is_held(w, 'Q', 0),
                         is_held(w, 'W', RGL_KEY_UP) - is_held(w, 'S', RGL_KEY_DOWN)};
    if (rend_hands_fly(&v->hands, held, rgl_window_is_down(w, RGL_KEY_SHIFT), rgl_window_seconds(),
                       nearest_distance(v), &v->view.camera))
        touch_camera(v);
}

static void play(viewer *v)
{
    rend_moment m;
    if (rend_strip_play(&v->strip, rgl_window_seconds(), &m))
        look_through(v, &m.camera, m.colour, m.has_clip ? &m.clip : NULL);
}

/* ---- frames ---- */

/* A font once it is known how large; a window without words is better than none. */
static void fit_text(viewer *v)
{
    float scale = rgl_window_scale(v->window);
    mospt_err err = {0};
    if (v->text_scale == scale) return;
    v->text_scale = scale;
    rgl_text_destroy(v->text);
    v->text = NULL;
    if (!rgl_text_create(TEXT_PX * scale, &v->text, &err)) v->result.no_words = err;
}

static bool draw_words(viewer *v, mospt_err *err)
{
    char look[160];
    rend_hud hud = {.frame_ms = v->frame_ms,
                    .budget_points = v->view.budget_points,
                    .notice = v->notice,
                    .help = v->help};
    if (v->text == NULL) return true;
    rend_look_text(&v->view.look, look, sizeof look);
    if (!v->no_legend) hud.legend = rend_stage_legend(v->stage);
    hud.look = look;
    rend_stage_figures(v->stage, &hud.figures);
    return rend_hud_draw(v->text, &hud, v->view.width, v->view.height, err) &&
           rend_strip_draw(&v->strip, v->text, v->view.width, v->view.height, err);
}

/* While the camera moves, a frame is as much as fits into its time. At rest it draws so much of a
 * picture that may be larger. The last one before the window closes is whole. */
static bool draw_points(viewer *v, bool last, mospt_err *err)
{
    rend_view_of view = v->view;
    rend_allowance allowed;
    rend_figures figures;
    bool rests = rend_motion_plan(&v->motion, last, rgl_window_seconds(), &view, &allowed);
    if (!rend_stage_frame(v->stage, &view, &allowed, &v->progress, err)) return false;
    if (!rests || v->progress == REND_PART) return true;
    rend_stage_figures(v->stage, &figures);
    if (rend_motion_grow(&v->motion, &figures, v->view.budget_points)) v->progress = REND_AGAIN;
    return true;
}

static bool is_last(const viewer *v)
{
    return v->quit || (v->options->frames > 0 && v->result.frames + 1 >= v->options->frames);
}

static void count_frame(viewer *v, const rend_figures *before, double ms)
{
    rend_figures now;
    rend_stage_figures(v->stage, &now);
    rend_pace_note(&v->motion.pace, now.points_total - before->points_total,
                   now.uploaded_bytes - before->uploaded_bytes, v->progress != REND_PART, ms);
    v->frame_ms = ms;
    v->result.mean_ms += ms; /* the sum as yet */
    v->result.slowest_ms = fmax(v->result.slowest_ms, ms);
    v->result.frames++;
}

static bool frame(viewer *v, mospt_err *err)
{
    uint32_t width, height;
    double start = rgl_window_seconds();
    atomic_store(&v->loaded, false);
    v->dirty = false;
    rgl_window_size(v->window, &width, &height);
    if (width == 0 || height == 0) { /* iconified; a refresh tells when it is back */
        v->progress = REND_WAITING;
        return true;
    }
    v->view.width = width, v->view.height = height;
    bool last = is_last(v) && v->options->screenshot != NULL;
    rend_figures before;
    rend_stage_figures(v->stage, &before);
    if (v->options->reset_at > 0 && v->result.frames == v->options->reset_at)
        rgl_pretend_reset(v->engine.gl);
    if (!draw_points(v, last, err)) return false;
    fit_text(v);                    /* now: with another context, it is gone */
    if (v->progress != REND_PART) { /* else the picture before stays on the screen */
        if (!draw_words(v, err)) return false;
        if (last && !write_picture(v, true, v->options->screenshot, err)) return false;
        rgl_window_show(v->window);
    }
    count_frame(v, &before, (rgl_window_seconds() - start) * 1e3);
    return true;
}

static bool is_due(const viewer *v)
{
    return v->dirty || v->progress == REND_AGAIN || v->progress == REND_PART ||
           atomic_load(&v->loaded) || v->options->frames > 0;
}

/* How long nothing needs to be drawn, unless something happens: seconds, 0 not at all, below 0 for
 * ever. */
static double rest(const viewer *v)
{
    if (is_due(v)) return 0;
    double moving = rend_motion_wait(&v->motion, rgl_window_seconds());
    if (moving > 0) return moving;
    return v->notice[0] != '\0' ? fmax(v->notice_until - rgl_window_seconds(), 0.01) : -1;
}

/* ---- a dataset that changes ---- */

static void tell_growth(viewer *v, uint64_t points_before)
{
    char points[16], text[64];
    const mospt_metadata *m = &v->dataset->metadata;
    rend_hud_count(m->point_count, points);
    if (m->unfinished.commit > 0)
        snprintf(text, sizeof text, "being built: %s points so far", points);
    else if (m->point_count == points_before)
        snprintf(text, sizeof text, "the dataset is finished");
    else snprintf(text, sizeof text, "the dataset has %s points now", points);
    tell(v, text);
}

/* Goes on with what the dataset has become; what cannot be opened is left alone. */
static bool take_newer(viewer *v, mospt_err *err)
{
    mospt_dataset *newer = NULL;
    mospt_err why = {0};
    if (!mospt_dataset_open(v->dataset->path, &newer, &why)) {
        tell(v, why.message);
        return true;
    }
    if (rend_watch_is_same(v->dataset, newer)) return mospt_dataset_close(newer), true;
    uint64_t points = v->dataset->metadata.point_count;
    bool ok = rend_stage_swap(v->stage, newer, err);
    mospt_dataset_close(v->newer);
    v->dataset = v->newer = newer;
    v->choice_count = rend_choice_list(&newer->metadata, v->choices);
    rend_look_fit(&v->view.look, newer);
    v->result.swaps++;
    ok = ok &&
         rend_camera_make(&v->options->camera, newer, v->view.width, v->view.height, &v->home, err);
    tell_growth(v, points);
    return ok;
}

static bool watch(viewer *v, mospt_err *err)
{
    double now = rgl_window_seconds();
    if (now < v->watched_at + WATCH_S) return true;
    v->watched_at = now;
    switch (rend_watch_look(&v->watch)) {
    case REND_WATCH_CHANGED:
        return take_newer(v, err);
    case REND_WATCH_GONE:
        tell(v, "the dataset was deleted; it can be seen until this window is closed");
        return true;
    default:
        return true;
    }
}

/* The letters were in the context that is lost, too. */
static bool renew_window(void *user, mospt_err *err)
{
    viewer *v = user;
    rgl_text_destroy(v->text);
    v->text = NULL, v->text_scale = 0;
    return rgl_window_renew(v->window, err);
}

/* What went wrong on the way and was got over. */
static void tell_faults(viewer *v)
{
    rend_figures figures;
    char text[80];
    rend_stage_figures(v->stage, &figures);
    if (figures.resets != v->resets)
        tell(v, "the graphics driver was reset: everything was sent to it again");
    v->resets = figures.resets;
    if (figures.gpu_halved == v->gpu_halved) return;
    v->gpu_halved = figures.gpu_halved;
    snprintf(text, sizeof text, "graphics memory is short: nodes get %llu MB of it now",
             (unsigned long long)(figures.gpu_limit / 1000000));
    tell(v, text);
}

static bool run(viewer *v, mospt_err *err)
{
    while (!v->quit) {
        rgl_event event;
        double seconds = rest(v);
        double longest = v->options->should_stop != NULL ? STOP_ASKED_S : WATCH_S;
        if (seconds < 0 || seconds > longest) seconds = longest;
        rgl_window_wait(v->window, seconds);
        if (v->options->should_stop != NULL && v->options->should_stop()) v->quit = true;
        while (rgl_window_next(v->window, &event))
            handle(v, &event);
        fly(v);
        play(v);
        if (!watch(v, err)) return false;
        tell_faults(v);
        if (rend_motion_settle(&v->motion, v->hands.drag != REND_DRAG_NONE, rgl_window_seconds()))
            v->dirty = true;
        if (v->notice[0] != '\0' && rgl_window_seconds() >= v->notice_until)
            v->notice[0] = '\0', v->dirty = true;
        if (is_due(v) && !frame(v, err)) return false;
        if (v->options->frames > 0 && v->result.frames >= v->options->frames) v->quit = true;
    }
    /* The user has quit: the picture that was asked for is still owed. */
    bool owed = v->options->screenshot != NULL &&
                (v->options->frames == 0 || v->result.frames < v->options->frames);
    return !owed || frame(v, err);
}

static bool open_viewer(viewer *v, mospt_err *err)
{
    const rend_view_options *o = v->options;
    memset(&v->view, 0, sizeof v->view); /* to the last byte: views are compared */
    rend_motion_init(&v->motion, o->fps > 0 ? o->fps : REND_FPS_DEFAULT);
    v->view.look = o->look;
    v->view.no_occlusion = o->limits.no_occlusion;
    v->view.budget_points =
        o->limits.budget_points > 0 ? o->limits.budget_points : REND_VIEW_BUDGET_DEFAULT;
    v->view.min_node_px = o->limits.min_node_px;
    v->view.parts = RGL_TO_WINDOW;
    v->view.width = o->width > 0 ? o->width : REND_WIDTH_DEFAULT;
    v->view.height = o->height > 0 ? o->height : REND_HEIGHT_DEFAULT;
    v->choice_count = rend_choice_list(&v->dataset->metadata, v->choices);
    v->help = o->help;
    v->dirty = true;
    if (!rend_strip_init(o->path, &v->strip, err)) return false;
    if (!rend_watch_init(&v->watch, v->dataset->path, err)) return false;
    if (!rend_camera_make(&o->camera, v->dataset, v->view.width, v->view.height, &v->home, err))
        return false;
    v->view.camera = v->home;
    return rgl_window_create(o->title != NULL ? o->title : v->dataset->path, v->view.width,
                             v->view.height, &v->window, err) &&
           rend_engine_open_window(&o->engine, renew_window, v, &v->engine, err) &&
           rend_stage_create(v->dataset, v->engine.gl, &o->limits, on_loaded, v, &v->stage, err);
}

bool rend_view(const mospt_dataset *dataset, const rend_view_options *options,
               rend_view_result *result, mospt_err *err)
{
    viewer v = {.dataset = dataset, .options = options};
    bool ok = open_viewer(&v, err) && run(&v, err);
    if (ok) {
        rend_figures figures;
        rend_stage_figures(v.stage, &figures);
        v.result.damaged_nodes = figures.damaged_nodes;
        v.result.damaged_points = figures.damaged_points;
        v.result.damage = figures.damage;
        v.result.resets = figures.resets;
        if (v.result.frames > 0) v.result.mean_ms /= (double)v.result.frames;
        if (result != NULL) *result = v.result;
    }
    rend_strip_fini(&v.strip);
    rgl_text_destroy(v.text);
    rend_stage_destroy(v.stage);
    mospt_dataset_close(v.newer);
    rend_watch_fini(&v.watch);
    rend_engine_close(&v.engine);
    rgl_window_destroy(v.window);
    return ok;
}
