/* render/hands.h - what the hands do with a camera: they drag, turn the wheel, hold keys to fly and
 * change the lens.
 *
 * Pure: knows no window, no clock and no points; what is under the cursor, whoever has the picture
 * says. `nearest` is how near the eye comes to its target, metres.
 * threads  one */
#pragma once
#include "render/camera.h"

/* What is under the cursor. */
typedef struct {
    bool is_point; /* false: empty space, taken to be as far away as the target */
    double w;      /* metres along the view axis */
    double at[3];  /* world */
} rend_spot;

/* {0}: nothing is held. */
typedef struct {
    enum { REND_DRAG_NONE, REND_DRAG_ORBIT, REND_DRAG_PAN } drag;
    double cursor[2];        /* pixels of the picture from the top left */
    double pivot[3], grip_w; /* of the drag; metres */
    double flown_at;         /* seconds; 0: not flying */
} rend_hands;

/* A drag begins: around the point under the cursor, else around the target; or with it.
 * pan      instead of to orbit */
void rend_hands_grip(rend_hands *hands, bool pan, const rend_spot *spot, const rend_camera *camera);
void rend_hands_release(rend_hands *hands);

/* The cursor is elsewhere; true if it has dragged the camera along.
 * height   of the picture, pixels */
bool rend_hands_move(rend_hands *hands, double x, double y, uint32_t height, rend_camera *camera);

/* The wheel: what is under the cursor stays there.
 * steps    away from the hand, which is nearer */
void rend_hands_zoom(double steps, const rend_spot *spot, double nearest, rend_camera *camera);

/* Keys that are held fly, the faster the farther away the target is, which flies along; true if the
 * camera has moved.
 * held     right, up, forward: each -1, 0 or 1
 * now      seconds, > 0 */
bool rend_hands_fly(rend_hands *hands, const int held[3], bool fast, double now, double nearest,
                    rend_camera *camera);

/* Scales the field of view as far as a lens goes; returns what it is now, degrees. */
double rend_hands_lens(double factor, rend_camera *camera);
