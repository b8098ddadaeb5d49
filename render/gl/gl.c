/* The OpenGL 3.3 core backend. */
#include "render/gl/driver.h"
#include "render/gl/program.h"

#include <math.h>
#include <stdlib.h>

typedef struct {
    GLuint name;
    GLint anchor, offset, rotation, inverse_tan, range, splat, grid_bits, clip_low, clip_high;
} points_program;

typedef struct {
    GLuint name;
    GLint range, edl, top, bottom, height;
} shade_program;

enum { ROUND = 1, OCTANTS = 2, CLIP = 4, KIND_COUNT = 8 }; /* flags */
enum { OCTANTS_WIDTH = 1024 };                             /* texels; the shader knows it too */

typedef struct {
    rgl base;
    GLuint arena, arena_vao, empty_vao;
    uint64_t arena_size;               /* vertices */
    points_program points[KIND_COUNT]; /* made at first use */
    shade_program shade;
    GLuint scene_fbo, colours, depths; /* of scene_width by scene_height; 0: none yet */
    GLuint picture_fbo, picture;
    GLuint octants;
    uint32_t width, height;
    bool robust; /* the context tells when it is lost */
    char renderer[128];
} gl_rgl;

static void delete_targets(gl_rgl *g)
{
    glDeleteFramebuffers(1, &g->scene_fbo);
    glDeleteFramebuffers(1, &g->picture_fbo);
    glDeleteTextures(1, &g->colours);
    glDeleteTextures(1, &g->depths);
    glDeleteTextures(1, &g->picture);
    g->scene_fbo = g->picture_fbo = g->colours = g->depths = g->picture = 0;
    g->width = g->height = 0;
}

static void gl_destroy(rgl *gl)
{
    gl_rgl *g = (gl_rgl *)gl;
    delete_targets(g);
    glDeleteTextures(1, &g->octants);
    glDeleteBuffers(1, &g->arena);
    glDeleteVertexArrays(1, &g->arena_vao);
    glDeleteVertexArrays(1, &g->empty_vao);
    for (int k = 0; k < KIND_COUNT; k++)
        glDeleteProgram(g->points[k].name);
    glDeleteProgram(g->shade.name);
    free(g);
}

static const char *gl_renderer(const rgl *gl)
{
    return ((const gl_rgl *)gl)->renderer;
}

/* Errors that are no mistake of ours: no memory, or the driver has reset. */
static bool is_healthy(const gl_rgl *g, const char *what, mospt_err *err)
{
    if (g->robust && glGetGraphicsResetStatusARB() != GL_NO_ERROR)
        return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                             "the graphics driver was reset; the dataset is unharmed, start again");
    GLenum error = glGetError();
    if (error == GL_OUT_OF_MEMORY)
        return mospt_err_set(
            err, MOSPT_ENOMEM, mospt_nowhere(),
            "the graphics card has no memory left for %s; try a smaller --gpu-cache", what);
    if (error != GL_NO_ERROR)
        return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                             "the graphics driver reports error 0x%04x at %s", error, what);
    return true;
}

static bool gl_arena_create(rgl *gl, uint64_t vertex_count, mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    if (vertex_count > INT32_MAX) /* what a GLint addresses */
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "a GPU cache of %llu points is more than the %d that can be addressed",
                             (unsigned long long)vertex_count, INT32_MAX);
    GL(glBindVertexArray(g->arena_vao));
    GL(glBindBuffer(GL_ARRAY_BUFFER, g->arena));
    GL(glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(vertex_count * sizeof(mospt_vertex)), NULL,
                    GL_DYNAMIC_DRAW));
    GL(glEnableVertexAttribArray(0));
    GL(glEnableVertexAttribArray(1));
    GL(glVertexAttribIPointer(0, 3, GL_UNSIGNED_INT, sizeof(mospt_vertex), NULL));
    GL(glVertexAttribPointer(1, 4, GL_UNSIGNED_BYTE, GL_TRUE, sizeof(mospt_vertex),
                             (const void *)offsetof(mospt_vertex, r)));
    g->arena_size = vertex_count;
    return is_healthy(g, "the GPU cache", err);
}

