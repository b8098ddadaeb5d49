/* How fast pictures are drawn, and how good they are; scripts/bench_render explains. */
#include "render/engine.h"
#include "render/stage.h"
#include "scripts/bench_flight.h"
#include "scripts/bench_picture.h"
#include "scripts/bench_points.h"
#include "scripts/plain_loop.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { SHARES = 6, BUDGETS = 5, IN_A_ROW = 10, PAUSE_US = 50000 };
#define COLD_SIZE ((size_t)64 << 20) /* more than a processor's caches hold */
static const double SHARE[SHARES] = {0.01, 0.02, 0.05, 0.1, 0.25, 0.5};

typedef struct {
    const char *dataset;
    rend_engine_options engine;
    uint32_t width, height, frames, views, threads;
    uint64_t budget_points;
    rend_look look;
    float cell_px;
    bool no_occlusion, speed, quality;
} options;

typedef struct {
    const options *o;
    mospt_dataset *dataset;
    bench_points points;
    rend_engine engine, second; /* the second one draws points as they are */
    rgl *raw;
    rend_selector *selector;
    plain_loop *loop;
    bench_flight flight;
} bench;

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static rend_view_of view_at(const bench *b, double t, double later_s, uint64_t budget)
{
    return (rend_view_of){.camera = bench_flight_at(&b->flight, t, later_s),
                          .width = b->o->width,
                          .height = b->o->height,
                          .look = b->o->look,
                          .budget_points = budget,
                          .cell_px = b->o->cell_px,
                          .no_occlusion = b->o->no_occlusion};
}

/* ---- points as they are ---- */

/* What render/picture.c makes of the usual look, at one pixel a point. */
static rgl_scene plain_scene(const bench *b, const rend_frame *frame)
{
    const rend_look *look = &b->o->look;
    return (rgl_scene){.frame = *frame,
                       .grid_bits = b->dataset->metadata.grid.bits,
                       .px_min = 1,
                       .px_max = 1,
                       .blend_slab = look->blend_slab,
                       .fill_px = look->fill_px,
                       .edl_strength = look->no_edl ? 0 : 24,
                       .edl_radius_px = fmaxf(1, (float)frame->height / 720),
                       .background_top = {0.36f, 0.39f, 0.43f},
                       .background_bottom = {0.20f, 0.21f, 0.23f}};
}

/* sizes    of a selection of everything; NULL: all points are one pixel wide */
static bool draw_raw(bench *b, const rend_frame *frame, const rend_selection *sizes,
                     const int32_t *first, const int32_t *count, uint32_t ranges, mospt_err *err)
{
    const rgl_batch batch = {.shape = sizes != NULL ? RGL_ROUND : RGL_SQUARE,
                             .smallest = sizes == NULL,
                             .first = first,
                             .count = count,
                             .range_count = ranges};
    rgl_scene scene = plain_scene(b, frame);
    if (sizes != NULL) {
        scene.octants = sizes->octants, scene.octant_nodes = sizes->draw_count;
        scene.splat_scale = 1.25f, scene.px_max = REND_POINT_PX_MAX_DEFAULT;
    }
    int parts = RGL_BEGIN | RGL_END | (scene.blend_slab > 0 ? RGL_AGAIN : 0);
    return rgl_draw(b->raw, &scene, &batch, 1, parts, err);
}

/* Waits for all that was drawn. */
static bool finish(rgl *gl, mospt_err *err)
{
    float depth;
    return rgl_read_depth(gl, 0, 0, 0, &depth, err);
}

/* ---- speed ---- */

/* One of our frames, and what its points take if they are drawn as they are. */
typedef struct {
    rend_frame frame;
    rend_selection drawn; /* with draws of its own */
    double ours_ms, one_ms, many_ms, plain_ms;
} flown_frame;

/* What limits are drawn from. */
typedef struct {
    mospt_vertex *vertices; /* [budget] */
    int32_t *first, *count; /* [nodes] */
    uint8_t *other;         /* [COLD_SIZE], to have nothing in the processor's caches */
} room;

static void room_fini(room *r)
{
    free(r->vertices), free(r->first), free(r->count), free(r->other);
}

