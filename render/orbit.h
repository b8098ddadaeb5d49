/* render/orbit.h - how hands move a camera. Pure; axes as in render/camera.h. */
#pragma once
#include "render/camera.h"

/* Turns eye and target about a point: `yaw` about the up direction (positive: the site turns to the
 * right), `pitch` about the eye's right (positive: the eye rises). The view never passes straight
 * up or down, where yaw would lose its meaning. */
void rend_orbit_turn(rend_camera *camera, const double pivot[3], double yaw_rad, double pitch_rad);

/* Moves the camera in its own plane so that what is at distance w (metres along the view axis)
 * follows the cursor.
 * dx, dy   pixels, right and down */
void rend_orbit_pan(rend_camera *camera, double dx, double dy, double w, uint32_t height);

/* Scales the distance to a point, which stays where it is on screen.
 * factor   < 1 is nearer
 * nearest  the eye comes no nearer to its target than this, metres */
void rend_orbit_zoom(rend_camera *camera, const double towards[3], double factor, double nearest);

/* Moves eye and target along the eye's axes, metres: right, up, forward. Up is the world's. */
void rend_orbit_fly(rend_camera *camera, const double by[3]);

double rend_orbit_distance(const rend_camera *camera);

/* World position of a pixel at distance w along the view axis.
 * x, y     pixels from the top left, the middle of a pixel at .5 */
void rend_orbit_unproject(const rend_camera *camera, double x, double y, double w, uint32_t width,
                          uint32_t height, double out[3]);
