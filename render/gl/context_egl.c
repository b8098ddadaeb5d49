#include "render/gl/context.h"

#include <epoxy/egl.h>
#include <stdlib.h>

struct rgl_context {
    EGLDisplay display;
    EGLContext context;
    EGLSurface surface; /* EGL_NO_SURFACE where the driver needs none */
};

static bool has(EGLDisplay display, const char *extension)
{
    return epoxy_has_egl_extension(display, extension);
}

static bool start(EGLDisplay display)
{
    EGLint major, minor;
    return display != EGL_NO_DISPLAY && eglInitialize(display, &major, &minor) &&
           eglBindAPI(EGL_OPENGL_API);
}

/* A card by itself first, whoever made its driver: Mesa's surfaceless platform, which always has
 * the software renderer, would pass over a card that is not Mesa's. Then whatever the system thinks
 * is the default. */
enum { TRY_DEVICE, TRY_SURFACELESS, TRY_DEFAULT, TRY_COUNT };

static EGLDisplay open_display(int attempt)
{
    if (attempt == TRY_DEFAULT) return eglGetDisplay(EGL_DEFAULT_DISPLAY);
    if (!has(EGL_NO_DISPLAY, "EGL_EXT_platform_base")) return EGL_NO_DISPLAY;
    if (attempt == TRY_SURFACELESS)
        return has(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless")
                   ? eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY,
                                              NULL)
                   : EGL_NO_DISPLAY;
    EGLDeviceEXT device;
    EGLint count = 0;
    if (!has(EGL_NO_DISPLAY, "EGL_EXT_device_enumeration") ||
        !eglQueryDevicesEXT(1, &device, &count) || count < 1)
        return EGL_NO_DISPLAY;
    return eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, device, NULL);
}

/* With a notice of resets where the driver has it. */
static EGLContext make_context(EGLDisplay display, EGLConfig config)
{
    const EGLint robust[] = {EGL_CONTEXT_MAJOR_VERSION_KHR,
                             3,
                             EGL_CONTEXT_MINOR_VERSION_KHR,
                             3,
                             EGL_CONTEXT_OPENGL_PROFILE_MASK_KHR,
                             EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT_KHR,
                             EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY_KHR,
                             EGL_LOSE_CONTEXT_ON_RESET_KHR,
                             EGL_NONE};
    const EGLint plain[] = {EGL_CONTEXT_MAJOR_VERSION_KHR,
                            3,
                            EGL_CONTEXT_MINOR_VERSION_KHR,
                            3,
                            EGL_CONTEXT_OPENGL_PROFILE_MASK_KHR,
                            EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT_KHR,
                            EGL_NONE};
    EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, robust);
    return context != EGL_NO_CONTEXT ? context
                                     : eglCreateContext(display, config, EGL_NO_CONTEXT, plain);
}

static bool try(int attempt, rgl_context *c)
{
    const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT,
                             EGL_NONE};
    const EGLint size[] = {EGL_WIDTH, 16, EGL_HEIGHT, 16, EGL_NONE};
    EGLConfig config = NULL;
    EGLint count = 0;
    *c = (rgl_context){
        .display = open_display(attempt), .context = EGL_NO_CONTEXT, .surface = EGL_NO_SURFACE};
    if (!start(c->display)) return false;
    bool configured = eglChooseConfig(c->display, wanted, &config, 1, &count) && count > 0;
    if (!configured && !has(c->display, "EGL_KHR_no_config_context")) return false;
    if (!configured) config = EGL_NO_CONFIG_KHR;
    c->context = make_context(c->display, config);
    if (c->context == EGL_NO_CONTEXT) return false;
    if (has(c->display, "EGL_KHR_surfaceless_context") &&
        eglMakeCurrent(c->display, EGL_NO_SURFACE, EGL_NO_SURFACE, c->context))
        return true;
    if (!configured) return false;
    c->surface = eglCreatePbufferSurface(c->display, config, size);
    return c->surface != EGL_NO_SURFACE &&
           eglMakeCurrent(c->display, c->surface, c->surface, c->context);
}

static void fini(rgl_context *c)
{
    if (c->display == EGL_NO_DISPLAY) return;
    eglMakeCurrent(c->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (c->surface != EGL_NO_SURFACE) eglDestroySurface(c->display, c->surface);
    if (c->context != EGL_NO_CONTEXT) eglDestroyContext(c->display, c->context);
    eglTerminate(c->display);
}

static bool open_any(rgl_context *c, mospt_err *err)
{
    for (int attempt = 0; attempt < TRY_COUNT; attempt++) {
        if (try(attempt, c)) return true;
        fini(c);
    }
    *c = (rgl_context){.display = EGL_NO_DISPLAY};
    return mospt_err_set(
        err, MOSPT_EIO, mospt_nowhere(),
        "no graphics driver offers OpenGL 3.3 through EGL; Mesa's software renderer would do "
        "(packages libegl1 and libgl1-mesa-dri)");
}

bool rgl_context_create(rgl_context **out, mospt_err *err)
{
    rgl_context *c = calloc(1, sizeof *c);
    if (c == NULL) return mospt_err_nomem(err, sizeof *c);
    if (!open_any(c, err)) return free(c), false;
    *out = c;
    return true;
}

bool rgl_context_renew(void *context, mospt_err *err)
{
    fini(context);
    return open_any(context, err);
}

void rgl_context_destroy(rgl_context *context)
{
    if (context == NULL) return;
    fini(context);
    free(context);
}