static bool room_init(const bench *b, room *r, mospt_err *err)
{
    uint64_t most = b->o->budget_points < b->points.count ? b->o->budget_points : b->points.count;
    uint32_t nodes = b->dataset->hierarchy.count;
    *r = (room){.vertices = malloc((most + 1) * sizeof *r->vertices),
                .first = calloc(nodes + 1, sizeof *r->first),
                .count = calloc(nodes + 1, sizeof *r->count),
                .other = malloc(COLD_SIZE)};
    return ((r->vertices != NULL && r->first != NULL && r->count != NULL && r->other != NULL) ||
            mospt_err_nomem(err, most * sizeof *r->vertices)) &&
           rgl_arena_create(b->raw, most + 1, err);
}

/* Vertices that were just put together would be at hand, ours were not. */
static void cool(room *r)
{
    memset(r->other, r->other[COLD_SIZE / 2] + 1, COLD_SIZE);
}

static bool time_raw(bench *b, const flown_frame *f, room *r, bool many, double *ms, mospt_err *err)
{
    int32_t whole = 0, points = (int32_t)f->drawn.points;
    cool(r);
    double start = now_ms();
    if (!draw_raw(b, &f->frame, NULL, many ? r->first : &whole, many ? r->count : &points,
                  many ? f->drawn.draw_count : 1, err) ||
        !finish(b->raw, err))
        return false;
    *ms = now_ms() - start;
    return true;
}

/* turn     which is drawn first */
static bool time_limits(bench *b, room *r, uint32_t turn, flown_frame *f, mospt_err *err)
{
    const rend_selection *s = &f->drawn;
    for (uint32_t i = 0, at = 0; i < s->draw_count; at += s->draws[i++].count)
        r->first[i] = (int32_t)at, r->count[i] = (int32_t)s->draws[i].count;
    bench_points_gather(&b->points, s, r->vertices);
    bool ok =
        rgl_arena_upload(b->raw, 0, r->vertices, (uint32_t)s->points, err) && finish(b->raw, err);
    for (uint32_t k = 0; k < 2 && ok; k++) {
        bool many = (turn + k) % 2 > 0;
        ok = time_raw(b, f, r, many, many ? &f->many_ms : &f->one_ms, err);
    }
    cool(r);
    double start = now_ms();
    plain_loop_draw(b->loop, &f->frame, r->vertices, (uint32_t)s->points);
    f->plain_ms = now_ms() - start;
    return ok;
}

typedef struct {
    double points, ms, median_ms, p99_ms, missing, hidden, nodes;
    double one_ms, many_ms, plain_ms; /* of the limits, sums */
    double median_ratio;              /* of frames: the better limit's time by ours */
    uint64_t loaded_bytes, uploaded_bytes;
} flown;

static bool sum_up(const bench *b, const flown_frame *frames, flown *out, mospt_err *err)
{
    uint32_t n = b->o->frames;
    double *ms = calloc(2 * (size_t)n, sizeof *ms), *ratio = ms + n;
    if (ms == NULL) return mospt_err_nomem(err, n);
    for (uint32_t i = 0; i < n; i++) {
        ms[i] = frames[i].ours_ms;
        out->ms += frames[i].ours_ms, out->one_ms += frames[i].one_ms;
        out->many_ms += frames[i].many_ms, out->plain_ms += frames[i].plain_ms;
    }
    bool one = out->one_ms < out->many_ms;
    for (uint32_t i = 0; i < n; i++)
        ratio[i] = (one ? frames[i].one_ms : frames[i].many_ms) / frames[i].ours_ms;
    qsort(ms, n, sizeof *ms, compare);
    qsort(ratio, n, sizeof *ratio, compare);
    out->median_ms = ms[n / 2], out->p99_ms = ms[n * 99 / 100], out->median_ratio = ratio[n / 2];
    free(ms);
    return true;
}

static bool remember(rend_stage *stage, double ms, flown_frame *out, mospt_err *err)
{
    const rend_selection *s = rend_stage_last_selection(stage);
    *out = (flown_frame){.frame = *rend_stage_last_frame(stage), .drawn = *s, .ours_ms = ms};
    out->drawn.draws = malloc((s->draw_count + 1) * sizeof *s->draws);
    if (out->drawn.draws == NULL) return mospt_err_nomem(err, s->draw_count * sizeof *s->draws);
    memcpy(out->drawn.draws, s->draws, s->draw_count * sizeof *s->draws);
    return true;
}

