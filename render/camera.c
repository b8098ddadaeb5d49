#include "render/camera.h"

#include "render/outline.h"

#include <cglm/cglm.h>
#include <math.h>
#include <stdlib.h>

#define FOV_DEFAULT_RAD (60 * 3.14159265358979323846 / 180)
#define RAD_PER_DEG (3.14159265358979323846 / 180)

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross3(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static bool normalise3(double v[3])
{
    double length = sqrt(dot3(v, v));
    if (!(length > 0) || !isfinite(length)) return false;
    for (int a = 0; a < 3; a++)
        v[a] /= length;
    return true;
}

/* `up` projected off `back`; where they are parallel, the axis that is least so takes its place. */
static void axes_from(const double direction[3], const double up_wanted[3], double right[3],
                      double up[3], double back[3])
{
    for (int a = 0; a < 3; a++)
        back[a] = -direction[a];
    if (!normalise3(back)) back[0] = 0, back[1] = -1, back[2] = 0;
    double wanted[3] = {up_wanted[0], up_wanted[1], up_wanted[2]};
    if (!normalise3(wanted)) wanted[0] = 0, wanted[1] = 0, wanted[2] = 1;
    cross3(wanted, back, right);
    if (dot3(right, right) < 1e-12) {
        double other[3] = {0, fabs(back[1]) < 0.9 ? 1 : 0, fabs(back[1]) < 0.9 ? 0 : 1};
        cross3(other, back, right);
    }
    normalise3(right);
    cross3(back, right, up);
}

void rend_camera_axes(const rend_camera *camera, double right[3], double up[3], double back[3])
{
    double direction[3];
    for (int a = 0; a < 3; a++)
        direction[a] = camera->target[a] - camera->eye[a];
    axes_from(direction, camera->up, right, up, back);
}

/* A view from a fixed direction on a box, before it is moved to where all that is to be seen fits.
 */
typedef struct {
    double middle[3], half[3];
    double right[3], up[3], back[3];
    double tx, ty; /* tangents of half the field of view, less a margin */
} overview;

static void look_from_above(const double low[3], const double high[3], double aspect,
                            double fov_rad, overview *out)
{
    enum { MARGIN_PERCENT = 8 };
    double size = 0;
    for (int a = 0; a < 3; a++) {
        out->middle[a] = low[a] + 0.5 * (high[a] - low[a]);
        out->half[a] = 0.5 * (high[a] - low[a]);
        size = fmax(size, out->half[a]);
    }
    if (!(size > 0)) size = fmax(fabs(out->middle[0]), 1) * 1e-6;
    for (int a = 0; a < 3; a++)
        out->half[a] = fmax(out->half[a], 1e-3 * size);

    /* 34 degrees down, and a little across, so that two sides of every house show. */
    double turn = (out->half[1] > 1.3 * out->half[0] ? -160.0 : -110.0) * RAD_PER_DEG,
           pitch = 34 * RAD_PER_DEG;
    double direction[3] = {-cos(turn) * cos(pitch), -sin(turn) * cos(pitch), -sin(pitch)};
    double z_up[3] = {0, 0, 1};
    axes_from(direction, z_up, out->right, out->up, out->back);
    out->ty = tan(0.5 * fov_rad) * (1 - 0.01 * MARGIN_PERCENT);
    out->tx = out->ty * aspect;
}

/* How far a point, given from the middle of the box, pushes each side of the picture outwards. */
static void push_sides(const overview *o, const double p[3], double reach[4])
{
    double x = dot3(p, o->right), y = dot3(p, o->up), z = dot3(p, o->back);
    reach[0] = x + o->tx * z, reach[1] = -x + o->tx * z;
    reach[2] = y + o->ty * z, reach[3] = -y + o->ty * z;
}

/* The tightest view: the eye stands where the planes through the outermost points meet. All is
 * relative to the middle of the box, so that no digit is lost at UTM coordinates. */
static void stand_at(const overview *o, const double reach[4], double fov_rad, rend_camera *out)
{
    double ex = 0.5 * (reach[0] - reach[1]), ey = 0.5 * (reach[2] - reach[3]);
    double ez = fmax((reach[0] + reach[1]) / (2 * o->tx), (reach[2] + reach[3]) / (2 * o->ty));
    for (int a = 0; a < 3; a++) {
        double shift = o->right[a] * ex + o->up[a] * ey;
        out->eye[a] = o->middle[a] + shift + o->back[a] * ez;
        out->target[a] = o->middle[a] + shift;
        out->up[a] = a == 2;
    }
    out->fov_rad = fov_rad;
}

void rend_camera_overview(const double low[3], const double high[3], double aspect, double fov_rad,
                          rend_camera *out)
{
    overview o;
    double reach[4] = {-INFINITY, -INFINITY, -INFINITY, -INFINITY};
    look_from_above(low, high, aspect, fov_rad, &o);
    for (int corner = 0; corner < 8; corner++) {
        double p[3], pushed[4];
        for (int a = 0; a < 3; a++)
            p[a] = (corner >> a & 1) ? o.half[a] : -o.half[a];
        push_sides(&o, p, pushed);
        for (int side = 0; side < 4; side++)
            reach[side] = fmax(reach[side], pushed[side]);
    }
    stand_at(&o, reach, fov_rad, out);
}

static int compare_reals(const void *a, const void *b)
{
    double m = *(const double *)a, n = *(const double *)b;
    return m < n ? -1 : m > n;
}

/* A box is mostly empty; what is to fill the picture is the points. One in a thousand may fall
 * outside. */
static bool fit_to_points(const rend_outline *site, double aspect, double fov_rad, rend_camera *out,
                          mospt_err *err)
{
    enum { STRAYS = 1000 };
    const uint32_t n = site->count;
    double *pushed = malloc(4 * (size_t)n * sizeof *pushed), reach[4];
    if (pushed == NULL) return mospt_err_nomem(err, 4 * (size_t)n * sizeof *pushed);
    overview o;
    look_from_above(site->low, site->high, aspect, fov_rad, &o);
    for (uint32_t i = 0; i < n; i++) {
        double sides[4];
        push_sides(&o, site->at[i], sides);
        for (uint32_t side = 0; side < 4; side++)
            pushed[side * n + i] = sides[side];
    }
    for (uint32_t side = 0; side < 4; side++) {
        double *of_side = pushed + (size_t)side * n;
        qsort(of_side, n, sizeof *of_side, compare_reals);
        reach[side] = of_side[n - 1 - n / STRAYS];
    }
    free(pushed);
    /* Points that all lie on one line of sight fill no picture. */
    if (fmax(reach[0] + reach[1], reach[2] + reach[3]) >
        1e-3 * fmax(o.half[0], fmax(o.half[1], o.half[2])))
        stand_at(&o, reach, fov_rad, out);
    else rend_camera_overview(site->low, site->high, aspect, fov_rad, out);
    return true;
}

static bool finite3(const double v[3])
{
    return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
}

/* Puts what is given over the overview. An eye without a target keeps looking at the middle of the
 * site; a target without an eye keeps the overview's direction and distance. */
static void override(const rend_camera_options *options, const double middle[3],
                     rend_camera *camera)
{
    for (int a = 0; a < 3; a++) {
        double away = camera->eye[a] - camera->target[a];
        if (options->has_eye) {
            camera->eye[a] = options->eye[a];
            camera->target[a] = options->has_target ? options->target[a] : middle[a];
        } else if (options->has_target) {
            camera->target[a] = options->target[a];
            camera->eye[a] = options->target[a] + away;
        }
        if (options->has_up) camera->up[a] = options->up[a];
    }
}

bool rend_camera_make(const rend_camera_options *options, const mospt_dataset *dataset,
                      uint32_t width, uint32_t height, rend_camera *out, mospt_err *err)
{
    if ((options->has_eye && !finite3(options->eye)) ||
        (options->has_target && !finite3(options->target)) ||
        (options->has_up && !finite3(options->up)))
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "eye, target and up must be finite numbers");
    if (options->has_up && !(dot3(options->up, options->up) > 0))
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(), "the up direction is zero");
    if (options->has_fov && !(options->fov_deg >= 1 && options->fov_deg <= 170))
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "a field of view of %g degrees is not between 1 and 170",
                             options->fov_deg);
    rend_camera camera;
    rend_outline site;
    if (!rend_outline_make(dataset, &site, err)) return false;
    double fov_rad = options->has_fov ? options->fov_deg * RAD_PER_DEG : FOV_DEFAULT_RAD;
    bool ok = fit_to_points(&site, (double)width / height, fov_rad, &camera, err);
    if (ok) override(options, site.middle, &camera);
    rend_outline_fini(&site);
    if (!ok) return false;
    if (camera.eye[0] == camera.target[0] && camera.eye[1] == camera.target[1] &&
        camera.eye[2] == camera.target[2])
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "the eye is on its target, %g %g %g", camera.eye[0], camera.eye[1],
                             camera.eye[2]);
    *out = camera;
    return true;
}

