/* Shows in a window what a backend without one has drawn: its picture is a texture. */
#include "render/gl/driver.h"
#include "render/gl/program.h"

#include <stdlib.h>

typedef struct {
    rgl base;
    rgl *inner; /* owned */
    rgl_picture_of *picture_of;
    GLuint program, vao, texture;
    GLint picture, height;
    uint32_t texture_width, texture_height; /* pixels; 0: none yet */
    bool robust;                            /* the context tells when it is lost */
} present_rgl;

static present_rgl *of(rgl *gl)
{
    return (present_rgl *)gl;
}

static void present_destroy(rgl *gl)
{
    rgl_destroy(of(gl)->inner);
    if (!gl->is_lost) { /* else they are gone */
        glDeleteTextures(1, &of(gl)->texture);
        glDeleteVertexArrays(1, &of(gl)->vao);
        glDeleteProgram(of(gl)->program);
    }
    free(gl);
}

static const char *present_renderer(const rgl *gl)
{
    return rgl_renderer(((const present_rgl *)gl)->inner);
}

static bool present_arena_create(rgl *gl, uint64_t vertex_count, mospt_err *err)
{
    return rgl_arena_create(of(gl)->inner, vertex_count, err);
}

static bool present_arena_upload(rgl *gl, uint64_t first, const mospt_vertex *vertices,
                                 uint32_t count, mospt_err *err)
{
    return rgl_arena_upload(of(gl)->inner, first, vertices, count, err);
}

static void upload_picture(present_rgl *p, uint32_t width, uint32_t height)
{
    uint32_t stride = 0;
    const uint32_t *pixels = p->picture_of(p->inner, &stride);
    bool fits = p->texture_width == width && p->texture_height == height;
    GL(glActiveTexture(GL_TEXTURE0));
    GL(glBindTexture(GL_TEXTURE_2D, p->texture));
    GL(glPixelStorei(GL_UNPACK_ALIGNMENT, 4));
    GL(glPixelStorei(GL_UNPACK_ROW_LENGTH, (GLint)stride));
    if (fits)
        GL(glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, (GLsizei)width, (GLsizei)height, GL_RGBA,
                           GL_UNSIGNED_BYTE, pixels));
    else
        GL(glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, (GLsizei)width, (GLsizei)height, 0, GL_RGBA,
                        GL_UNSIGNED_BYTE, pixels));
    GL(glPixelStorei(GL_UNPACK_ROW_LENGTH, 0));
    p->texture_width = width, p->texture_height = height;
}

/* A reset is found at the end of a frame: until then calls do nothing. */
static bool is_reset(const present_rgl *p, GLenum error)
{
    return p->base.pretends || error == GL_CONTEXT_LOST ||
           (p->robust && glGetGraphicsResetStatusARB() != GL_NO_ERROR);
}

static bool show(present_rgl *p, uint32_t width, uint32_t height, mospt_err *err)
{
    upload_picture(p, width, height);
    GL(glBindFramebuffer(GL_FRAMEBUFFER, 0));
    GL(glViewport(0, 0, (GLsizei)width, (GLsizei)height));
    GL(glDisable(GL_DEPTH_TEST));
    GL(glDisable(GL_BLEND));
    GL(glUseProgram(p->program));
    GL(glUniform1i(p->picture, 0));
    GL(glUniform1i(p->height, (GLint)height));
    GL(glBindVertexArray(p->vao));
    GL(glDrawArrays(GL_TRIANGLES, 0, 3));
    GLenum error = glGetError();
    if (is_reset(p, error)) return rgl_set_lost(&p->base, err);
    return error == GL_NO_ERROR ||
           mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                         "the graphics driver reports error 0x%04x at showing a picture", error);
}

static bool present_draw(rgl *gl, const rgl_scene *scene, const rgl_batch *batches,
                         uint32_t batch_count, int parts, mospt_err *err)
{
    int both = RGL_END | RGL_TO_WINDOW;
    if (!rgl_draw(of(gl)->inner, scene, batches, batch_count, parts & ~RGL_TO_WINDOW, err))
        return false;
    return (parts & both) != both || show(of(gl), scene->frame.width, scene->frame.height, err);
}

static bool present_read_pixels(rgl *gl, bool from_window, uint32_t width, uint32_t height,
                                uint8_t *rgb, mospt_err *err)
{
    return from_window ? rgl_gl_read_window(width, height, rgb, err)
                       : rgl_read_pixels(of(gl)->inner, false, width, height, rgb, err);
}

static bool present_read_depth(rgl *gl, int x, int y, int radius, float *out, mospt_err *err)
{
    return rgl_read_depth(of(gl)->inner, x, y, radius, out, err);
}

static bool present_read_depths(rgl *gl, float *out, mospt_err *err)
{
    return rgl_read_depths(of(gl)->inner, out, err);
}

static bool begin(present_rgl *p, mospt_err *err)
{
    if (!rgl_program_create("", RGL_SCREEN_VERTEX, RGL_PRESENT_FRAGMENT, &p->program, err))
        return false;
    p->picture = glGetUniformLocation(p->program, "picture");
    p->height = glGetUniformLocation(p->program, "height");
    p->robust = rgl_program_sees_resets();
    GL(glGenVertexArrays(1, &p->vao));
    GL(glGenTextures(1, &p->texture));
    GL(glBindTexture(GL_TEXTURE_2D, p->texture));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST));
    return true;
}

/* What draws needs no context, and has lost nothing. */
static bool present_restart(rgl *gl, mospt_err *err)
{
    present_rgl *p = of(gl);
    *p = (present_rgl){.base = p->base, .inner = p->inner, .picture_of = p->picture_of};
    return begin(p, err);
}

static const rgl_driver PRESENT_DRIVER = {
    .destroy = present_destroy,
    .renderer = present_renderer,
    .arena_create = present_arena_create,
    .arena_upload = present_arena_upload,
    .draw = present_draw,
    .read_pixels = present_read_pixels,
    .read_depth = present_read_depth,
    .read_depths = present_read_depths,
    .restart = present_restart,
};

bool rgl_present_create(rgl *inner, rgl_picture_of *picture_of, rgl **out, mospt_err *err)
{
    present_rgl *p = calloc(1, sizeof *p);
    if (p == NULL) return mospt_err_nomem(err, sizeof *p);
    p->base.driver = &PRESENT_DRIVER;
    p->picture_of = picture_of;
    if (!begin(p, err)) return free(p), false;
    p->inner = inner;
    *out = &p->base;
    return true;
}
