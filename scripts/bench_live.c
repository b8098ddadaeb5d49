/* How even frames are, flown in time as a window would: a frame begins when the one before has been
 * shown for long enough, points and uploads are as many as fit, and nothing has been read before.
 *
 *   bench_live DATASET [--seconds N] [--fps N] [--budget N] [--size WxH] [--renderer gl|cpu]
 *              [--threads N] [--point-size PX|auto] [--gpu-cache MIB] [--no-edl] [--no-occlusion]
 *
 * Flies around the site and through it within N seconds (40), first cold - the dataset is dropped
 * from the page cache, as far as the system obliges -, then again with what the caches hold. A GPU
 * cache of a tenth of the points, unless given. Prints for each: how long frames took to make, and
 * how long each was the one to be seen, until the next was done; those that came too late for the
 * rate, points drawn, nodes missed in a frame, megabytes read and uploaded; and the same of a plain
 * loop over as many points, at the same rate: the machine's own share.
 */
#include "render/engine.h"
#include "render/pace.h"
#include "render/stage.h"
#include "scripts/bench_flight.h"
#include "scripts/bench_options.h"
#include "scripts/bench_time.h"
#include "scripts/plain_loop.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct {
    bench_options common;
    double seconds, fps;
    uint64_t gpu_cache_bytes; /* 0: a tenth of the points */
} options;

typedef struct {
    const options *o;
    bench_flight flight;
    rend_engine engine;
    rend_stage *stage;
    rend_pace pace;
    uint32_t frames;
    double *ms;   /* [2][frames], owned: to make each, and `seen` */
    double *seen; /* [frames] until the next was done; of the last one, 0 */
    double done;  /* when the frame before was, of bench_now_ms() */
} bench;

static void wait_until(double ms)
{
    double left = ms - bench_now_ms();
    if (left > 0) usleep((useconds_t)(left * 1e3));
}

/* What has been written to the disk goes; the rest stays. */
static void drop_from_cache(const char *folder)
{
    DIR *dir = opendir(folder);
    for (const struct dirent *e; dir != NULL && (e = readdir(dir)) != NULL;) {
        int fd = openat(dirfd(dir), e->d_name, O_RDONLY);
        if (fd < 0) continue;
        posix_fadvise(fd, 0, 0, POSIX_FADV_DONTNEED);
        close(fd);
    }
    if (dir != NULL) closedir(dir);
}

/* The frame that was begun at `start` is done. */
static void note_frame(bench *b, uint32_t i, double start)
{
    double now = bench_now_ms();
    b->ms[i] = now - start;
    b->seen[i] = 0;
    if (i > 0) b->seen[i - 1] = now - b->done;
    b->done = now;
}

static bool fly_frame(bench *b, uint32_t i, uint64_t *points, mospt_err *err)
{
    rend_progress progress;
    rend_figures before, after;
    rend_view_of view = b->o->common.view;
    const rend_allowance allowed = {.upload_bytes = rend_pace_bytes(&b->pace)};
    uint64_t fits = rend_pace_points(&b->pace);
    float depth;
    view.camera = bench_flight_at(&b->flight, (i + 0.5) / b->frames, 0);
    if (view.budget_points > fits) view.budget_points = fits;
    rend_stage_figures(b->stage, &before);
    double start = bench_now_ms();
    if (!rend_stage_frame(b->stage, &view, &allowed, &progress, err) ||
        !rgl_read_depth(b->engine.gl, 0, 0, 0, &depth, err)) /* waits for all that was drawn */
        return false;
    note_frame(b, i, start);
    rend_stage_figures(b->stage, &after);
    *points = after.points_drawn;
    rend_pace_note(&b->pace, after.points_total - before.points_total,
                   after.uploaded_bytes - before.uploaded_bytes, true, b->ms[i]);
    return true;
}

static void print_times(double *ms, uint32_t n)
{
    bench_sort(ms, n);
    double median = ms[n / 2], p99 = ms[n * 99 / 100];
    printf(" %7.1f %7.1f %5.2f %7.1f", median, p99, p99 / median, ms[n - 1]);
}

static void print_frames(bench *b, const char *name)
{
    printf("%-6s %6u", name, b->frames);
    print_times(b->ms, b->frames);
    print_times(b->seen, b->frames);
}

static bool fly(bench *b, const char *name, mospt_err *err)
{
    rend_figures before, f = {0};
    double points = 0, missing = 0, frame_ms = 1e3 / b->o->fps, next = bench_now_ms();
    uint32_t late = 0, n = b->frames;
    rend_pace_init(&b->pace, b->o->fps);
    rend_stage_figures(b->stage, &before);
    for (uint32_t i = 0; i < n; i++) {
        uint64_t drawn;
        wait_until(next);
        next = bench_now_ms() + frame_ms;
        if (!fly_frame(b, i, &drawn, err)) return false;
        rend_stage_figures(b->stage, &f);
        points += (double)drawn, missing += f.pending, late += b->ms[i] > frame_ms;
    }
    print_frames(b, name);
    printf(" %7.2f %7.2f %7.1f %8.1f %8.1f\n", 100.0 * late / n, points / n * 1e-6, missing / n,
           (double)(f.loaded_bytes - before.loaded_bytes) * 1e-6,
           (double)(f.uploaded_bytes - before.uploaded_bytes) * 1e-6);
    return true;
}

