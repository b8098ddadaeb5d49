/* render/engine.h - what draws: the graphics card through OpenGL, or the processor. */
#pragma once
#include "render/gl/context.h"
#include "render/gl/rgl.h"
#include "render/options.h"

typedef struct {
    rgl *gl;                /* owned */
    rgl_context *context;   /* owned; NULL: none is needed, or a window has it */
    rend_renderer renderer; /* what was taken: never REND_RENDERER_AUTO */
} rend_engine;

/* For pictures without a window. REND_RENDERER_AUTO takes the processor where OpenGL would draw on
 * it too, or where there is none.
 * errors   MOSPT_EIO: REND_RENDERER_GL without a driver; MOSPT_EINVAL, MOSPT_ENOMEM */
bool rend_engine_open(const rend_engine_options *options, rend_engine *out, mospt_err *err);

/* For the window whose context is current.
 * renew    makes another one, should it be lost */
bool rend_engine_open_window(const rend_engine_options *options, rgl_renew *renew, void *user,
                             rend_engine *out, mospt_err *err);

void rend_engine_close(rend_engine *engine);
