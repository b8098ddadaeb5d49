/* Holes are closed from their borders: section 3 of render/gl/rgl.h. */
#include "render/cpu/lanes.h"

#include <math.h>

void RCPU_NAME(fill)(const rcpu_hole *hole, uint32_t y, const rcpu_layer *from,
                     const rcpu_layer *to);

/* The directions around a pixel, with y upwards. */
static int32_t sector_of(int i, int j)
{
    if (i > 0 && j >= 0) return j < i ? 1 : 2;
    if (i <= 0 && j > 0) return -i < j ? 4 : 8;
    if (i < 0 && j <= 0) return -j < -i ? 16 : 32;
    return i < -j ? 64 : 128;
}

/* Of RCPU_LANES pixels. */
typedef struct {
    lanes_f front, limit, nearest;
    lanes_f red, green, blue, depth, weights;
    lanes_i found;
} fill_state;

/* Logarithms of neighbours, those beyond the picture as if they were sky. */
static inline lanes_f logs_at(const rcpu_hole *hole, const rcpu_layer *from, size_t at, int32_t x)
{
    lanes_f logs;
    lanes_i column;
    memcpy(&logs, from->logs + at, sizeof logs);
    for (int l = 0; l < RCPU_LANES; l++)
        column[l] = x + l;
    lanes_i within = (column >= 0) & (column < (int32_t)hole->size.width);
    return lanes_pick(within, logs, lanes_all(RCPU_SKY));
}

static inline lanes_f channel_of(lanes_u colours, int shift)
{
    return __builtin_convertvector((lanes_i)(colours >> shift & 255u), lanes_f);
}

static inline void add_neighbour(const rcpu_layer *from, size_t at, lanes_f logs, int32_t sector,
                                 float weight, fill_state *s)
{
    lanes_u colours;
    lanes_i near = logs <= s->limit;
    memcpy(&colours, from->colours + at, sizeof colours);
    lanes_f share = lanes_pick(near, lanes_all(weight), lanes_all(0));
    s->found |= near & sector;
    s->red += share * channel_of(colours, 0);
    s->green += share * channel_of(colours, 8);
    s->blue += share * channel_of(colours, 16);
    s->depth += lanes_pick(near, weight * logs, lanes_all(0));
    s->weights += share;
}

/* Goes over the neighbours, for what is nearest, or for the sums of the near ones. */
static inline void look_around(const rcpu_hole *hole, uint32_t y, int32_t x, const rcpu_layer *from,
                               bool sums, fill_state *s)
{
    int radius = hole->radius;
    for (int j = -radius; j <= radius; j++) {
        int64_t row = (int64_t)y - j; /* j upwards, rows downwards */
        if (row < 0 || row >= (int64_t)hole->size.height) continue;
        for (int i = -radius; i <= radius; i++) {
            int square = i * i + j * j;
            if (square == 0 || square > radius * (radius + 1)) continue;
            size_t at = (size_t)(row * from->stride + from->margin + x + i);
            lanes_f logs = logs_at(hole, from, at, x + i);
            if (sums) add_neighbour(from, at, logs, sector_of(i, j), 1.0f / (float)square, s);
            else s->nearest = lanes_min(s->nearest, logs);
        }
    }
}

static inline lanes_u mean_of(lanes_f sum, lanes_f weights, int shift)
{
    return (lanes_u) __builtin_convertvector(sum / weights + 0.5f, lanes_i) << shift;
}

/* Fills those of RCPU_LANES pixels that are holes. */
static inline void fill_block(const rcpu_hole *hole, uint32_t y, int32_t x, const rcpu_layer *from,
                              const rcpu_layer *to)
{
    size_t at = (size_t)y * from->stride + from->margin + (size_t)x;
    fill_state s = {.nearest = lanes_all(RCPU_SKY)};
    lanes_f here;
    lanes_u colours;
    memcpy(&here, from->logs + at, sizeof here);
    memcpy(&colours, from->colours + at, sizeof colours);
    s.front = lanes_pick(here == RCPU_SKY, lanes_all(hole->far_log), here) - hole->behind_log;
    look_around(hole, y, x, from, false, &s);
    if (lanes_any(s.nearest <= s.front)) {
        s.limit = lanes_min(s.front, s.nearest + hole->spread_log);
        look_around(hole, y, x, from, true, &s);
        lanes_i turned = s.found >> 1 | (s.found & 1) << 7;
        lanes_i closed = (s.nearest <= s.front) & ((s.found | turned) == 255);
        lanes_u mean = mean_of(s.red, s.weights, 0) | mean_of(s.green, s.weights, 8) |
                       mean_of(s.blue, s.weights, 16);
        here = lanes_pick(closed, s.depth / s.weights, here);
        colours = (lanes_u)lanes_pick_i(closed, (lanes_i)mean, (lanes_i)colours);
    }
    memcpy(to->logs + at, &here, sizeof here);
    memcpy(to->colours + at, &colours, sizeof colours);
}

void RCPU_NAME(fill)(const rcpu_hole *hole, uint32_t y, const rcpu_layer *from,
                     const rcpu_layer *to)
{
    for (uint32_t x = 0; x < hole->size.width; x += RCPU_LANES)
        fill_block(hole, y, (int32_t)x, from, to);
}
