#include "render/gl/canvas.h"

#include <math.h>

static void delete_layer(rgl_layer *layer)
{
    glDeleteFramebuffers(1, &layer->fbo);
    glDeleteTextures(1, &layer->colours);
    glDeleteTextures(1, &layer->depths);
    *layer = (rgl_layer){0};
}

static void delete_layers(rgl_canvas *c)
{
    delete_layer(&c->points);
    delete_layer(&c->sums);
    delete_layer(&c->nearest);
    delete_layer(&c->resolved);
    delete_layer(&c->filled);
    delete_layer(&c->picture);
    c->width = c->height = 0;
}

void rgl_canvas_init(rgl_canvas *canvas)
{
    *canvas = (rgl_canvas){0};
    glGenVertexArrays(1, &canvas->nothing);
}

void rgl_canvas_fini(rgl_canvas *canvas)
{
    delete_layers(canvas);
    glDeleteProgram(canvas->resolve);
    glDeleteProgram(canvas->fill);
    glDeleteProgram(canvas->shade);
    glDeleteProgram(canvas->background);
    glDeleteVertexArrays(1, &canvas->nothing);
}

/* ---- layers ---- */

static GLuint make_texture(const rgl_canvas *c, GLint format, GLenum layout, GLenum type)
{
    GLuint texture = 0;
    GL(glGenTextures(1, &texture));
    GL(glActiveTexture(GL_TEXTURE0));
    GL(glBindTexture(GL_TEXTURE_2D, texture));
    glTexImage2D(GL_TEXTURE_2D, 0, format, (GLsizei)c->width, (GLsizei)c->height, 0, layout, type,
                 NULL);
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE));
    return texture;
}

static void attach(GLenum where, GLuint texture)
{
    if (texture != 0) GL(glFramebufferTexture2D(GL_FRAMEBUFFER, where, GL_TEXTURE_2D, texture, 0));
}

/* What is 0 is left out. */
static bool make_fbo(const rgl_canvas *c, rgl_layer *layer, GLuint colours, GLuint depth_values,
                     GLuint depth_buffer, mospt_err *err)
{
    static const GLenum targets[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    GL(glGenFramebuffers(1, &layer->fbo));
    GL(glBindFramebuffer(GL_FRAMEBUFFER, layer->fbo));
    attach(GL_COLOR_ATTACHMENT0, colours);
    attach(GL_COLOR_ATTACHMENT1, depth_values);
    attach(GL_DEPTH_ATTACHMENT, depth_buffer);
    if (colours == 0) GL(glDrawBuffer(GL_NONE));
    else GL(glDrawBuffers(depth_values != 0 ? 2 : 1, targets));
    if (colours == 0) GL(glReadBuffer(GL_NONE));
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE) return true;
    bool no_memory = glGetError() == GL_OUT_OF_MEMORY;
    return mospt_err_set(err, no_memory ? MOSPT_ENOMEM : MOSPT_EIO, mospt_nowhere(),
                         "the graphics driver cannot draw into a picture of %u x %u%s", c->width,
                         c->height, no_memory ? ": it has no memory left" : "");
}

static bool make_points_layer(const rgl_canvas *c, rgl_layer *layer, mospt_err *err)
{
    layer->colours = make_texture(c, GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE);
    layer->depths = make_texture(c, GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT, GL_FLOAT);
    return make_fbo(c, layer, layer->colours, 0, layer->depths, err);
}

static bool make_nearest_layer(const rgl_canvas *c, rgl_layer *layer, mospt_err *err)
{
    if (layer->fbo != 0) return true;
    layer->depths = make_texture(c, GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT, GL_FLOAT);
    return make_fbo(c, layer, 0, 0, layer->depths, err);
}

static bool make_sums_layer(const rgl_canvas *c, rgl_layer *layer, mospt_err *err)
{
    if (layer->fbo != 0) return true;
    layer->colours = make_texture(c, GL_RGBA32F, GL_RGBA, GL_FLOAT);
    layer->depths = make_texture(c, GL_R32F, GL_RED, GL_FLOAT);
    return make_fbo(c, layer, layer->colours, layer->depths, c->points.depths, err);
}

/* Colours and depths as values. */
static bool make_plain_layer(const rgl_canvas *c, rgl_layer *layer, mospt_err *err)
{
    if (layer->fbo != 0) return true;
    layer->colours = make_texture(c, GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE);
    layer->depths = make_texture(c, GL_R32F, GL_RED, GL_FLOAT);
    return make_fbo(c, layer, layer->colours, layer->depths, 0, err);
}

