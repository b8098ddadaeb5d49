/* render/cpu/cpu.h - the backend of render/gl/rgl.h that draws on the processor, for machines whose
 * OpenGL would do so too, and slower.
 *
 * The arena is plain memory. Each thread draws into a frame of its own; at RGL_END the frames
 * become one, which stays as it is until the next RGL_BEGIN, and is shaded. Pictures are those of
 * the OpenGL backend within rounding, but where two points have the same distance: there the one
 * with the lower colour is seen. They depend neither on the number of threads, nor on the order of
 * the points, nor on the processor. */
#pragma once
#include "render/gl/rgl.h"

typedef struct {
    uint32_t threads;   /* 0: one per processor */
    const char *kernel; /* "portable", "avx2" or "avx512"; NULL: the best one here */
} rcpu_options;

/* errors   MOSPT_EINVAL: no such kernel on this processor; MOSPT_ENOMEM, MOSPT_EIO */
bool rcpu_create(const rcpu_options *options, rgl **out, mospt_err *err);

/* What RGL_END put out: red in the lowest byte of each pixel, then green and blue, top row first.
 * stride   pixels from row to row */
const uint32_t *rcpu_picture(const rgl *gl, uint32_t *stride);
