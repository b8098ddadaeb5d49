/* render/curve.h - the smooth curve through the keyframes of a camera path.
 *
 * The eye follows a centripetal Catmull-Rom spline (Yuksel, Schaefer and Keyser, Parameterization
 * and applications of Catmull-Rom curves, 2011), which has neither cusps nor loops between two
 * keyframes, evaluated by the pyramid of Barry and Goldman (SIGGRAPH 1988). The orientation goes
 * through the same pyramid with spherical interpolation of quaternions for the straight one
 * (Schlag, Graphics Gems II, 1991).
 *
 * Where on the curve the eye is at a time is a monotone cubic (Fritsch and Carlson, 1980) of the
 * length of the way: the speed never jumps, the eye never goes back, and it eases in and out at
 * both ends. Between keyframes that stand in one place the angle takes the place of the way; a
 * pause stays a pause. Field of view, distance of the target, budget and the sides of the clip box
 * are monotone cubics of time; where only one of two keyframes has a budget, a box or an end to one
 * of its sides, that of the first stays until the second.
 *
 * Where all keyframes have the same up direction and none looks along it, the horizon stays level.
 * Pure; the same keyframes give the same cameras. */
#pragma once
#include "render/path.h"

typedef struct rend_curve rend_curve;

/* What a keyframe says, at any time. */
typedef struct {
    rend_camera camera;
    uint64_t budget_points; /* 0: that of the recording; REND_ALL: no limit */
    const char *colour;     /* borrowed from the curve; NULL: that of the recording */
    bool has_clip;          /* without one, that of the recording */
    rend_box clip;
} rend_moment;

/* path     valid; not needed any more afterwards
 * errors   MOSPT_ENOMEM */
bool rend_curve_create(const rend_path *path, rend_curve **out, mospt_err *err);
void rend_curve_destroy(rend_curve *curve);

/* Before the first keyframe and after the last one the camera rests. */
void rend_curve_at(const rend_curve *curve, double time_s, rend_moment *out);

/* Metres that the eye has gone. */
double rend_curve_way(const rend_curve *curve, double time_s);
