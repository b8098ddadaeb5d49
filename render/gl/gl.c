/* The OpenGL 3.3 core backend. */
#include "render/gl/canvas.h"
#include "render/gl/driver.h"
#include "render/gl/program.h"
#include "render/gl/staging.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    GLuint name; /* 0: not made yet */
    GLint anchor, offset, rotation, inverse_tan, range, splat, grid_bits, slab, bend;
    GLint clip_low, clip_high;
} points_program;

/* What a program for points does; flags. */
enum {
    ROUND = 1,
    PARABOLOID = 2,
    OCTANTS = 4,
    SMALLEST = 8,
    BLEND = 16,
    CLIP = 32,
    KIND_COUNT = 64
};
enum { OCTANTS_WIDTH = 1024 }; /* texels; the shader knows it too */

typedef struct {
    rgl base;
    GLuint arena, arena_vao;
    rgl_staging staging;
    points_program points[KIND_COUNT]; /* made at first use */
    rgl_canvas canvas;
    GLuint octants;
    GLsizei octants_rows; /* that its texture has room for */
    bool robust;          /* the context tells when it is lost */
    char renderer[128];
} gl_rgl;

static void delete_all(gl_rgl *g)
{
    rgl_canvas_fini(&g->canvas);
    glDeleteTextures(1, &g->octants);
    rgl_staging_fini(&g->staging);
    glDeleteBuffers(1, &g->arena);
    glDeleteVertexArrays(1, &g->arena_vao);
    for (int k = 0; k < KIND_COUNT; k++)
        glDeleteProgram(g->points[k].name);
}

/* What was in a lost context is gone, and perhaps no other is current. */
static void gl_destroy(rgl *gl)
{
    if (!gl->is_lost) delete_all((gl_rgl *)gl);
    free(gl);
}

static const char *gl_renderer(const rgl *gl)
{
    return ((const gl_rgl *)gl)->renderer;
}

/* The driver tells of a reset until it is over, and not any more then. */
static bool is_reset(const gl_rgl *g)
{
    return g->base.is_lost || g->base.pretends ||
           (g->robust && glGetGraphicsResetStatusARB() != GL_NO_ERROR);
}

/* Errors that are no mistake of ours: no memory, or the driver was reset. */
static bool is_healthy(gl_rgl *g, const char *what, mospt_err *err)
{
    if (is_reset(g)) return rgl_set_lost(&g->base, err);
    GLenum error = glGetError();
    if (error == GL_CONTEXT_LOST) return rgl_set_lost(&g->base, err);
    if (error == GL_OUT_OF_MEMORY)
        return mospt_err_set(
            err, MOSPT_ENOMEM, mospt_nowhere(),
            "the graphics card has no memory left for %s; try a smaller --gpu-cache", what);
    if (error != GL_NO_ERROR)
        return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                             "the graphics driver reports error 0x%04x at %s", error, what);
    return true;
}

/* After calls of which one may have failed: if the driver was reset, that is why. */
static bool conclude(gl_rgl *g, bool ok, const char *what, mospt_err *err)
{
    if (ok || is_reset(g)) return is_healthy(g, what, err);
    return false;
}

static void set_vertex_format(const gl_rgl *g)
{
    GL(glBindVertexArray(g->arena_vao));
    GL(glEnableVertexAttribArray(0));
    GL(glEnableVertexAttribArray(1));
    GL(glVertexAttribIPointer(0, 3, GL_UNSIGNED_INT, sizeof(mospt_vertex), NULL));
    GL(glVertexAttribPointer(1, 4, GL_UNSIGNED_BYTE, GL_TRUE, sizeof(mospt_vertex),
                             (const void *)offsetof(mospt_vertex, r)));
}

/* On failure there is none; a smaller one may be tried. */
static bool gl_arena_create(rgl *gl, uint64_t vertex_count, mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    GLsizeiptr size = (GLsizeiptr)((vertex_count > 0 ? vertex_count : 1) * sizeof(mospt_vertex));
    glDeleteBuffers(1, &g->arena); /* first: there may not be room for both */
    g->arena = 0;
    if (!is_healthy(g, "the time before the GPU cache", err)) return false;
    GL(glGenBuffers(1, &g->arena));
    GL(glBindBuffer(GL_ARRAY_BUFFER, g->arena));
    if (rgl_staging_is_mapped()) glBufferStorage(GL_ARRAY_BUFFER, size, NULL, 0);
    else glBufferData(GL_ARRAY_BUFFER, size, NULL, GL_DYNAMIC_DRAW);
    if (!is_healthy(g, "the GPU cache", err)) return false;
    set_vertex_format(g);
    return is_healthy(g, "the GPU cache", err);
}

