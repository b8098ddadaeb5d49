/* render/panorama.h - the view all around from six square pictures.
 *
 * A cube stands around the eye: forward, right, back, left, up, down. Its faces are drawn a little
 * wider than 90 degrees, so that what happens at the edge of a picture (eye-dome lighting looks at
 * neighbours) stays outside. The panorama is equirectangular: the middle column is forward, the
 * middle row the horizon. Pure. */
#pragma once
#include "render/camera.h"

enum { REND_FACES = 6 };

typedef struct {
    uint32_t width, height; /* of the panorama, pixels */
    uint32_t face;          /* pixels along the side of a face, its margin included */
    uint32_t *offsets;      /* [width * height] of the pixel above and left, in a column of faces */
    uint8_t (*shares)[2];   /* [width * height] of the next column and row, in 256ths */
} rend_panorama;

/* out      rend_panorama_fini() */
bool rend_panorama_init(uint32_t width, uint32_t height, rend_panorama *out, mospt_err *err);
void rend_panorama_fini(rend_panorama *panorama);

/* The camera of a face. Up stays the way it is: where the camera looks is forward only as far as it
 * is level. */
void rend_panorama_camera(const rend_panorama *panorama, const rend_camera *camera, uint32_t face,
                          rend_camera *out);

/* Pixel `i` of the panorama.
 * faces    [face * 6 * face * 3], one below the other
 * rgb      out: in 256 * 256ths of what is in `faces` */
void rend_panorama_sample(const rend_panorama *panorama, const uint32_t *faces, size_t i,
                          uint64_t rgb[3]);
