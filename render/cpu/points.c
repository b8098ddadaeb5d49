/* Points of one pixel: the common case where there are many. */
#include "render/cpu/project.h"

void RCPU_NAME(points)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame);

/* The pixels of a block: of two beside the same edge, GL takes the left and the lower one. */
static lanes_i pixels_of(const rcpu_view *v, const rcpu_places *p)
{
    lanes_i column = (rcpu_snap(p->x) - 1) >> 8;
    lanes_i row = (int32_t)v->size.height - 1 - ((rcpu_snap(p->y) - 1) >> 8);
    lanes_i shown = p->inside & (column >= 0) & (row < (int32_t)v->size.height);
    int32_t nowhere = (int32_t)(v->size.stride * v->size.height);
    return lanes_pick_i(shown, row * (int32_t)v->size.stride + column, (lanes_i){0} + nowhere);
}

static inline void draw_block(const rcpu_view *v, const mospt_vertex *vertices, int64_t *frame)
{
    rcpu_block block = rcpu_load(vertices);
    rcpu_places places = rcpu_project(v, &block);
    lanes_i pixels = pixels_of(v, &places);
    int64_t keys[RCPU_LANES];
    int32_t at[RCPU_LANES];
    rcpu_keys(places.w, block.colour, keys);
    memcpy(at, &pixels, sizeof pixels);
    for (uint32_t k = 0; k < RCPU_LANES; k++) {
        int64_t *pixel = &frame[at[rcpu_key_lane(k)]];
        if (keys[k] < *pixel) *pixel = keys[k];
    }
}

void RCPU_NAME(points)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame)
{
    uint32_t i = 0;
    for (; i + RCPU_LANES <= count; i += RCPU_LANES)
        draw_block(view, vertices + i, frame);
    if (i == count) return;
    mospt_vertex last[RCPU_LANES];
    for (uint32_t k = 0; k < RCPU_LANES; k++)
        last[k] = vertices[i + k < count ? i + k : i]; /* the same one twice changes nothing */
    draw_block(view, last, frame);
}
