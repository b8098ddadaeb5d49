#include "render/cpu/cpu.h"

#include "render/cpu/frames.h"
#include "render/cpu/log.h"
#include "render/cpu/memory.h"
#include "render/cpu/touch.h"
#include "render/gl/driver.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum {
    CHUNK_POINTS = 8192,   /* 128 KiB of vertices: a fifth of a millisecond */
    EDL_RADIUS_MAX = 1024, /* pixels */
};

/* Points that one thread draws in one go. */
typedef struct {
    const mospt_vertex *vertices; /* borrowed */
    uint32_t count, batch;
} chunk;

typedef struct {
    rgl base;
    const rcpu_kernel *kernel;
    rcpu_threads *threads;
    mospt_vertex *arena; /* [arena_size], owned */
    uint64_t arena_size;
    rcpu_touch *arena_touch;
    rcpu_frames frames;
    uint32_t *octants; /* [8 * octant_capacity], owned: those of the scene */
    uint32_t octant_capacity;
    chunk *chunks; /* [chunk_capacity], owned */
    size_t chunk_count, chunk_capacity;
    float near_log, range_log; /* log2 of near, and of far / near, of the last scene */
    char name[64];
} cpu_rgl;

static size_t arena_bytes(const cpu_rgl *c)
{
    return (c->arena_size + 1) * sizeof *c->arena;
}

static void drop_arena(cpu_rgl *c)
{
    rcpu_touch_destroy(c->arena_touch);
    rcpu_memory_release(c->arena, arena_bytes(c));
    c->arena = NULL, c->arena_touch = NULL, c->arena_size = 0;
}

static void cpu_destroy(rgl *gl)
{
    cpu_rgl *c = (cpu_rgl *)gl;
    rcpu_threads_destroy(c->threads);
    rcpu_frames_fini(&c->frames);
    drop_arena(c);
    free(c->octants);
    free(c->chunks);
    free(c);
}

static const char *cpu_renderer(const rgl *gl)
{
    return ((const cpu_rgl *)gl)->name;
}

static bool cpu_arena_create(rgl *gl, uint64_t vertex_count, mospt_err *err)
{
    cpu_rgl *c = (cpu_rgl *)gl;
    drop_arena(c);
    c->arena_size = vertex_count;
    c->arena = rcpu_memory_take(arena_bytes(c));
    if (c->arena == NULL) {
        c->arena_size = 0;
        return mospt_err_nomem(err, vertex_count * sizeof *c->arena);
    }
    c->arena_touch = rcpu_touch_create(c->arena, arena_bytes(c));
    return true;
}

static bool cpu_arena_upload(rgl *gl, uint64_t first, const mospt_vertex *vertices, uint32_t count,
                             mospt_err *err)
{
    (void)err;
    cpu_rgl *c = (cpu_rgl *)gl;
    assert(first <= c->arena_size && count <= c->arena_size - first);
    memcpy(c->arena + first, vertices, count * sizeof *vertices);
    rcpu_touch_filled(c->arena_touch, (first + count) * sizeof *vertices);
    return true;
}

/* ---- points ---- */

static rcpu_view make_view(const cpu_rgl *c, const rgl_scene *scene)
{
    const rend_frame *f = &scene->frame;
    rcpu_view v = {
        .size = c->frames.size,
        .inverse_tan = {1 / f->tan_half[0], 1 / f->tan_half[1]},
        .near_w = f->near_w,
        .far_w = f->far_w,
        .splat_px = (scene->octants != NULL ? scene->splat_scale : scene->splat_size) * f->focal_px,
        .px_min = scene->px_min,
        .px_max = scene->px_max,
        .octants = scene->octants != NULL ? c->octants : NULL,
        .grid_bits = scene->grid_bits,
        .square_px = RGL_SQUARE_PX,
        .slab = scene->blend_slab,
        .slab_log = log2f(1 + scene->blend_slab),
    };
    if (scene->clip != NULL) {
        v.has_clip = true;
        memcpy(v.clip_low, scene->clip->low, sizeof v.clip_low);
        memcpy(v.clip_high, scene->clip->high, sizeof v.clip_high);
    }
    memcpy(v.anchor, f->anchor, sizeof v.anchor);
    memcpy(v.offset, f->offset, sizeof v.offset);
    memcpy(v.rotation, f->rotation, sizeof v.rotation);
    return v;
}

static bool take_octants(cpu_rgl *c, const rgl_scene *scene, mospt_err *err)
{
    size_t size = 8 * sizeof *c->octants * scene->octant_nodes;
    if (scene->octants == NULL) return true;
    if (scene->octant_nodes > c->octant_capacity || c->octants == NULL) {
        uint32_t capacity = scene->octant_nodes + scene->octant_nodes / 2 + 16;
        uint32_t *larger = realloc(c->octants, 8 * sizeof *larger * capacity);
        if (larger == NULL) return mospt_err_nomem(err, size);
        c->octants = larger, c->octant_capacity = capacity;
    }
    memcpy(c->octants, scene->octants, size);
    return true;
}

