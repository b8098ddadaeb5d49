/* render/gl/window.h - a window with an OpenGL context, and what happens to it, in plain structs.
 * threads  the main one, but for rgl_window_wake() */
#pragma once
#include "mospt/err.h"

typedef struct rgl_window rgl_window;

/* Letters are their capitals, other typed characters are themselves. */
enum {
    RGL_KEY_ESCAPE = 256,
    RGL_KEY_F1,
    RGL_KEY_SHIFT,
    RGL_KEY_LEFT,
    RGL_KEY_RIGHT,
    RGL_KEY_UP,
    RGL_KEY_DOWN
};

typedef enum { RGL_BUTTON_LEFT, RGL_BUTTON_RIGHT, RGL_BUTTON_MIDDLE } rgl_button;

typedef struct {
    enum {
        RGL_EVENT_KEY,
        RGL_EVENT_BUTTON,
        RGL_EVENT_MOVE,
        RGL_EVENT_SCROLL,
        RGL_EVENT_REFRESH,
        RGL_EVENT_CLOSE
    } kind;
    int key; /* RGL_EVENT_KEY, on its way down */
    bool shift, control;
    rgl_button button; /* RGL_EVENT_BUTTON */
    bool down;
    double x, y; /* cursor, pixels of the picture from the top left; for RGL_EVENT_SCROLL `dy` steps
                    away from the hand */
    double dy;
} rgl_event;

/* Opens a window and makes its context current.
 * errors   MOSPT_EINVAL: no display, no OpenGL 3.3 */
bool rgl_window_create(const char *title, uint32_t width, uint32_t height, rgl_window **out,
                       mospt_err *err);
void rgl_window_destroy(rgl_window *window);

/* Opens another window in the place of this one, whose context is lost, and makes the new context
 * current.
 * errors   MOSPT_EINVAL: none can be opened; the one before is still there */
bool rgl_window_renew(rgl_window *window, mospt_err *err);

/* Waits for something to happen: 0 looks only, below 0 waits for ever. */
void rgl_window_wait(rgl_window *window, double seconds);

/* Ends a wait. threads: any. */
void rgl_window_wake(void *window);

/* The next thing that happened; false if there is none. */
bool rgl_window_next(rgl_window *window, rgl_event *out);

bool rgl_window_is_down(const rgl_window *window,
                        int key); /* a letter, or RGL_KEY_SHIFT and the arrows */
void rgl_window_size(const rgl_window *window, uint32_t *width,
                     uint32_t *height); /* pixels; 0 while it is iconified */
float rgl_window_scale(
    const rgl_window *window);            /* pixels for what is one pixel on a common screen */
void rgl_window_show(rgl_window *window); /* puts the back buffer on the screen */
void rgl_window_toggle_fullscreen(rgl_window *window);
double rgl_window_seconds(void); /* monotonic */
