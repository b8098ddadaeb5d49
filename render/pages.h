/* render/pages.h - which pages of the GPU arena belong to which node.
 *
 * All vertices on the GPU live in one buffer, cut into pages of equal size. Any free pages will do
 * for a node, so the arena never fragments: what fits by count, fits. Neighbouring pages are
 * preferred, as every run of them is one range to draw. The first page found is the lowest free
 * one: the same calls give the same places. */
#pragma once
#include "mospt/err.h"

typedef struct {
    uint32_t first, count; /* pages */
} rend_run;

typedef struct {
    rend_run *runs; /* [run_count], owned, in the order of the node's vertices */
    uint32_t run_count;
} rend_place;

typedef struct rend_pages rend_pages;

rend_pages *rend_pages_create(uint32_t page_count); /* NULL without memory */
void rend_pages_destroy(rend_pages *pages);

uint32_t rend_pages_free_count(const rend_pages *pages);

/* Takes `count` pages, at most rend_pages_free_count().
 * out      given back by rend_pages_release()
 * errors   MOSPT_ENOMEM: no memory for the list of runs */
bool rend_pages_take(rend_pages *pages, uint32_t count, rend_place *out, mospt_err *err);
void rend_pages_release(rend_pages *pages, rend_place *place);
