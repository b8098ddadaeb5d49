#include "render/take.h"

#include "render/caption.h"
#include "render/choice.h"
#include "render/engine.h"
#include "render/pace.h"
#include "render/panorama.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { SUBFRAMES_DEFAULT = 8, PIXELS_MAX = 1 << 28 };
#define EYE_DISTANCE_M 0.064

struct rend_take {
    const mospt_dataset *dataset;
    rend_take_options options;
    uint32_t samples, subframes, views;
    uint32_t pass_width, pass_height;     /* of a view, reduced */
    uint32_t canvas_width, canvas_height; /* of all views side by side, or one below the other */
    bool direct;                          /* what is read back is the picture */
    rend_engine engine;
    rend_stage *stage;
    rend_caption caption;
    bool has_caption;
    rend_legend legend; /* of the pass in hand */
    rend_panorama panorama;
    uint8_t *raw;   /* one pass as it was drawn, owned */
    uint32_t *sums; /* [canvas_width * canvas_height * 3], owned */
    rend_take_times spent;
    rend_pace pace; /* live */
};

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ---- making one ---- */

static bool has_words(const rend_take_options *o)
{
    return o->counter || (o->title != NULL && o->title[0] != '\0');
}

bool rend_take_fits(const rend_take_options *o, mospt_err *err)
{
    uint64_t samples = o->samples > 0 ? o->samples : 1;
    const char *fault = NULL;
    if (o->width == 0 || o->height == 0 || o->width * samples > REND_SIZE_MAX ||
        o->height * samples > REND_SIZE_MAX)
        return mospt_err_set(
            err, MOSPT_EINVAL, mospt_nowhere(),
            "a picture of %u x %u, drawn at %u x that size, is larger than %d x %d", o->width,
            o->height, (unsigned)samples, REND_SIZE_MAX, REND_SIZE_MAX);
    if (samples > REND_SAMPLES_MAX || o->subframes > REND_SUBFRAMES_MAX)
        fault = "too many samples or sub-frames";
    if (o->panorama && o->stereo) fault = "a panorama for two eyes is not possible";
    if (o->panorama && (has_words(o) || o->legend)) fault = "there are no words over a panorama";
    if (o->panorama && o->width != 2 * o->height)
        fault = "a panorama is twice as wide as it is high";
    if (o->stereo && o->width % 2 != 0) fault = "two pictures side by side have an even width";
    if (fault == NULL) return true;
    return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(), "%s", fault);
}

static bool lay_out(rend_take *t, mospt_err *err)
{
    const rend_take_options *o = &t->options;
    t->samples = o->samples > 0 ? o->samples : 1;
    t->subframes = o->shutter_s <= 0 ? 1 : o->subframes > 0 ? o->subframes : SUBFRAMES_DEFAULT;
    t->views = o->panorama ? REND_FACES : o->stereo ? 2 : 1;
    t->canvas_width = o->width, t->canvas_height = o->height;
    t->pass_width = o->stereo ? o->width / 2 : o->width, t->pass_height = o->height;
    if (o->panorama) {
        if (!rend_panorama_init(o->width, o->height, &t->panorama, err)) return false;
        t->pass_width = t->pass_height = t->canvas_width = t->panorama.face;
        t->canvas_height = REND_FACES * t->panorama.face;
    }
    t->direct = o->bits == 8 && t->samples == 1 && t->subframes == 1 && t->views == 1;
    if (t->direct) return true;
    size_t raw = (size_t)t->pass_width * t->pass_height * t->samples * t->samples * 3;
    size_t sums = (size_t)t->canvas_width * t->canvas_height * 3 * sizeof *t->sums;
    t->raw = malloc(raw);
    t->sums = malloc(sums);
    return (t->raw != NULL && t->sums != NULL) || mospt_err_nomem(err, raw + sums);
}

/* A picture that is drawn larger has larger points. */
static void scale_look(rend_take *t)
{
    rend_look *look = &t->options.look;
    float factor = (float)t->samples;
    look->point_px = fmaxf(look->point_px, 1) * factor;
    look->point_px_max =
        (look->point_px_max > 0 ? look->point_px_max : REND_POINT_PX_MAX_DEFAULT) * factor;
    look->edl_radius_px *= factor;
    t->options.limits.min_node_px *= factor;
}

