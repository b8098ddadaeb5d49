#include "render/still.h"

#include <math.h>

enum { OCCLUDER_SHARE = 2 }; /* of the budget, for what hides */

/* How far the order goes until the GPU cache is full. */
static uint32_t end_of_chunk(const rend_picture *p, uint32_t from)
{
    uint64_t pages = 0;
    uint32_t to = from;
    for (; to < p->selection->draw_count; to++) {
        pages += rend_store_pages_of(p->store, rend_picture_at(p, to)->node);
        if (pages > rend_store_page_count(p->store) && to > from) break;
    }
    return to;
}

/* Brings the nodes from .. to - 1 of the order to the GPU and keeps them there. */
static bool bring(rend_picture *p, uint32_t from, uint32_t to, mospt_err *err)
{
    rend_store *store = p->store;
    rend_store_unpin_all(store);
    rend_store_want_nothing(store);
    for (uint32_t i = from; i < to; i++) {
        uint32_t node = rend_picture_at(p, i)->node;
        if (rend_store_is_stale(store, node)) rend_store_drop(store, node);
        if (rend_store_is_resident(store, node) && !rend_store_pin(store, node, err)) return false;
    }
    for (uint32_t i = from; i < to; i++) {
        uint32_t node = rend_picture_at(p, i)->node;
        if (rend_store_residency(store)[node] != REND_ABSENT) continue;
        const mospt_vertex *vertices = rend_store_vertices(store, node);
        if (vertices == NULL) rend_store_want(store, node);
        else if (!rend_store_put(store, node, vertices, err)) return false;
    }
    return rend_store_bring(store, err);
}

/* Draws the selection through the GPU cache, in as many parts as that needs.
 * first, last  flags for the first and the last of them, besides those for all */
static bool draw_all(rend_picture *p, const rend_view_of *view, int first, int all, int last,
                     mospt_err *err)
{
    uint32_t total = p->selection->draw_count, from = 0;
    p->figures.points_drawn = 0;
    p->figures.nodes_drawn = 0;
    do {
        uint32_t to = end_of_chunk(p, from);
        int parts = all | (from == 0 ? first : 0) | (to == total ? last : 0);
        if (!bring(p, from, to, err) || !rend_picture_draw(p, view, from, to, parts, err))
            return false;
        from = to;
    } while (from < total);
    rend_store_unpin_all(p->store);
    return true;
}

/* Few points are drawn sooner than depths are read back. */
static bool may_hide(const rend_picture *p, const rend_view_of *view)
{
    return !view->no_occlusion &&
           (p->selection->stopped || p->selection->points > REND_OCCLUSION_POINTS_MIN);
}

/* What hides others, from a part of the points: with cells nearly twice as wide, and as wide as
 * that where the picture's own points will close a wall. */
static bool draw_occluders(rend_picture *p, const rend_view_of *view, mospt_err *err)
{
    rend_view_of closed = *view;
    rend_select_input input = rend_picture_aim(p, view);
    closed.parts = 0;
    if (view->look.size_mode != REND_SIZE_AUTO) {
        rgl_scene own = rend_picture_scene(p, view);
        input.own_px = own.px_min, input.own_cell = own.splat_size / own.splat_scale;
        closed.look.size_mode = REND_SIZE_AUTO, closed.look.point_px_min = own.px_min;
        closed.look.point_px_max = fmaxf(own.px_min, rend_order_px_max(&closed.look));
    }
    if (view->budget_points != REND_ALL) input.budget_points /= OCCLUDER_SHARE;
    input.cell_px = 1.4f;
    return rend_picture_select(p, &closed, &input, err) &&
           draw_all(p, &closed, RGL_BEGIN, 0, 0, err) && rend_picture_look_behind(p, view, err);
}

bool rend_still_draw(rend_picture *picture, const rend_view_of *view, mospt_err *err)
{
    rend_picture *p = picture;
    rend_select_input input = rend_picture_aim(p, view);
    if (!rend_picture_select(p, view, &input, err)) return false;
    if (may_hide(p, view)) {
        if (!draw_occluders(p, view, err)) return false;
        input.occlusion = p->occlusion;
        if (!rend_picture_select(p, view, &input, err)) return false;
    }
    p->figures.pending = 0;
    bool blend = view->look.blend_slab > 0;
    if (blend && end_of_chunk(p, 0) < p->selection->draw_count)
        return draw_all(p, view, RGL_BEGIN, 0, 0, err) &&
               draw_all(p, view, 0, RGL_AGAIN, RGL_END, err);
    return draw_all(p, view, RGL_BEGIN | (blend ? RGL_AGAIN : 0), 0, RGL_END, err);
}

bool rend_still_expect(rend_picture *picture, const rend_view_of *view, mospt_err *err)
{
    rend_picture *p = picture;
    rend_store *store = p->store;
    rend_select_input input = rend_picture_aim(p, view);
    input.occlusion = p->occlusion; /* of the picture before: a guess, good enough to read by */
    rend_occlusion_aim(p->occlusion, &p->frame);
    if (!rend_picture_select(p, view, &input, err)) return false;
    /* What takes several parts has no room for anything that is read early. */
    if (end_of_chunk(p, 0) < p->selection->draw_count) return true;
    rend_store_want_nothing(store);
    for (uint32_t i = 0; i < p->selection->draw_count; i++) {
        uint32_t node = rend_picture_at(p, i)->node;
        bool missing =
            rend_store_residency(store)[node] == REND_ABSENT || rend_store_is_stale(store, node);
        if (missing && !rend_store_has_vertices(store, node)) rend_store_want(store, node);
    }
    return rend_store_ask(store, err);
}
