/* From distances and colours to a picture: the terms of RGL_SHADE_FRAGMENT. */
#include "render/cpu/lanes.h"
#include "render/cpu/log.h"

#include <math.h>

void RCPU_NAME(look)(const int64_t *row, uint32_t count, float *logs, uint32_t *colours);
void RCPU_NAME(shade)(const rcpu_light *light, uint32_t y, const rcpu_layer *layer, uint32_t *rgba);

void RCPU_NAME(look)(const int64_t *row, uint32_t count, float *restrict logs,
                     uint32_t *restrict colours)
{
    for (uint32_t i = 0; i < count; i++) {
        float log = rcpu_log2((uint32_t)(row[i] >> 32));
        logs[i] = row[i] == RCPU_EMPTY ? RCPU_SKY : log;
        colours[i] = (uint32_t)row[i];
    }
}

/* e^x for x <= 0: 2 to the whole part, times a polynomial for what is left. */
static inline lanes_f exp_of(lanes_f x)
{
    lanes_f y = lanes_max(x * 1.44269504f, lanes_all(-126));
    lanes_i whole = __builtin_convertvector(y - 0.5f, lanes_i); /* towards 0: to the nearest */
    lanes_f f = y - __builtin_convertvector(whole, lanes_f);
    lanes_f p =
        1.0f + f * (0.693147181f +
                    f * (0.240226507f +
                         f * (0.0555041087f +
                              f * (0.00961812911f + f * (0.00133335581f + f * 0.000154035304f)))));
    return p * (lanes_f)((whole + 127) << 23);
}

static inline lanes_f load(const float *at)
{
    lanes_f v;
    memcpy(&v, at, sizeof v);
    return v;
}

/* How much nearer two opposite neighbours are. */
static inline lanes_f nearer(lanes_f here, const float *one, const float *other)
{
    lanes_f a = load(one), b = load(other), none = lanes_all(0);
    lanes_f da = lanes_pick(a < RCPU_SKY, here - a, none);
    lanes_f db = lanes_pick(b < RCPU_SKY, here - b, none);
    lanes_f bend = lanes_max(da + db, none), slope = lanes_max(da, none) + lanes_max(db, none);
    lanes_f sum = bend * 0.75f + slope * 0.25f;
    return sum / (1.0f + 60.0f * sum);
}

static inline lanes_u scale_channel(lanes_u colours, uint32_t shift, lanes_f factor)
{
    lanes_u channel = colours >> shift & 255u;
    lanes_f value = __builtin_convertvector((lanes_i)channel, lanes_f) * factor + 0.5f;
    return (lanes_u) __builtin_convertvector(value, lanes_i) << shift;
}

static uint32_t background(const rcpu_light *light, uint32_t y)
{
    float height = (float)light->size.height, t = (height - (float)y - 0.5f) / height;
    uint32_t rgba = 0;
    for (int c = 0; c < 3; c++) {
        float value = light->background_bottom[c] * (1 - t) + light->background_top[c] * t;
        value = value < 0 ? 0 : value > 1 ? 1 : value;
        rgba |= (uint32_t)(value * 255 + 0.5f) << 8 * c;
    }
    return rgba;
}

/* Rows of logarithms above and below, the outermost ones for those beyond. */
typedef struct {
    const float *here, *up, *down, *far_up, *far_down;
} rows;

static const float *row_at(const rcpu_light *light, const rcpu_layer *layer, int64_t y)
{
    int64_t last = (int64_t)light->size.height - 1;
    y = y < 0 ? 0 : y > last ? last : y;
    return layer->logs + (size_t)y * layer->stride + layer->margin;
}

static inline lanes_f brightness(const rcpu_light *light, const rows *r, lanes_f here, uint32_t x)
{
    int s = light->straight, d = light->diagonal;
    lanes_f sum = nearer(here, r->here + x + s, r->here + x - s);
    sum = sum + nearer(here, r->far_up + x, r->far_down + x);
    sum = sum + nearer(here, r->up + x + d, r->down + x - d);
    sum = sum + nearer(here, r->down + x + d, r->up + x - d);
    return exp_of(sum * -light->edl_strength);
}

void RCPU_NAME(shade)(const rcpu_light *light, uint32_t y, const rcpu_layer *layer, uint32_t *rgba)
{
    const rows r = {
        .here = row_at(light, layer, y),
        .up = row_at(light, layer, (int64_t)y - light->diagonal),
        .down = row_at(light, layer, (int64_t)y + light->diagonal),
        .far_up = row_at(light, layer, (int64_t)y - light->straight),
        .far_down = row_at(light, layer, (int64_t)y + light->straight),
    };
    const uint32_t *row = layer->colours + (size_t)y * layer->stride + layer->margin;
    lanes_u behind = (lanes_u){0} + background(light, y), colours;
    for (uint32_t x = 0; x < light->size.width; x += RCPU_LANES) {
        lanes_f here = load(r.here + x);
        memcpy(&colours, row + x, sizeof colours);
        if (light->edl_strength > 0) {
            lanes_f factor = brightness(light, &r, here, x);
            colours = scale_channel(colours, 0, factor) | scale_channel(colours, 8, factor) |
                      scale_channel(colours, 16, factor);
        }
        lanes_u sky = (lanes_u)(here == RCPU_SKY);
        lanes_u shown = (behind & sky) | (colours & ~sky);
        memcpy(rgba + x, &shown, sizeof shown);
    }
}
