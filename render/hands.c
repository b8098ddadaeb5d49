#include "render/hands.h"

#include "render/orbit.h"

#include <math.h>
#include <string.h>

#define FLY_DISTANCES_PER_S 0.6 /* of the distance to the target */
#define FLY_FASTER 4
#define FLY_FIRST_S 0.016 /* what the first frame of a flight is taken for */
#define FLY_LONGEST_S 0.25
#define ZOOM_PER_STEP 0.85
#define RAD_PER_DEG (3.14159265358979323846 / 180)
#define FOV_MIN_RAD (5 * RAD_PER_DEG)
#define FOV_MAX_RAD (120 * RAD_PER_DEG)
#define TURN_RAD_PER_PX 0.006 /* at 720 lines: half a turn for three quarters of the height */

void rend_hands_grip(rend_hands *hands, bool pan, const rend_spot *spot, const rend_camera *camera)
{
    hands->drag = pan ? REND_DRAG_PAN : REND_DRAG_ORBIT;
    hands->grip_w = spot->w;
    memcpy(hands->pivot, spot->is_point ? spot->at : camera->target, sizeof hands->pivot);
}

void rend_hands_release(rend_hands *hands)
{
    hands->drag = REND_DRAG_NONE;
}

bool rend_hands_move(rend_hands *hands, double x, double y, uint32_t height, rend_camera *camera)
{
    double dx = x - hands->cursor[0], dy = y - hands->cursor[1];
    double turn = TURN_RAD_PER_PX * 720 / height;
    if (hands->drag == REND_DRAG_ORBIT) rend_orbit_turn(camera, hands->pivot, dx * turn, dy * turn);
    if (hands->drag == REND_DRAG_PAN) rend_orbit_pan(camera, dx, dy, hands->grip_w, height);
    hands->cursor[0] = x, hands->cursor[1] = y;
    return hands->drag != REND_DRAG_NONE;
}

void rend_hands_zoom(double steps, const rend_spot *spot, double nearest, rend_camera *camera)
{
    rend_orbit_zoom(camera, spot->at, pow(ZOOM_PER_STEP, steps), nearest);
}

bool rend_hands_fly(rend_hands *hands, const int held[3], bool fast, double now, double nearest,
                    rend_camera *camera)
{
    double by[3], elapsed = FLY_FIRST_S;
    if (hands->flown_at > 0) elapsed = fmin(now - hands->flown_at, FLY_LONGEST_S);
    bool flies = held[0] != 0 || held[1] != 0 || held[2] != 0;
    hands->flown_at = flies ? now : 0;
    if (!flies) return false;
    double speed = FLY_DISTANCES_PER_S * fmax(rend_orbit_distance(camera), nearest);
    if (fast) speed *= FLY_FASTER;
    for (int a = 0; a < 3; a++)
        by[a] = held[a] * (speed * elapsed);
    rend_orbit_fly(camera, by);
    return true;
}

double rend_hands_lens(double factor, rend_camera *camera)
{
    camera->fov_rad = fmin(fmax(camera->fov_rad * factor, FOV_MIN_RAD), FOV_MAX_RAD);
    return camera->fov_rad / RAD_PER_DEG;
}