static bool gl_arena_upload(rgl *gl, uint64_t first, const mospt_vertex *vertices, uint32_t count,
                            mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    if (count == 0) return true;
    GL(glBindBuffer(GL_ARRAY_BUFFER, g->arena));
    GL(glBufferSubData(GL_ARRAY_BUFFER, (GLintptr)(first * sizeof *vertices),
                       (GLsizeiptr)(count * sizeof *vertices), vertices));
    return is_healthy(g, "an upload", err);
}

static GLuint make_texture(GLint format, GLenum layout, GLenum type, uint32_t width,
                           uint32_t height)
{
    GLuint texture = 0;
    GL(glGenTextures(1, &texture));
    GL(glBindTexture(GL_TEXTURE_2D, texture));
    GL(glTexImage2D(GL_TEXTURE_2D, 0, format, (GLsizei)width, (GLsizei)height, 0, layout, type,
                    NULL));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST));
    return texture;
}

static GLuint make_framebuffer(GLuint colour, GLuint depth)
{
    GLuint fbo = 0;
    GL(glGenFramebuffers(1, &fbo));
    GL(glBindFramebuffer(GL_FRAMEBUFFER, fbo));
    GL(glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, colour, 0));
    if (depth != 0)
        GL(glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depth, 0));
    return fbo;
}

static bool fit_targets(gl_rgl *g, uint32_t width, uint32_t height, mospt_err *err)
{
    if (g->width == width && g->height == height) return true;
    GLint max = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &max);
    if (width == 0 || height == 0 || width > (uint32_t)max || height > (uint32_t)max)
        return mospt_err_set(
            err, MOSPT_EINVAL, mospt_nowhere(),
            "a picture of %u x %u pixels is not possible; this driver draws up to %d x %d", width,
            height, max, max);
    delete_targets(g);
    g->colours = make_texture(GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE, width, height);
    g->depths = make_texture(GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT, GL_FLOAT, width, height);
    g->picture = make_texture(GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE, width, height);
    g->scene_fbo = make_framebuffer(g->colours, g->depths);
    bool complete = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    g->picture_fbo = make_framebuffer(g->picture, 0);
    complete = complete && glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    if (!is_healthy(g, "the picture", err)) return false;
    if (!complete)
        return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                             "the graphics driver cannot draw into a picture of %u x %u", width,
                             height);
    g->width = width, g->height = height;
    return true;
}

static bool use_points_program(gl_rgl *g, int kind, const points_program **out, mospt_err *err)
{
    points_program *p = &g->points[kind];
    if (p->name == 0) {
        char defines[64] = "";
        strcat(defines, kind & ROUND ? "#define ROUND\n" : "");
        strcat(defines, kind & OCTANTS ? "#define OCTANTS\n" : "");
        strcat(defines, kind & CLIP ? "#define CLIP\n" : "");
        if (!rgl_program_create(defines, RGL_POINTS_VERTEX, RGL_POINTS_FRAGMENT, &p->name, err))
            return false;
        p->anchor = glGetUniformLocation(p->name, "anchor");
        p->offset = glGetUniformLocation(p->name, "offset");
        p->rotation = glGetUniformLocation(p->name, "rotation");
        p->inverse_tan = glGetUniformLocation(p->name, "inverse_tan");
        p->range = glGetUniformLocation(p->name, "range");
        p->splat = glGetUniformLocation(p->name, "splat");
        p->grid_bits = glGetUniformLocation(p->name, "grid_bits");
        p->clip_low = glGetUniformLocation(p->name, "clip_low");
        p->clip_high = glGetUniformLocation(p->name, "clip_high");
    }
    *out = p;
    return true;
}

static void set_scene(const points_program *p, const rgl_scene *scene)
{
    const rend_frame *f = &scene->frame;
    GL(glUseProgram(p->name));
    GL(glUniform3uiv(p->anchor, 1, f->anchor));
    GL(glUniform3fv(p->offset, 1, f->offset));
    GL(glUniformMatrix3fv(p->rotation, 1, GL_FALSE, f->rotation));
    GL(glUniform2f(p->inverse_tan, 1 / f->tan_half[0], 1 / f->tan_half[1]));
    GL(glUniform2f(p->range, log2f(f->near_w), 1 / log2f(f->far_w / f->near_w)));
    GL(glUniform1i(p->grid_bits, (GLint)scene->grid_bits));
    if (scene->clip != NULL) {
        GL(glUniform3uiv(p->clip_low, 1, scene->clip->low));
        GL(glUniform3uiv(p->clip_high, 1, scene->clip->high));
    }
    float size = scene->octants != NULL ? scene->splat_scale : scene->splat_size;
    GL(glUniform3f(p->splat, size * f->focal_px, scene->px_min, scene->px_max));
}