bool rgl_canvas_fit(rgl_canvas *canvas, const rgl_scene *scene, mospt_err *err)
{
    uint32_t width = scene->frame.width, height = scene->frame.height;
    if (canvas->width == width && canvas->height == height) return true;
    GLint max = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &max);
    if (width == 0 || height == 0 || width > (uint32_t)max || height > (uint32_t)max)
        return mospt_err_set(
            err, MOSPT_EINVAL, mospt_nowhere(),
            "a picture of %u x %u pixels is not possible; this driver draws up to %d x %d", width,
            height, max, max);
    delete_layers(canvas);
    canvas->width = width, canvas->height = height;
    canvas->picture.colours = make_texture(canvas, GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE);
    if (make_points_layer(canvas, &canvas->points, err) &&
        make_fbo(canvas, &canvas->picture, canvas->picture.colours, 0, 0, err))
        return true;
    delete_layers(canvas);
    return false;
}

/* ---- what points are drawn into ---- */

static void use_layer(const rgl_canvas *c, GLuint fbo, bool test_depths)
{
    GL(glBindFramebuffer(GL_FRAMEBUFFER, fbo));
    GL(glViewport(0, 0, (GLsizei)c->width, (GLsizei)c->height));
    GL(glDisable(GL_BLEND));
    if (test_depths) GL(glEnable(GL_DEPTH_TEST));
    else GL(glDisable(GL_DEPTH_TEST));
}

void rgl_canvas_draw(rgl_canvas *canvas, bool clear)
{
    use_layer(canvas, canvas->points.fbo, true);
    GL(glDepthFunc(GL_LESS));
    GL(glDepthMask(GL_TRUE));
    if (!clear) return;
    GL(glClearColor(0, 0, 0, 1));
    GL(glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT));
    canvas->adding = false;
}

static bool start_sums(rgl_canvas *c, mospt_err *err)
{
    if (!make_sums_layer(c, &c->sums, err) || !make_nearest_layer(c, &c->nearest, err))
        return false;
    GLint w = (GLint)c->width, h = (GLint)c->height;
    GL(glBindFramebuffer(GL_READ_FRAMEBUFFER, c->points.fbo));
    GL(glBindFramebuffer(GL_DRAW_FRAMEBUFFER, c->nearest.fbo));
    GL(glBlitFramebuffer(0, 0, w, h, 0, 0, w, h, GL_DEPTH_BUFFER_BIT, GL_NEAREST));
    use_layer(c, c->sums.fbo, true);
    GL(glClearColor(0, 0, 0, 0));
    GL(glClear(GL_COLOR_BUFFER_BIT));
    c->adding = true;
    return true;
}

bool rgl_canvas_add(rgl_canvas *canvas, mospt_err *err)
{
    if (!canvas->adding && !start_sums(canvas, err)) return false;
    use_layer(canvas, canvas->sums.fbo, true);
    GL(glDepthFunc(GL_LEQUAL));
    GL(glDepthMask(GL_FALSE));
    GL(glEnable(GL_BLEND));
    GL(glBlendFunc(GL_ONE, GL_ONE));
    GL(glActiveTexture(GL_TEXTURE0 + RGL_CANVAS_NEAREST));
    GL(glBindTexture(GL_TEXTURE_2D, canvas->nearest.depths));
    return true;
}

/* ---- passes over the screen ---- */

static bool use_program(GLuint *program, const char *fragment, mospt_err *err)
{
    static const char *const units[] = {"colours", "depths", "nearest"};
    if (*program == 0 && !rgl_program_create("", RGL_SCREEN_VERTEX, fragment, program, err))
        return false;
    GL(glUseProgram(*program));
    for (int u = 0; u < 3; u++)
        GL(glUniform1i(glGetUniformLocation(*program, units[u]), u));
    return true;
}

static void read_layer(const rgl_layer *layer)
{
    GL(glActiveTexture(GL_TEXTURE1));
    GL(glBindTexture(GL_TEXTURE_2D, layer->depths));
    GL(glActiveTexture(GL_TEXTURE0));
    GL(glBindTexture(GL_TEXTURE_2D, layer->colours));
}

static void run_pass(const rgl_canvas *c, const rgl_layer *from, GLuint to)
{
    use_layer(c, to, false);
    read_layer(from);
    GL(glBindVertexArray(c->nothing));
    GL(glDrawArrays(GL_TRIANGLES, 0, 3));
}

static float span_of(const rgl_scene *scene)
{
    return log2f(scene->frame.far_w / scene->frame.near_w);
}

