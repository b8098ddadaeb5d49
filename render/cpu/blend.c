/* Points within a slab are averaged: section 2 of render/gl/rgl.h. */
#include "render/cpu/log.h"
#include "render/cpu/place.h"
#include "render/cpu/span.h"

#include <math.h>

void RCPU_NAME(blend)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                      const rcpu_front *front, rcpu_sums *sums);
void RCPU_NAME(limit)(const int64_t *row, uint32_t count, float slab, float *limits);
void RCPU_NAME(resolve)(const rcpu_sums *sums, uint32_t sums_count, size_t from, uint32_t count,
                        const float *nearest, float slab_log, float *logs, uint32_t *colours);

/* Sums of colours have 21 bits: what was added with weights of up to 8224, of which a splat has 8
 * at most. */
enum { COLOUR_BITS = 21, COLOUR_MASK = (1 << COLOUR_BITS) - 1, WEIGHT_FULL = 8192 };

void RCPU_NAME(limit)(const int64_t *row, uint32_t count, float slab, float *limits)
{
    for (uint32_t i = 0; i < count; i++) {
        uint32_t bits = (uint32_t)(row[i] >> 32);
        float w;
        memcpy(&w, &bits, sizeof w);
        limits[i] = row[i] == RCPU_EMPTY ? -1 : w * (1 + slab);
    }
}

/* ---- adding up ---- */

static int32_t depth_of(uint64_t weights)
{
    return (int32_t)(uint32_t)weights;
}

static uint32_t weight_of(uint64_t weights)
{
    return (uint32_t)((weights - (uint64_t)(int64_t)depth_of(weights)) >> 32);
}

/* Makes room in the narrow sums. */
static void spill(rcpu_sums *sums, size_t at)
{
    sums->has_spilled = true;
    for (size_t i = at; i < at + SPAN; i++) {
        uint64_t c = sums->colours[i], w = sums->weights[i];
        rcpu_wide *wide = &sums->spilled[i];
        wide->r += c & COLOUR_MASK, wide->g += c >> COLOUR_BITS & COLOUR_MASK;
        wide->b += c >> 2 * COLOUR_BITS;
        wide->weight += weight_of(w), wide->depth += depth_of(w);
        sums->colours[i] = sums->weights[i] = 0;
    }
}

/* weight   0 where the splat does not count
 * behind   how far behind the nearest its point is; 1 is as far as the slab is deep */
static inline void add_span(rcpu_sums *sums, size_t at, uint64_t colour, span_i weight,
                            span_f behind)
{
    behind = span_pick(behind > -1, behind, span_all(-1));
    behind = span_pick(behind < 1, behind, span_all(1));
    span_i depth = __builtin_convertvector(behind * 255.0f + 256.5f, span_i) - 256;
    span_l w = __builtin_convertvector(weight, span_l), c, all;
    memcpy(&c, sums->colours + at, sizeof c);
    memcpy(&all, sums->weights + at, sizeof all);
    c += w * (int64_t)colour;
    all += (w << 32) + __builtin_convertvector(weight * depth, span_l);
    memcpy(sums->colours + at, &c, sizeof c);
    memcpy(sums->weights + at, &all, sizeof all);
    if (span_any(__builtin_convertvector(all >= (int64_t)WEIGHT_FULL << 32, span_i)))
        spill(sums, at);
}

/* A splat and what it is added with. */
typedef struct {
    float w, log, scale, bend, rim;
    uint64_t colour;
} brush;

static brush make_brush(const rcpu_view *v, float size, float log, int64_t key)
{
    bool wide = size >= v->square_px, disc = wide && v->round;
    uint64_t colour = (uint64_t)key;
    uint32_t bits = (uint32_t)(colour >> 32);
    brush b = {.log = log,
               .scale = wide ? 2 / size : 0,
               .bend = disc ? v->bend * size : 0,
               .rim = disc ? 1 : INFINITY,
               .colour = (colour & 255) | (colour >> 8 & 255) << COLOUR_BITS |
                         (colour >> 16 & 255) << 2 * COLOUR_BITS};
    memcpy(&b.w, &bits, sizeof b.w);
    return b;
}

static void blend_splat(const rcpu_view *v, const rcpu_splats *s, uint32_t l, const brush *b,
                        const rcpu_front *front, rcpu_sums *sums)
{
    float per_slab = 1 / v->slab_log;
    for (int32_t x = s->left[l] & -SPAN; x < s->right[l]; x += SPAN) {
        span_i column = span_count() + x;
        span_i within = (column >= s->left[l]) & (column < s->right[l]);
        span_f dx = (__builtin_convertvector(column, span_f) + 0.5f - s->x[l]) * b->scale;
        span_f dx2 = dx * dx;
        for (int32_t y = s->top[l]; y < s->bottom[l]; y++) {
            size_t at = (size_t)y * v->size.stride + (size_t)x;
            float dy = ((float)y + 0.5f - s->y[l]) * b->scale;
            span_f r2 = dx2 + dy * dy, limits, logs;
            memcpy(&limits, front->limits + at, sizeof limits);
            span_i counts = within & (r2 <= b->rim) & (b->w * (1 + r2 * b->bend) <= limits);
            if (!span_any(counts)) continue;
            memcpy(&logs, front->logs + (size_t)y * front->stride + (size_t)x, sizeof logs);
            span_i weight = __builtin_convertvector(8.5f - r2 * 8.0f, span_i);
            weight = span_pick_i(weight > 1, weight, (span_i){0} + 1) & counts;
            add_span(sums, at, b->colour, weight, (b->log - logs) * per_slab);
        }
    }
}

