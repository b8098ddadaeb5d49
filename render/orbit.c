#include "render/orbit.h"

#include <math.h>

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Rodrigues: v about the unit axis k. */
static void rotate(double v[3], const double k[3], double angle)
{
    double c = cos(angle), s = sin(angle), along = dot3(k, v) * (1 - c);
    double cross[3] = {k[1] * v[2] - k[2] * v[1], k[2] * v[0] - k[0] * v[2],
                       k[0] * v[1] - k[1] * v[0]};
    for (int a = 0; a < 3; a++)
        v[a] = v[a] * c + cross[a] * s + k[a] * along;
}

static void unit_up(const rend_camera *camera, double up[3])
{
    double length = sqrt(dot3(camera->up, camera->up));
    for (int a = 0; a < 3; a++)
        up[a] = length > 0 ? camera->up[a] / length : a == 2;
}

void rend_orbit_turn(rend_camera *camera, const double pivot[3], double yaw_rad, double pitch_rad)
{
    const double margin = 0.02; /* a degree from straight up and down */
    double right[3], eye_up[3], back[3], up[3];
    rend_camera_axes(camera, right, eye_up, back);
    unit_up(camera, up);
    double height = asin(fmin(fmax(dot3(back, up), -1), 1)), limit = acos(-1) / 2 - margin;
    pitch_rad = fmin(fmax(pitch_rad, fmin(-limit - height, 0)), fmax(limit - height, 0));
    for (int end = 0; end < 2; end++) {
        double *point = end == 0 ? camera->eye : camera->target, arm[3];
        for (int a = 0; a < 3; a++)
            arm[a] = point[a] - pivot[a];
        rotate(arm, right, -pitch_rad);
        rotate(arm, up, -yaw_rad);
        for (int a = 0; a < 3; a++)
            point[a] = pivot[a] + arm[a];
    }
}

static void move(rend_camera *camera, const double by[3])
{
    for (int a = 0; a < 3; a++)
        camera->eye[a] += by[a], camera->target[a] += by[a];
}

void rend_orbit_pan(rend_camera *camera, double dx, double dy, double w, uint32_t height)
{
    double right[3], up[3], back[3], by[3];
    double per_px = 2 * w * tan(0.5 * camera->fov_rad) / height;
    rend_camera_axes(camera, right, up, back);
    for (int a = 0; a < 3; a++)
        by[a] = per_px * (up[a] * dy - right[a] * dx);
    move(camera, by);
}

void rend_orbit_zoom(rend_camera *camera, const double towards[3], double factor, double nearest)
{
    double distance = rend_orbit_distance(camera);
    if (factor < 1 && distance * factor < nearest) factor = fmin(1, nearest / distance);
    for (int a = 0; a < 3; a++) {
        camera->eye[a] = towards[a] + (camera->eye[a] - towards[a]) * factor;
        camera->target[a] = towards[a] + (camera->target[a] - towards[a]) * factor;
    }
}

void rend_orbit_fly(rend_camera *camera, const double by[3])
{
    double right[3], eye_up[3], back[3], up[3], sum[3];
    rend_camera_axes(camera, right, eye_up, back);
    unit_up(camera, up);
    for (int a = 0; a < 3; a++)
        sum[a] = right[a] * by[0] + up[a] * by[1] - back[a] * by[2];
    move(camera, sum);
}

double rend_orbit_distance(const rend_camera *camera)
{
    double d[3];
    for (int a = 0; a < 3; a++)
        d[a] = camera->target[a] - camera->eye[a];
    return sqrt(dot3(d, d));
}

void rend_orbit_unproject(const rend_camera *camera, double x, double y, double w, uint32_t width,
                          uint32_t height, double out[3])
{
    double right[3], up[3], back[3], tan_half = tan(0.5 * camera->fov_rad);
    rend_camera_axes(camera, right, up, back);
    double rx = (2 * x / width - 1) * tan_half * width / height * w,
           ry = (1 - 2 * y / height) * tan_half * w;
    for (int a = 0; a < 3; a++)
        out[a] = camera->eye[a] + right[a] * rx + up[a] * ry - back[a] * w;
}