bool rend_take_create(const mospt_dataset *dataset, const rend_take_options *options,
                      rend_take **out, mospt_err *err)
{
    if (!rend_take_fits(options, err)) return false;
    rend_take *t = calloc(1, sizeof *t);
    if (t == NULL) return mospt_err_nomem(err, sizeof *t);
    t->dataset = dataset;
    t->options = *options;
    t->has_caption = has_words(options);
    bool ok = lay_out(t, err);
    scale_look(t);
    ok = ok && rend_engine_open(&options->engine, &t->engine, err) &&
         rend_stage_create(dataset, t->engine.gl, &options->limits, NULL, NULL, &t->stage, err) &&
         (!t->has_caption || rend_caption_init(options->height * t->samples, &t->caption, err));
    if (!ok) rend_take_destroy(t);
    else *out = t;
    return ok;
}

void rend_take_destroy(rend_take *take)
{
    if (take == NULL) return;
    rend_caption_fini(&take->caption);
    rend_stage_destroy(take->stage);
    rend_engine_close(&take->engine);
    rend_panorama_fini(&take->panorama);
    free(take->raw);
    free(take->sums);
    free(take);
}

/* ---- passes ---- */

/* Both eyes look the same way: what is far away stands at the depth of the screen. */
static void step_aside(rend_camera *camera, double metres)
{
    double right[3], up[3], back[3];
    rend_camera_axes(camera, right, up, back);
    for (int a = 0; a < 3; a++)
        camera->eye[a] += metres * right[a], camera->target[a] += metres * right[a];
}

/* The sky is one grey where faces meet. */
static void flatten_background(rend_look *look)
{
    static const float grey[3] = {0.28f, 0.30f, 0.32f};
    for (int c = 0; c < 3; c++) {
        float middle = look->has_background
                           ? 0.5f * (look->background_top[c] + look->background_bottom[c])
                           : grey[c];
        look->background_top[c] = look->background_bottom[c] = middle;
    }
    look->has_background = true;
}

static uint64_t budget_of(const rend_take *t, const rend_moment *moment)
{
    uint64_t most =
        t->options.limits.budget_points > 0 ? t->options.limits.budget_points : REND_ALL;
    bool is_less = moment->budget_points > 0 && moment->budget_points < most;
    return is_less ? moment->budget_points : most;
}

bool rend_take_view(const rend_take *take, const rend_curve *curve, double time_s, uint32_t pass,
                    rend_view_of *out)
{
    const rend_take_options *o = &take->options;
    uint32_t sub = pass / take->views, view = pass % take->views;
    rend_moment moment;
    if (sub >= take->subframes) return false;
    double late = ((double)sub + 0.5) / take->subframes - 0.5;
    rend_curve_at(curve, time_s + (take->subframes > 1 ? late * o->shutter_s : 0), &moment);
    uint64_t budget = budget_of(take, &moment);
    memset(out, 0, sizeof *out); /* to the last byte: views are compared */
    out->camera = moment.camera;
    out->width = take->pass_width * take->samples, out->height = take->pass_height * take->samples;
    out->look = o->look;
    if (moment.colour != NULL) rend_choice_recall(moment.colour, &o->look, &out->look);
    if (moment.has_clip) out->look.has_clip = true, out->look.clip = moment.clip;
    out->budget_points = budget == REND_ALL ? REND_ALL : budget / take->views;
    out->min_node_px = o->limits.min_node_px;
    out->no_occlusion = o->limits.no_occlusion;
    if (o->panorama) {
        rend_panorama_camera(&take->panorama, &moment.camera, view, &out->camera);
        flatten_background(&out->look);
    }
    double apart = o->eye_distance > 0 ? o->eye_distance : EYE_DISTANCE_M;
    if (o->stereo) step_aside(&out->camera, (view == 0 ? -0.5 : 0.5) * apart);
    return true;
}

