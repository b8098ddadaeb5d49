#include "render/motion.h"

#include <math.h>

#define MOVING_S 0.2 /* a camera that has not been touched for so long rests */
#define AHEAD_S 0.5  /* how far the camera's motion is thought on */
#define TRAVEL_S 1.0 /* one that moved for longer is somewhere else */
#define FULLER 4     /* how many times as many points the next picture at rest has */

void rend_motion_init(rend_motion *m, double fps)
{
    *m = (rend_motion){0};
    rend_pace_init(&m->pace, fps);
}

void rend_motion_touch(rend_motion *m, double now)
{
    if (m->moved_at == 0) m->set_out_at = now;
    m->moved_at = now;
}

void rend_motion_restart(rend_motion *m)
{
    m->rest_points = 0;
}

bool rend_motion_settle(rend_motion *m, bool held, double now)
{
    held = held && now < m->moved_at + 3 * MOVING_S;
    if (m->moved_at == 0 || held || now < m->moved_at + MOVING_S) return false;
    if (m->moved_at > m->set_out_at + TRAVEL_S) m->rest_points = 0;
    m->moved_at = 0;
    return true;
}

double rend_motion_wait(const rend_motion *m, double now)
{
    return m->moved_at > 0 ? fmax(m->moved_at + MOVING_S - now, 0.001) : -1;
}

/* Pictures at rest have more and more points, so that the first one is there soon. After a small
 * movement they go on with as many as there were before it. */
static uint64_t rest_budget(rend_motion *m, uint64_t budget_points)
{
    uint64_t first = FULLER * rend_pace_points(&m->pace);
    if (m->rest_points < first) m->rest_points = first;
    return m->rest_points < budget_points ? m->rest_points : budget_points;
}

/* Where the camera will be if it moves on as it does; false while it rests. */
static bool think_ahead(rend_motion *m, bool moves, const rend_camera *camera, double now)
{
    double elapsed = now - m->drawn_at;
    bool known = moves && m->drawn_at > 0 && elapsed > 0 && elapsed < AHEAD_S;
    m->ahead = *camera;
    for (int a = 0; known && a < 3; a++) {
        m->ahead.eye[a] += (camera->eye[a] - m->drawn.eye[a]) * AHEAD_S / elapsed;
        m->ahead.target[a] += (camera->target[a] - m->drawn.target[a]) * AHEAD_S / elapsed;
    }
    m->drawn = *camera;
    m->drawn_at = moves ? now : 0;
    return known;
}

bool rend_motion_plan(rend_motion *m, bool whole, double now, rend_view_of *view,
                      rend_allowance *allowed)
{
    uint64_t fits = rend_pace_points(&m->pace);
    bool moves = m->moved_at > 0 && !whole, rests = !moves && !whole;
    *allowed = (rend_allowance){.points = fits, .upload_bytes = rend_pace_bytes(&m->pace)};
    if (think_ahead(m, moves, &view->camera, now)) allowed->ahead = &m->ahead;
    if (moves && view->budget_points > fits) view->budget_points = fits;
    if (rests) view->budget_points = rest_budget(m, view->budget_points);
    else allowed->points = 0;
    return rests;
}

bool rend_motion_grow(rend_motion *m, const rend_figures *figures, uint64_t budget_points)
{
    if (figures->pending > 0 || !figures->budget_spent) return false;
    if (m->rest_points >= budget_points) return false;
    m->rest_points = m->rest_points < REND_ALL / FULLER ? m->rest_points * FULLER : REND_ALL;
    return true;
}