/* The tree of what is drawn, for the walk in the vertex shader. */
static void upload_octants(gl_rgl *g, const rgl_scene *scene)
{
    GLsizei count = (GLsizei)(8 * scene->octant_nodes), rows = count / OCTANTS_WIDTH;
    GL(glActiveTexture(GL_TEXTURE0));
    GL(glBindTexture(GL_TEXTURE_2D, g->octants));
    GL(glPixelStorei(GL_UNPACK_ALIGNMENT, 4));
    GL(glTexImage2D(GL_TEXTURE_2D, 0, GL_R32UI, OCTANTS_WIDTH, rows + 1, 0, GL_RED_INTEGER,
                    GL_UNSIGNED_INT, NULL));
    if (rows > 0)
        GL(glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, OCTANTS_WIDTH, rows, GL_RED_INTEGER,
                           GL_UNSIGNED_INT, scene->octants));
    if (count % OCTANTS_WIDTH > 0)
        GL(glTexSubImage2D(GL_TEXTURE_2D, 0, 0, rows, count % OCTANTS_WIDTH, 1, GL_RED_INTEGER,
                           GL_UNSIGNED_INT, scene->octants + (size_t)rows * OCTANTS_WIDTH));
}

static bool draw_points(gl_rgl *g, const rgl_scene *scene, const rgl_batch *batches,
                        uint32_t batch_count, mospt_err *err)
{
    GL(glBindVertexArray(g->arena_vao));
    GL(glActiveTexture(GL_TEXTURE0));
    GL(glBindTexture(GL_TEXTURE_2D, g->octants));
    for (uint32_t b = 0; b < batch_count; b++) {
        const points_program *p = NULL;
        int kind = (batches[b].round ? ROUND : 0) | (scene->octants != NULL ? OCTANTS : 0) |
                   (scene->clip != NULL ? CLIP : 0);
        if (batches[b].range_count == 0) continue;
        if (!use_points_program(g, kind, &p, err)) return false;
        set_scene(p, scene);
        GL(glMultiDrawArrays(GL_POINTS, batches[b].first, batches[b].count,
                             (GLsizei)batches[b].range_count));
    }
    return true;
}

static void shade(gl_rgl *g, const rgl_scene *scene, GLuint target)
{
    const rend_frame *f = &scene->frame;
    GL(glBindFramebuffer(GL_FRAMEBUFFER, target));
    GL(glDisable(GL_DEPTH_TEST));
    GL(glUseProgram(g->shade.name));
    GL(glActiveTexture(GL_TEXTURE1));
    GL(glBindTexture(GL_TEXTURE_2D, g->depths));
    GL(glActiveTexture(GL_TEXTURE0));
    GL(glBindTexture(GL_TEXTURE_2D, g->colours));
    GL(glUniform2f(g->shade.range, log2f(f->near_w), log2f(f->far_w / f->near_w)));
    GL(glUniform2f(g->shade.edl, scene->edl_strength, scene->edl_radius_px));
    GL(glUniform3fv(g->shade.top, 1, scene->background_top));
    GL(glUniform3fv(g->shade.bottom, 1, scene->background_bottom));
    GL(glUniform1f(g->shade.height, (float)f->height));
    GL(glBindVertexArray(g->empty_vao));
    GL(glDrawArrays(GL_TRIANGLES, 0, 3));
}

static bool gl_draw(rgl *gl, const rgl_scene *scene, const rgl_batch *batches, uint32_t batch_count,
                    int parts, mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    if (!fit_targets(g, scene->frame.width, scene->frame.height, err)) return false;
    GL(glViewport(0, 0, (GLsizei)g->width, (GLsizei)g->height));
    GL(glBindFramebuffer(GL_FRAMEBUFFER, g->scene_fbo));
    GL(glEnable(GL_DEPTH_TEST));
    GL(glDepthFunc(GL_LESS));
    GL(glDisable(GL_BLEND));
    if (parts & RGL_BEGIN) {
        GL(glClearColor(0, 0, 0, 1));
        GL(glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT));
        if (scene->octants != NULL) upload_octants(g, scene);
    }
    GL(glEnable(GL_PROGRAM_POINT_SIZE));
    if (!draw_points(g, scene, batches, batch_count, err)) return false;
    if (parts & RGL_END) shade(g, scene, parts & RGL_TO_WINDOW ? 0 : g->picture_fbo);
    return is_healthy(g, "a frame", err);
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