/* settle   until the frame has all that it wants */
static bool fly_frame(bench *b, rend_stage *stage, uint32_t i, bool settle, bool no_occlusion,
                      double *ms, mospt_err *err)
{
    rend_progress progress;
    rend_view_of view = view_at(b, (i + 0.5) / b->o->frames, 0, b->o->budget_points);
    view.no_occlusion = no_occlusion;
    do {
        double start = now_ms();
        if (!rend_stage_frame(stage, &view, NULL, &progress, err) || !finish(b->engine.gl, err))
            return false;
        *ms = now_ms() - start;
        if (settle && progress == REND_WAITING) usleep(1000);
    } while (settle && progress != REND_SETTLED);
    return true;
}

static bool visit_all(bench *b, rend_stage *stage, mospt_err *err)
{
    double ms;
    for (uint32_t i = 0; i < b->o->frames; i++)
        if (!fly_frame(b, stage, i, true, true, &ms, err)) return false;
    return true;
}

/* Frames follow each other, for a while: nobody reads for the next one while limits are drawn, and
 * the first one after that is drawn once more, as it was, before they go on. */
static bool fly(bench *b, rend_stage *stage, bool no_occlusion, flown *out, mospt_err *err)
{
    uint32_t n = b->o->frames;
    flown_frame *frames = calloc(n, sizeof *frames);
    rend_figures f = {0}, before;
    room r = {0};
    double ms;
    bool ok = (frames != NULL || mospt_err_nomem(err, n)) && room_init(b, &r, err);
    ok = ok && fly_frame(b, stage, 0, true, no_occlusion, &ms, err);
    *out = (flown){0};
    rend_stage_figures(stage, &before);
    for (uint32_t i = 0, limit = 0; i < n && ok; i++) {
        cool(&r);
        ok = fly_frame(b, stage, i, false, no_occlusion, &ms, err) &&
             remember(stage, ms, &frames[i], err);
        rend_stage_figures(stage, &f);
        out->points += (double)f.points_drawn;
        out->missing += f.pending, out->hidden += f.nodes_hidden, out->nodes += f.nodes_drawn;
        if ((i + 1) % IN_A_ROW > 0 && i + 1 < n) continue;
        usleep(PAUSE_US);
        for (; limit <= i && ok; limit++)
            ok = time_limits(b, &r, limit, &frames[limit], err);
        ok = ok && fly_frame(b, stage, i, false, no_occlusion, &ms, err);
    }
    out->loaded_bytes = f.loaded_bytes - before.loaded_bytes;
    out->uploaded_bytes = f.uploaded_bytes - before.uploaded_bytes;
    ok = ok && sum_up(b, frames, out, err);
    for (uint32_t i = 0; frames != NULL && i < n; i++)
        free(frames[i].drawn.draws);
    free(frames);
    room_fini(&r);
    return ok;
}

static void print_flown(const char *name, const flown *f, uint32_t frames)
{
    double points = f->points * 1e-3, raw_ms = fmin(f->one_ms, f->many_ms);
    printf("%-12s %7.1f %6.2f %6.2f %6.2f %7.1f %7.1f %7.1f %8.1f %8.1f %7.2f %7.0f %7.1f %8.1f "
           "%8.1f\n",
           name, points / f->ms, raw_ms / f->ms, f->median_ratio, f->plain_ms / f->ms,
           points / f->one_ms, points / f->many_ms, points / f->plain_ms, f->median_ms, f->p99_ms,
           f->points / frames * 1e-6, f->nodes / frames, f->missing / frames,
           (double)f->loaded_bytes * 1e-6, (double)f->uploaded_bytes * 1e-6);
}