void rend_frame_bounds(const mospt_dataset *dataset, uint32_t low[3], uint32_t high[3])
{
    const mospt_grid *grid = &dataset->metadata.grid;
    if (mospt_grid_from_world(grid, dataset->metadata.low, low) &&
        mospt_grid_from_world(grid, dataset->metadata.high, high) && low[0] <= high[0] &&
        low[1] <= high[1] && low[2] <= high[2])
        return;
    for (int a = 0; a < 3; a++) {
        low[a] = grid->root[a];
        high[a] = (uint32_t)(grid->root[a] + (mospt_cell_width(grid, 0) - 1));
    }
}

/* A world position in steps, on the lattice that the header promises. */
static void to_lattice(const mospt_grid *grid, const double world[3], double out[3])
{
    double lattice = ldexp(1, (int)grid->bits - 28);
    for (int a = 0; a < 3; a++) {
        double steps = (world[a] - grid->offset[a]) / grid->step - (double)grid->base[a];
        out[a] = nearbyint(steps / lattice) * lattice;
    }
}

static void set_planes(rend_frame *f)
{
    /* Normals in eye axes; the last one is the view direction. Grid axes are the rows of R's
     * transpose. */
    float tx = f->tan_half[0], ty = f->tan_half[1];
    float nx = 1 / sqrtf(1 + tx * tx), ny = 1 / sqrtf(1 + ty * ty);
    float normal[5][3] = {
        {nx, 0, -tx * nx}, {-nx, 0, -tx * nx}, {0, ny, -ty * ny}, {0, -ny, -ty * ny}, {0, 0, -1}};
    for (int p = 0; p < 5; p++) {
        f->plane_reach[p] = 0;
        for (int a = 0; a < 3; a++) {
            const float *column = f->rotation + 3 * a;
            f->plane[p][a] =
                column[0] * normal[p][0] + column[1] * normal[p][1] + column[2] * normal[p][2];
            f->plane_reach[p] += fabsf(f->plane[p][a]);
        }
    }
}

