/* render/cpu/frames.h - the memory of a picture that is being drawn, and the passes over it.
 *
 * Each thread draws points into a frame of its own. They are merged into the first one, which stays
 * as it is until it is cleared: a picture may be looked at, and then go on. From there the picture
 * goes from layer to layer: the nearest points; what blending makes of the sums, which again are
 * one array for each thread; what filling makes of that; and what is lit. */
#pragma once
#include "mospt/err.h"
#include "render/cpu/kernel.h"
#include "render/cpu/threads.h"

enum { RCPU_FRAMES_MAX = 256 };

typedef struct {
    rcpu_size size;
    uint32_t margin;                    /* of layers */
    int64_t *frames[RCPU_FRAMES_MAX];   /* [frame_count] of [stride * height + 16], owned */
    uint32_t frame_count;               /* threads that draw: no more than there is memory for */
    bool drawn[RCPU_FRAMES_MAX];        /* into, since they were merged or emptied */
    bool merged;                        /* all is in the first frame, and in `points` */
    rcpu_sums sums[RCPU_FRAMES_MAX];    /* [sums_count] */
    float *limits;                      /* [stride * height], owned: rcpu_front; made with sums */
    uint32_t sums_count;                /* 0: not needed yet */
    bool blending;                      /* sums belong to the picture in hand */
    rcpu_layer points, blended, filled; /* the last two are made when they are needed */
    uint32_t *picture;                  /* [stride * height], owned */
} rcpu_frames;

/* Makes them fit a size; contents are empty if it changes.
 * margin   as far as shading and filling look, pixels
 * errors   MOSPT_EINVAL, MOSPT_ENOMEM */
bool rcpu_frames_fit(rcpu_frames *frames, uint32_t width, uint32_t height, uint32_t margin,
                     uint32_t threads, mospt_err *err);
void rcpu_frames_fini(rcpu_frames *frames);

/* Empties the frames. */
void rcpu_frames_clear(rcpu_frames *frames, rcpu_threads *threads);

/* Brings all into the first frame, and that into the layer `points`. */
void rcpu_frames_merge(rcpu_frames *frames, const rcpu_kernel *kernel, rcpu_threads *threads);

/* Depths of what has been merged, see rcpu_depth().
 * out      [width * height] */
void rcpu_frames_depths(rcpu_frames *frames, rcpu_threads *threads, float near_log, float range_log,
                        float *out);

/* Makes ready for blending what has been merged: the sums are empty.
 * errors   MOSPT_ENOMEM */
bool rcpu_frames_blend(rcpu_frames *frames, const rcpu_kernel *kernel, rcpu_threads *threads,
                       float slab, mospt_err *err);
rcpu_front rcpu_frames_front(const rcpu_frames *frames);

/* Passes from layer to layer.
 * hole, slab_log   radius 0, or 0: without filling, without blending
 * errors           MOSPT_ENOMEM */
bool rcpu_frames_finish(rcpu_frames *frames, const rcpu_kernel *kernel, rcpu_threads *threads,
                        const rcpu_light *light, const rcpu_hole *hole, float slab_log,
                        mospt_err *err);
