/* render/figures.h - what a picture took, and what is where: for the overlay, reports and tests. */
#pragma once
#include "mospt/err.h"

typedef struct {
    /* Of the picture in hand. */
    uint64_t points_drawn, points_in_view; /* in view: all points of the nodes that a higher budget
                                              would not reject first */
    uint32_t nodes_drawn, nodes_visited;
    uint32_t nodes_hidden;  /* left out behind others, with all below them */
    uint64_t points_hidden; /* all points of these, without what is below */
    bool budget_spent;
    uint32_t pending;      /* nodes that this view still misses */
    uint32_t ahead;        /* nodes that are read because they will be seen shortly */
    uint64_t points_total; /* drawn since the start, part by part */

    /* Of the caches. */
    uint64_t ram_used, ram_limit, gpu_used, gpu_limit; /* bytes */
    uint32_t gpu_halved;                               /* times, for want of graphics memory */
    uint32_t resets;         /* of the graphics driver, after which all was made anew */
    uint64_t loaded_bytes;   /* since the start */
    uint64_t uploaded_bytes; /* since the start */
    double waited_s;         /* for the loader, by rend_stage_still(), since the start */
    uint32_t damaged_nodes;
    uint64_t damaged_points;
    mospt_err damage; /* of the first damaged node; code MOSPT_OK without any */
} rend_figures;
