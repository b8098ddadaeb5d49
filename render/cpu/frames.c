#include "render/cpu/frames.h"

#include "render/cpu/log.h"
#include "render/cpu/memory.h"

#include <string.h>

enum {
    SPARE = 16, /* vectors reach beyond the end */
    ROWS_PER_JOB = 8,
    SIZE_MAX_PX = 16384,
};
/* Of all frames together, and of all sums; a picture that needs more is drawn by fewer threads. */
#define FRAMES_BYTES_MAX ((size_t)1 << 30)

static size_t pixels_of(const rcpu_frames *f)
{
    return (size_t)f->size.stride * f->size.height;
}

static size_t frame_size(const rcpu_frames *f)
{
    return (pixels_of(f) + SPARE) * sizeof(int64_t);
}

/* Of packed sums, both kinds. */
static size_t sums_size(const rcpu_frames *f)
{
    return pixels_of(f) * 2 * sizeof(uint64_t);
}

static size_t spilled_size(const rcpu_frames *f)
{
    return pixels_of(f) * sizeof(rcpu_wide);
}

static size_t limits_size(const rcpu_frames *f)
{
    return pixels_of(f) * sizeof(float);
}

static size_t picture_size(const rcpu_frames *f)
{
    return (pixels_of(f) + SPARE) * sizeof *f->picture;
}

/* Of logarithms, or of colours. */
static size_t layer_size(const rcpu_frames *f)
{
    size_t stride = f->size.stride + 2 * f->margin;
    return (stride * f->size.height + SPARE) * sizeof(float);
}

/* ---- memory ---- */

static bool make_layer(const rcpu_frames *f, rcpu_layer *layer, mospt_err *err)
{
    if (layer->logs != NULL && layer->colours != NULL) return true;
    layer->stride = f->size.stride + 2 * f->margin, layer->margin = f->margin;
    if (layer->logs == NULL) layer->logs = rcpu_memory_take(layer_size(f));
    if (layer->colours == NULL) layer->colours = rcpu_memory_take(layer_size(f));
    return (layer->logs != NULL && layer->colours != NULL) ||
           mospt_err_nomem(err, 2 * layer_size(f));
}

static void release_layer(const rcpu_frames *f, rcpu_layer *layer)
{
    rcpu_memory_release(layer->logs, layer_size(f));
    rcpu_memory_release(layer->colours, layer_size(f));
}

static void release_sums(const rcpu_frames *f, rcpu_sums *sums)
{
    rcpu_memory_release(sums->colours, sums_size(f));
    rcpu_memory_release(sums->spilled, spilled_size(f));
}

/* Wide sums take memory only where there are some. */
static bool make_sums(const rcpu_frames *f, rcpu_sums *out, mospt_err *err)
{
    rcpu_sums sums = {.colours = rcpu_memory_take(sums_size(f)),
                      .spilled = rcpu_memory_take(spilled_size(f))};
    *out = sums;
    if (sums.colours == NULL || sums.spilled == NULL) {
        release_sums(f, &sums);
        return mospt_err_nomem(err, sums_size(f) + spilled_size(f));
    }
    out->weights = sums.colours + pixels_of(f);
    return true;
}

void rcpu_frames_fini(rcpu_frames *frames)
{
    for (uint32_t i = 0; i < frames->frame_count; i++)
        rcpu_memory_release(frames->frames[i], frame_size(frames));
    for (uint32_t i = 0; i < frames->sums_count; i++)
        release_sums(frames, &frames->sums[i]);
    rcpu_memory_release(frames->limits, limits_size(frames));
    release_layer(frames, &frames->points);
    release_layer(frames, &frames->blended);
    release_layer(frames, &frames->filled);
    rcpu_memory_release(frames->picture, picture_size(frames));
    *frames = (rcpu_frames){0};
}

static uint32_t round_up(uint32_t value, uint32_t unit)
{
    return (value + unit - 1) / unit * unit;
}

/* How many of this size there may be. */
static uint32_t count_for(size_t size, uint32_t threads)
{
    size_t most = FRAMES_BYTES_MAX / size;
    uint32_t count = most < 1 ? 1 : most < threads ? (uint32_t)most : threads;
    return count < RCPU_FRAMES_MAX ? count : RCPU_FRAMES_MAX;
}

static bool make(rcpu_frames *f, uint32_t width, uint32_t height, uint32_t margin, uint32_t threads,
                 mospt_err *err)
{
    f->size = (rcpu_size){.width = width, .height = height};
    f->size.stride = round_up(width, 16);
    if (f->size.stride % 32 == 0) f->size.stride += 16;
    f->margin = round_up(margin, 16);
    f->picture = rcpu_memory_take(picture_size(f));
    if (f->picture == NULL) return mospt_err_nomem(err, picture_size(f));
    if (!make_layer(f, &f->points, err)) return false;
    for (uint32_t count = count_for(frame_size(f), threads); f->frame_count < count;) {
        int64_t *frame = rcpu_memory_take(frame_size(f));
        if (frame == NULL) return mospt_err_nomem(err, frame_size(f));
        f->drawn[f->frame_count] = true;
        f->frames[f->frame_count++] = frame;
    }
    return true;
}