/* Everything resident, then with a GPU cache of a tenth and nothing read yet. */
static bool measure_speed(bench *b, mospt_err *err)
{
    flown resident, all, paging;
    rend_stage *stage = NULL;
    uint64_t size = b->points.count * sizeof(mospt_vertex) * 5 / 4 + 64 * REND_MIB;
    uint32_t n = b->o->frames;
    const rend_limits large = {.ram_cache_bytes = 1, .gpu_cache_bytes = size},
                      small = {.gpu_cache_bytes = b->points.count * sizeof(mospt_vertex) / 10};
    bool ok = rend_stage_create(b->dataset, b->engine.gl, &large, NULL, NULL, &stage, err) &&
              visit_all(b, stage, err) && fly(b, stage, true, &all, err) &&
              (b->o->no_occlusion || fly(b, stage, false, &resident, err));
    rend_stage_destroy(stage);
    stage = NULL;
    ok = ok && rend_stage_create(b->dataset, b->engine.gl, &small, NULL, NULL, &stage, err) &&
         fly(b, stage, b->o->no_occlusion, &paging, err);
    rend_stage_destroy(stage);
    if (!ok) return false;
    printf("%-12s %7s %6s %6s %6s %7s %7s %7s %8s %8s %7s %7s %7s %8s %8s\n", "", "M p/s", "/raw",
           "median", "/plain", "one", "many", "plain", "med ms", "p99 ms", "M pts", "nodes",
           "misses", "MB read", "MB up");
    print_flown("resident", &all, n);
    if (!b->o->no_occlusion) print_flown("+ occlusion", &resident, n);
    print_flown("paging 1/10", &paging, n);
    if (!b->o->no_occlusion)
        printf("occlusion: %.0f %% fewer points\n", 100 * (1 - resident.points / all.points));
    return true;
}

/* ---- quality ---- */

typedef struct {
    float *luminance[2], *depth; /* owned; two: a moment later */
} picture;

typedef struct {
    double similarity, missing, flicker, points;
} quality;

static void picture_fini(picture *p)
{
    free(p->luminance[0]), free(p->luminance[1]), free(p->depth);
}

static bool picture_init(picture *p, uint32_t pixels, mospt_err *err)
{
    *p = (picture){.luminance = {malloc(pixels * sizeof(float)), malloc(pixels * sizeof(float))},
                   .depth = malloc(pixels * sizeof(float))};
    return (p->luminance[0] != NULL && p->luminance[1] != NULL && p->depth != NULL) ||
           mospt_err_nomem(err, pixels * sizeof(float));
}

static bool read_picture(const bench *b, rgl *gl, picture *p, int moment, mospt_err *err)
{
    uint32_t pixels = b->o->width * b->o->height;
    uint8_t *rgb = malloc(3 * (size_t)pixels);
    if (rgb == NULL) return mospt_err_nomem(err, 3 * (size_t)pixels);
    bool ok = (moment > 0 || rgl_read_depths(gl, p->depth, err)) &&
              rgl_read_pixels(gl, false, b->o->width, b->o->height, rgb, err);
    if (ok) bench_luminance(rgb, pixels, p->luminance[moment]);
    free(rgb);
    return ok;
}

/* Everything in view, with its splat sizes. */
static bool select_all(bench *b, const rend_frame *frame, const rend_selection **out,
                       mospt_err *err)
{
    const rend_select_input input = {.hierarchy = &b->dataset->hierarchy,
                                     .grid = &b->dataset->metadata.grid,
                                     .frame = frame,
                                     .budget_points = REND_ALL,
                                     .cell_px = 0.001f};
    return rend_select_run(b->selector, &input, out, err);
}

/* The first `share` of the shuffled points. */
static bool take_share(bench *b, double t, double share, picture *out, mospt_err *err)
{
    uint32_t low[3], high[3];
    int32_t first = 0, count = (int32_t)(share * (double)b->points.count);
    rend_frame_bounds(b->dataset, low, high);
    for (int moment = 0; moment < 2; moment++) {
        rend_frame frame;
        const rend_selection *sizes = NULL;
        rend_camera camera = bench_flight_at(&b->flight, t, moment / 30.0);
        rend_frame_make(&camera, &b->dataset->metadata.grid, low, high, b->o->width, b->o->height,
                        &frame);
        if (b->o->look.size_mode == REND_SIZE_AUTO && !select_all(b, &frame, &sizes, err))
            return false;
        if (!draw_raw(b, &frame, sizes, &first, &count, 1, err) ||
            !read_picture(b, b->raw, out, moment, err))
            return false;
    }
    return true;
}

static bool take_ours(bench *b, rend_stage *stage, double t, double share, picture *out,
                      uint64_t *points, mospt_err *err)
{
    for (int moment = 0; moment < 2; moment++) {
        rend_view_of view =
            view_at(b, t, moment / 30.0, (uint64_t)(share * (double)b->points.count));
        rend_figures f;
        if (!rend_stage_still(stage, &view, err) ||
            !read_picture(b, b->engine.gl, out, moment, err))
            return false;
        rend_stage_figures(stage, &f);
        *points = f.points_drawn;
    }
    return true;
}