/* Near is a ten-millionth of far at least: beyond that, a float's depth would have nothing to say.
 */
static void set_range(rend_frame *f, const uint32_t low[3], const uint32_t high[3])
{
    double nearest = INFINITY, farthest = -INFINITY;
    for (int corner = 0; corner < 8; corner++) {
        double w = 0;
        for (int a = 0; a < 3; a++)
            w += f->plane[4][a] * ((double)((corner >> a & 1) ? high[a] : low[a]) - f->eye[a]);
        nearest = fmin(nearest, w), farthest = fmax(farthest, w);
    }
    farthest = fmax(farthest * 1.001 + 1, 2);
    f->far_w = (float)farthest;
    f->near_w = (float)fmax(nearest * 0.999 - 1, fmax(farthest * 1e-7, 1e-3));
}

void rend_frame_make(const rend_camera *camera, const mospt_grid *grid, const uint32_t low[3],
                     const uint32_t high[3], uint32_t width, uint32_t height, rend_frame *out)
{
    rend_frame f = {.width = width, .height = height};
    double target[3], direction[3], right[3], up[3], back[3];
    to_lattice(grid, camera->eye, f.eye);
    to_lattice(grid, camera->target, target);
    for (int a = 0; a < 3; a++) {
        direction[a] = target[a] - f.eye[a];
        double nearest = fmin(fmax(nearbyint(f.eye[a]), 0), UINT32_MAX);
        f.anchor[a] = (uint32_t)nearest;
        f.offset[a] = (float)(nearest - f.eye[a]);
    }
    axes_from(direction, camera->up, right, up, back);
    mat3 rotation;
    for (int a = 0; a < 3; a++) {
        rotation[a][0] = (float)right[a];
        rotation[a][1] = (float)up[a];
        rotation[a][2] = (float)back[a];
    }
    memcpy(f.rotation, rotation, sizeof f.rotation);
    f.tan_half[1] = (float)tan(0.5 * camera->fov_rad);
    f.tan_half[0] = f.tan_half[1] * (float)width / (float)height;
    f.focal_px = 0.5f * (float)height / f.tan_half[1];
    f.corner_cos = 1 / sqrtf(1 + f.tan_half[0] * f.tan_half[0] + f.tan_half[1] * f.tan_half[1]);
    set_planes(&f);
    set_range(&f, low, high);
    *out = f;
}

float rend_frame_depth_to_w(const rend_frame *frame, float depth)
{
    return frame->near_w * powf(frame->far_w / frame->near_w, depth);
}
