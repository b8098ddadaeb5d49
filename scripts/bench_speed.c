#include "scripts/bench_render.h"
#include "scripts/bench_time.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { IN_A_ROW = 10, PAUSE_US = 50000 };
#define COLD_SIZE ((size_t)64 << 20) /* more than a processor's caches hold */

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

static bool room_init(const bench_render *b, room *r, mospt_err *err)
{
    uint64_t most =
        b->view->budget_points < b->points.count ? b->view->budget_points : b->points.count;
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

/* Waits for all that was drawn. */
static bool finish(rgl *gl, mospt_err *err)
{
    float depth;
    return rgl_read_depth(gl, 0, 0, 0, &depth, err);
}

static bool time_raw(bench_render *b, const flown_frame *f, room *r, bool many, double *ms,
                     mospt_err *err)
{
    int32_t whole = 0, points = (int32_t)f->drawn.points;
    cool(r);
    double start = bench_now_ms();
    if (!bench_render_raw(b, &f->frame, NULL, many ? r->first : &whole, many ? r->count : &points,
                          many ? f->drawn.draw_count : 1, err) ||
        !finish(b->raw, err))
        return false;
    *ms = bench_now_ms() - start;
    return true;
}

/* turn     which is drawn first */
static bool time_limits(bench_render *b, room *r, uint32_t turn, flown_frame *f, mospt_err *err)
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
    double start = bench_now_ms();
    plain_loop_draw(b->loop, &f->frame, r->vertices, (uint32_t)s->points);
    f->plain_ms = bench_now_ms() - start;
    return ok;
}

typedef struct {
    double points, ms, median_ms, p99_ms, missing, hidden, nodes;
    double one_ms, many_ms, plain_ms; /* of the limits, sums */
    double median_ratio;              /* of frames: the better limit's time by ours */
    uint64_t loaded_bytes, uploaded_bytes;
} flown;

static bool sum_up(const bench_render *b, const flown_frame *frames, flown *out, mospt_err *err)
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
    bench_sort(ms, n);
    bench_sort(ratio, n);
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
static bool fly_frame(bench_render *b, rend_stage *stage, uint32_t i, bool settle,
                      bool no_occlusion, double *ms, mospt_err *err)
{
    rend_progress progress;
    rend_view_of view = bench_render_view(b, (i + 0.5) / b->o->frames, 0, b->view->budget_points);
    view.no_occlusion = no_occlusion;
    do {
        double start = bench_now_ms();
        if (!rend_stage_frame(stage, &view, NULL, &progress, err) || !finish(b->engine.gl, err))
            return false;
        *ms = bench_now_ms() - start;
        if (settle && progress == REND_WAITING) usleep(1000);
    } while (settle && progress != REND_SETTLED);
    return true;
}

static bool visit_all(bench_render *b, rend_stage *stage, mospt_err *err)
{
    double ms;
    for (uint32_t i = 0; i < b->o->frames; i++)
        if (!fly_frame(b, stage, i, true, true, &ms, err)) return false;
    return true;
}

/* Frames follow each other, for a while: nobody reads for the next one while limits are drawn, and
 * the first one after that is drawn once more, as it was, before they go on. */
static bool fly(bench_render *b, rend_stage *stage, bool no_occlusion, flown *out, mospt_err *err)
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

bool bench_speed_measure(bench_render *b, mospt_err *err)
{
    flown resident, all, paging;
    rend_stage *stage = NULL;
    uint64_t size = b->points.count * sizeof(mospt_vertex) * 5 / 4 + 64 * REND_MIB;
    uint32_t n = b->o->frames;
    const rend_limits large = {.ram_cache_bytes = 1, .gpu_cache_bytes = size},
                      small = {.gpu_cache_bytes = b->points.count * sizeof(mospt_vertex) / 10};
    bool ok = rend_stage_create(b->dataset, b->engine.gl, &large, NULL, NULL, &stage, err) &&
              visit_all(b, stage, err) && fly(b, stage, true, &all, err) &&
              (b->view->no_occlusion || fly(b, stage, false, &resident, err));
    rend_stage_destroy(stage);
    stage = NULL;
    ok = ok && rend_stage_create(b->dataset, b->engine.gl, &small, NULL, NULL, &stage, err) &&
         fly(b, stage, b->view->no_occlusion, &paging, err);
    rend_stage_destroy(stage);
    if (!ok) return false;
    printf("%-12s %7s %6s %6s %6s %7s %7s %7s %8s %8s %7s %7s %7s %8s %8s\n", "", "M p/s", "/raw",
           "median", "/plain", "one", "many", "plain", "med ms", "p99 ms", "M pts", "nodes",
           "misses", "MB read", "MB up");
    print_flown("resident", &all, n);
    if (!b->view->no_occlusion) print_flown("+ occlusion", &resident, n);
    print_flown("paging 1/10", &paging, n);
    if (!b->view->no_occlusion)
        printf("with occlusion %.1f %% of the points without it\n",
               100 * resident.points / all.points);
    return true;
}
