/* render/gl/driver.h - what a backend of rgl.h provides. Each starts with a struct rgl. */
#pragma once
#include "render/gl/rgl.h"

typedef struct {
    void (*destroy)(rgl *gl);
    const char *(*renderer)(const rgl *gl);
    bool (*arena_create)(rgl *gl, uint64_t vertex_count, mospt_err *err);
    bool (*arena_upload)(rgl *gl, uint64_t first, const mospt_vertex *vertices, uint32_t count,
                         mospt_err *err);
    bool (*draw)(rgl *gl, const rgl_scene *scene, const rgl_batch *batches, uint32_t batch_count,
                 int parts, mospt_err *err);
    bool (*read_pixels)(rgl *gl, bool from_window, uint32_t width, uint32_t height, uint8_t *rgb,
                        mospt_err *err);
    bool (*read_depth)(rgl *gl, int x, int y, int radius, float *out, mospt_err *err);
    bool (*read_depths)(rgl *gl, float *out, mospt_err *err);
    /* In another context, where nothing is of what was in the one before. NULL: needs no context.
     */
    bool (*restart)(rgl *gl, mospt_err *err);
} rgl_driver;

/* Reads the window's back buffer, for whichever backend has drawn into it. */
bool rgl_gl_read_window(uint32_t width, uint32_t height, uint8_t *rgb, mospt_err *err);

struct rgl {
    const rgl_driver *driver;
    rgl_renew *renew;
    void *user; /* of renew() */
    bool is_lost, pretends;
};

/* Fails because of a reset. */
bool rgl_set_lost(rgl *gl, mospt_err *err);