bool rcpu_frames_fit(rcpu_frames *frames, uint32_t width, uint32_t height, uint32_t margin,
                     uint32_t threads, mospt_err *err)
{
    if (frames->size.width == width && frames->size.height == height && margin <= frames->margin)
        return true;
    if (width == 0 || height == 0 || width > SIZE_MAX_PX || height > SIZE_MAX_PX)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "a picture of %u x %u pixels is not possible; up to %d x %d are",
                             width, height, SIZE_MAX_PX, SIZE_MAX_PX);
    rcpu_frames_fini(frames);
    if (make(frames, width, height, margin, threads, err)) return true;
    rcpu_frames_fini(frames);
    return false;
}

/* ---- passes: each job is some rows ---- */

typedef struct {
    rcpu_frames *frames;
    const rcpu_kernel *kernel;
    int64_t *drawn[RCPU_FRAMES_MAX]; /* the first frame, and those that were drawn into */
    uint32_t drawn_count;
    const rcpu_light *light;
    const rcpu_hole *hole;
    float slab, slab_log;
    float near_log, range_log;
    float *depths; /* [width * height] */
    const rcpu_layer *from, *to;
} pass;

static uint32_t job_count(const rcpu_frames *f)
{
    return (f->size.height + ROWS_PER_JOB - 1) / ROWS_PER_JOB;
}

static uint32_t end_of(const rcpu_frames *f, uint32_t job)
{
    uint32_t end = (job + 1) * ROWS_PER_JOB;
    return end < f->size.height ? end : f->size.height;
}

static void run(pass *p, rcpu_threads *threads, rcpu_job *job)
{
    rcpu_threads_run(threads, 0, job_count(p->frames), job, p);
}

static void find_drawn(pass *p)
{
    for (uint32_t i = 0; i < p->frames->frame_count; i++)
        if (i == 0 || p->frames->drawn[i]) p->drawn[p->drawn_count++] = p->frames->frames[i];
}

/* Repeats both ends of a row of logarithms. */
static void extend(const rcpu_frames *f, const rcpu_layer *layer, uint32_t y)
{
    float *row = layer->logs + (size_t)y * layer->stride;
    for (uint32_t i = 0; i < layer->margin; i++) {
        row[i] = row[layer->margin];
        row[layer->margin + f->size.width + i] = row[layer->margin + f->size.width - 1];
    }
}

static size_t in_layer(const rcpu_layer *layer, uint32_t y)
{
    return (size_t)y * layer->stride + layer->margin;
}

static void clear_rows(void *user, uint32_t worker, uint32_t job)
{
    (void)worker;
    pass *p = user;
    size_t stride = p->frames->size.stride, end = end_of(p->frames, job) * stride;
    for (uint32_t d = 0; d < p->drawn_count; d++)
        for (size_t i = job * ROWS_PER_JOB * stride; i < end; i++)
            p->drawn[d][i] = RCPU_EMPTY;
}

void rcpu_frames_clear(rcpu_frames *frames, rcpu_threads *threads)
{
    pass p = {.frames = frames};
    find_drawn(&p);
    run(&p, threads, clear_rows);
    memset(frames->drawn, 0, sizeof frames->drawn);
    frames->merged = frames->blending = false;
}

static uint32_t *picture_row(const rcpu_frames *f, uint32_t y)
{
    return f->picture + (size_t)y * f->size.stride;
}

static void merge_rows(void *user, uint32_t worker, uint32_t job)
{
    (void)worker;
    pass *p = user;
    rcpu_frames *f = p->frames;
    for (uint32_t y = job * ROWS_PER_JOB; y < end_of(f, job); y++) {
        size_t first = (size_t)y * f->size.stride, at = in_layer(&f->points, y);
        p->kernel->merge(p->drawn, p->drawn_count, first, f->size.stride);
        p->kernel->look(f->frames[0] + first, f->size.width, f->points.logs + at,
                        f->points.colours + at);
        extend(f, &f->points, y);
        if (p->light != NULL) p->kernel->shade(p->light, y, &f->points, picture_row(f, y));
    }
}

/* light    of a picture whose rows are shaded while they are at hand; NULL: none are */
static void merge(rcpu_frames *frames, const rcpu_kernel *kernel, rcpu_threads *threads,
                  const rcpu_light *light)
{
    pass p = {.frames = frames, .kernel = kernel, .light = light};
    find_drawn(&p);
    run(&p, threads, merge_rows);
    memset(frames->drawn, 0, sizeof frames->drawn);
    frames->drawn[0] = true;
    frames->merged = true;
}

void rcpu_frames_merge(rcpu_frames *frames, const rcpu_kernel *kernel, rcpu_threads *threads)
{
    if (!frames->merged) merge(frames, kernel, threads, NULL);
}

