/* scripts/bench_raster.c - points a second of the back end that draws on the processor, beside a
 * plain loop over the same vertices and beside OpenGL. Called by hand:
 *
 *     bench_raster DATASET [--threads N] [--points N] [--gl] [--runs N]
 *
 * All vertices of a dataset, or the first so many, lie in one array; a camera looks at all of them,
 * and another from the middle. Every configuration draws the same pictures, one after the other in
 * each run; printed are the median of the runs and the ratio to the plain loop's. The pictures of
 * one-pixel points must be the plain loop's. */
#include "render/cpu/cpu.h"
#include "render/gl/context.h"
#include "scripts/bench_time.h"
#include "scripts/plain_loop.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { WIDTH = 1280, HEIGHT = 720, RUNS_MAX = 99, RANGE_POINTS = 15000 };

typedef struct {
    mospt_vertex *vertices; /* [count] */
    uint32_t count;
    int32_t *first, *counts; /* [range_count] as many points as a node has */
    uint32_t range_count;
    rend_frame frame;
    rgl *cpu, *gl;
    plain_loop *plain;
} bench;

static void need(bool ok, const mospt_err *err)
{
    char text[2048];
    if (ok) return;
    mospt_err_text(err, text, sizeof text);
    fprintf(stderr, "bench_raster: %s\n", text);
    exit(1);
}

static void load(const mospt_dataset *dataset, uint64_t most, bench *b)
{
    const mospt_hierarchy *h = &dataset->hierarchy;
    mospt_err err = {0};
    b->vertices = malloc(h->point_count * sizeof *b->vertices);
    if (b->vertices == NULL) exit(1);
    for (uint32_t n = 0; n < h->count && b->count + (uint64_t)h->nodes[n].count <= most; n++) {
        need(mospt_dataset_read_vertices(dataset, n, b->vertices + b->count, &err), &err);
        b->count += h->nodes[n].count;
    }
    b->range_count = (b->count + RANGE_POINTS - 1) / RANGE_POINTS;
    b->first = malloc(b->range_count * sizeof *b->first);
    b->counts = malloc(b->range_count * sizeof *b->counts);
    for (uint32_t r = 0; r < b->range_count; r++) {
        b->first[r] = (int32_t)(r * RANGE_POINTS);
        b->counts[r] = (int32_t)(b->count - r * RANGE_POINTS);
        if (b->counts[r] > RANGE_POINTS) b->counts[r] = RANGE_POINTS;
    }
}

static void look(const mospt_dataset *dataset, bool inside, bench *b)
{
    mospt_err err = {0};
    rend_camera camera;
    uint32_t low[3], high[3];
    need(rend_camera_make(&(rend_camera_options){0}, dataset, WIDTH, HEIGHT, &camera, &err), &err);
    for (int a = 0; a < 3 && inside; a++) {
        double ahead = camera.target[a] - camera.eye[a];
        camera.eye[a] = camera.target[a];
        camera.target[a] += a < 2 ? ahead : 0;
    }
    rend_frame_bounds(dataset, low, high);
    rend_frame_make(&camera, &dataset->metadata.grid, low, high, WIDTH, HEIGHT, &b->frame);
}

typedef enum { PLAIN, POINTS, LIT, SPLATS, LIT_SPLATS, OPENGL, CASES } bench_case;

static const char *const NAMES[CASES] = {"plain loop", "points",     "points, lit",
                                         "2 x 2",      "2 x 2, lit", "OpenGL, points"};

static void draw(const bench *b, bench_case which)
{
    mospt_err err = {0};
    bool wide = which == SPLATS || which == LIT_SPLATS;
    rgl_scene scene = {.frame = b->frame, .px_min = wide ? 2 : 1, .px_max = wide ? 2 : 1};
    rgl_batch batch = {.first = b->first, .count = b->counts, .range_count = b->range_count};
    if (which == LIT || which == LIT_SPLATS) scene.edl_strength = 24, scene.edl_radius_px = 1;
    if (which == PLAIN) {
        plain_loop_draw(b->plain, &b->frame, b->vertices, b->count);
        return;
    }
    rgl *gl = which == OPENGL ? b->gl : b->cpu;
    uint8_t pixel[3];
    need(rgl_draw(gl, &scene, &batch, 1, RGL_BEGIN | RGL_END, &err), &err);
    if (which == OPENGL) need(rgl_read_pixels(gl, false, 1, 1, pixel, &err), &err);
}

