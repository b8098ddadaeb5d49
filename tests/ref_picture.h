/* tests/ref_picture.h - the slow, obvious twin of a picture: every point of a dataset, projected in
 * doubles, one pixel each. */
#pragma once
#include "mospt/dataset.h"
#include "render/camera.h"

/* Says which pixels have a point in them.
 * clip     points outside are left out; NULL: none
 * covered  [width * height] 0 or 1, top row first */
void ref_picture_cover(const mospt_dataset *dataset, const rend_camera *camera,
                       const rend_box *clip, uint32_t width, uint32_t height, uint8_t *covered);
