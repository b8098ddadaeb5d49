/* render/motion.h - a camera that is moved and comes to rest, and how much of the point budget the
 * frames draw meanwhile.
 *
 * While it moves, a frame is as much as fits into its time. At rest pictures of more and more
 * points follow, each drawn over as many frames as it takes, up to the budget. Pure: knows no
 * clock; `now` is in seconds, and above 0.
 * threads  one */
#pragma once
#include "render/live.h"
#include "render/pace.h"

typedef struct {
    rend_pace pace;
    double moved_at;      /* 0: the camera rests */
    double set_out_at;    /* since when it has moved */
    rend_camera drawn;    /* in the frame before, while the camera moved */
    double drawn_at;      /* 0: it rested */
    rend_camera ahead;    /* where it will be shortly */
    uint64_t rest_points; /* budget of the pictures at rest, which grows with each; 0: not begun */
} rend_motion;

/* fps      frames a second that are aimed at while the camera moves, > 0 */
void rend_motion_init(rend_motion *motion, double fps);

/* The camera has been moved. */
void rend_motion_touch(rend_motion *motion, double now);

/* Pictures at rest begin anew, with few points. */
void rend_motion_restart(rend_motion *motion);

/* True if the camera has just come to rest: fuller pictures are owed.
 * held     by a hand, which perhaps goes on with it */
bool rend_motion_settle(rend_motion *motion, bool held, double now);

/* Seconds until it may come to rest, > 0; below 0 if it rests. */
double rend_motion_wait(const rend_motion *motion, double now);

/* What the next frame may draw.
 * whole    it is the last one: nothing is held back
 * view     in: what is to be seen; its budget becomes that of the frame
 * allowed  out: `ahead` is borrowed from the motion
 * returns  true if it belongs to a picture at rest, which rend_motion_grow() can follow */
bool rend_motion_plan(rend_motion *motion, bool whole, double now, rend_view_of *view,
                      rend_allowance *allowed);

/* True if the picture at rest, which is done, can be followed by a fuller one.
 * figures  of the picture */
bool rend_motion_grow(rend_motion *motion, const rend_figures *figures, uint64_t budget_points);