static void judge(const bench *b, const picture *full, const picture *ours, uint64_t points,
                  quality *sum)
{
    uint32_t pixels = b->o->width * b->o->height;
    const float *f[2] = {full->luminance[0], full->luminance[1]},
                *p[2] = {ours->luminance[0], ours->luminance[1]};
    sum->similarity += bench_similarity(f[0], p[0], b->o->width, b->o->height) / b->o->views;
    sum->missing += bench_missing(full->depth, ours->depth, pixels) / b->o->views;
    sum->flicker += bench_flicker(f, p, pixels) / b->o->views;
    sum->points += (double)points / b->o->views;
}

/* The random share that is as similar, by the logarithm between two. */
static double share_like(double similarity, const quality *random)
{
    if (similarity < random[0].similarity) return 0;
    for (int i = 1; i < SHARES; i++) {
        double a = random[i - 1].similarity, z = random[i].similarity;
        if (similarity < z)
            return SHARE[i - 1] * pow(SHARE[i] / SHARE[i - 1], (similarity - a) / (z - a));
    }
    return SHARE[SHARES - 1];
}

static void print_quality(const char *kind, double share, const quality *q, const quality *random)
{
    printf("%-7s %4.0f %%  %10.4f %9.2f %9.2f %9.2f", kind, 100 * share, q->similarity,
           100 * q->missing, q->flicker, q->points * 1e-6);
    if (random != NULL) {
        double like = share_like(q->similarity, random);
        printf("   %s%.1f %%",
               like <= 0     ? "< "
               : like >= 0.5 ? ">= "
                             : "",
               100 * (like > 0 ? like : SHARE[0]));
    }
    printf("\n");
}

static bool judge_view(bench *b, rend_stage *stage, double t, picture *full, picture *ours,
                       quality *random, quality *budget, mospt_err *err)
{
    uint64_t points;
    if (!take_share(b, t, 1, full, err)) return false;
    for (int i = 0; i < SHARES; i++) {
        if (!take_share(b, t, SHARE[i], ours, err)) return false;
        judge(b, full, ours, (uint64_t)(SHARE[i] * (double)b->points.count), &random[i]);
    }
    for (int i = 0; i < BUDGETS; i++) {
        if (!take_ours(b, stage, t, SHARE[i], ours, &points, err)) return false;
        judge(b, full, ours, points, &budget[i]);
    }
    return true;
}

static bool measure_quality(bench *b, mospt_err *err)
{
    quality random[SHARES] = {{0}}, budget[BUDGETS] = {{0}};
    picture full = {0}, ours = {0};
    rend_stage *stage = NULL;
    uint32_t pixels = b->o->width * b->o->height;
    const rend_limits limits = {.ram_cache_bytes = 1, .gpu_cache_bytes = 4096 * REND_MIB};
    bench_points_shuffle(&b->points);
    bool ok = rgl_arena_create(b->raw, b->points.count, err);
    for (uint64_t i = 0, n; i < b->points.count && ok; i += n) {
        n = b->points.count - i < 1 << 24 ? b->points.count - i : 1 << 24;
        ok = rgl_arena_upload(b->raw, i, b->points.vertices + i, (uint32_t)n, err);
    }
    free(b->points.vertices);
    b->points.vertices = NULL;
    ok = ok && picture_init(&full, pixels, err) && picture_init(&ours, pixels, err) &&
         rend_stage_create(b->dataset, b->engine.gl, &limits, NULL, NULL, &stage, err);
    for (uint32_t v = 0; v < b->o->views && ok; v++)
        ok = judge_view(b, stage, (v + 0.5) / b->o->views, &full, &ours, random, budget, err);
    if (ok) {
        printf("%-14s %10s %9s %9s %9s   %s\n", "", "similarity", "missing %", "flicker",
               "M points", "equals random");
        for (int i = 0; i < SHARES; i++)
            print_quality("random", SHARE[i], &random[i], NULL);
        for (int i = 0; i < BUDGETS; i++)
            print_quality("budget", SHARE[i], &budget[i], random);
    }
    rend_stage_destroy(stage);
    picture_fini(&full), picture_fini(&ours);
    return ok;
}

/* ---- */

