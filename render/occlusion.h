/* render/occlusion.h - which nodes are hidden behind what has been drawn.
 *
 * Gobbetti and Marton 2004, section 4, ask the graphics hardware about each node, and see the
 * answers a frame later. Here the depths of a picture are read back once and made into a pyramid,
 * so that the selection can ask before it spends points on a node, or has it read from the disk.
 *
 * A wall of points has gaps, and a tree is nearly a wall: a tile of 4 x 4 pixels is as far away as
 * the sixth of its pixels when they are sorted by depth. So what covers less of it hides nothing,
 * and what covers more closes it: of a wall with a tenth of gaps every tile does, of a tree with
 * half of them one tile in ten does not, and a node covers a hundred tiles. Where points are no
 * wider for being far from each other, gaps are part of the picture, and what is seen through one
 * surface and another closes nothing: there twelve of the pixels count. Each tile then takes
 * the farthest depth of itself and its neighbours, so that nothing hides beyond its own silhouette.
 * Above that, a tile is the farthest of four.
 *
 * A cube is hidden if its nearest corner is clearly behind every tile that it covers. Depths may be
 * those of another view, such as the frame before: the cube is then looked at from there, grown by
 * as much as things in front of it may have moved aside on the screen since; and what that view did
 * not see at all is never hidden. What such a guess hides wrongly appears when the depths are those
 * of the view itself.
 *
 * Pure: the same depths give the same answers.
 * threads  one */
#pragma once
#include "render/camera.h"

typedef struct rend_occlusion rend_occlusion;

/* NULL without memory. Hides nothing before it has learnt something. */
rend_occlusion *rend_occlusion_create(void);
void rend_occlusion_destroy(rend_occlusion *occlusion);

/* Where the depths of a picture are to be put: [width * height], top row first; NULL without
 * memory. */
float *rend_occlusion_depths(rend_occlusion *occlusion, uint32_t width, uint32_t height);

/* Makes the pyramid of the depths that were put there.
 * frame    that they are of
 * is_open  gaps between the points are to be seen through */
void rend_occlusion_learn(rend_occlusion *occlusion, const rend_frame *frame, bool is_open);

/* Hides nothing until it learns again. */
void rend_occlusion_forget(rend_occlusion *occlusion);

/* Says from which view will be asked; false if answers will be guesses, because another one was
 * learnt. */
bool rend_occlusion_aim(rend_occlusion *occlusion, const rend_frame *frame);

/* True if the cube is hidden.
 * corner   lowest, grid coordinates
 * width    steps */
bool rend_occlusion_hides(const rend_occlusion *occlusion, const uint32_t corner[3],
                          uint64_t width);
