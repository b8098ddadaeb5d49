/* tests/ref_raster.h - the slow, obvious twin of drawing points: section 1 of render/gl/rgl.h, in
 * doubles, point by point and pixel by pixel. */
#pragma once
#include "render/gl/rgl.h"

/* Draws all points; no blending, filling, lighting or background.
 * rgb      [width * height * 3] black where there is nothing, top row first
 * w        [width * height] distances of what is nearest; infinite where there is nothing */
void ref_raster_draw(const rgl_scene *scene, rgl_shape shape, const mospt_vertex *vertices,
                     uint32_t count, uint8_t *rgb, double *w);
