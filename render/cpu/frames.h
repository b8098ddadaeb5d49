/* render/cpu/frames.h - the memory of a picture that is being drawn: a frame for each thread, the
 * logarithms of their distances, and what is shown. */
#pragma once
#include "mospt/err.h"
#include "render/cpu/kernel.h"
#include "render/cpu/threads.h"

enum { RCPU_FRAMES_MAX = 256 };

typedef struct {
    rcpu_size size;
    int64_t *frames[RCPU_FRAMES_MAX]; /* [frame_count] of [stride * height + 16], owned */
    uint32_t frame_count;             /* threads that draw: no more than there is memory for */
    bool dirty[RCPU_FRAMES_MAX];      /* drawn into since they were merged or emptied */
    bool merged;                      /* all is in the first one, with its logarithms */
    float *logs;                      /* [log_stride * height], owned */
    uint32_t log_stride, margin;      /* of each row at both ends: repeated ends */
    uint32_t *picture;                /* [stride * height], owned */
} rcpu_frames;

/* Makes them fit a size; contents are empty if it changes.
 * margin   as far as shading looks, pixels
 * errors   MOSPT_EINVAL, MOSPT_ENOMEM */
bool rcpu_frames_fit(rcpu_frames *frames, uint32_t width, uint32_t height, uint32_t margin,
                     uint32_t threads, mospt_err *err);
void rcpu_frames_fini(rcpu_frames *frames);

/* Empties all of them. */
void rcpu_frames_clear(rcpu_frames *frames, rcpu_threads *threads);

/* Brings all into the first one, and takes its logarithms. */
void rcpu_frames_merge(rcpu_frames *frames, const rcpu_kernel *kernel, rcpu_threads *threads);

/* The first logarithm of the picture itself. */
static inline const float *rcpu_frames_logs(const rcpu_frames *frames)
{
    return frames->logs + frames->margin;
}
