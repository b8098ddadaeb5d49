/* tests/render_tools.h - what the tests of render/ share: made-up outer octrees, cameras, datasets
 * on disk. */
#pragma once
#include "render/camera.h"
#include "render/select.h"
#include "tests/core_tools.h"

/* A random outer octree with plausible level ends; owned, mospt_hierarchy_fini().
 * most     nodes, about */
void render_tree_make(const mospt_grid *grid, uint32_t inner_depth, uint32_t most, uint64_t seed,
                      mospt_hierarchy *out);

mospt_grid render_grid(uint32_t bits); /* in metres: a step is 2^-10 */

/* A random camera near, in or far from the root cube, looking roughly at it. */
rend_camera render_camera_random(const mospt_grid *grid, uint64_t *state);

void render_frame_make(const rend_camera *camera, const mospt_grid *grid,
                       rend_frame *out); /* 640 x 360 */

/* A small dataset in a folder of its own.
 * shift    added to the world coordinates of the points, whole steps */
typedef struct {
    char *folder, *path;
    mospt_dataset *dataset;
    core_site site;
} render_site;

void render_site_make(core_kind kind, uint32_t count, const int64_t shift[3], render_site *out);
/* Walls that make 8 x 8 closed rooms, 65.536 m all together, each as high as wide. */
void render_rooms_make(uint32_t count, render_site *out);
/* The first `count` points of render_site_make(CORE_CLUSTERED, count, ...), and as many again in
 * the upper half of x: below it, nodes stay as they were. */
void render_more_make(uint32_t count, render_site *out);
/* The points of render_site_make(CORE_CLUSTERED, count, ...) with one more attribute, "mark",
 * before their "tag". */
void render_marked_make(uint32_t count, render_site *out);
void render_site_fini(render_site *site);

/* Changes one byte of the first vertex of a node on disk. */
void render_site_damage(const render_site *site, uint32_t node);
