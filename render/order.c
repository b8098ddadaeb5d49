#include "render/order.h"

#include <math.h>
#include <stdlib.h>

enum { GROUP_SMALLEST, GROUP_SMALL, GROUP_WIDE };
/* Wider ones are discs, if nobody asks for anything else: up to three pixels nobody tells the two
 * apart, and a disc costs the early depth test. */
#define SQUARE_PX_MAX 3.0f

void rend_order_fini(rend_order *order)
{
    free(order->keys);
    free(order->first);
    free(order->count);
    *order = (rend_order){0};
}

float rend_order_px_max(const rend_look *look)
{
    if (look->size_mode == REND_SIZE_FIXED) return fmaxf(look->point_px, 1);
    return look->point_px_max > 0 ? fmaxf(look->point_px_max, 1) : REND_POINT_PX_MAX_DEFAULT;
}

float rend_order_px_min(const rend_look *look)
{
    if (look->size_mode == REND_SIZE_FIXED) return rend_order_px_max(look);
    return fminf(fmaxf(look->point_px_min, 1), rend_order_px_max(look));
}

static int group_of(const rend_look *look, const rend_draw *d)
{
    float widest =
        look->size_mode == REND_SIZE_AUTO ? REND_SPLAT_PER_CELL * d->widest_px : INFINITY;
    widest = fminf(widest, rend_order_px_max(look));
    if (widest <= 1.001f * rend_order_px_min(look)) return GROUP_SMALLEST;
    return widest > SQUARE_PX_MAX ? GROUP_WIDE : GROUP_SMALL;
}

static rgl_batch batch_of(const rend_look *look, int group)
{
    static const rgl_shape shapes[] = {[REND_SHAPE_SQUARE] = RGL_SQUARE,
                                       [REND_SHAPE_ROUND] = RGL_ROUND,
                                       [REND_SHAPE_PARABOLOID] = RGL_PARABOLOID};
    bool narrow = group == GROUP_SMALL ||
                  (group == GROUP_SMALLEST && rend_order_px_min(look) <= SQUARE_PX_MAX);
    return (rgl_batch){.shape = look->shape != REND_SHAPE_AUTO ? shapes[look->shape]
                                : narrow                       ? RGL_SQUARE
                                                               : RGL_ROUND,
                       .smallest = group == GROUP_SMALLEST};
}

static uint64_t key_of(const rend_look *look, const rend_draw *d, uint32_t index)
{
    return (uint64_t)group_of(look, d) << 32 | index;
}

static int compare_keys(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

bool rend_order_sort(rend_order *order, const rend_selection *selection, const rend_look *look,
                     mospt_err *err)
{
    uint32_t count = selection->draw_count;
    order->selection = selection;
    if (count > order->key_capacity) {
        uint64_t *larger = realloc(order->keys, count * sizeof *larger);
        if (larger == NULL) return mospt_err_nomem(err, count * sizeof *larger);
        order->keys = larger, order->key_capacity = count;
    }
    for (uint32_t i = 0; i < count; i++)
        order->keys[i] = key_of(look, &selection->draws[i], i);
    if (count > 0) qsort(order->keys, count, sizeof *order->keys, compare_keys);
    return true;
}

const rend_draw *rend_order_at(const rend_order *order, uint32_t i)
{
    return &order->selection->draws[order->keys[i] & UINT32_MAX];
}

static bool add_range(rend_order *o, uint32_t first, uint32_t count, mospt_err *err)
{
    bool join = o->range_count > o->batch_start[o->batch_count - 1];
    if (join && o->first[o->range_count - 1] + o->count[o->range_count - 1] == (int32_t)first) {
        o->count[o->range_count - 1] += (int32_t)count;
        return true;
    }
    if (o->range_count == o->range_capacity) {
        uint32_t capacity = o->range_capacity > 0 ? 2 * o->range_capacity : 1024;
        int32_t *f = realloc(o->first, capacity * sizeof *f);
        if (f != NULL) o->first = f;
        int32_t *c = realloc(o->count, capacity * sizeof *c);
        if (c != NULL) o->count = c;
        if (f == NULL || c == NULL) return mospt_err_nomem(err, capacity * sizeof *f);
        o->range_capacity = capacity;
    }
    o->first[o->range_count] = (int32_t)first;
    o->count[o->range_count++] = (int32_t)count;
    return true;
}

void rend_order_begin(rend_order *order)
{
    order->range_count = order->batch_count = 0;
}

/* The leading points of a node, through the runs of pages that hold them. */
bool rend_order_add(rend_order *order, const rend_look *look, uint32_t i, const rend_place *place,
                    uint32_t page_points, mospt_err *err)
{
    uint32_t left = rend_order_at(order, i)->count, group = (uint32_t)(order->keys[i] >> 32);
    if (order->batch_count == 0 || group != order->last_group) {
        order->batch_start[order->batch_count] = order->range_count;
        order->batches[order->batch_count++] = batch_of(look, (int)group);
        order->last_group = group;
    }
    for (uint32_t r = 0; left > 0 && r < place->run_count; r++) {
        uint32_t part = place->runs[r].count * page_points;
        if (part > left) part = left;
        if (!add_range(order, place->runs[r].first * page_points, part, err)) return false;
        left -= part;
    }
    return true;
}

void rend_order_end(rend_order *order)
{
    for (uint32_t b = 0; b < order->batch_count; b++) {
        uint32_t start = order->batch_start[b];
        uint32_t end = b + 1 < order->batch_count ? order->batch_start[b + 1] : order->range_count;
        order->batches[b].first = order->first + start;
        order->batches[b].count = order->count + start;
        order->batches[b].range_count = end - start;
    }
}