static bool gl_arena_upload(rgl *gl, uint64_t first, const mospt_vertex *vertices, uint32_t count,
                            mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    if (count == 0) return true;
    bool ok = rgl_staging_upload(&g->staging, g->arena, first * sizeof *vertices, vertices,
                                 count * sizeof *vertices, err);
    return conclude(g, ok, "an upload", err);
}

static bool make_points_program(int kind, points_program *out, mospt_err *err)
{
    char defines[200];
    snprintf(defines, sizeof defines, "#define SQUARE_PX %.1f\n%s%s%s%s%s%s", (double)RGL_SQUARE_PX,
             kind & (ROUND | PARABOLOID) ? "#define ROUND\n" : "",
             kind & PARABOLOID ? "#define PARABOLOID\n" : "",
             kind & OCTANTS ? "#define OCTANTS\n" : "", kind & SMALLEST ? "#define SMALLEST\n" : "",
             kind & BLEND ? "#define BLEND\n" : "", kind & CLIP ? "#define CLIP\n" : "");
    points_program p = {0};
    if (!rgl_program_create(defines, RGL_POINTS_VERTEX, RGL_POINTS_FRAGMENT, &p.name, err))
        return false;
    p.anchor = glGetUniformLocation(p.name, "anchor");
    p.offset = glGetUniformLocation(p.name, "offset");
    p.rotation = glGetUniformLocation(p.name, "rotation");
    p.inverse_tan = glGetUniformLocation(p.name, "inverse_tan");
    p.range = glGetUniformLocation(p.name, "range");
    p.splat = glGetUniformLocation(p.name, "splat");
    p.grid_bits = glGetUniformLocation(p.name, "grid_bits");
    p.slab = glGetUniformLocation(p.name, "slab");
    p.clip_low = glGetUniformLocation(p.name, "clip_low");
    p.clip_high = glGetUniformLocation(p.name, "clip_high");
    p.bend = glGetUniformLocation(p.name, "bend");
    GL(glUseProgram(p.name));
    GL(glUniform1i(glGetUniformLocation(p.name, "nearest"), RGL_CANVAS_NEAREST));
    *out = p;
    return true;
}

static int kind_of(const rgl_scene *scene, const rgl_batch *batch, bool blend)
{
    int kind = (blend ? BLEND : 0) | (scene->clip != NULL ? CLIP : 0);
    /* What is narrower than this is a square. */
    if (scene->px_max >= RGL_SQUARE_PX && !(batch->smallest && scene->px_min < RGL_SQUARE_PX))
        kind |= batch->shape == RGL_ROUND ? ROUND : batch->shape == RGL_PARABOLOID ? PARABOLOID : 0;
    if (batch->smallest) kind |= SMALLEST;
    else if (scene->octants != NULL) kind |= OCTANTS;
    return kind;
}

static void set_scene(const points_program *p, const rgl_scene *scene)
{
    const rend_frame *f = &scene->frame;
    float span = log2f(f->far_w / f->near_w);
    float size = scene->octants != NULL ? scene->splat_scale : scene->splat_size;
    GL(glUseProgram(p->name));
    GL(glUniform3uiv(p->anchor, 1, f->anchor));
    GL(glUniform3fv(p->offset, 1, f->offset));
    GL(glUniformMatrix3fv(p->rotation, 1, GL_FALSE, f->rotation));
    GL(glUniform2f(p->inverse_tan, 1 / f->tan_half[0], 1 / f->tan_half[1]));
    GL(glUniform2f(p->range, log2f(f->near_w), 1 / span));
    GL(glUniform1i(p->grid_bits, (GLint)scene->grid_bits));
    if (scene->clip != NULL) {
        GL(glUniform3uiv(p->clip_low, 1, scene->clip->low));
        GL(glUniform3uiv(p->clip_high, 1, scene->clip->high));
    }
    GL(glUniform3f(p->splat, size * f->focal_px, scene->px_min, scene->px_max));
    GL(glUniform1f(p->slab, rgl_canvas_deeper(scene, scene->blend_slab)));
    GL(glUniform2f(p->bend, 1 / (2 * f->focal_px), 1 / span));
}

