/* render/cpu/kernel.h - the inner loops of a frame, once for each instruction set.
 *
 * The same sources are compiled several times (render/CMakeLists.txt), for vectors of as many lanes
 * as the instruction set has. No product is fused with a sum and every sum has one order, so all of
 * them draw the same picture, bit for bit.
 *
 * A frame is an array of 64-bit numbers, one for each pixel: the bits of the distance w along the
 * view axis above those of the colour. The nearest point is the minimum, whatever the order in
 * which points come, and where distances are equal the lowest colour is: pictures do not depend on
 * how the work was divided. */
#pragma once
#include "mospt/point.h"

#include <stdbool.h>

#define RCPU_EMPTY INT64_MAX /* a pixel without a point */
#define RCPU_SKY INFINITY    /* the logarithm of its distance */

/* A frame of pixels, top row first. */
typedef struct {
    uint32_t width, height;
    uint32_t stride; /* pixels from row to row: a multiple of a cache line, and an odd one, so that
                        the pixels below each other do not compete for the same places in a cache */
} rcpu_size;

/* What the points of a batch are drawn with: the terms of RGL_POINTS_VERTEX. */
typedef struct {
    rcpu_size size;
    uint32_t anchor[3];
    float offset[3], rotation[9], inverse_tan[2];
    float near_w, far_w;
    float splat_px, px_min, px_max; /* width of a splat (of a cell of one step) at one step */
    const uint32_t *octants;        /* NULL: all cells are one step wide */
    uint32_t grid_bits;
    bool has_clip;
    uint32_t clip_low[3], clip_high[3];
    /* Of splats that are wide enough. */
    bool round; /* leaves out the corners of the square */
    float bend; /* a splat bends away from the eye by its width times this at its rim, as a share
                   of the distance; 0: it does not */
    float square_px;      /* narrower ones are squares, whatever is said here */
    float slab, slab_log; /* of blending: a share of the distance, and log2(1 + slab) */
} rcpu_view;

/* What blending compares with, for each pixel. */
typedef struct {
    const float *limits; /* [stride of the frame * height] the farthest distance that counts; -1
                            where there is no point */
    const float *logs;   /* [stride * height] of the nearest distances, from the first pixel on */
    uint32_t stride;
} rcpu_front;

/* What is summed up of one pixel, see section 2 of render/gl/rgl.h. */
typedef struct {
    uint64_t r, g, b, weight;
    int64_t depth;
} rcpu_wide;

/* The sums of one thread: packed, so that two additions make them, and where they become too large
 * for that, wide. */
typedef struct {
    uint64_t *colours;  /* [stride * height], owned: r, and 21 and 42 bits higher g and b */
    uint64_t *weights;  /* [stride * height], owned: depth, and 32 bits higher the weight */
    rcpu_wide *spilled; /* [stride * height], owned: what is missing in the above */
    bool has_spilled;
} rcpu_sums;

/* What a picture shows of each pixel before it is lit: log2 of the distance, and the colour. Rows
 * have a margin at both ends, where the outermost logarithms are repeated. */
typedef struct {
    float *logs;       /* [stride * height], owned */
    uint32_t *colours; /* [stride * height], owned; red in the lowest byte, then green and blue */
    uint32_t stride, margin;
} rcpu_layer;

/* How holes are filled: section 3 of render/gl/rgl.h. */
typedef struct {
    rcpu_size size;
    int radius;
    float behind_log, spread_log, far_log;
} rcpu_hole;

/* What a row is shaded with. */
typedef struct {
    rcpu_size size;
    float edl_strength;
    int straight, diagonal; /* steps to the neighbours, pixels */
    float background_top[3], background_bottom[3];
} rcpu_light;

typedef struct {
    const char *name;
    /* Draws points of one pixel each, or splats, into a frame.
     * frame    [stride * height + 16]; what misses the picture may go to the pixels at the end */
    void (*points)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                   int64_t *frame);
    void (*splats)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                   int64_t *frame);
    /* Makes frames[0][from .. from + count - 1] the minimum of all, and the others empty. */
    void (*merge)(int64_t *const *frames, uint32_t frame_count, size_t from, size_t count);
    /* A row of a frame as a layer has it. */
    void (*look)(const int64_t *row, uint32_t count, float *logs, uint32_t *colours);
    /* How far away points of a row may be that blending counts: rcpu_front. */
    void (*limit)(const int64_t *row, uint32_t count, float slab, float *limits);
    /* Adds up what is near enough behind the nearest. */
    void (*blend)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                  const rcpu_front *front, rcpu_sums *sums);
    /* All sums of pixels from .. from + count - 1, a row, as a layer has it.
     * nearest  logarithms of the nearest distances */
    void (*resolve)(const rcpu_sums *sums, uint32_t sums_count, size_t from, uint32_t count,
                    const float *nearest, float slab_log, float *logs, uint32_t *colours);
    /* Fills the holes of a row. */
    void (*fill)(const rcpu_hole *hole, uint32_t y, const rcpu_layer *from, const rcpu_layer *to);
    /* Shades a row.
     * rgba     [stride of the frame] */
    void (*shade)(const rcpu_light *light, uint32_t y, const rcpu_layer *layer, uint32_t *rgba);
} rcpu_kernel;

/* The kernel of that name, or, with NULL, the best that this processor has; NULL: there is none. */
const rcpu_kernel *rcpu_kernel_find(const char *name);
