/* tests/ref_select.h - the slow, obvious twin of render/select.c: Wimmer & Scheiblauer 2006,
 * section 5.3, in doubles, with a list in which the largest node is looked for every time. */
#pragma once
#include "render/select.h"

typedef struct {
    uint32_t *draw_node, *draw_count_of; /* [draws], owned */
    uint32_t *finest;                    /* [draws], owned: inner level drawn, at most the depth */
    uint32_t draws;
    uint32_t *request; /* [requests], owned */
    uint32_t requests;
    uint64_t points;
    bool stopped;
    bool close_call; /* a decision hung on less than a float can tell: the two may differ */
} ref_selection;

void ref_select(const rend_select_input *input, ref_selection *out);
void ref_select_fini(ref_selection *selection);

/* Width of a splat at a place, steps: found among all nodes drawn. */
double ref_select_cell_at(const rend_select_input *input, const ref_selection *selection,
                          const uint32_t place[3]);
