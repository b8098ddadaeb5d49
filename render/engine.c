#include "render/engine.h"

#include "render/cpu/cpu.h"

#include <string.h>

/* Mesa's drivers that draw on the processor, by the names they give themselves. */
static bool is_software(const char *renderer)
{
    static const char *const names[] = {"llvmpipe", "softpipe", "SWR", "Software Rasterizer"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (strstr(renderer, names[i]) != NULL) return true;
    return false;
}

static bool open_cpu(const rend_engine_options *options, rgl **out, mospt_err *err)
{
    rcpu_options cpu = {.threads = options->threads};
    return rcpu_create(&cpu, out, err);
}

static bool open_gl(rend_engine *out, mospt_err *err)
{
    rend_engine e = {.renderer = REND_RENDERER_GL};
    if (!rgl_context_create(&e.context, err)) return false;
    if (!rgl_gl_create(&e.gl, err)) {
        rgl_context_destroy(e.context);
        return false;
    }
    rgl_set_renew(e.gl, rgl_context_renew, e.context);
    *out = e;
    return true;
}

bool rend_engine_open(const rend_engine_options *options, rend_engine *out, mospt_err *err)
{
    rend_engine e = {0};
    if (options->renderer == REND_RENDERER_GL) return open_gl(out, err);
    if (options->renderer == REND_RENDERER_AUTO && open_gl(&e, NULL)) {
        if (!is_software(rgl_renderer(e.gl))) {
            *out = e;
            return true;
        }
        rend_engine_close(&e);
    }
    *out = (rend_engine){.renderer = REND_RENDERER_CPU};
    return open_cpu(options, &out->gl, err);
}

static bool open_in_window(const rend_engine_options *options, rend_engine *out, mospt_err *err)
{
    rgl *gl = NULL, *cpu = NULL;
    *out = (rend_engine){0};
    if (options->renderer != REND_RENDERER_CPU) {
        if (!rgl_gl_create(&gl, err)) return false;
        if (options->renderer == REND_RENDERER_GL || !is_software(rgl_renderer(gl))) {
            *out = (rend_engine){.gl = gl, .renderer = REND_RENDERER_GL};
            return true;
        }
        rgl_destroy(gl);
    }
    if (!open_cpu(options, &cpu, err)) return false;
    out->renderer = REND_RENDERER_CPU;
    if (rgl_present_create(cpu, rcpu_picture, &out->gl, err)) return true;
    rgl_destroy(cpu);
    return false;
}

bool rend_engine_open_window(const rend_engine_options *options, rgl_renew *renew, void *user,
                             rend_engine *out, mospt_err *err)
{
    if (!open_in_window(options, out, err)) return false;
    rgl_set_renew(out->gl, renew, user);
    return true;
}

void rend_engine_close(rend_engine *engine)
{
    rgl_destroy(engine->gl);
    rgl_context_destroy(engine->context);
    *engine = (rend_engine){0};
}