/* Into what was read back, as large as it was drawn. */
static bool draw_words(rend_take *t, const rend_take_frame *frame, uint8_t *rgb, mospt_err *err)
{
    char counter[64];
    unsigned ms = (unsigned)(frame->time_s * 1000 + 0.5), seconds = ms / 1000;
    uint32_t width = t->pass_width * t->samples, height = t->pass_height * t->samples;
    snprintf(counter, sizeof counter, "%06" PRIu64 "  %02u:%02u.%03u", frame->number, seconds / 60,
             seconds % 60, ms % 1000);
    if (t->has_caption)
        rend_caption_draw(&t->caption, width, height, t->options.title, frame->title_s,
                          t->options.counter ? counter : NULL, rgb);
    return !t->options.legend || rend_legend_draw(&t->legend, width, height, rgb, err);
}

/* Draws a pass; its figures and legend are taken before those of the expected one. */
/* As a window does: no more points and uploads than fit into the frame's time. */
static bool draw_live(rend_take *t, const rend_view_of *view, mospt_err *err)
{
    rend_progress ignored;
    rend_view_of in_time = *view;
    const rend_allowance allowed = {.upload_bytes = rend_pace_bytes(&t->pace)};
    uint64_t fits = rend_pace_points(&t->pace);
    if (in_time.budget_points > fits) in_time.budget_points = fits;
    return rend_stage_frame(t->stage, &in_time, &allowed, &ignored, err);
}

/* A live pass that is on its way to the encoder. */
static void note_pass(rend_take *t, const rend_figures *before, double ms)
{
    rend_figures now;
    rend_stage_figures(t->stage, &now);
    rend_pace_note(&t->pace, now.points_total - before->points_total,
                   now.uploaded_bytes - before->uploaded_bytes, true, ms);
}

static bool draw_pass(rend_take *t, const rend_view_of *view, rend_figures *figures, mospt_err *err)
{
    double start = now_s(), waited;
    rend_stage_figures(t->stage, figures);
    waited = figures->waited_s;
    bool ok = t->options.live ? draw_live(t, view, err) : rend_stage_still(t->stage, view, err);
    if (!ok) return false;
    t->legend = *rend_stage_legend(t->stage);
    rend_stage_figures(t->stage, figures);
    waited = figures->waited_s - waited;
    t->spent.loading += waited;
    t->spent.drawing += now_s() - start - waited;
    return true;
}

static bool expect(rend_take *t, const rend_view_of *view, mospt_err *err)
{
    double start = now_s();
    bool ok = t->options.live || rend_stage_expect(t->stage, view, err);
    t->spent.selecting += now_s() - start;
    return ok;
}

/* One pixel is there when all are: up to then it was drawing. */
static bool read_back(rend_take *t, const rend_view_of *view, uint8_t *rgb, mospt_err *err)
{
    double start = now_s();
    if (!rgl_read_pixels(t->engine.gl, false, 1, 1, rgb, err)) return false;
    double drawn = now_s();
    t->spent.drawing += drawn - start;
    if (!rgl_read_pixels(t->engine.gl, false, view->width, view->height, rgb, err)) return false;
    t->spent.reading += now_s() - drawn;
    return true;
}

/* What comes next is read from the disk while the graphics driver is at work. */
static bool run_pass(rend_take *t, const rend_view_of *view, const rend_view_of *following,
                     rend_figures *figures, uint8_t *rgb, mospt_err *err)
{
    do {
        if (!draw_pass(t, view, figures, err)) return false;
        if (following != NULL && !expect(t, following, err)) return false;
        if (read_back(t, view, rgb, err)) return true;
    } while (rend_stage_recover(t->stage, err));
    return false;
}

/* Adds what was read back to its place on the canvas, reduced. */
static void add_pass(rend_take *t, uint32_t view)
{
    uint32_t left = t->options.panorama ? 0 : view * t->pass_width;
    uint32_t top = t->options.panorama ? view * t->pass_height : 0;
    size_t row_size = (size_t)t->pass_width * t->samples * 3;
    for (uint32_t y = 0; y < t->pass_height * t->samples; y++) {
        const uint8_t *from = t->raw + y * row_size;
        uint32_t *to = t->sums + 3 * ((size_t)(top + y / t->samples) * t->canvas_width + left);
        for (uint32_t x = 0; x < t->pass_width; x++, to += 3)
            for (uint32_t s = 0; s < t->samples; s++, from += 3)
                to[0] += from[0], to[1] += from[1], to[2] += from[2];
    }
}

