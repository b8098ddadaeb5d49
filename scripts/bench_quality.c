#include "scripts/bench_render.h"
#include "scripts/bench_picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { SHARES = 6, BUDGETS = 5 };
static const double SHARE[SHARES] = {0.01, 0.02, 0.05, 0.1, 0.25, 0.5};

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

static bool read_picture(const bench_render *b, rgl *gl, picture *p, int moment, mospt_err *err)
{
    uint32_t pixels = b->view->width * b->view->height;
    uint8_t *rgb = malloc(3 * (size_t)pixels);
    if (rgb == NULL) return mospt_err_nomem(err, 3 * (size_t)pixels);
    bool ok = (moment > 0 || rgl_read_depths(gl, p->depth, err)) &&
              rgl_read_pixels(gl, false, b->view->width, b->view->height, rgb, err);
    if (ok) bench_luminance(rgb, pixels, p->luminance[moment]);
    free(rgb);
    return ok;
}

/* Everything in view, with its splat sizes. */
static bool select_all(bench_render *b, const rend_frame *frame, const rend_selection **out,
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
static bool take_share(bench_render *b, double t, double share, picture *out, mospt_err *err)
{
    uint32_t low[3], high[3];
    int32_t first = 0, count = (int32_t)(share * (double)b->points.count);
    rend_frame_bounds(b->dataset, low, high);
    for (int moment = 0; moment < 2; moment++) {
        rend_frame frame;
        const rend_selection *sizes = NULL;
        rend_camera camera = bench_flight_at(&b->flight, t, moment / 30.0);
        rend_frame_make(&camera, &b->dataset->metadata.grid, low, high, b->view->width,
                        b->view->height, &frame);
        if (b->view->look.size_mode == REND_SIZE_AUTO && !select_all(b, &frame, &sizes, err))
            return false;
        if (!bench_render_raw(b, &frame, sizes, &first, &count, 1, err) ||
            !read_picture(b, b->raw, out, moment, err))
            return false;
    }
    return true;
}

static bool take_ours(bench_render *b, rend_stage *stage, double t, double share, picture *out,
                      uint64_t *points, mospt_err *err)
{
    for (int moment = 0; moment < 2; moment++) {
        rend_view_of view =
            bench_render_view(b, t, moment / 30.0, (uint64_t)(share * (double)b->points.count));
        rend_figures f;
        if (!rend_stage_still(stage, &view, err) ||
            !read_picture(b, b->engine.gl, out, moment, err))
            return false;
        rend_stage_figures(stage, &f);
        *points = f.points_drawn;
    }
    return true;
}

static void judge(const bench_render *b, const picture *full, const picture *ours, uint64_t points,
                  quality *sum)
{
    uint32_t pixels = b->view->width * b->view->height;
    const float *f[2] = {full->luminance[0], full->luminance[1]},
                *p[2] = {ours->luminance[0], ours->luminance[1]};
    sum->similarity += bench_similarity(f[0], p[0], b->view->width, b->view->height) / b->o->views;
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

static bool judge_view(bench_render *b, rend_stage *stage, double t, picture *full, picture *ours,
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

bool bench_quality_measure(bench_render *b, mospt_err *err)
{
    quality random[SHARES] = {{0}}, budget[BUDGETS] = {{0}};
    picture full = {0}, ours = {0};
    rend_stage *stage = NULL;
    uint32_t pixels = b->view->width * b->view->height;
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
