/* Splats of several pixels: squares, discs, and discs that bend away from the eye. */
#include "render/cpu/project.h"

#include <string.h>

void RCPU_NAME(splats)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame);

/* The walk of RGL_POINTS_VERTEX from the root to the cell of a place, remembered: the next place is
 * mostly nearby, and then the walk starts where the two part. */
typedef struct {
    const uint32_t *octants;
    uint32_t used_bits; /* of a place, as a mask */
    uint32_t place[3];  /* the last one */
    uint32_t node[33];  /* [bit + 1] node whose octant that bit of the last place chose */
    int leaf;           /* the bit that ended the walk; -1: none did */
    float cell;
} walker;

static walker start_walk(const rcpu_view *v)
{
    walker w = {.octants = v->octants, .cell = 1, .leaf = (int)v->grid_bits};
    w.used_bits = v->grid_bits < 32 ? (UINT32_C(1) << v->grid_bits) - 1 : UINT32_MAX;
    return w;
}

static void walk_down(walker *w, uint32_t x, uint32_t y, uint32_t z, int bit)
{
    uint32_t node = w->node[bit + 1];
    w->cell = 1;
    for (; bit >= 0; bit--) {
        w->node[bit + 1] = node;
        uint32_t octant = (x >> bit & 1) | (y >> bit & 1) << 1 | (z >> bit & 1) << 2;
        uint32_t found = w->octants[8 * (size_t)node + octant];
        if (found >= 0x80000000u) {
            found &= 0x7fffffff; /* the sign only marks it */
            memcpy(&w->cell, &found, sizeof w->cell);
            break;
        }
        node = found;
    }
    w->leaf = bit;
}

static float cell_at(walker *w, uint32_t x, uint32_t y, uint32_t z, uint32_t grid_bits)
{
    uint32_t differ = ((x ^ w->place[0]) | (y ^ w->place[1]) | (z ^ w->place[2])) & w->used_bits;
    int bit = differ != 0 ? 31 - __builtin_clz(differ) : -1;
    bool first = w->leaf == (int)grid_bits;
    if (!first && bit < w->leaf) return w->cell;
    if (!first && bit < 0) return w->cell;
    w->place[0] = x, w->place[1] = y, w->place[2] = z;
    walk_down(w, x, y, z, first ? (int)grid_bits - 1 : bit);
    return w->cell;
}

static lanes_f cells_of(const rcpu_view *v, const rcpu_block *block, lanes_i inside, walker *w)
{
    lanes_f cells = lanes_all(1);
    for (int l = 0; v->octants != NULL && l < RCPU_LANES; l++)
        if (inside[l] != 0)
            cells[l] = cell_at(w, block->x[l], block->y[l], block->z[l], v->grid_bits);
    return cells;
}

/* Splats of a block, clipped. */
typedef struct {
    int32_t left[RCPU_LANES], right[RCPU_LANES]; /* columns, the right one excluded */
    int32_t top[RCPU_LANES], bottom[RCPU_LANES]; /* rows, the bottom one excluded */
    float x[RCPU_LANES], y[RCPU_LANES];          /* centre, pixels from the top left */
    float size[RCPU_LANES];
    int64_t keys[RCPU_LANES];
} splat_block;

static lanes_i at_least(lanes_i a, int32_t low)
{
    return lanes_pick_i(a > low, a, (lanes_i){0} + low);
}

static lanes_i at_most(lanes_i a, int32_t high)
{
    return lanes_pick_i(a < high, a, (lanes_i){0} + high);
}

/* A pixel belongs to a square if its centre does; of two pixels beside the same edge, GL takes the
 * left and the lower one. */