/* Pixels must have the plain loop's distances, but for points on the 256th of a pixel where GL
 * rounds to the other side. */
static void verify(const bench *b)
{
    mospt_err err = {0};
    float *depths = malloc(sizeof *depths * WIDTH * HEIGHT);
    uint32_t wrong = 0, covered = 0;
    draw(b, PLAIN);
    draw(b, POINTS);
    need(rgl_read_depths(b->cpu, depths, &err), &err);
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) {
        float w = plain_loop_distance(b->plain, i % WIDTH, i / WIDTH);
        float ours = depths[i] < 1 ? rend_frame_depth_to_w(&b->frame, depths[i]) : INFINITY;
        covered += depths[i] < 1;
        wrong +=
            (w == INFINITY) != (ours == INFINITY) || (w < INFINITY && fabsf(ours / w - 1) > 1e-4f);
    }
    free(depths);
    if (wrong * 50 > covered) {
        fprintf(stderr, "bench_raster: %u of %u pixels are not the plain loop's\n", wrong, covered);
        exit(1);
    }
}

static void measure(const bench *b, const char *view, uint32_t runs)
{
    double ms[CASES][RUNS_MAX];
    verify(b);
    for (uint32_t r = 0; r < runs; r++)
        for (int c = 0; c < CASES; c++) {
            if (c == OPENGL && b->gl == NULL) continue;
            double start = bench_now_ms();
            draw(b, (bench_case)c);
            ms[c][r] = bench_now_ms() - start;
        }
    for (int c = 0; c < CASES; c++) {
        if (c == OPENGL && b->gl == NULL) continue;
        bench_sort(ms[c], runs);
        double median = ms[c][runs / 2];
        printf("%-8s %-15s %8.2f ms %8.1f M points/s %6.2f of the plain loop\n", view, NAMES[c],
               median, 1e-3 * b->count / median, ms[PLAIN][runs / 2] / median);
    }
}

int main(int argc, char **argv)
{
    mospt_err err = {0};
    mospt_dataset *dataset = NULL;
    bench b = {0};
    uint32_t threads = 0, runs = 5;
    uint64_t most = 100000000;
    bool with_gl = false;
    for (int i = 2; i < argc; i++) {
        if (strcmp(argv[i], "--gl") == 0) with_gl = true;
        else if (i + 1 == argc) return 2;
        else if (strcmp(argv[i], "--threads") == 0) threads = (uint32_t)atoi(argv[++i]);
        else if (strcmp(argv[i], "--points") == 0) most = (uint64_t)atof(argv[++i]);
        else if (strcmp(argv[i], "--runs") == 0) runs = (uint32_t)atoi(argv[++i]);
        else return 2;
    }
    if (argc < 2 || runs < 1 || runs > RUNS_MAX) return 2;
    need(mospt_dataset_open(argv[1], &dataset, &err), &err);
    load(dataset, most, &b);
    need(rcpu_create(&(rcpu_options){.threads = threads}, &b.cpu, &err), &err);
    need(rgl_arena_create(b.cpu, b.count, &err), &err);
    need(rgl_arena_upload(b.cpu, 0, b.vertices, b.count, &err), &err);
    rgl_context *context = NULL;
    if (with_gl) {
        need(rgl_context_create(&context, &err) && rgl_gl_create(&b.gl, &err), &err);
        need(rgl_arena_create(b.gl, b.count, &err), &err);
        need(rgl_arena_upload(b.gl, 0, b.vertices, b.count, &err), &err);
    }
    b.plain = plain_loop_create(WIDTH, HEIGHT, threads);
    if (b.plain == NULL) return 1;
    printf("%u points, %s\n", b.count, rgl_renderer(b.cpu));
    for (int inside = 0; inside < 2; inside++) {
        look(dataset, inside != 0, &b);
        measure(&b, inside ? "inside" : "outside", runs);
    }
    plain_loop_destroy(b.plain);
    rgl_destroy(b.cpu);
    rgl_destroy(b.gl);
    rgl_context_destroy(context);
    free(b.vertices), free(b.first), free(b.counts);
    mospt_dataset_close(dataset);
    return 0;
}
