/* Points within a slab are averaged: section 2 of render/gl/rgl.h. */
#include "render/cpu/log.h"
#include "render/cpu/place.h"

#include <math.h>

void RCPU_NAME(blend)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                      const int64_t *nearest, rcpu_sums *sums);
void RCPU_NAME(add)(rcpu_sums *const *sums, uint32_t sums_count, size_t from, size_t count);
void RCPU_NAME(resolve)(const rcpu_sums *sums, const int64_t *nearest, uint32_t count,
                        float slab_log, float *logs, uint32_t *colours);

static float distance_of(int64_t key)
{
    uint32_t bits = (uint32_t)(key >> 32);
    float w;
    memcpy(&w, &bits, sizeof w);
    return w;
}

/* How far behind the nearest a distance is: 255 is as far as the slab is deep. */
static int32_t depth_in_slab(const rcpu_view *v, float w, float front)
{
    float ratio = w / front;
    uint32_t bits;
    memcpy(&bits, &ratio, sizeof bits);
    float behind = rcpu_log2(bits) / v->slab_log;
    behind = behind < -1 ? -1 : behind > 1 ? 1 : behind;
    return (int32_t)floorf(255 * behind + 0.5f);
}

static void add_one(const rcpu_view *v, int64_t key, float r2, float bend, int64_t nearest,
                    rcpu_sums *sum)
{
    float w = distance_of(key), front = distance_of(nearest);
    if (nearest == RCPU_EMPTY || w * (1 + r2 * bend) > front * (1 + v->slab)) return;
    uint32_t weight = r2 < 0.9375f ? (uint32_t)(8.5f - 8 * r2) : 1;
    sum->r += weight * ((uint32_t)key & 255);
    sum->g += weight * ((uint32_t)key >> 8 & 255);
    sum->b += weight * ((uint32_t)key >> 16 & 255);
    sum->weight += weight;
    sum->depth += (int32_t)weight * depth_in_slab(v, w, front);
}

static void blend_splat(const rcpu_view *v, const rcpu_splats *s, uint32_t l, int64_t key,
                        const int64_t *nearest, rcpu_sums *sums)
{
    float scale = 2 / s->size[l];
    bool wide = s->size[l] >= v->square_px, disc = wide && v->round;
    float bend = disc ? v->bend * s->size[l] : 0;
    for (int32_t y = s->top[l]; y < s->bottom[l]; y++) {
        size_t row = (size_t)y * v->size.stride;
        float dy = ((float)y + 0.5f - s->y[l]) * scale;
        for (int32_t x = s->left[l]; x < s->right[l]; x++) {
            float dx = ((float)x + 0.5f - s->x[l]) * scale, r2 = wide ? dx * dx + dy * dy : 0;
            if (disc && r2 > 1) continue;
            add_one(v, key, r2, bend, nearest[row + (size_t)x], &sums[row + (size_t)x]);
        }
    }
}

void RCPU_NAME(blend)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                      const int64_t *nearest, rcpu_sums *sums)
{
    rcpu_walk walk;
    rcpu_walk_start(&walk, view->octants, view->grid_bits);
    for (uint32_t i = 0; i < count; i += RCPU_LANES) {
        mospt_vertex block[RCPU_LANES];
        rcpu_splats splats;
        uint32_t some = count - i < RCPU_LANES ? count - i : RCPU_LANES;
        for (uint32_t k = 0; k < RCPU_LANES; k++)
            block[k] = vertices[i + (k < some ? k : 0)];
        rcpu_place(view, block, &walk, &splats);
        for (uint32_t k = 0; k < RCPU_LANES; k++) {
            uint32_t lane = rcpu_key_lane(k);
            if (rcpu_lane_vertex(lane) >= some) continue;
            blend_splat(view, &splats, lane, splats.keys[k], nearest, sums);
        }
    }
}

void RCPU_NAME(add)(rcpu_sums *const *sums, uint32_t sums_count, size_t from, size_t count)
{
    for (uint32_t f = 1; f < sums_count; f++)
        for (size_t i = from; i < from + count; i++) {
            rcpu_sums *all = &sums[0][i], *one = &sums[f][i];
            all->r += one->r, all->g += one->g, all->b += one->b;
            all->weight += one->weight, all->depth += one->depth;
            *one = (rcpu_sums){0};
        }
}

static uint32_t mean_of(uint32_t sum, uint32_t weight)
{
    return (uint32_t)((float)sum / (float)weight + 0.5f);
}

void RCPU_NAME(resolve)(const rcpu_sums *sums, const int64_t *nearest, uint32_t count,
                        float slab_log, float *logs, uint32_t *colours)
{
    for (uint32_t i = 0; i < count; i++) {
        const rcpu_sums *s = &sums[i];
        logs[i] = RCPU_SKY, colours[i] = 0;
        if (s->weight == 0) continue;
        float front = rcpu_log2((uint32_t)(nearest[i] >> 32));
        logs[i] = front + slab_log * ((float)s->depth / (255 * (float)s->weight));
        colours[i] = mean_of(s->r, s->weight) | mean_of(s->g, s->weight) << 8 |
                     mean_of(s->b, s->weight) << 16;
    }
}