void RCPU_NAME(blend)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                      const rcpu_front *front, rcpu_sums *sums)
{
    rcpu_walk walk;
    rcpu_walk_start(&walk, view->octants, view->grid_bits);
    for (uint32_t i = 0; i < count; i += RCPU_LANES) {
        mospt_vertex block[RCPU_LANES];
        rcpu_splats splats;
        float logs[RCPU_LANES];
        uint32_t some = count - i < RCPU_LANES ? count - i : RCPU_LANES;
        for (uint32_t k = 0; k < RCPU_LANES; k++)
            block[k] = vertices[i + (k < some ? k : 0)];
        rcpu_place(view, block, &walk, &splats);
        for (uint32_t k = 0; k < RCPU_LANES; k++)
            logs[k] = rcpu_log2((uint32_t)(splats.keys[k] >> 32));
        for (uint32_t k = 0; k < RCPU_LANES; k++) {
            uint32_t lane = rcpu_key_lane(k);
            if (rcpu_lane_vertex(lane) >= some) continue;
            brush b = make_brush(view, splats.size[lane], logs[k], splats.keys[k]);
            blend_splat(view, &splats, lane, &b, front, sums);
        }
    }
}

/* ---- the means ---- */

enum { PART = 64 }; /* pixels that are resolved in one go */

/* Of so many pixels. */
typedef struct {
    int32_t r[PART], g[PART], b[PART], weight[PART], depth[PART];
} narrow;

static void add_narrow(const rcpu_sums *sums, size_t from, uint32_t count, narrow *out)
{
    const uint64_t *colours = sums->colours + from, *weights = sums->weights + from;
    for (uint32_t i = 0; i < count; i++) {
        out->r[i] += (int32_t)(colours[i] & COLOUR_MASK);
        out->g[i] += (int32_t)(colours[i] >> COLOUR_BITS & COLOUR_MASK);
        out->b[i] += (int32_t)(colours[i] >> 2 * COLOUR_BITS);
        out->weight[i] += (int32_t)weight_of(weights[i]);
        out->depth[i] += depth_of(weights[i]);
    }
}

static uint32_t mean_of(float sum, float weight)
{
    return (uint32_t)(int32_t)(sum / weight + 0.5f);
}

static float mean_log(float nearest, float slab_log, float depth, float weight)
{
    return nearest + slab_log * (depth / (255 * weight));
}

/* Pixels whose sums have spilled, once more. */
static void resolve_wide(const rcpu_sums *sums, uint32_t sums_count, size_t from, uint32_t count,
                         const narrow *n, const float *nearest, float slab_log, float *logs,
                         uint32_t *colours)
{
    for (uint32_t i = 0; i < count; i++) {
        rcpu_wide all = {0};
        for (uint32_t f = 0; f < sums_count; f++) {
            const rcpu_wide *one = &sums[f].spilled[from + i];
            if (!sums[f].has_spilled) continue;
            all.r += one->r, all.g += one->g, all.b += one->b;
            all.weight += one->weight, all.depth += one->depth;
        }
        if (all.weight == 0) continue;
        float weight = (float)(all.weight + (uint64_t)n->weight[i]);
        logs[i] = mean_log(nearest[i], slab_log, (float)(all.depth + n->depth[i]), weight);
        colours[i] = mean_of((float)(all.r + (uint64_t)n->r[i]), weight) |
                     mean_of((float)(all.g + (uint64_t)n->g[i]), weight) << 8 |
                     mean_of((float)(all.b + (uint64_t)n->b[i]), weight) << 16;
    }
}

static void resolve_part(const rcpu_sums *sums, uint32_t sums_count, size_t from, uint32_t count,
                         const float *restrict nearest, float slab_log, float *restrict logs,
                         uint32_t *restrict colours)
{
    narrow n = {0};
    bool has_spilled = false;
    for (uint32_t f = 0; f < sums_count; f++) {
        add_narrow(&sums[f], from, count, &n);
        has_spilled |= sums[f].has_spilled;
    }
    for (uint32_t i = 0; i < count; i++) {
        float weight = (float)(n.weight[i] > 0 ? n.weight[i] : 1);
        float log = mean_log(nearest[i], slab_log, (float)n.depth[i], weight);
        uint32_t colour = mean_of((float)n.r[i], weight) | mean_of((float)n.g[i], weight) << 8 |
                          mean_of((float)n.b[i], weight) << 16;
        logs[i] = n.weight[i] == 0 ? RCPU_SKY : log;
        colours[i] = n.weight[i] == 0 ? 0 : colour;
    }
    if (has_spilled)
        resolve_wide(sums, sums_count, from, count, &n, nearest, slab_log, logs, colours);
}

void RCPU_NAME(resolve)(const rcpu_sums *sums, uint32_t sums_count, size_t from, uint32_t count,
                        const float *nearest, float slab_log, float *logs, uint32_t *colours)
{
    for (uint32_t i = 0; i < count; i += PART) {
        uint32_t some = count - i < PART ? count - i : PART;
        resolve_part(sums, sums_count, from + i, some, nearest + i, slab_log, logs + i,
                     colours + i);
    }
}