float rgl_canvas_deeper(const rgl_scene *scene, float share)
{
    return log2f(1 + share) / span_of(scene);
}

static GLint uniform(GLuint program, const char *name)
{
    return glGetUniformLocation(program, name);
}

static bool resolve(rgl_canvas *c, const rgl_scene *scene, mospt_err *err)
{
    if (!make_plain_layer(c, &c->resolved, err) ||
        !use_program(&c->resolve, RGL_RESOLVE_FRAGMENT, err))
        return false;
    GL(glActiveTexture(GL_TEXTURE0 + RGL_CANVAS_NEAREST));
    GL(glBindTexture(GL_TEXTURE_2D, c->nearest.depths));
    GL(glUniform1f(uniform(c->resolve, "slab"), rgl_canvas_deeper(scene, scene->blend_slab)));
    run_pass(c, &c->sums, c->resolved.fbo);
    return true;
}

static bool fill(rgl_canvas *c, const rgl_scene *scene, const rgl_layer *from, mospt_err *err)
{
    if (!make_plain_layer(c, &c->filled, err) || !use_program(&c->fill, RGL_FILL_FRAGMENT, err))
        return false;
    uint32_t radius = scene->fill_px < RGL_FILL_PX_MAX ? scene->fill_px : RGL_FILL_PX_MAX;
    GL(glUniform1i(uniform(c->fill, "radius"), (GLint)radius));
    GL(glUniform2f(uniform(c->fill, "tolerance"), rgl_canvas_deeper(scene, RGL_FILL_BEHIND),
                   rgl_canvas_deeper(scene, RGL_FILL_SPREAD)));
    run_pass(c, from, c->filled.fbo);
    return true;
}

static void set_background(GLuint program, const rgl_scene *scene)
{
    GL(glUniform3fv(uniform(program, "top"), 1, scene->background_top));
    GL(glUniform3fv(uniform(program, "bottom"), 1, scene->background_bottom));
    GL(glUniform1f(uniform(program, "height"), (float)scene->frame.height));
}

static bool shade(rgl_canvas *c, const rgl_scene *scene, const rgl_layer *from, GLuint to,
                  mospt_err *err)
{
    if (!use_program(&c->shade, RGL_SHADE_FRAGMENT, err)) return false;
    GL(glUniform1f(uniform(c->shade, "span"), span_of(scene)));
    GL(glUniform2f(uniform(c->shade, "edl"), scene->edl_strength, scene->edl_radius_px));
    GL(glUniform2f(uniform(c->shade, "texel"), 1 / (float)c->width, 1 / (float)c->height));
    set_background(c->shade, scene);
    run_pass(c, from, to);
    return true;
}

/* Puts the background behind the points where they were drawn: the depth test finds where. */
static bool finish_in_place(rgl_canvas *c, const rgl_scene *scene, mospt_err *err)
{
    if (!use_program(&c->background, RGL_BACKGROUND_FRAGMENT, err)) return false;
    set_background(c->background, scene);
    use_layer(c, c->points.fbo, true);
    GL(glDepthFunc(GL_LEQUAL));
    GL(glDepthMask(GL_FALSE));
    GL(glBindVertexArray(c->nothing));
    GL(glDrawArrays(GL_TRIANGLES, 0, 3));
    c->shown = c->points.fbo;
    return true;
}

static void copy_to_window(const rgl_canvas *c, GLuint from)
{
    GLint w = (GLint)c->width, h = (GLint)c->height;
    GL(glBindFramebuffer(GL_READ_FRAMEBUFFER, from));
    GL(glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0));
    GL(glBlitFramebuffer(0, 0, w, h, 0, 0, w, h, GL_COLOR_BUFFER_BIT, GL_NEAREST));
    GL(glBindFramebuffer(GL_FRAMEBUFFER, 0));
}

bool rgl_canvas_finish(rgl_canvas *canvas, const rgl_scene *scene, bool to_window, mospt_err *err)
{
    const rgl_layer *last = &canvas->points;
    if (!canvas->adding && scene->fill_px == 0 && !(scene->edl_strength > 0)) {
        if (!finish_in_place(canvas, scene, err)) return false;
        if (to_window) copy_to_window(canvas, canvas->shown);
        return true;
    }
    if (canvas->adding) {
        if (!resolve(canvas, scene, err)) return false;
        last = &canvas->resolved;
    }
    if (scene->fill_px > 0) {
        if (!fill(canvas, scene, last, err)) return false;
        last = &canvas->filled;
    }
    canvas->shown = canvas->picture.fbo;
    return shade(canvas, scene, last, to_window ? 0 : canvas->shown, err);
}
