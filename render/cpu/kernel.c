/* The functions of one instruction set. */
#include "render/cpu/lanes.h"

void RCPU_NAME(points)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame);
void RCPU_NAME(splats)(const rcpu_view *view, const mospt_vertex *vertices, uint32_t count,
                       int64_t *frame);
void RCPU_NAME(merge)(int64_t *const *frames, uint32_t frame_count, size_t from, size_t count);
void RCPU_NAME(logs)(const int64_t *row, uint32_t count, float *out);
void RCPU_NAME(shade)(const rcpu_light *light, uint32_t y, const int64_t *frame, const float *logs,
                      uint32_t *rgba);
extern const rcpu_kernel RCPU_NAME(kernel);

#define NAME_OF(name) #name
#define NAME(name) NAME_OF(name)

const rcpu_kernel RCPU_NAME(kernel) = {
    .name = NAME(RCPU_KERNEL),
    .points = RCPU_NAME(points),
    .splats = RCPU_NAME(splats),
    .merge = RCPU_NAME(merge),
    .logs = RCPU_NAME(logs),
    .shade = RCPU_NAME(shade),
};
