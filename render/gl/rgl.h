/* render/gl/rgl.h - all that is drawn, in plain structs; no GL header shows here.
 *
 * Three backends implement it: gl.c talks to OpenGL 3.3 core, render/cpu/cpu.c draws on the
 * processor, null.c counts and records, for tests; present.c shows in a window what cpu.c drew.
 * One arena of vertices is the GPU cache; what belongs where in it is the caller's business
 * (render/pages.h). Vertices go in as they are in the file, painted (render/paint.h): their r, g
 * and b are what is drawn. A picture is drawn in parts: RGL_BEGIN clears, any number of calls add
 * points, RGL_END shades and puts it out.
 * threads  the one that has the context
 *
 * What a picture is, so that every backend draws the same one. Depths are logarithmic: a distance
 * w along the view axis has the depth d(w) = log2(w / near_w) / span, span = log2(far_w / near_w);
 * "farther by the share t" means deeper by log2(1 + t) / span. Nothing outside of 0 <= d <= 1 is
 * drawn. A pixel without a point has depth 1.
 *
 * 1. Splats. A point at a distance w, whose place on the screen is (x, y), has the width
 *      s = clamp(focal_px * size / w, px_min, px_max),
 *    see rgl_scene for its size. It covers the pixels whose centres are inside the square of width
 *    s around (x, y); u and v, -1 to 1, say where, and r2 = u*u + v*v. A splat narrower than
 *    RGL_SQUARE_PX is a square whatever its shape, with r2 = 0 all over: a disc might miss every
 *    pixel. Of other splats,
 *      RGL_SQUARE      is as deep as its point all over;
 *      RGL_ROUND       too, and leaves out what has r2 > 1;
 *      RGL_PARABOLOID  does that, and its depth is that of w * (1 + r2 * s / (2 * focal_px)): it
 *                      bends away from the eye by its own radius at the rim, so splats that
 *                      overlap meet halfway between their points instead of hiding each other.
 *    What is nearest at a pixel is seen there; of two at the same depth, what was drawn first.
 *
 * 2. Blending (blend_slab > 0), for scans that overlap and are noisy. Points are drawn twice: what
 *    is nearest is found first, with depth dn, and then all that is at most farther than that by
 *    the share blend_slab is averaged: with slab = log2(1 + blend_slab) / span, a splat whose depth
 *    d at a pixel is <= dn + slab counts there with the whole numbers
 *      weight  g = max(1, floor(8.5 - 8 * r2))
 *      colour  g * r, g * g, g * b, of r, g, b in 0 to 255
 *      depth   g * floor(255 * clamp((dp - dn) / slab, -1, 1) + 0.5), dp the depth of its point,
 *              before it bends away: what follows sees the surface, not the splats.
 *    The sums are exact, so neither order nor parts show. A pixel's colour is the sum of colours by
 *    the sum of weights, rounded to whole 1/255, and its depth, for what follows, is
 *    dn + slab * (sum of depths / sum of weights) / 255.
 *
 * 3. Filling holes (fill_px > 0), where a wall near the eye has fewer points than pixels. At each
 *    pixel, of depth d, the neighbours are those at offsets (i, j), 0 < i*i + j*j <= fill_px *
 *    (fill_px + 1). Those in front are nearer than the pixel by the share RGL_FILL_BEHIND or more;
 *    with d0 the nearest of them, the near ones are those in front that are farther than d0 by the
 *    share RGL_FILL_SPREAD at most. The directions around the pixel are eight half-open sectors,
 *    the first from (1, 0) to (1, 1); if no two sectors that follow each other are without near
 *    ones, the pixel gets the mean of their colours and of their depths, weighted by 1 / (i*i +
 *    j*j). Wherever a straight edge or a right angle of sky begins, two such sectors are empty:
 *    silhouettes do not grow.
 *
 * 4. Eye-dome lighting (edl_strength > 0), see shade() in shaders.c: with rounded radii R =
 *    edl_radius_px and Q = R * sqrt(1/2), for the offsets o of (R, 0), (0, R), (Q, Q), (Q, -Q), a
 *    and b are how much nearer than the pixel, span * difference of depths, its neighbours at o and
 *    -o are, 0 for one without a point (beyond the picture its border goes on);
 *      m = 0.75 * max(a + b, 0) + 0.25 * (max(a, 0) + max(b, 0)),
 *    and the colour is multiplied by exp(-edl_strength * sum of m / (1 + 60 * m)).
 *
 * 5. Pixels that are still without a point show the background, from background_bottom at the
 *    lower edge of the picture to background_top at the upper. */
#pragma once
#include "mospt/point.h"
#include "render/camera.h"
#include "render/clip.h"

typedef struct rgl rgl;

#define RGL_SQUARE_PX 2.0f
#define RGL_FILL_BEHIND 0.02f
#define RGL_FILL_SPREAD 0.10f
#define RGL_FILL_PX_MAX 8

typedef struct {
    rend_frame frame;
    /* A splat's size, steps, is splat_scale times the cell that `octants` give for its place, or
     * splat_size where there are none. */
    const uint32_t *octants; /* [8 * octant_nodes], see render/select.h; NULL: splat_size for all.
                                Taken at RGL_BEGIN. */
    uint32_t octant_nodes;
    uint32_t grid_bits;
    float splat_scale, splat_size;
    float px_min, px_max; /* >= 1 */
    float blend_slab;     /* share of the distance; 0: off */
    uint32_t fill_px;     /* radius, up to RGL_FILL_PX_MAX; 0: off */
    float edl_strength;   /* 0: off */
    float edl_radius_px;
    float background_top[3], background_bottom[3];
    const rend_clip *clip; /* a vertex v is drawn if clip->low[a] <= v[a] <= clip->high[a] on all
                              three axes, compared as unsigned integers; NULL: all are */
} rgl_scene;

