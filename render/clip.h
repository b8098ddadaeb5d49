/* render/clip.h - the part of a site that is shown: a box along the axes of the world.
 *
 * Whether a point is inside is decided in grid integers, by whoever draws it (render/gl/rgl.h): the
 * same points are shown from everywhere, with every level of detail, on every machine. */
#pragma once
#include "mospt/grid.h"
#include "render/options.h"

/* Grid coordinates, both ends inside; with low above high on any axis it holds nothing. */
typedef struct {
    uint32_t low[3], high[3];
} rend_clip;

/* The grid coordinates that lie in a box. A face within a thousandth of a step of a coordinate
 * passes through it, so that coordinates as a scan gives them are inside of their own box. */
void rend_clip_make(const mospt_grid *grid, const rend_box *box, rend_clip *out);

/* A box with all its sides open. */
rend_box rend_clip_open(void);

/* Moves the side of a box that faces the eye to a place: what stood in front of it is cut away.
 * back     from the view towards the eye, any length */
void rend_clip_cut(const double back[3], const double place[3], rend_box *box);

/* True if no point of a cube can be inside.
 * width    in steps */
bool rend_clip_misses(const rend_clip *clip, const uint32_t corner[3], uint64_t width);
