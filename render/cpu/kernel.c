/* The functions of one instruction set. */
#include "render/cpu/lanes.h"

void RCPU_NAME(points)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame);
void RCPU_NAME(splats)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame);
void RCPU_NAME(merge)(int64_t *const *frames, uint32_t frame_count, size_t from, size_t count);
void RCPU_NAME(look)(const int64_t *row, uint32_t count, float *logs, uint32_t *colours);
void RCPU_NAME(blend)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                      const rcpu_front *front, rcpu_sums *sums);
void RCPU_NAME(limit)(const int64_t *row, uint32_t count, float slab, float *limits);
void RCPU_NAME(resolve)(const rcpu_sums *sums, uint32_t sums_count, size_t from, uint32_t count,
                        const float *nearest, float slab_log, float *logs, uint32_t *colours);
void RCPU_NAME(fill)(const rcpu_hole *hole, uint32_t y, const rcpu_layer *from,
                     const rcpu_layer *to);
void RCPU_NAME(shade)(const rcpu_light *light, uint32_t y, const rcpu_layer *layer, uint32_t *rgba);
extern const rcpu_kernel RCPU_NAME(kernel);

#define NAME_OF(name) #name
#define NAME(name) NAME_OF(name)

const rcpu_kernel RCPU_NAME(kernel) = {
    .name = NAME(RCPU_KERNEL),
    .points = RCPU_NAME(points),
    .splats = RCPU_NAME(splats),
    .merge = RCPU_NAME(merge),
    .look = RCPU_NAME(look),
    .blend = RCPU_NAME(blend),
    .limit = RCPU_NAME(limit),
    .resolve = RCPU_NAME(resolve),
    .fill = RCPU_NAME(fill),
    .shade = RCPU_NAME(shade),
};
