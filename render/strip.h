/* render/strip.h - the strip of keyframes at the lower edge of a window: a camera path in the
 * making.
 *
 *   T        takes a keyframe where the camera is; with shift it replaces the chosen one
 *   N        chooses the next one, with shift the one before, and looks through it; a click on its
 *            mark does too
 *   < >      move the chosen one half a second; so does dragging its mark
 *   X        deletes the chosen one
 *   J        plays the path from the chosen one on, and stops it
 *
 * Every change is saved at once. Knows no window and no clock.
 * threads  one */
#pragma once
#include "render/curve.h"
#include "render/gl/text.h"

enum { REND_STRIP_NONE = -1, REND_STRIP_NOTICE = 1200 };

typedef struct {
    rend_path path;
    char *file;     /* owned */
    int32_t chosen; /* index, or REND_STRIP_NONE */
    bool shown;
    bool dragging;
    rend_curve *playing; /* NULL: not playing */
    double played_from_s, started_s;
    char notice[REND_STRIP_NOTICE]; /* what just happened; the owner takes it and empties it */
} rend_strip;

/* file     is read if it is there, and written with every change; NULL: walk.json, not read
 * errors   MOSPT_EFORMAT, MOSPT_EIO, MOSPT_ENOMEM */
bool rend_strip_init(const char *file, rend_strip *out, mospt_err *err);
void rend_strip_fini(rend_strip *strip);

/* A key was pressed; false if it is none of the strip's.
 * now      in: a keyframe of what is seen, its time does not matter; out: what is to be seen */
bool rend_strip_press(rend_strip *strip, int key, bool shift, double seconds, rend_key *now);

/* The mouse, in pixels of the picture; each returns true if the strip takes it.
 * now      as above */
bool rend_strip_grip(rend_strip *strip, double x, double y, uint32_t width, uint32_t height,
                     float line, rend_key *now);
bool rend_strip_drag(rend_strip *strip, double x, uint32_t width);
void rend_strip_release(rend_strip *strip);

/* While the path plays, what is to be seen; false when it does not. */
bool rend_strip_play(rend_strip *strip, double seconds, rend_moment *out);

/* Over the picture that was drawn last. */
bool rend_strip_draw(const rend_strip *strip, rgl_text *text, uint32_t width, uint32_t height,
                     mospt_err *err);
