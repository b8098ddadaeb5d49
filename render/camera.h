/* render/camera.h - where the eye is, and the one page about axes, handedness and matrices.
 *
 * World      right-handed, z up unless the user says otherwise, double metres (or the unit of the
 *            scans).
 * Grid       the axes of the world, counted in steps from grid coordinate (0, 0, 0); see
 *            mospt/grid.h.
 * Eye space  right-handed: x right, y up, the eye looks along -z. Its unit is one grid step, its
 *            origin the eye.
 * Matrices   column-major, for column vectors, as cglm and GL have them: v_eye = R v_grid.
 *
 * A large coordinate never becomes a float. A frame holds the eye in steps as a double, and an
 * anchor: the grid position nearest to it. A vertex is reduced by the anchor in integers; `offset`
 * takes it from there to the eye.
 *
 * The eye is put on a lattice that is 2^-28 of the root cube fine (half a micrometre for a hall of
 * 128 m), so that the last bits of a double at UTM coordinates do not show: a site gives the same
 * picture, bit for bit, wherever it stands.
 *
 * Depth is logarithmic in the distance w along the view axis. A point is a square that faces the
 * eye, so its depth is the same all over and the vertex shader may choose it freely: no
 * glClipControl is needed, and one range from near to far serves a chapel and a 10 km corridor,
 * with a relative precision of 1e-6 everywhere. */
#pragma once
#include "mospt/dataset.h"
#include "render/options.h"

typedef struct {
    double eye[3], target[3], up[3]; /* world; up need not be perpendicular, only not parallel */
    double fov_rad;                  /* vertical */
} rend_camera;

/* A camera at one frame. */
typedef struct {
    uint32_t width, height; /* pixels */
    double eye[3];          /* steps */
    uint32_t anchor[3];     /* grid coordinates */
    float offset[3];        /* anchor minus eye, steps */
    float rotation[9];      /* column-major 3x3, grid axes to eye axes */
    float plane[5][3];      /* inward normals, grid axes, of left, right, bottom, top, and the view
                               direction */
    float plane_reach[5];   /* |x| + |y| + |z| of each: how far half a cube of width 2 reaches along
                               it */
    float focal_px;         /* width in pixels of what is one unit wide at a distance of one unit */
    float tan_half[2];      /* of half the horizontal and vertical field of view */
    float corner_cos;       /* cosine between the view axis and the picture's corner */
    float near_w, far_w; /* steps along the view axis; everything in the dataset's bounds is nearer
                            than far_w */
} rend_frame;

/* Looks at all of a box from above and the south (or the west, for a box that is longer that way),
 * so that it fills the picture. Flat, linear and single-point boxes are fine. */
void rend_camera_overview(const double low[3], const double high[3], double aspect, double fov_rad,
                          rend_camera *out);

/* The camera that the options ask for.
 * errors   MOSPT_EINVAL: not finite, eye on the target, a field of view out of range */
bool rend_camera_make(const rend_camera_options *options, const mospt_dataset *dataset,
                      uint32_t width, uint32_t height, rend_camera *out, mospt_err *err);

/* Unit axes of the eye in the world: right, up, back. */
void rend_camera_axes(const rend_camera *camera, double right[3], double up[3], double back[3]);

/* Prepares a frame.
 * low, high   grid coordinates of the bounds of all points */
void rend_frame_make(const rend_camera *camera, const mospt_grid *grid, const uint32_t low[3],
                     const uint32_t high[3], uint32_t width, uint32_t height, rend_frame *out);

/* Grid bounds of a dataset's points; the root cube if metadata.json's bounds are not inside it. */
void rend_frame_bounds(const mospt_dataset *dataset, uint32_t low[3], uint32_t high[3]);

/* Distance along the view axis, steps, of a depth between 0 (near) and 1 (far). */
float rend_frame_depth_to_w(const rend_frame *frame, float depth);
