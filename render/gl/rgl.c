#include "render/gl/driver.h"

#include <errno.h>
#include <time.h>

enum { RENEW_MAX = 20, RENEW_PAUSE_NS = 250000000 };

void rgl_destroy(rgl *gl)
{
    if (gl != NULL) gl->driver->destroy(gl);
}

const char *rgl_renderer(const rgl *gl)
{
    return gl->driver->renderer(gl);
}

bool rgl_arena_create(rgl *gl, uint64_t vertex_count, mospt_err *err)
{
    if (vertex_count > INT32_MAX) /* what a range of a batch addresses */
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "a GPU cache of %llu points is more than the %d that can be addressed",
                             (unsigned long long)vertex_count, INT32_MAX);
    return gl->driver->arena_create(gl, vertex_count, err);
}

bool rgl_arena_upload(rgl *gl, uint64_t first, const mospt_vertex *vertices, uint32_t count,
                      mospt_err *err)
{
    return gl->driver->arena_upload(gl, first, vertices, count, err);
}

bool rgl_draw(rgl *gl, const rgl_scene *scene, const rgl_batch *batches, uint32_t batch_count,
              int parts, mospt_err *err)
{
    return gl->driver->draw(gl, scene, batches, batch_count, parts, err);
}

bool rgl_read_pixels(rgl *gl, bool from_window, uint32_t width, uint32_t height, uint8_t *rgb,
                     mospt_err *err)
{
    return gl->driver->read_pixels(gl, from_window, width, height, rgb, err);
}

bool rgl_read_depth(rgl *gl, int x, int y, int radius, float *out, mospt_err *err)
{
    return gl->driver->read_depth(gl, x, y, radius, out, err);
}

bool rgl_read_depths(rgl *gl, float *out, mospt_err *err)
{
    return gl->driver->read_depths(gl, out, err);
}

void rgl_set_renew(rgl *gl, rgl_renew *renew, void *user)
{
    gl->renew = renew, gl->user = user;
}

bool rgl_is_lost(const rgl *gl)
{
    return gl->is_lost;
}

bool rgl_set_lost(rgl *gl, mospt_err *err)
{
    gl->is_lost = true;
    errno = 0;
    return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                         "the graphics driver was reset; the dataset is unharmed, start again");
}

bool rgl_recover(rgl *gl, mospt_err *err)
{
    const struct timespec pause = {.tv_nsec = RENEW_PAUSE_NS};
    if (gl->renew == NULL) return rgl_set_lost(gl, err);
    for (int i = 0; !gl->renew(gl->user, err); i++) {
        if (i == RENEW_MAX) return false;
        nanosleep(&pause, NULL);
    }
    gl->is_lost = gl->pretends = false;
    return gl->driver->restart == NULL || gl->driver->restart(gl, err);
}

void rgl_pretend_reset(rgl *gl)
{
    gl->pretends = true;
}