/* The coarsest nodes, as many as the budget has points. */
static bool read_points(const bench *b, const mospt_dataset *dataset, mospt_vertex **out,
                        uint32_t *count, mospt_err *err)
{
    const mospt_hierarchy *h = &dataset->hierarchy;
    uint64_t most = b->o->common.view.budget_points, all = dataset->metadata.point_count;
    if (most > all) most = all;
    *out = malloc(most * sizeof **out);
    if (*out == NULL) return mospt_err_nomem(err, most * sizeof **out);
    *count = 0;
    for (uint32_t n = 0; n < h->count && *count + h->nodes[n].count <= most; n++) {
        if (!mospt_dataset_read_vertices(dataset, n, *out + *count, err)) return false;
        *count += h->nodes[n].count;
    }
    return true;
}

static bool loop(bench *b, const mospt_dataset *dataset, mospt_err *err)
{
    const rend_view_of *v = &b->o->common.view;
    mospt_vertex *vertices = NULL;
    uint32_t count, low[3], high[3];
    double frame_ms = 1e3 / b->o->fps, next = bench_now_ms();
    plain_loop *l = plain_loop_create(v->width, v->height, b->o->common.engine.threads);
    bool ok =
        (l != NULL || mospt_err_nomem(err, 0)) && read_points(b, dataset, &vertices, &count, err);
    rend_frame_bounds(dataset, low, high);
    for (uint32_t i = 0; ok && i < b->frames; i++) {
        rend_frame frame;
        rend_camera camera = bench_flight_at(&b->flight, (i + 0.5) / b->frames, 0);
        rend_frame_make(&camera, &dataset->metadata.grid, low, high, v->width, v->height, &frame);
        wait_until(next);
        double start = bench_now_ms();
        next = start + frame_ms;
        plain_loop_draw(l, &frame, vertices, count);
        note_frame(b, i, start);
    }
    plain_loop_destroy(l);
    free(vertices);
    if (ok) print_frames(b, "loop"), printf("\n");
    return ok;
}

static bool run(const options *o, mospt_err *err)
{
    bench b = {.o = o, .frames = (uint32_t)(o->seconds * o->fps)};
    const rend_view_of *v = &o->common.view;
    mospt_dataset *dataset = NULL;
    b.ms = calloc(2 * (size_t)b.frames, sizeof *b.ms);
    b.seen = b.ms != NULL ? b.ms + b.frames : NULL;
    bool ok = (b.ms != NULL || mospt_err_nomem(err, 2 * b.frames * sizeof *b.ms)) &&
              mospt_dataset_open(o->common.dataset, &dataset, err) &&
              bench_flight_make(dataset, (double)v->width / v->height, &b.flight, err) &&
              rend_engine_open(&o->common.engine, &b.engine, err);
    if (ok) {
        uint64_t tenth = dataset->metadata.point_count * sizeof(mospt_vertex) / 10;
        const rend_limits limits = {.gpu_cache_bytes =
                                        o->gpu_cache_bytes > 0 ? o->gpu_cache_bytes : tenth};
        ok = rend_stage_create(dataset, b.engine.gl, &limits, NULL, NULL, &b.stage, err);
        drop_from_cache(o->common.dataset);
    }
    if (ok) {
        printf("%s, %ux%u, %.1f M points, budget %.1f M, %.0f frames a second\n",
               rgl_renderer(b.engine.gl), v->width, v->height,
               (double)dataset->metadata.point_count * 1e-6, (double)v->budget_points * 1e-6,
               o->fps);
        printf("%-6s %6s %7s %7s %5s %7s %7s %7s %5s %7s %7s %7s %7s %8s %8s\n", "", "frames",
               "made ms", "p99", "/med", "most", "seen ms", "p99", "/med", "most", "late %",
               "M pts", "misses", "MB read", "MB up");
        ok = fly(&b, "cold", err) && fly(&b, "again", err) && loop(&b, dataset, err);
    }
    rend_stage_destroy(b.stage);
    rend_engine_close(&b.engine);
    bench_flight_fini(&b.flight);
    mospt_dataset_close(dataset);
    free(b.ms);
    return ok;
}

static int set(void *user, const char *name, const char *value)
{
    options *o = user;
    if (value == NULL) return 0;
    if (strcmp(name, "--seconds") == 0) o->seconds = atof(value);
    else if (strcmp(name, "--fps") == 0) o->fps = atof(value);
    else if (strcmp(name, "--gpu-cache") == 0)
        o->gpu_cache_bytes = (uint64_t)atol(value) * REND_MIB;
    else return 0;
    return 2;
}

int main(int argc, char **argv)
{
    options o = {.common = bench_options_usual(), .seconds = 40, .fps = 30};
    mospt_err err = {0};
    if (!bench_options_parse(argc, argv, set, &o, &o.common) || !(o.fps > 0) ||
        !(o.seconds * o.fps >= 1)) {
        fprintf(stderr, "usage: bench_live DATASET [--seconds N] [--fps N] [--budget N] "
                        "[--size WxH] [--renderer gl|cpu] [--threads N] [--point-size PX|auto] "
                        "[--gpu-cache MIB] [--no-edl] [--no-occlusion]\n");
        return 2;
    }
    return run(&o, &err) ? 0 : bench_options_fail("bench_live", &err);
}