static bool open_engines(bench *b, mospt_err *err)
{
    if (!rend_engine_open(&b->o->engine, &b->engine, err)) return false;
    printf("%s, %ux%u, %.1f M points, budget %.1f M, %u frames\n", rgl_renderer(b->engine.gl),
           b->o->width, b->o->height, (double)b->points.count * 1e-6,
           (double)b->o->budget_points * 1e-6, b->o->frames);
    if (b->engine.context != NULL) return rgl_gl_create(&b->raw, err);
    if (!rend_engine_open(&b->o->engine, &b->second, err)) return false;
    b->raw = b->second.gl;
    return true;
}

static bool run(const options *o, mospt_err *err)
{
    bench b = {.o = o};
    b.selector = rend_select_create();
    b.loop = plain_loop_create(o->width, o->height, o->threads);
    if (b.selector == NULL || b.loop == NULL) return mospt_err_nomem(err, 0);
    bool ok = mospt_dataset_open(o->dataset, &b.dataset, err) &&
              bench_points_load(b.dataset, &b.points, err) &&
              bench_flight_make(b.dataset, (double)o->width / o->height, &b.flight, err) &&
              open_engines(&b, err) && (!o->speed || measure_speed(&b, err)) &&
              (!o->quality || measure_quality(&b, err));
    if (b.raw != b.second.gl) rgl_destroy(b.raw);
    rend_engine_close(&b.second);
    rend_engine_close(&b.engine);
    rend_select_destroy(b.selector);
    plain_loop_destroy(b.loop);
    bench_flight_fini(&b.flight);
    bench_points_fini(&b.points);
    mospt_dataset_close(b.dataset);
    return ok;
}

static bool set_option(options *o, const char *name, const char *value)
{
    if (strcmp(name, "--budget") == 0) o->budget_points = (uint64_t)atof(value);
    else if (strcmp(name, "--frames") == 0) o->frames = (uint32_t)atol(value);
    else if (strcmp(name, "--views") == 0) o->views = (uint32_t)atol(value);
    else if (strcmp(name, "--threads") == 0) o->engine.threads = o->threads = (uint32_t)atol(value);
    else if (strcmp(name, "--cell") == 0) o->cell_px = (float)atof(value);
    else if (strcmp(name, "--blend") == 0) o->look.blend_slab = (float)(atof(value) / 100);
    else if (strcmp(name, "--fill") == 0) o->look.fill_px = (uint32_t)atol(value);
    else if (strcmp(name, "--size") == 0) return sscanf(value, "%ux%u", &o->width, &o->height) == 2;
    else if (strcmp(name, "--renderer") == 0)
        o->engine.renderer = strcmp(value, "gl") == 0 ? REND_RENDERER_GL : REND_RENDERER_CPU;
    else if (strcmp(name, "--point-size") == 0) {
        o->look.size_mode = strcmp(value, "auto") == 0 ? REND_SIZE_AUTO : REND_SIZE_FIXED;
        o->look.point_px = (float)atof(value);
    } else return false;
    return true;
}

static bool parse(int argc, char **argv, options *o)
{
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--no-edl") == 0) o->look.no_edl = true;
        else if (strcmp(argv[i], "--no-occlusion") == 0) o->no_occlusion = true;
        else if (strcmp(argv[i], "--speed") == 0) o->quality = false;
        else if (strcmp(argv[i], "--quality") == 0) o->speed = false;
        else if (argv[i][0] != '-') o->dataset = argv[i];
        else if (i + 1 >= argc || !set_option(o, argv[i], argv[i + 1])) return false;
        else i++;
    }
    return o->dataset != NULL && o->frames > 0 && o->views > 0 && o->width > 0 && o->height > 0 &&
           o->threads > 0 && o->budget_points > 0 && (o->speed || o->quality);
}

int main(int argc, char **argv)
{
    options o = {.width = 1280,
                 .height = 720,
                 .frames = 100,
                 .views = 20,
                 .threads = 2,
                 .budget_points = 2000000,
                 .engine = {.renderer = REND_RENDERER_CPU, .threads = 2},
                 .look = {.size_mode = REND_SIZE_FIXED, .point_px = 1},
                 .speed = true,
                 .quality = true};
    mospt_err err = {0};
    if (!parse(argc, argv, &o)) {
        fprintf(stderr, "bench_render: see scripts/bench_render\n");
        return 2;
    }
    if (run(&o, &err)) return 0;
    char text[2048];
    mospt_err_text(&err, text, sizeof text);
    fprintf(stderr, "bench_render: %s\n", text);
    return 1;
}