/* ---- the picture ---- */

static void put(const rend_take *t, void *picture, size_t i, double value)
{
    if (t->options.bits == 16) ((uint16_t *)picture)[i] = (uint16_t)(value * 65535 + 0.5);
    else ((uint8_t *)picture)[i] = (uint8_t)(value * 255 + 0.5);
}

/* Averages, fades and rounds. */
static void resolve(const rend_take *t, double fade, void *picture)
{
    size_t pixels = (size_t)t->options.width * t->options.height;
    double one = 255.0 * t->samples * t->samples * t->subframes;
    if (!t->options.panorama)
        for (size_t i = 0; i < 3 * pixels; i++)
            put(t, picture, i, fade / one * t->sums[i]);
    for (size_t i = 0; t->options.panorama && i < pixels; i++) {
        uint64_t rgb[3];
        rend_panorama_sample(&t->panorama, t->sums, i, rgb);
        for (size_t c = 0; c < 3; c++)
            put(t, picture, 3 * i + c, fade / (65536 * one) * (double)rgb[c]);
    }
}

static void fade_directly(const rend_take *t, double fade, uint8_t *rgb)
{
    size_t size = (size_t)t->options.width * t->options.height * 3;
    for (size_t i = 0; fade < 1 && i < size; i++)
        rgb[i] = (uint8_t)(fade * rgb[i] + 0.5);
}

/* All passes of a moment are one drawn frame; of several, the fullest counts. */
static void count(const rend_figures *figures, uint32_t view, rend_taken *now, rend_taken *most)
{
    if (view == 0) now->points_drawn = now->nodes_drawn = 0;
    now->points_drawn += figures->points_drawn;
    now->nodes_drawn += figures->nodes_drawn;
    most->pending += figures->pending;
    if (now->points_drawn < most->points_drawn) return;
    most->points_drawn = now->points_drawn;
    most->nodes_drawn = now->nodes_drawn;
}

bool rend_take_run(rend_take *take, const rend_curve *curve, const rend_take_frame *frame,
                   const double *next, void *picture, rend_taken *out, mospt_err *err)
{
    rend_view_of view, following;
    rend_moment moment;
    rend_taken now = {0};
    rend_curve_at(curve, frame->time_s, &moment);
    *out = (rend_taken){.camera = moment.camera,
                        .has_clip = moment.has_clip || take->options.look.has_clip,
                        .clip = moment.has_clip ? moment.clip : take->options.look.clip,
                        .budget_points = budget_of(take, &moment)};
    if (take->options.live && take->pace.target_ms == 0)
        rend_pace_init(&take->pace, frame->rate * take->views * take->subframes);
    if (!take->direct)
        memset(take->sums, 0,
               (size_t)take->canvas_width * take->canvas_height * 3 * sizeof *take->sums);
    for (uint32_t pass = 0; rend_take_view(take, curve, frame->time_s, pass, &view); pass++) {
        rend_figures before, figures;
        uint8_t *rgb = take->direct ? picture : take->raw;
        double start = now_s();
        rend_stage_figures(take->stage, &before);
        bool more = rend_take_view(take, curve, frame->time_s, pass + 1, &following) ||
                    (next != NULL && rend_take_view(take, curve, *next, 0, &following));
        if (!run_pass(take, &view, more ? &following : NULL, &figures, rgb, err)) return false;
        count(&figures, pass % take->views, &now, out);
        if (!draw_words(take, frame, rgb, err)) return false;
        if (take->options.live) note_pass(take, &before, 1e3 * (now_s() - start));
        if (!take->direct) add_pass(take, pass % take->views);
    }
    if (take->direct) fade_directly(take, frame->fade, picture);
    else resolve(take, frame->fade, picture);
    return true;
}

uint32_t rend_take_views(const rend_take *take)
{
    return take->views;
}

rend_take_times rend_take_spent(const rend_take *take)
{
    return take->spent;
}

void rend_take_figures(const rend_take *take, rend_figures *out)
{
    rend_stage_figures(take->stage, out);
}

const char *rend_take_renderer(const rend_take *take)
{
    return rgl_renderer(take->engine.gl);
}

rend_renderer rend_take_renderer_kind(const rend_take *take)
{
    return take->engine.renderer;
}
