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

/* Places first, pixels afterwards: which of them are nearer cannot be foretold, and the more places
 * are known by then, the less a wrong guess costs. */
enum { BLOCK = 64 };

/* Returns whether any of them is in the view. */
static bool place_block(const rcpu_view *v, const mospt_vertex *vertices, int64_t keys[BLOCK],
                        int32_t at[BLOCK])
{
    lanes_i any = {0};
    for (uint32_t i = 0; i < BLOCK; i += RCPU_LANES) {
        rcpu_block block = rcpu_load(vertices + i);
        rcpu_places places = rcpu_project(v, &block);
        lanes_i pixels = pixels_of(v, &places);
        rcpu_keys(places.w, block.colour, keys + i);
        memcpy(at + i, &pixels, sizeof pixels);
        any |= places.inside;
    }
    return lanes_any(any);
}

static void draw_block(const rcpu_view *v, const mospt_vertex *vertices, int64_t *frame)
{
    int64_t keys[BLOCK];
    int32_t at[BLOCK];
    if (!place_block(v, vertices, keys, at)) return;
    for (uint32_t i = 0; i < BLOCK; i += RCPU_LANES)
        for (uint32_t k = 0; k < RCPU_LANES; k++) {
            int64_t *pixel = &frame[at[i + rcpu_key_lane(k)]];
            if (keys[i + k] < *pixel) *pixel = keys[i + k];
        }
}

void RCPU_NAME(points)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame)
{
    uint32_t i = 0;
    for (; i + BLOCK <= count; i += BLOCK)
        draw_block(view, vertices + i, frame);
    if (i == count) return;
    mospt_vertex last[BLOCK];
    for (uint32_t k = 0; k < BLOCK; k++)
        last[k] = vertices[i + k < count ? i + k : i]; /* the same one twice changes nothing */
    draw_block(view, last, frame);
}