/* The tree of what is drawn, for the walk in the vertex shader. */
static void upload_octants(gl_rgl *g, const rgl_scene *scene)
{
    GLsizei count = (GLsizei)(8 * scene->octant_nodes), rows = count / OCTANTS_WIDTH;
    GL(glActiveTexture(GL_TEXTURE0));
    GL(glBindTexture(GL_TEXTURE_2D, g->octants));
    GL(glPixelStorei(GL_UNPACK_ALIGNMENT, 4));
    if (rows >= g->octants_rows) { /* twice what is needed: this is rare */
        g->octants_rows = 2 * (rows + 1);
        GL(glTexImage2D(GL_TEXTURE_2D, 0, GL_R32UI, OCTANTS_WIDTH, g->octants_rows, 0,
                        GL_RED_INTEGER, GL_UNSIGNED_INT, NULL));
    }
    if (rows > 0)
        GL(glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, OCTANTS_WIDTH, rows, GL_RED_INTEGER,
                           GL_UNSIGNED_INT, scene->octants));
    if (count % OCTANTS_WIDTH > 0)
        GL(glTexSubImage2D(GL_TEXTURE_2D, 0, 0, rows, count % OCTANTS_WIDTH, 1, GL_RED_INTEGER,
                           GL_UNSIGNED_INT, scene->octants + (size_t)rows * OCTANTS_WIDTH));
}

/* The size of a point is the program's business, unless all are alike. */
static void set_point_size(const rgl_scene *scene, const rgl_batch *batch)
{
    if (batch->smallest) {
        GL(glDisable(GL_PROGRAM_POINT_SIZE));
        GL(glPointSize(scene->px_min));
    } else {
        GL(glEnable(GL_PROGRAM_POINT_SIZE));
    }
}

static bool draw_points(gl_rgl *g, const rgl_scene *scene, const rgl_batch *batches,
                        uint32_t batch_count, bool blend, mospt_err *err)
{
    GL(glBindVertexArray(g->arena_vao));
    GL(glActiveTexture(GL_TEXTURE0));
    GL(glBindTexture(GL_TEXTURE_2D, g->octants));
    for (uint32_t b = 0; b < batch_count; b++) {
        points_program *p = &g->points[kind_of(scene, &batches[b], blend)];
        if (batches[b].range_count == 0) continue;
        if (p->name == 0 && !make_points_program((int)(p - g->points), p, err)) return false;
        set_scene(p, scene);
        set_point_size(scene, &batches[b]);
        GL(glMultiDrawArrays(GL_POINTS, batches[b].first, batches[b].count,
                             (GLsizei)batches[b].range_count));
    }
    return true;
}

static bool draw(gl_rgl *g, const rgl_scene *scene, const rgl_batch *batches, uint32_t batch_count,
                 int parts, mospt_err *err)
{
    bool begin = (parts & RGL_BEGIN) != 0, again = (parts & RGL_AGAIN) != 0;
    if (!rgl_canvas_fit(&g->canvas, scene, err)) return false;
    if (begin || !again) {
        rgl_canvas_draw(&g->canvas, begin);
        if (begin && scene->octants != NULL) upload_octants(g, scene);
        if (!draw_points(g, scene, batches, batch_count, false, err)) return false;
    }
    if (again && (!rgl_canvas_add(&g->canvas, err) ||
                  !draw_points(g, scene, batches, batch_count, true, err)))
        return false;
    return (parts & RGL_END) == 0 ||
           rgl_canvas_finish(&g->canvas, scene, (parts & RGL_TO_WINDOW) != 0, err);
}

static bool gl_draw(rgl *gl, const rgl_scene *scene, const rgl_batch *batches, uint32_t batch_count,
                    int parts, mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    return conclude(g, draw(g, scene, batches, batch_count, parts, err), "a frame", err);
}

/* GL's first row is the lowest. */
static void flip_rows(void *picture, size_t row_size, uint32_t rows)
{
    uint8_t *bytes = picture;
    for (uint32_t r = 0; r < rows / 2; r++) {
        uint8_t *a = bytes + r * row_size, *b = bytes + (rows - 1 - r) * row_size;
        for (size_t i = 0; i < row_size; i++) {
            uint8_t swapped = a[i];
            a[i] = b[i], b[i] = swapped;
        }
    }
}