static void depth_rows(void *user, uint32_t worker, uint32_t job)
{
    (void)worker;
    pass *p = user;
    const rcpu_frames *f = p->frames;
    for (uint32_t y = job * ROWS_PER_JOB; y < end_of(f, job); y++) {
        const float *restrict logs = f->points.logs + in_layer(&f->points, y);
        float *restrict out = p->depths + (size_t)y * f->size.width;
        for (uint32_t x = 0; x < f->size.width; x++)
            out[x] = rcpu_depth(logs[x], p->near_log, p->range_log);
    }
}

void rcpu_frames_depths(rcpu_frames *frames, rcpu_threads *threads, float near_log, float range_log,
                        float *out)
{
    pass p = {.frames = frames, .near_log = near_log, .range_log = range_log, .depths = out};
    run(&p, threads, depth_rows);
}

static void prepare_rows(void *user, uint32_t worker, uint32_t job)
{
    (void)worker;
    pass *p = user;
    rcpu_frames *f = p->frames;
    size_t first = (size_t)job * ROWS_PER_JOB * f->size.stride,
           count = (size_t)end_of(f, job) * f->size.stride - first;
    p->kernel->limit(f->frames[0] + first, (uint32_t)count, p->slab, f->limits + first);
    for (uint32_t s = 0; s < f->sums_count; s++) {
        const rcpu_sums *sums = &f->sums[s];
        memset(sums->colours + first, 0, count * sizeof *sums->colours);
        memset(sums->weights + first, 0, count * sizeof *sums->weights);
        if (sums->has_spilled) memset(sums->spilled + first, 0, count * sizeof *sums->spilled);
    }
}

bool rcpu_frames_blend(rcpu_frames *frames, const rcpu_kernel *kernel, rcpu_threads *threads,
                       float slab, mospt_err *err)
{
    uint32_t count = count_for(sums_size(frames), frames->frame_count);
    if (!make_layer(frames, &frames->blended, err)) return false;
    if (frames->limits == NULL) frames->limits = rcpu_memory_take(limits_size(frames));
    if (frames->limits == NULL) return mospt_err_nomem(err, limits_size(frames));
    for (; frames->sums_count < count; frames->sums_count++)
        if (!make_sums(frames, &frames->sums[frames->sums_count], err)) return false;
    pass p = {.frames = frames, .kernel = kernel, .slab = slab};
    run(&p, threads, prepare_rows);
    for (uint32_t s = 0; s < count; s++)
        frames->sums[s].has_spilled = false;
    frames->blending = true;
    return true;
}

rcpu_front rcpu_frames_front(const rcpu_frames *frames)
{
    const rcpu_layer *points = &frames->points;
    return (rcpu_front){
        .limits = frames->limits, .logs = points->logs + points->margin, .stride = points->stride};
}

static void resolve_rows(void *user, uint32_t worker, uint32_t job)
{
    (void)worker;
    pass *p = user;
    rcpu_frames *f = p->frames;
    for (uint32_t y = job * ROWS_PER_JOB; y < end_of(f, job); y++) {
        size_t first = (size_t)y * f->size.stride, at = in_layer(p->to, y);
        p->kernel->resolve(f->sums, f->sums_count, first, f->size.width,
                           f->points.logs + in_layer(&f->points, y), p->slab_log, p->to->logs + at,
                           p->to->colours + at);
        extend(f, p->to, y);
    }
}

static void fill_rows(void *user, uint32_t worker, uint32_t job)
{
    (void)worker;
    pass *p = user;
    for (uint32_t y = job * ROWS_PER_JOB; y < end_of(p->frames, job); y++) {
        p->kernel->fill(p->hole, y, p->from, p->to);
        extend(p->frames, p->to, y);
    }
}

static void shade_rows(void *user, uint32_t worker, uint32_t job)
{
    (void)worker;
    pass *p = user;
    rcpu_frames *f = p->frames;
    for (uint32_t y = job * ROWS_PER_JOB; y < end_of(f, job); y++)
        p->kernel->shade(p->light, y, p->from, picture_row(f, y));
}

/* True if no pixel of the picture depends on those around it. */
static bool is_flat(const rcpu_frames *frames, const rcpu_light *light, const rcpu_hole *hole)
{
    return !frames->blending && hole->radius == 0 && !(light->edl_strength > 0);
}

bool rcpu_frames_finish(rcpu_frames *frames, const rcpu_kernel *kernel, rcpu_threads *threads,
                        const rcpu_light *light, const rcpu_hole *hole, float slab_log,
                        mospt_err *err)
{
    pass p = {.frames = frames, .kernel = kernel, .light = light, .hole = hole};
    if (!frames->merged && is_flat(frames, light, hole)) {
        merge(frames, kernel, threads, light);
        return true;
    }
    rcpu_frames_merge(frames, kernel, threads);
    p.from = &frames->points, p.slab_log = slab_log;
    if (frames->blending) {
        p.to = &frames->blended;
        run(&p, threads, resolve_rows);
        p.from = p.to;
    }
    if (hole->radius > 0) {
        if (!make_layer(frames, &frames->filled, err)) return false;
        p.to = &frames->filled;
        run(&p, threads, fill_rows);
        p.from = p.to;
    }
    run(&p, threads, shade_rows);
    return true;
}
