/* render/order.h - the draws of a selection in the order in which they are drawn, and as batches.
 *
 * What is drawn alike goes together: splats of the least width, those that are squares for being
 * small, and wide ones; within each, the order of the selection. This order, not the one in which
 * nodes were read, decides which of two points at the same depth is seen. */
#pragma once
#include "render/gl/rgl.h"
#include "render/options.h"
#include "render/pages.h"
#include "render/select.h"

enum { REND_ORDER_GROUPS = 3 };

/* Points of neighbouring cells are up to two cells apart: splats this much wider than a cell leave
 * few holes. */
#define REND_SPLAT_PER_CELL 1.25f

typedef struct {
    const rend_selection *selection; /* borrowed */
    uint64_t *keys;                  /* [key_capacity], owned: group, and index of the draw */
    uint32_t key_capacity;
    int32_t *first, *count; /* [range_capacity], owned */
    uint32_t range_count, range_capacity;
    rgl_batch batches[REND_ORDER_GROUPS]; /* [batch_count] */
    uint32_t batch_start[REND_ORDER_GROUPS], batch_count, last_group;
} rend_order;

void rend_order_fini(rend_order *order); /* {0} is a good start */

/* Sorts the draws of a selection, which is borrowed until the next one. */
bool rend_order_sort(rend_order *order, const rend_selection *selection, const rend_look *look,
                     mospt_err *err);

/* The i-th draw to be drawn. */
const rend_draw *rend_order_at(const rend_order *order, uint32_t i);

/* Batches are made anew, of draws that are added by rising number, and are whole after the end. */
void rend_order_begin(rend_order *order);
bool rend_order_add(rend_order *order, const rend_look *look, uint32_t i, const rend_place *place,
                    uint32_t page_points, mospt_err *err);
void rend_order_end(rend_order *order);

/* Least and largest width of a splat, pixels. */
float rend_order_px_min(const rend_look *look);
float rend_order_px_max(const rend_look *look);