static void place_splats(const rcpu_view *v, const rcpu_places *p, lanes_f size, splat_block *out)
{
    int32_t width = (int32_t)v->size.width, height = (int32_t)v->size.height;
    lanes_i fixed = at_least(rcpu_snap(size), 256);
    lanes_i left = rcpu_snap(p->x) - 128 - (fixed >> 1);
    lanes_i low = rcpu_snap(p->y) - 128 - (fixed >> 1);
    lanes_i x0 = (left + 255) >> 8, x1 = (left + fixed + 255) >> 8;
    lanes_i y0 = (low + 255) >> 8, y1 = (low + fixed + 255) >> 8;
    x0 = at_least(x0, 0), x1 = at_most(x1, width) & p->inside;
    lanes_i top = at_least(height - y1, 0), bottom = at_most(height - y0, height);
    lanes_f from_top = (float)height - p->y;
    memcpy(out->left, &x0, sizeof x0);
    memcpy(out->right, &x1, sizeof x1);
    memcpy(out->top, &top, sizeof top);
    memcpy(out->bottom, &bottom, sizeof bottom);
    memcpy(out->x, &p->x, sizeof p->x);
    memcpy(out->y, &from_top, sizeof from_top);
    memcpy(out->size, &size, sizeof size);
}

static inline void put(int64_t *pixel, int64_t key)
{
    if (key < *pixel) *pixel = key;
}

static void draw_square(const splat_block *s, uint32_t l, int64_t key, uint32_t stride,
                        int64_t *frame)
{
    for (int32_t y = s->top[l]; y < s->bottom[l]; y++) {
        int64_t *row = frame + (size_t)y * stride;
        for (int32_t x = s->left[l]; x < s->right[l]; x++)
            put(row + x, key);
    }
}

/* The bits of the distance of a splat that bends away, above its colour. */
static int64_t bend_key(int64_t key, float share)
{
    uint32_t bits = (uint32_t)(key >> 32);
    float w;
    memcpy(&w, &bits, sizeof w);
    w *= 1 + share;
    memcpy(&bits, &w, sizeof bits);
    return (int64_t)bits << 32 | (key & UINT32_MAX);
}

static void draw_disc(const rcpu_view *v, const splat_block *s, uint32_t l, int64_t key,
                      int64_t *frame)
{
    float scale = 2 / s->size[l], bend = v->bend * s->size[l];
    for (int32_t y = s->top[l]; y < s->bottom[l]; y++) {
        int64_t *row = frame + (size_t)y * v->size.stride;
        float dy = ((float)y + 0.5f - s->y[l]) * scale;
        for (int32_t x = s->left[l]; x < s->right[l]; x++) {
            float dx = ((float)x + 0.5f - s->x[l]) * scale, r2 = dx * dx + dy * dy;
            if (r2 <= 1) put(row + x, bend > 0 ? bend_key(key, r2 * bend) : key);
        }
    }
}

static void draw_block(const rcpu_view *v, const mospt_vertex *vertices, walker *w, int64_t *frame)
{
    splat_block splats;
    rcpu_block block = rcpu_load(vertices);
    rcpu_places places = rcpu_project(v, &block);
    lanes_f size = v->splat_px * cells_of(v, &block, places.inside, w) / places.w;
    size = lanes_min(lanes_max(size, lanes_all(v->px_min)), lanes_all(v->px_max));
    place_splats(v, &places, size, &splats);
    rcpu_keys(places.w, block.colour, splats.keys);
    for (uint32_t k = 0; k < RCPU_LANES; k++) {
        uint32_t lane = rcpu_key_lane(k);
        bool disc = v->round && splats.size[lane] >= v->square_px;
        if (disc) draw_disc(v, &splats, lane, splats.keys[k], frame);
        else draw_square(&splats, lane, splats.keys[k], v->size.stride, frame);
    }
}

void RCPU_NAME(splats)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame)
{
    uint32_t i = 0;
    walker w = start_walk(view);
    for (; i + RCPU_LANES <= count; i += RCPU_LANES)
        draw_block(view, vertices + i, &w, frame);
    if (i == count) return;
    mospt_vertex last[RCPU_LANES];
    for (uint32_t k = 0; k < RCPU_LANES; k++)
        last[k] = vertices[i + k < count ? i + k : i]; /* the same one twice changes nothing */
    draw_block(view, last, &w, frame);
}
