/* render/gl/context.h - an OpenGL context without a window, for pictures and recordings on machines
 * without a display. */
#pragma once
#include "mospt/err.h"

typedef struct rgl_context rgl_context;

/* Makes an OpenGL 3.3 core context, current on this thread.
 * errors   MOSPT_EIO: no driver, not even the software one */
bool rgl_context_create(rgl_context **out, mospt_err *err);

/* Makes another one in its place, current on this thread: the one before is lost.
 * context  a rgl_context: this is a rgl_renew
 * errors   MOSPT_EIO: there is none; it can be tried again */
bool rgl_context_renew(void *context, mospt_err *err);

void rgl_context_destroy(rgl_context *context);