static bool add_chunk(cpu_rgl *c, chunk added, mospt_err *err)
{
    if (c->chunk_count == c->chunk_capacity) {
        size_t capacity = c->chunk_capacity > 0 ? 2 * c->chunk_capacity : 1024;
        chunk *larger = realloc(c->chunks, capacity * sizeof *larger);
        if (larger == NULL) return mospt_err_nomem(err, capacity * sizeof *larger);
        c->chunks = larger, c->chunk_capacity = capacity;
    }
    c->chunks[c->chunk_count++] = added;
    return true;
}

static bool cut_batches(cpu_rgl *c, const rgl_batch *batches, uint32_t batch_count, mospt_err *err)
{
    c->chunk_count = 0;
    for (uint32_t b = 0; b < batch_count; b++)
        for (uint32_t r = 0; r < batches[b].range_count; r++) {
            const mospt_vertex *at = c->arena + batches[b].first[r];
            uint32_t left = (uint32_t)batches[b].count[r];
            assert((uint64_t)batches[b].first[r] + left <= c->arena_size);
            for (uint32_t part; left > 0; at += part, left -= part) {
                part = left < CHUNK_POINTS ? left : CHUNK_POINTS;
                if (!add_chunk(c, (chunk){at, part, b}, err)) return false;
            }
        }
    return true;
}

typedef struct {
    cpu_rgl *c;
    rcpu_view view;
    float bend;
    const rgl_batch *batches;
} points_round;

/* How the points of a batch are drawn. */
static rcpu_view view_of(const points_round *round, const rgl_batch *batch)
{
    rcpu_view view = round->view;
    if (batch->smallest) view.px_max = view.px_min, view.octants = NULL;
    view.round = batch->shape != RGL_SQUARE;
    view.bend = batch->shape == RGL_PARABOLOID ? round->bend : 0;
    return view;
}

/* What is never wider than a pixel covers one, whatever cells say. */
static void draw_chunk(void *user, uint32_t worker, uint32_t job)
{
    const points_round *round = user;
    cpu_rgl *c = round->c;
    const chunk *part = &c->chunks[job];
    rcpu_view view = view_of(round, &round->batches[part->batch]);
    c->frames.drawn[worker] = true;
    (view.px_max <= 1 ? c->kernel->points : c->kernel->splats)(&view, part->vertices, part->count,
                                                               c->frames.frames[worker]);
}

static void blend_chunk(void *user, uint32_t worker, uint32_t job)
{
    const points_round *round = user;
    cpu_rgl *c = round->c;
    const chunk *part = &c->chunks[job];
    rcpu_view view = view_of(round, &round->batches[part->batch]);
    rcpu_front front = rcpu_frames_front(&c->frames);
    c->kernel->blend(&view, part->vertices, part->count, &front, &c->frames.sums[worker]);
}

static bool draw_points(cpu_rgl *c, const rgl_scene *scene, const rgl_batch *batches, int parts,
                        mospt_err *err)
{
    rcpu_frames *f = &c->frames;
    points_round round = {c, make_view(c, scene), 1 / (2 * scene->frame.focal_px), batches};
    uint32_t chunks = (uint32_t)c->chunk_count;
    bool begin = (parts & RGL_BEGIN) != 0, again = (parts & RGL_AGAIN) != 0;
    if (begin || !again) {
        if (begin) rcpu_frames_clear(f, c->threads);
        if (chunks > 0) f->merged = false;
        rcpu_threads_run(c->threads, f->frame_count, chunks, draw_chunk, &round);
    }
    if (again) {
        rcpu_frames_merge(f, c->kernel, c->threads);
        if (!f->blending && !rcpu_frames_blend(f, c->kernel, c->threads, scene->blend_slab, err))
            return false;
        rcpu_threads_run(c->threads, f->sums_count, chunks, blend_chunk, &round);
    }
    return true;
}

/* ---- shading ---- */

static rcpu_light make_light(const cpu_rgl *c, const rgl_scene *scene)
{
    rcpu_light light = {
        .size = c->frames.size,
        .edl_strength = scene->edl_strength,
        .straight = (int)(scene->edl_radius_px + 0.5f),
        .diagonal = (int)(0.7071f * scene->edl_radius_px + 0.5f),
    };
    if (light.straight > EDL_RADIUS_MAX) light.straight = EDL_RADIUS_MAX;
    if (light.diagonal > EDL_RADIUS_MAX) light.diagonal = EDL_RADIUS_MAX;
    memcpy(light.background_top, scene->background_top, sizeof light.background_top);
    memcpy(light.background_bottom, scene->background_bottom, sizeof light.background_bottom);
    return light;
}

static rcpu_hole make_hole(const cpu_rgl *c, const rgl_scene *scene)
{
    uint32_t radius = scene->fill_px < RGL_FILL_PX_MAX ? scene->fill_px : RGL_FILL_PX_MAX;
    return (rcpu_hole){.size = c->frames.size,
                       .radius = (int)radius,
                       .behind_log = log2f(1 + RGL_FILL_BEHIND),
                       .spread_log = log2f(1 + RGL_FILL_SPREAD),
                       .far_log = log2f(scene->frame.far_w)};
}

