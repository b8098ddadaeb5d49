/* render/gl/program.h - shader programs, and the check behind every GL call of debug builds. */
#pragma once
#include "mospt/err.h"

#include <epoxy/gl.h>

/* Compiles and links.
 * defines  lines put after the #version of both shaders
 * errors   MOSPT_EIO with the first lines of the driver's log */
bool rgl_program_create(const char *defines, const char *vertex, const char *fragment, GLuint *out,
                        mospt_err *err);

/* True if the context tells of the graphics driver's resets (glGetGraphicsResetStatusARB). */
bool rgl_program_sees_resets(void);

extern const char RGL_POINTS_VERTEX[], RGL_POINTS_FRAGMENT[];
extern const char RGL_SCREEN_VERTEX[], RGL_RESOLVE_FRAGMENT[], RGL_FILL_FRAGMENT[],
    RGL_BACKGROUND_FRAGMENT[], RGL_SHADE_FRAGMENT[], RGL_PRESENT_FRAGMENT[];
extern const char RGL_TEXT_VERTEX[], RGL_TEXT_FRAGMENT[];

#ifdef NDEBUG
#define GL(call) call
#else
/* Stops at our own mistakes. Calls that may run out of memory go without it: that is theirs to
 * handle, by glGetError(), which tells only once. */
void rgl_check(const char *call, const char *file, int line);
#define GL(call)                                                                                   \
    do {                                                                                           \
        call;                                                                                      \
        rgl_check(#call, __FILE__, __LINE__);                                                      \
    } while (0)
#endif