static bool gl_read_pixels(rgl *gl, bool from_window, uint32_t width, uint32_t height, uint8_t *rgb,
                           mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    GL(glBindFramebuffer(GL_FRAMEBUFFER, from_window ? 0 : g->picture_fbo));
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
    if (g->scene_fbo == 0) return true;
    int left = x - radius < 0 ? 0 : x - radius, top = y - radius < 0 ? 0 : y - radius;
    int right = x + radius < (int)g->width ? x + radius : (int)g->width - 1;
    int low = y + radius < (int)g->height ? y + radius : (int)g->height - 1;
    GL(glBindFramebuffer(GL_FRAMEBUFFER, g->scene_fbo));
    for (int row = top; row <= low && left <= right; row++)
        GL(glReadPixels(left, (GLint)g->height - 1 - row, right - left + 1, 1, GL_DEPTH_COMPONENT,
                        GL_FLOAT, out + (row - (y - radius)) * side + (left - (x - radius))));
    return is_healthy(g, "reading depths", err);
}

static bool gl_read_depths(rgl *gl, float *out, mospt_err *err)
{
    gl_rgl *g = (gl_rgl *)gl;
    GL(glBindFramebuffer(GL_FRAMEBUFFER, g->scene_fbo));
    GL(glPixelStorei(GL_PACK_ALIGNMENT, 4));
    GL(glReadPixels(0, 0, (GLsizei)g->width, (GLsizei)g->height, GL_DEPTH_COMPONENT, GL_FLOAT,
                    out));
    flip_rows(out, g->width * sizeof *out, g->height);
    return is_healthy(g, "reading depths", err);
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
};

static bool make_shade_program(gl_rgl *g, mospt_err *err)
{
    shade_program *s = &g->shade;
    if (!rgl_program_create("", RGL_SCREEN_VERTEX, RGL_SHADE_FRAGMENT, &s->name, err)) return false;
    s->range = glGetUniformLocation(s->name, "range");
    s->edl = glGetUniformLocation(s->name, "edl");
    s->top = glGetUniformLocation(s->name, "top");
    s->bottom = glGetUniformLocation(s->name, "bottom");
    s->height = glGetUniformLocation(s->name, "height");
    GL(glUseProgram(s->name));
    GL(glUniform1i(glGetUniformLocation(s->name, "colours"), 0));
    GL(glUniform1i(glGetUniformLocation(s->name, "depths"), 1));
    return true;
}

bool rgl_gl_create(rgl **out, mospt_err *err)
{
    if (epoxy_gl_version() < 33)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "the graphics driver offers OpenGL %d.%d, 3.3 is needed",
                             epoxy_gl_version() / 10, epoxy_gl_version() % 10);
    gl_rgl *g = calloc(1, sizeof *g);
    if (g == NULL) return mospt_err_nomem(err, sizeof *g);
    g->base.driver = &GL_DRIVER;
    const GLubyte *name = glGetString(GL_RENDERER);
    if (name != NULL) strncpy(g->renderer, (const char *)name, sizeof g->renderer - 1);
    if (epoxy_has_gl_extension("GL_ARB_robustness")) {
        GLint strategy = 0;
        glGetIntegerv(GL_RESET_NOTIFICATION_STRATEGY_ARB, &strategy);
        g->robust = strategy == GL_LOSE_CONTEXT_ON_RESET_ARB;
    }
    while (glGetError() != GL_NO_ERROR) {
    }
    glGenVertexArrays(1, &g->arena_vao);
    glGenVertexArrays(1, &g->empty_vao);
    glGenBuffers(1, &g->arena);
    g->octants = make_texture(GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, 1, 1);
    if (!make_shade_program(g, err)) {
        gl_destroy(&g->base);
        return false;
    }
    *out = &g->base;
    return true;
}
