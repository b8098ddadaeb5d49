/* tests/ref_select.h - the slow, obvious twin of render/select.c: Wimmer & Scheiblauer 2006,
 * section 5.3, in doubles: the whole outer octree is walked anew for each cell size tried. */
#pragma once
#include "render/select.h"

typedef struct {
    double *points; /* [node count], owned: of each node in view, that it shows or would show; real
                       numbers, which the selection rounds down level by level */
    double cell_px;
    bool stopped;
    bool close_call; /* a decision hung on less than a float can tell: the two may differ */
} ref_selection;

/* Without a limit of pages. */
void ref_select(const rend_select_input *input, ref_selection *out);
void ref_select_fini(ref_selection *selection);

/* Width of a splat at a place, steps: found among all nodes that a selection draws. */
double ref_select_cell_at(const rend_select_input *input, const rend_selection *selection,
                          const uint32_t place[3]);