static bool finish(cpu_rgl *c, const rgl_scene *scene, mospt_err *err)
{
    rcpu_light light = make_light(c, scene);
    rcpu_hole hole = make_hole(c, scene);
    return rcpu_frames_finish(&c->frames, c->kernel, c->threads, &light, &hole,
                              log2f(1 + scene->blend_slab), err);
}

static uint32_t margin_for(const rgl_scene *scene)
{
    float radius = scene->edl_strength > 0 ? fminf(scene->edl_radius_px, EDL_RADIUS_MAX) : 0;
    return (uint32_t)fmaxf(radius, RGL_FILL_PX_MAX) + 1;
}

static bool cpu_draw(rgl *gl, const rgl_scene *scene, const rgl_batch *batches,
                     uint32_t batch_count, int parts, mospt_err *err)
{
    cpu_rgl *c = (cpu_rgl *)gl;
    const rend_frame *f = &scene->frame;
    if (!rcpu_frames_fit(&c->frames, f->width, f->height, margin_for(scene),
                         rcpu_threads_count(c->threads), err))
        return false;
    if (parts & RGL_BEGIN && !take_octants(c, scene, err)) return false;
    if (!cut_batches(c, batches, batch_count, err) || !draw_points(c, scene, batches, parts, err))
        return false;
    c->near_log = log2f(f->near_w), c->range_log = log2f(f->far_w / f->near_w);
    return !(parts & RGL_END) || finish(c, scene, err);
}

/* ---- reading ---- */

static bool cpu_read_pixels(rgl *gl, bool from_window, uint32_t width, uint32_t height,
                            uint8_t *rgb, mospt_err *err)
{
    (void)from_window, (void)err;
    const cpu_rgl *c = (const cpu_rgl *)gl;
    const rcpu_frames *f = &c->frames;
    memset(rgb, 0, (size_t)width * height * 3);
    for (uint32_t y = 0; y < height && y < f->size.height; y++) {
        const uint32_t *row = f->picture + (size_t)y * f->size.stride;
        uint8_t *out = rgb + (size_t)y * width * 3;
        for (uint32_t x = 0; x < width && x < f->size.width; x++) {
            out[3 * x] = (uint8_t)row[x];
            out[3 * x + 1] = (uint8_t)(row[x] >> 8);
            out[3 * x + 2] = (uint8_t)(row[x] >> 16);
        }
    }
    return true;
}

/* What has been drawn so far, though RGL_END is still to come. */
static void look(cpu_rgl *c)
{
    if (c->frames.merged || c->frames.frame_count == 0) return;
    rcpu_frames_merge(&c->frames, c->kernel, c->threads);
}

static float depth_at(const cpu_rgl *c, int x, int y)
{
    const rcpu_frames *f = &c->frames;
    if (x < 0 || y < 0 || x >= (int)f->size.width || y >= (int)f->size.height) return 1;
    const rcpu_layer *l = &f->points;
    return rcpu_depth(l->logs[(size_t)y * l->stride + l->margin + (size_t)x], c->near_log,
                      c->range_log);
}

static bool cpu_read_depth(rgl *gl, int x, int y, int radius, float *out, mospt_err *err)
{
    (void)err;
    cpu_rgl *c = (cpu_rgl *)gl;
    look(c);
    for (int dy = -radius; dy <= radius; dy++)
        for (int dx = -radius; dx <= radius; dx++)
            *out++ = depth_at(c, x + dx, y + dy);
    return true;
}

static bool cpu_read_depths(rgl *gl, float *out, mospt_err *err)
{
    (void)err;
    cpu_rgl *c = (cpu_rgl *)gl;
    look(c);
    rcpu_frames_depths(&c->frames, c->threads, c->near_log, c->range_log, out);
    return true;
}

static const rgl_driver CPU_DRIVER = {
    .destroy = cpu_destroy,
    .renderer = cpu_renderer,
    .arena_create = cpu_arena_create,
    .arena_upload = cpu_arena_upload,
    .draw = cpu_draw,
    .read_pixels = cpu_read_pixels,
    .read_depth = cpu_read_depth,
    .read_depths = cpu_read_depths,
};

bool rcpu_create(const rcpu_options *options, rgl **out, mospt_err *err)
{
    const rcpu_kernel *kernel = rcpu_kernel_find(options->kernel);
    if (kernel == NULL)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "this processor cannot run the kernel \"%s\"", options->kernel);
    cpu_rgl *c = calloc(1, sizeof *c);
    if (c == NULL) return mospt_err_nomem(err, sizeof *c);
    c->base.driver = &CPU_DRIVER;
    c->kernel = kernel;
    if (!rcpu_threads_create(options->threads, &c->threads, err)) {
        cpu_destroy(&c->base);
        return false;
    }
    snprintf(c->name, sizeof c->name, "processor (%s, %u threads)", kernel->name,
             rcpu_threads_count(c->threads));
    *out = &c->base;
    return true;
}

const uint32_t *rcpu_picture(const rgl *gl, uint32_t *stride)
{
    const rcpu_frames *f = &((const cpu_rgl *)gl)->frames;
    *stride = f->size.stride;
    return f->picture;
}
