#include "render/cpu/frames.h"

#include "render/cpu/memory.h"

#include <assert.h>
#include <string.h>

enum { SPARE = 16, ROWS_PER_JOB = 8, SIZE_MAX_PX = 16384 };
/* Of all frames together; a picture that needs more is drawn by fewer threads. */
#define FRAMES_BYTES_MAX ((size_t)1 << 30)

static size_t pixels_of(const rcpu_frames *f)
{
    return (size_t)f->size.stride * f->size.height;
}

static size_t frame_size(const rcpu_frames *f)
{
    return (pixels_of(f) + SPARE) * sizeof(int64_t);
}

static size_t logs_size(const rcpu_frames *f)
{
    return ((size_t)f->log_stride * f->size.height + SPARE) * sizeof *f->logs;
}

static size_t picture_size(const rcpu_frames *f)
{
    return (pixels_of(f) + SPARE) * sizeof *f->picture;
}

void rcpu_frames_fini(rcpu_frames *frames)
{
    for (uint32_t i = 0; i < frames->frame_count; i++)
        rcpu_memory_release(frames->frames[i], frame_size(frames));
    rcpu_memory_release(frames->logs, logs_size(frames));
    rcpu_memory_release(frames->picture, picture_size(frames));
    *frames = (rcpu_frames){0};
}

static void empty(int64_t *pixels, size_t count)
{
    for (size_t i = 0; i < count; i++)
        pixels[i] = RCPU_EMPTY;
}

static uint32_t round_up(uint32_t value, uint32_t unit)
{
    return (value + unit - 1) / unit * unit;
}

static bool make(rcpu_frames *f, uint32_t width, uint32_t height, uint32_t margin, uint32_t threads,
                 mospt_err *err)
{
    f->size = (rcpu_size){.width = width, .height = height};
    f->size.stride = round_up(width, 16);
    if (f->size.stride % 32 == 0) f->size.stride += 16; /* in logarithms and colours, too, a line */
    f->margin = round_up(margin, 16);
    f->log_stride = f->size.stride + 2 * f->margin;
    size_t most = FRAMES_BYTES_MAX / frame_size(f);
    uint32_t count = most < 1 ? 1 : most < threads ? (uint32_t)most : threads;
    if (count > RCPU_FRAMES_MAX) count = RCPU_FRAMES_MAX;
    f->logs = rcpu_memory_take(logs_size(f));
    f->picture = rcpu_memory_take(picture_size(f));
    bool ok = f->logs != NULL && f->picture != NULL;
    for (; ok && f->frame_count < count; f->frame_count++) {
        f->frames[f->frame_count] = rcpu_memory_take(frame_size(f));
        if (f->frames[f->frame_count] == NULL) return mospt_err_nomem(err, frame_size(f));
        f->dirty[f->frame_count] = true;
    }
    return ok || mospt_err_nomem(err, logs_size(f) + picture_size(f));
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

/* ---- jobs: some rows of all frames ---- */

typedef struct {
    rcpu_frames *frames;
    const rcpu_kernel *kernel;
    int64_t *dirty[RCPU_FRAMES_MAX]; /* the first frame, and those that were drawn into */
    uint32_t dirty_count;
} round_of;

static uint32_t job_count(const rcpu_frames *f)
{
    return (f->size.height + ROWS_PER_JOB - 1) / ROWS_PER_JOB;
}

static uint32_t end_of(const rcpu_frames *f, uint32_t job)
{
    uint32_t end = (job + 1) * ROWS_PER_JOB;
    return end < f->size.height ? end : f->size.height;
}

static round_of start(rcpu_frames *f, const rcpu_kernel *kernel)
{
    round_of r = {.frames = f, .kernel = kernel};
    for (uint32_t i = 0; i < f->frame_count; i++)
        if (i == 0 || f->dirty[i]) r.dirty[r.dirty_count++] = f->frames[i];
    return r;
}

static void clear_rows(void *user, uint32_t worker, uint32_t job)
{
    (void)worker;
    round_of *r = user;
    const rcpu_size *size = &r->frames->size;
    size_t from = (size_t)job * ROWS_PER_JOB * size->stride;
    size_t count = (size_t)end_of(r->frames, job) * size->stride - from;
    for (uint32_t d = 0; d < r->dirty_count; d++)
        empty(r->dirty[d] + from, count);
}

void rcpu_frames_clear(rcpu_frames *frames, rcpu_threads *threads)
{
    round_of r = start(frames, NULL);
    rcpu_threads_run(threads, 0, job_count(frames), clear_rows, &r);
    memset(frames->dirty, 0, sizeof frames->dirty);
    frames->merged = false;
}

/* Repeats both ends of a row of logarithms. */
static void extend(const rcpu_frames *f, float *row)
{
    for (uint32_t i = 0; i < f->margin; i++) {
        row[i] = row[f->margin];
        row[f->margin + f->size.width + i] = row[f->margin + f->size.width - 1];
    }
}

static void merge_rows(void *user, uint32_t worker, uint32_t job)
{
    (void)worker;
    round_of *r = user;
    rcpu_frames *f = r->frames;
    for (uint32_t y = job * ROWS_PER_JOB; y < end_of(f, job); y++) {
        size_t first = (size_t)y * f->size.stride;
        float *logs = f->logs + (size_t)y * f->log_stride;
        r->kernel->merge(r->dirty, r->dirty_count, first, f->size.stride);
        r->kernel->logs(f->frames[0] + first, f->size.width, logs + f->margin);
        extend(f, logs);
    }
}

void rcpu_frames_merge(rcpu_frames *frames, const rcpu_kernel *kernel, rcpu_threads *threads)
{
    if (frames->merged) return;
    round_of r = start(frames, kernel);
    rcpu_threads_run(threads, 0, job_count(frames), merge_rows, &r);
    for (uint32_t i = 1; i < frames->frame_count; i++)
        frames->dirty[i] = false;
    frames->merged = true;
}