bool rgl_gl_read_window(uint32_t width, uint32_t height, uint8_t *rgb, mospt_err *err)
{
    GL(glBindFramebuffer(GL_FRAMEBUFFER, 0));
    GL(glReadBuffer(GL_BACK));
    GL(glPixelStorei(GL_PACK_ALIGNMENT, 1));
    GL(glReadPixels(0, 0, (GLsizei)width, (GLsizei)height, GL_RGB, GL_UNSIGNED_BYTE, rgb));
    flip_rows(rgb, (size_t)width * 3, height);
    GLenum error = glGetError();
    return error == GL_NO_ERROR ||
           mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                         "the graphics driver reports error 0x%04x at reading the window", error);
}

static bool gl_read_pixels(rgl *gl, bool from_window, uint32_t width, uint32_t height, uint8_t *rgb,
                           mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    GL(glBindFramebuffer(GL_FRAMEBUFFER, from_window ? 0 : g->canvas.shown));
    GL(glReadBuffer(from_window ? GL_BACK : GL_COLOR_ATTACHMENT0));
    GL(glPixelStorei(GL_PACK_ALIGNMENT, 1));
    GL(glReadPixels(0, 0, (GLsizei)width, (GLsizei)height, GL_RGB, GL_UNSIGNED_BYTE, rgb));
    flip_rows(rgb, (size_t)width * 3, height);
    return is_healthy(g, "reading the picture", err);
}

static bool gl_read_depth(rgl *gl, int x, int y, int radius, float *out, mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    int side = 2 * radius + 1;
    for (int i = 0; i < side * side; i++)
        out[i] = 1;
    if (g->canvas.points.fbo == 0) return true;
    int width = (int)g->canvas.width, height = (int)g->canvas.height;
    int left = x - radius < 0 ? 0 : x - radius, top = y - radius < 0 ? 0 : y - radius;
    int right = x + radius < width ? x + radius : width - 1;
    int low = y + radius < height ? y + radius : height - 1;
    GL(glBindFramebuffer(GL_FRAMEBUFFER, g->canvas.points.fbo));
    for (int row = top; row <= low && left <= right; row++)
        GL(glReadPixels(left, height - 1 - row, right - left + 1, 1, GL_DEPTH_COMPONENT, GL_FLOAT,
                        out + (row - (y - radius)) * side + (left - (x - radius))));
    return is_healthy(g, "reading depths", err);
}

static bool gl_read_depths(rgl *gl, float *out, mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    GL(glBindFramebuffer(GL_FRAMEBUFFER, g->canvas.points.fbo));
    GL(glPixelStorei(GL_PACK_ALIGNMENT, 4));
    GL(glReadPixels(0, 0, (GLsizei)g->canvas.width, (GLsizei)g->canvas.height, GL_DEPTH_COMPONENT,
                    GL_FLOAT, out));
    flip_rows(out, g->canvas.width * sizeof *out, g->canvas.height);
    return is_healthy(g, "reading depths", err);
}

static GLuint make_octants_texture(void)
{
    GLuint texture = 0;
    GL(glGenTextures(1, &texture));
    GL(glBindTexture(GL_TEXTURE_2D, texture));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST));
    return texture;
}

/* Makes all that is there without anybody asking for it. */
static bool begin(gl_rgl *g, mospt_err *err)
{
    if (epoxy_gl_version() < 33)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "the graphics driver offers OpenGL %d.%d, 3.3 is needed",
                             epoxy_gl_version() / 10, epoxy_gl_version() % 10);
    const GLubyte *name = glGetString(GL_RENDERER);
    if (name != NULL) strncpy(g->renderer, (const char *)name, sizeof g->renderer - 1);
    g->robust = rgl_program_sees_resets();
    while (glGetError() != GL_NO_ERROR) {
    }
    glGenVertexArrays(1, &g->arena_vao);
    g->octants = make_octants_texture();
    rgl_canvas_init(&g->canvas);
    return true;
}

static bool gl_restart(rgl *gl, mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    *g = (gl_rgl){.base = g->base}; /* its names mean nothing here */
    return begin(g, err);
}

static const rgl_driver GL_DRIVER = {
    .destroy = gl_destroy,
    .renderer = gl_renderer,
    .arena_create = gl_arena_create,
    .arena_upload = gl_arena_upload,
    .draw = gl_draw,
    .read_pixels = gl_read_pixels,
    .read_depth = gl_read_depth,
    .read_depths = gl_read_depths,
    .restart = gl_restart,
};

bool rgl_gl_create(rgl **out, mospt_err *err)
{
    gl_rgl *g = calloc(1, sizeof *g);
    if (g == NULL) return mospt_err_nomem(err, sizeof *g);
    g->base.driver = &GL_DRIVER;
    if (!begin(g, err)) return free(g), false;
    *out = &g->base;
    return true;
}
