/* render/cpu/place.h - which pixels the splats of a block of points cover. */
#pragma once
#include "render/cpu/project.h"
#include "render/cpu/walk.h"

/* Cells are looked up one by one: most points lie in the cell of the one before. */
static inline lanes_f rcpu_cells(const rcpu_view *v, const rcpu_block *block, lanes_i inside,
                                 rcpu_walk *w)
{
    lanes_f cells = lanes_all(1);
    if (v->octants == NULL) return cells;
    lanes_u differ =
        ((block->x ^ w->place[0]) | (block->y ^ w->place[1]) | (block->z ^ w->place[2])) &
        w->used_bits;
    lanes_i elsewhere = (lanes_i)(w->leaf < 0 ? differ : differ >> w->leaf) & inside;
    cells = lanes_all(w->cell);
    if (!lanes_any(elsewhere)) return cells;
    for (int l = 0; l < RCPU_LANES; l++)
        if (inside[l] != 0)
            cells[l] = rcpu_walk_to(w, (uint32_t[3]){block->x[l], block->y[l], block->z[l]});
    return cells;
}

/* Splats of a block, clipped. */
typedef struct {
    int32_t left[RCPU_LANES], right[RCPU_LANES]; /* columns, the right one excluded */
    int32_t top[RCPU_LANES], bottom[RCPU_LANES]; /* rows, the bottom one excluded */
    float x[RCPU_LANES], y[RCPU_LANES];          /* centre, pixels from the top left */
    float size[RCPU_LANES];
    int64_t keys[RCPU_LANES];
} rcpu_splats;

static inline lanes_i rcpu_at_least(lanes_i a, int32_t low)
{
    return lanes_pick_i(a > low, a, (lanes_i){0} + low);
}

static inline lanes_i rcpu_at_most(lanes_i a, int32_t high)
{
    return lanes_pick_i(a < high, a, (lanes_i){0} + high);
}

/* A pixel belongs to a square if its centre does; of two pixels beside the same edge, GL takes the
 * left and the lower one. */
static inline void place_splats(const rcpu_view *v, const rcpu_places *p, lanes_f size,
                                rcpu_splats *out)
{
    int32_t width = (int32_t)v->size.width, height = (int32_t)v->size.height;
    lanes_i fixed = rcpu_at_least(rcpu_snap(size), 256);
    lanes_i left = rcpu_snap(p->x) - 128 - (fixed >> 1);
    lanes_i low = rcpu_snap(p->y) - 128 - (fixed >> 1);
    lanes_i x0 = (left + 255) >> 8, x1 = (left + fixed + 255) >> 8;
    lanes_i y0 = (low + 255) >> 8, y1 = (low + fixed + 255) >> 8;
    x0 = rcpu_at_least(x0, 0), x1 = rcpu_at_most(x1, width);
    lanes_i top = rcpu_at_least(height - y1, 0),
            bottom = rcpu_at_most(height - y0, height) & p->inside;
    lanes_f from_top = (float)height - p->y;
    memcpy(out->left, &x0, sizeof x0);
    memcpy(out->right, &x1, sizeof x1);
    memcpy(out->top, &top, sizeof top);
    memcpy(out->bottom, &bottom, sizeof bottom);
    memcpy(out->x, &p->x, sizeof p->x);
    memcpy(out->y, &from_top, sizeof from_top);
    memcpy(out->size, &size, sizeof size);
}

/* Splats of RCPU_LANES vertices.
 * walk     started, where the view has octants */
static inline void rcpu_place(const rcpu_view *v, const mospt_vertex *vertices, rcpu_walk *walk,
                              rcpu_splats *out)
{
    rcpu_block block = rcpu_load(vertices);
    rcpu_places places = rcpu_project(v, &block);
    lanes_f size = v->splat_px * rcpu_cells(v, &block, places.inside, walk) / places.w;
    size = lanes_min(lanes_max(size, lanes_all(v->px_min)), lanes_all(v->px_max));
    place_splats(v, &places, size, out);
    rcpu_keys(places.w, block.colour, out->keys);
}
