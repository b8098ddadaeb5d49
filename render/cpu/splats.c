/* Splats of several pixels: squares, discs, and discs that bend away from the eye. */
#include "render/cpu/place.h"
#include "render/cpu/span.h"

void RCPU_NAME(splats)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame);

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

static void draw_square(const rcpu_splats *s, uint32_t l, int64_t key, uint32_t stride,
                        int64_t *frame)
{
    span_l keys = (span_l){0} + key;
    for (int32_t x = s->left[l] & -SPAN; x < s->right[l]; x += SPAN) {
        span_i column = span_count() + x;
        span_l mask =
            __builtin_convertvector((column >= s->left[l]) & (column < s->right[l]), span_l);
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

static void draw_disc(const rcpu_view *v, const rcpu_splats *s, uint32_t l, int64_t key,
                      int64_t *frame)
{
    float scale = 2 / s->size[l], bend = v->bend * s->size[l];
    for (int32_t x = s->left[l] & -SPAN; x < s->right[l]; x += SPAN) {
        span_i column = span_count() + x;
        span_f dx = ((__builtin_convertvector(column, span_f) + 0.5f) - s->x[l]) * scale;
        span_i within = (column >= s->left[l]) & (column < s->right[l]);
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
    rcpu_splats splats;
    rcpu_place(v, vertices, w, &splats);
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
    rcpu_walk_start(&w, view->octants, view->grid_bits);
    for (; i + RCPU_LANES <= count; i += RCPU_LANES)
        draw_block(view, vertices + i, &w, frame);
    if (i == count) return;
    mospt_vertex last[RCPU_LANES];
    for (uint32_t k = 0; k < RCPU_LANES; k++)
        last[k] = vertices[i + k < count ? i + k : i]; /* the same one twice changes nothing */
    draw_block(view, last, &w, frame);
}
