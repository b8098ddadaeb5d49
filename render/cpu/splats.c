/* Splats of several pixels: squares, discs, and discs that bend away from the eye. */
#include "render/cpu/project.h"
#include "render/cpu/walk.h"

void RCPU_NAME(splats)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame);

/* Cells are looked up one by one: most points lie in the cell of the one before. */
static lanes_f cells_of(const rcpu_view *v, const rcpu_block *block, lanes_i inside, rcpu_walk *w)
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
    x0 = at_least(x0, 0), x1 = at_most(x1, width);
    lanes_i top = at_least(height - y1, 0), bottom = at_most(height - y0, height) & p->inside;
    lanes_f from_top = (float)height - p->y;
    memcpy(out->left, &x0, sizeof x0);
    memcpy(out->right, &x1, sizeof x1);
    memcpy(out->top, &top, sizeof top);
    memcpy(out->bottom, &bottom, sizeof bottom);
    memcpy(out->x, &p->x, sizeof p->x);
    memcpy(out->y, &from_top, sizeof from_top);
    memcpy(out->size, &size, sizeof size);
}

/* Pixels of a row, as many as fit a vector. */
enum { SPAN = RCPU_LANES / 2 };
typedef int64_t span_l __attribute__((vector_size(8 * SPAN)));
typedef int32_t span_i __attribute__((vector_size(4 * SPAN)));
typedef float span_f __attribute__((vector_size(4 * SPAN)));

static inline span_i span_count(void)
{
    span_i count;
    for (int i = 0; i < SPAN; i++)
        count[i] = i;
    return count;
}

/* Pixels beyond the mask are written as they were: a frame belongs to one thread, and has room at
 * its end. */
static inline void put(int64_t *pixels, span_l keys, span_l mask)
{
    span_l before;
    memcpy(&before, pixels, sizeof before);
    span_l nearer = (keys < before) & mask;
    before = (nearer & keys) | (~nearer & before);
    memcpy(pixels, &before, sizeof before);
}

static void draw_square(const splat_block *s, uint32_t l, int64_t key, uint32_t stride,
                        int64_t *frame)
{
    span_l keys = (span_l){0} + key;
    for (int32_t x = s->left[l]; x < s->right[l]; x += SPAN) {
        span_l mask = __builtin_convertvector(span_count() < s->right[l] - x, span_l);
        for (int32_t y = s->top[l]; y < s->bottom[l]; y++)
            put(frame + (size_t)y * stride + x, keys, mask);
    }
}

/* Distances of a splat that bends away, above its colour. */
static inline span_l bent_keys(int64_t key, span_f share)
{
    int32_t bits = (int32_t)(key >> 32);
    float w;
    memcpy(&w, &bits, sizeof w);
    span_i bent = (span_i)(w * (1 + share));
    return __builtin_convertvector(bent, span_l) << 32 | (key & UINT32_MAX);
}

static void draw_disc(const rcpu_view *v, const splat_block *s, uint32_t l, int64_t key,
                      int64_t *frame)
{
    float scale = 2 / s->size[l], bend = v->bend * s->size[l];
    span_f count = __builtin_convertvector(span_count(), span_f);
    for (int32_t x = s->left[l]; x < s->right[l]; x += SPAN) {
        span_f dx = ((count + ((float)x + 0.5f)) - s->x[l]) * scale;
        span_i within = span_count() < s->right[l] - x;
        for (int32_t y = s->top[l]; y < s->bottom[l]; y++) {
            float dy = ((float)y + 0.5f - s->y[l]) * scale;
            span_f r2 = dx * dx + dy * dy;
            span_l mask = __builtin_convertvector((r2 <= 1) & within, span_l);
            span_l keys = bend > 0 ? bent_keys(key, r2 * bend) : (span_l){0} + key;
            put(frame + (size_t)y * v->size.stride + x, keys, mask);
        }
    }
}

static void draw_block(const rcpu_view *v, const mospt_vertex *vertices, rcpu_walk *w,
                       int64_t *frame)
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
    rcpu_walk w;
    if (view->octants != NULL) rcpu_walk_start(&w, view->octants, view->grid_bits);
    for (; i + RCPU_LANES <= count; i += RCPU_LANES)
        draw_block(view, vertices + i, &w, frame);
    if (i == count) return;
    mospt_vertex last[RCPU_LANES];
    for (uint32_t k = 0; k < RCPU_LANES; k++)
        last[k] = vertices[i + k < count ? i + k : i]; /* the same one twice changes nothing */
    draw_block(view, last, &w, frame);
}