typedef enum { RGL_SQUARE, RGL_ROUND, RGL_PARABOLOID, RGL_SHAPES } rgl_shape;

/* Ranges of points that are drawn alike. */
typedef struct {
    rgl_shape shape;
    bool smallest; /* all of them are px_min wide: the caller knows, and their size is not looked
                      up */
    const int32_t *first, *count; /* [range_count] vertices of the arena */
    uint32_t range_count;
} rgl_batch;

/* Without blending, a picture is one or more calls, the first with RGL_BEGIN and the last with
 * RGL_END. With blending, all points are drawn by such calls, and then all of them again, in any
 * order and division, by calls with RGL_AGAIN, of which the last has RGL_END. RGL_BEGIN |
 * RGL_AGAIN in one call does both with its points. */
enum {
    RGL_BEGIN = 1,
    RGL_END = 2,
    RGL_TO_WINDOW = 4, /* with RGL_END: into the window's back buffer; else into a picture for
                          rgl_read_pixels() */
    RGL_AGAIN = 8,
};

/* errors   MOSPT_EINVAL: the context is older than OpenGL 3.3; MOSPT_ENOMEM */
bool rgl_gl_create(rgl **out, mospt_err *err);
bool rgl_null_create(rgl **out, mospt_err *err);

/* The picture that a backend has drawn: red in the lowest byte of a pixel, then green and blue, top
 * row first.
 * stride   pixels from row to row */
typedef const uint32_t *rgl_picture_of(const rgl *gl, uint32_t *stride);

/* Makes a backend that draws with another, and shows the picture in the window whose context is
 * current.
 * inner    taken if it succeeds
 * errors   MOSPT_EIO, MOSPT_ENOMEM */
bool rgl_present_create(rgl *inner, rgl_picture_of *picture_of, rgl **out, mospt_err *err);

void rgl_destroy(rgl *gl);

/* Name of the driver, for people. */
const char *rgl_renderer(const rgl *gl);

/* Makes another context current, in the place of one that is lost. */
typedef bool rgl_renew(void *user, mospt_err *err);

/* Says who is to be asked for another context; NULL: nobody. */
void rgl_set_renew(rgl *gl, rgl_renew *renew, void *user);

/* True since a call has failed because the graphics driver was reset (the card hung, or the driver
 * was replaced): whatever was in the context is gone, and every other call will fail. */
bool rgl_is_lost(const rgl *gl);

/* After that: goes on in another context, without an arena. A driver that is not back yet is given
 * a few seconds.
 * errors   MOSPT_EIO: there is no other context; MOSPT_ENOMEM */
bool rgl_recover(rgl *gl, mospt_err *err);

/* For tests: from now on it is as if the driver had been reset. */
void rgl_pretend_reset(rgl *gl);

/* Makes the arena, or replaces it; contents are undefined.
 * errors   MOSPT_ENOMEM: the GPU has no room for so many */
bool rgl_arena_create(rgl *gl, uint64_t vertex_count, mospt_err *err);
bool rgl_arena_upload(rgl *gl, uint64_t first, const mospt_vertex *vertices, uint32_t count,
                      mospt_err *err);

/* Draws batches, in their order.
 * errors   MOSPT_EIO: the context is lost, or the driver refuses; MOSPT_ENOMEM */
bool rgl_draw(rgl *gl, const rgl_scene *scene, const rgl_batch *batches, uint32_t batch_count,
              int parts, mospt_err *err);

/* Reads what RGL_END put out, or, with from_window, the window's back buffer.
 * rgb      [width * height * 3], top row first */
bool rgl_read_pixels(rgl *gl, bool from_window, uint32_t width, uint32_t height, uint8_t *rgb,
                     mospt_err *err);

/* Depths (0 near, 1 nothing) of the nearest points of the last scene in a square around a pixel,
 * clamped to the picture.
 * x, y     from the top left
 * out      [(2 radius + 1)^2], rows from the top */
bool rgl_read_depth(rgl *gl, int x, int y, int radius, float *out, mospt_err *err);

/* Depths of all pixels of the last scene, or of what has been drawn of it so far.
 * out      [width * height] of that scene's frame, top row first */
bool rgl_read_depths(rgl *gl, float *out, mospt_err *err);

/* The null backend's record of everything since it was made. */
typedef struct {
    uint64_t points_drawn, points_uploaded, ranges, batches, begins, ends;
    uint64_t points_again;  /* drawn with RGL_AGAIN; not in any other of these */
    uint64_t again_hash;    /* of those since the last RGL_BEGIN, like picture_hash */
    uint64_t sequence_hash; /* of all vertices drawn, in their order */
    uint64_t picture_hash;  /* of those since the last RGL_BEGIN */
    uint64_t octants_hash;  /* of the last scene */
    uint64_t overruns;      /* uploads or ranges outside the arena */
} rgl_record;
rgl_record rgl_null_record(const rgl *gl);

/* What the null backend says of every pixel's depth from now on; 1 at first: nothing there. */
void rgl_null_set_depth(rgl *gl, float depth);

/* Graphics memory of the null backend, vertices: a larger arena is refused, and so are uploads into
 * one that is there. */
void rgl_null_set_room(rgl *gl, uint64_t vertices);
