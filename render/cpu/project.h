/* render/cpu/project.h - from vertices to places in the picture, as RGL_POINTS_VERTEX and the fixed
 * part of GL's pipeline do it: a point whose centre is outside the view is not drawn. */
#pragma once
#include "render/cpu/lanes.h"

typedef struct {
    lanes_u x, y, z, colour;
} rcpu_block;

typedef struct {
    lanes_i inside;
    lanes_f x, y; /* pixels from the lower left corner; 0 outside, where it could be any number */
    lanes_f w;
} rcpu_places;

/* RCPU_LANES vertices, in an order of their own. */
static inline rcpu_block rcpu_load(const mospt_vertex *vertices)
{
    lanes_u a, b, c, d;
    const char *at = (const char *)vertices;
    memcpy(&a, at, sizeof a);
    memcpy(&b, at + sizeof a, sizeof b);
    memcpy(&c, at + 2 * sizeof a, sizeof c);
    memcpy(&d, at + 3 * sizeof a, sizeof d);
    lanes_u xy0 = LANES_LOW(a, b), zc0 = LANES_HIGH(a, b);
    lanes_u xy1 = LANES_LOW(c, d), zc1 = LANES_HIGH(c, d);
    return (rcpu_block){LANES_LOW2(xy0, xy1), LANES_HIGH2(xy0, xy1), LANES_LOW2(zc0, zc1),
                        LANES_HIGH2(zc0, zc1)};
}

/* Integers first, so that all 32 bits count; then floats. */
static inline lanes_f rcpu_away(lanes_u position, uint32_t anchor, float offset)
{
    lanes_u from = (lanes_u){0} + anchor;
    lanes_u behind = (lanes_u)(position < from);
    lanes_u distance = ((position - from) ^ behind) - behind;
    lanes_u bits = (lanes_u) __builtin_convertvector(distance, lanes_f) ^ (behind & 0x80000000u);
    return (lanes_f)bits + offset;
}

/* Whether points are inside of the box that is shown. */
static inline lanes_i clip_of(const rcpu_view *v, const rcpu_block *block)
{
    const uint32_t *low = v->clip_low, *high = v->clip_high;
    if (!v->has_clip) return (lanes_i){0} - 1;
    return (lanes_i)((block->x >= low[0]) & (block->x <= high[0]) & (block->y >= low[1]) &
                     (block->y <= high[1]) & (block->z >= low[2]) & (block->z <= high[2]));
}

static inline rcpu_places rcpu_project(const rcpu_view *v, const rcpu_block *block)
{
    const float *m = v->rotation;
    lanes_f gx = rcpu_away(block->x, v->anchor[0], v->offset[0]);
    lanes_f gy = rcpu_away(block->y, v->anchor[1], v->offset[1]);
    lanes_f gz = rcpu_away(block->z, v->anchor[2], v->offset[2]);
    lanes_f ex = (gx * m[0] + gy * m[3]) + gz * m[6];
    lanes_f ey = (gx * m[1] + gy * m[4]) + gz * m[7];
    lanes_f w = -((gx * m[2] + gy * m[5]) + gz * m[8]);
    lanes_f cx = ex * v->inverse_tan[0], cy = ey * v->inverse_tan[1];
    lanes_f half_x = lanes_all(0.5f * (float)v->size.width),
            half_y = lanes_all(0.5f * (float)v->size.height);
    lanes_f each = 1.0f / w;
    lanes_i inside = clip_of(v, block) & (w >= v->near_w) & (w <= v->far_w) & (cx <= w) &
                     (cx >= -w) & (cy <= w) & (cy >= -w);
    return (rcpu_places){
        .inside = inside,
        .x = lanes_pick(inside, (cx * each) * half_x + half_x, lanes_all(0)),
        .y = lanes_pick(inside, (cy * each) * half_y + half_y, lanes_all(0)),
        .w = w,
    };
}

/* Pixels in 256ths, rounded; not negative inside the view. */
static inline lanes_i rcpu_snap(lanes_f pixels)
{
    return __builtin_convertvector(pixels * 256.0f + 0.5f, lanes_i);
}

/* Distances above colours, for each lane; `keys` holds them in the order of rcpu_key_lane(). */
static inline void rcpu_keys(lanes_f w, lanes_u colour, int64_t keys[RCPU_LANES])
{
    lanes_u low = LANES_LOW(colour, (lanes_u)w), high = LANES_HIGH(colour, (lanes_u)w);
    memcpy(keys, &low, sizeof low);
    memcpy(keys + RCPU_LANES / 2, &high, sizeof high);
}

/* The lane whose key stands at a place: keys of a quarter stand side by side. */
static inline uint32_t rcpu_key_lane(uint32_t at)
{
    uint32_t half = RCPU_LANES / 2, high = at >= half, within = at - high * half;
    return within / 2 * 4 + within % 2 + 2 * high;
}

/* The vertex of a block that a lane holds: rcpu_load() deals them to the quarters. */
static inline uint32_t rcpu_lane_vertex(uint32_t lane)
{
    return lane % 4 * (RCPU_LANES / 4) + lane / 4;
}
