/* render/shot.h - one picture of a dataset, without a display.
 *
 * The same dataset and options give the same picture, byte for byte, on the same graphics driver,
 * or on any processor, whatever the cache sizes and the number of threads. */
#pragma once
#include "mospt/dataset.h"
#include "render/options.h"

typedef struct {
    const char *path;       /* of the PNG */
    uint32_t width, height; /* pixels; 0: 1280 x 720 */
    rend_camera_options camera;
    rend_look look;
    bool legend;        /* what the colours mean, in the picture */
    rend_limits limits; /* budget_points 0: all */
    rend_engine_options engine;
} rend_shot_options;

typedef struct {
    uint64_t points_drawn, budget_points, points_in_view;
    uint32_t nodes_drawn, nodes_hidden; /* hidden: see rend_figures */
    uint64_t points_hidden;
    bool budget_spent;
    uint64_t loaded_bytes;
    double total_ms, draw_ms; /* all of it; from the selection to the last pixel */
    uint32_t damaged_nodes;   /* not in the picture */
    uint64_t damaged_points;
    mospt_err damage;   /* of the first of them */
    uint32_t resets;    /* of the graphics driver, after which it went on */
    char renderer[128]; /* the graphics driver */
} rend_shot_result;

/* errors   MOSPT_EINVAL (options), MOSPT_EIO (no driver, file), MOSPT_ENOMEM. A damaged node is no
 * error: see the result.
 * result   NULL: not wanted */
bool rend_shot(const mospt_dataset *dataset, const rend_shot_options *options,
               rend_shot_result *result, mospt_err *err);
