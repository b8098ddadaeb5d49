/* render/gl/rgl.h - all that is drawn, in plain structs; no GL header shows here.
 *
 * Two backends implement it: gl.c talks to OpenGL 3.3 core, null.c counts and records, for tests.
 * One arena of vertices is the GPU cache; what belongs where in it is the caller's business
 * (render/pages.h). Vertices go in as they are in the file, painted (render/paint.h): their r, g
 * and b are what is drawn. A picture is drawn in parts: RGL_BEGIN
 * clears, any number of calls add points, RGL_END shades and puts it out.
 * threads  the one that has the context */
#pragma once
#include "mospt/point.h"
#include "render/camera.h"
#include "render/clip.h"

typedef struct rgl rgl;

typedef struct {
    rend_frame frame;
    /* A splat is a square (or disc) of splat_scale times the cell that `octants` give for its
     * place, or of splat_size steps where there are none; on screen it is never narrower than
     * px_min, and never wider than px_max. */
    const uint32_t *octants; /* [8 * octant_nodes], see render/select.h; NULL: splat_size for all.
                                Taken at RGL_BEGIN. */
    uint32_t octant_nodes;
    uint32_t grid_bits;
    float splat_scale, splat_size;
    float px_min, px_max; /* >= 1 */
    float edl_strength;   /* 0: off */
    float edl_radius_px;
    float background_top[3], background_bottom[3];
    const rend_clip *clip; /* a vertex v is drawn if clip->low[a] <= v[a] <= clip->high[a] on all
                              three axes, compared as unsigned integers; NULL: all are */
} rgl_scene;

/* Ranges of points that are drawn alike. */
typedef struct {
    bool round; /* discs; for splats of a few pixels, where the corners of squares show */
    const int32_t *first, *count; /* [range_count] vertices of the arena */
    uint32_t range_count;
} rgl_batch;

enum {
    RGL_BEGIN = 1,
    RGL_END = 2,
    RGL_TO_WINDOW = 4, /* with RGL_END: into the window's back buffer; else into a picture for
                          rgl_read_pixels() */
};

/* errors   MOSPT_EINVAL: the context is older than OpenGL 3.3; MOSPT_ENOMEM */
bool rgl_gl_create(rgl **out, mospt_err *err);
bool rgl_null_create(rgl **out, mospt_err *err);
void rgl_destroy(rgl *gl);

/* Name of the driver, for people. */
const char *rgl_renderer(const rgl *gl);

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

/* Depths (0 near, 1 nothing) of the last scene in a square around a pixel, clamped to the picture.
 * x, y     from the top left
 * out      [(2 radius + 1)^2], rows from the top */
bool rgl_read_depth(rgl *gl, int x, int y, int radius, float *out, mospt_err *err);

/* Depths of all pixels of the last scene, or of what has been drawn of it so far.
 * out      [width * height] of that scene's frame, top row first */
bool rgl_read_depths(rgl *gl, float *out, mospt_err *err);

/* The null backend's record of everything since it was made. */
typedef struct {
    uint64_t points_drawn, points_uploaded, ranges, batches, begins, ends;
    uint64_t sequence_hash; /* of all vertices drawn, in their order */
    uint64_t picture_hash;  /* of those since the last RGL_BEGIN */
    uint64_t octants_hash;  /* of the last scene */
    uint64_t overruns;      /* uploads or ranges outside the arena */
} rgl_record;
rgl_record rgl_null_record(const rgl *gl);

/* What the null backend says of every pixel's depth from now on; 1 at first: nothing there. */
void rgl_null_set_depth(rgl *gl, float depth);
