#include "preprocess/laz_items.h"

#include <stdlib.h>
#include <string.h>

enum { WINDOW_SIZE = 64 * 1024 };

/* One context per combination of return number (columns) and number of returns (rows); the sensible
 * ones of up to five returns have one of their own, the others share. */
static const uint8_t return_context[8][8] = {
    {15, 14, 13, 12, 11, 10, 9, 8},  {14, 0, 1, 3, 6, 10, 10, 9},
    {13, 1, 2, 4, 7, 11, 11, 10},    {12, 3, 4, 5, 8, 12, 12, 11},
    {11, 6, 7, 8, 9, 13, 13, 12},    {10, 10, 11, 12, 13, 14, 14, 13},
    {9, 10, 11, 12, 13, 14, 15, 14}, {8, 9, 10, 11, 12, 13, 14, 15},
};

typedef struct {
    uint32_t x, y, z;
    uint8_t returns, classification, angle, user;
    uint16_t intensity, source;
    /* version 1 */
    int32_t x_step[3], y_step[3];
    uint32_t oldest;
    /* version 2 */
    prep_laz_median x_median[16], y_median[16];
    uint32_t height[8];
    uint16_t intensities[16];

    prep_laz_model *changed, *returns_model[256], *classification_model[256], *user_model[256],
        *angle_model[2];
    prep_laz_integer x_integer, y_integer, z_integer, intensity_integer, source_integer,
        angle_integer;
    prep_laz_model *x_context[2], *y_context[22], *z_context[20], *intensity_context[4],
        *source_context, *angle_context[2];
} point_state;

struct prep_laz_rows {
    prep_laz_format format;
    prep_laz_arena arena;
    prep_laz_stream stream;
    uint8_t *window; /* owned */
    size_t need, window_capacity;
    point_state point;
    prep_laz_gps gps;
    prep_laz_rgb rgb;
    prep_laz_wave wave;
    prep_laz_integer extra_integer; /* version 1 */
    prep_laz_model *
        *extra_model; /* [extra_size], owned: of the byte, or in version 1 of its magnitude */
    uint8_t *last; /* [record_length], owned: colour, packet and extra bytes of the last record */
};

static size_t arena_size(const prep_laz_format *f)
{
    size_t size = prep_laz_model_size(64) + (3 * 256 + 2) * prep_laz_model_size(256);
    size += prep_laz_integer_size(32, 2) + prep_laz_integer_size(32, 22) +
            prep_laz_integer_size(32, 20);
    size +=
        prep_laz_integer_size(16, 4) + prep_laz_integer_size(16, 1) + prep_laz_integer_size(8, 2);
    if (f->gps_at != 0) size += prep_laz_gps_size();
    if (f->rgb_at != 0) size += prep_laz_rgb_size();
    if (f->wave_at != 0) size += prep_laz_wave_size();
    return size + f->extra_size * prep_laz_model_size(256) + prep_laz_integer_size(8, 0);
}

prep_laz_rows *prep_laz_rows_create(const prep_laz_format *format)
{
    prep_laz_rows *s = calloc(1, sizeof *s);
    if (s == NULL) return NULL;
    s->format = *format;
    s->need = PREP_LAZ_POINT_NEED + PREP_LAZ_GPS_NEED + PREP_LAZ_RGB_NEED + PREP_LAZ_WAVE_NEED +
              (size_t)format->extra_size * PREP_LAZ_BYTE_NEED;
    s->window_capacity = prep_laz_stream_capacity(UINT64_MAX, s->need, WINDOW_SIZE);
    s->window = malloc(s->window_capacity + prep_laz_stream_margin(s->need));
    s->arena.size = arena_size(format);
    s->arena.bytes = malloc(s->arena.size); /* touched only as far as it is used */
    s->extra_model = calloc((size_t)format->extra_size + 1, sizeof(prep_laz_model *));
    s->last = malloc(format->record_length);
    if (s->window != NULL && s->arena.bytes != NULL && s->extra_model != NULL && s->last != NULL)
        return s;
    prep_laz_rows_destroy(s);
    return NULL;
}

void prep_laz_rows_destroy(prep_laz_rows *s)
{
    if (s == NULL) return;
    free(s->window);
    free(s->arena.bytes);
    free(s->extra_model);
    free(s->last);
    free(s);
}

static void begin_point(point_state *p, const uint8_t *record, bool is_old)
{
    memset(p, 0, sizeof *p);
    p->x = prep_le32(record);
    p->y = prep_le32(record + 4);
    p->z = prep_le32(record + 8);
    p->intensity = is_old ? prep_le16(record + 12) : 0;
    p->returns = record[14];
    p->classification = record[15];
    p->angle = record[16];
    p->user = record[17];
    p->source = prep_le16(record + 18);
    prep_laz_integer_init(&p->x_integer, 32);
    prep_laz_integer_init(&p->y_integer, 32);
    prep_laz_integer_init(&p->z_integer, 32);
    prep_laz_integer_init(&p->intensity_integer, 16);
    prep_laz_integer_init(&p->source_integer, 16);
    prep_laz_integer_init(&p->angle_integer, 8);
}

bool prep_laz_rows_begin(prep_laz_rows *s, prep_laz_source source, uint8_t *first, mospt_err *err)
{
    const prep_laz_format *f = &s->format;
    if (!prep_laz_source_take(&source, first, f->record_length, err)) return false;
    s->arena.used = 0;
    begin_point(&s->point, first, f->version == 1);
    if (f->gps_at != 0) prep_laz_gps_init(&s->gps, prep_le64(first + f->gps_at));
    prep_laz_rgb_init(&s->rgb);
    prep_laz_wave_init(&s->wave);
    prep_laz_integer_init(&s->extra_integer, 8);
    memset(s->extra_model, 0, ((size_t)f->extra_size + 1) * sizeof(prep_laz_model *));
    memcpy(s->last, first, f->record_length);
    return prep_laz_stream_begin(&s->stream, source, s->window, s->window_capacity,
                                 prep_laz_stream_margin(s->need), err);
}

uint64_t prep_laz_rows_left(const prep_laz_rows *s)
{
    return prep_laz_stream_left(&s->stream);
}

/* What versions 1 and 2 read alike: the new value of a byte, whose old value picks the model. */
PREP_LAZ_INLINE uint8_t read_by_last(prep_laz_range *r, prep_laz_arena *arena,
                                     prep_laz_model **models, uint8_t last)
{
    return (uint8_t)prep_laz_range_symbol(r, prep_laz_model_at(&models[last], arena, 256));
}

PREP_LAZ_INLINE void read_attributes(prep_laz_range *r, prep_laz_arena *arena, point_state *p,
                                     uint32_t changed)
{
    if (changed & 32) p->returns = read_by_last(r, arena, p->returns_model, p->returns);
    uint32_t number = p->returns & 7, returns = p->returns >> 3 & 7,
             m = return_context[returns][number];
    if (changed & 16)
        p->intensities[m] = (uint16_t)prep_laz_integer_read(r, arena, &p->intensity_integer,
                                                            &p->intensity_context[m < 3 ? m : 3],
                                                            p->intensities[m]);
    p->intensity = p->intensities[m];
    if (changed & 8)
        p->classification = read_by_last(r, arena, p->classification_model, p->classification);
    if (changed & 4)
        p->angle =
            (uint8_t)prep_laz_byte_read(r, arena, &p->angle_model[p->returns >> 6 & 1], p->angle);
    if (changed & 2) p->user = read_by_last(r, arena, p->user_model, p->user);
    if (changed & 1)
        p->source = (uint16_t)prep_laz_integer_read(r, arena, &p->source_integer,
                                                    &p->source_context, p->source);
}

static inline uint32_t even_at_most(uint32_t magnitude, uint32_t most)
{
    return magnitude < most ? magnitude & ~1u : most;
}

PREP_LAZ_INLINE void read_point(prep_laz_range *r, prep_laz_arena *arena, point_state *p)
{
    uint32_t changed = prep_laz_range_symbol(r, prep_laz_model_at(&p->changed, arena, 64));
    if (changed != 0) read_attributes(r, arena, p, changed);

    uint32_t number = p->returns & 7, returns = p->returns >> 3 & 7,
             m = return_context[returns][number];
    uint32_t level = returns > number ? returns - number : number - returns;
    bool is_single = returns == 1;
    prep_laz_median *x = &p->x_median[m], *y = &p->y_median[m];
    uint32_t step = prep_laz_integer_read(r, arena, &p->x_integer, &p->x_context[is_single],
                                          (uint32_t)x->sorted[2]);
    p->x += step;
    prep_laz_median_add(x, (int32_t)step);

    uint32_t k = p->x_integer.magnitude;
    step = prep_laz_integer_read(r, arena, &p->y_integer,
                                 &p->y_context[even_at_most(k, 20) + is_single],
                                 (uint32_t)y->sorted[2]);
    p->y += step;
    prep_laz_median_add(y, (int32_t)step);

    k = (k + p->y_integer.magnitude) / 2;
    p->z = p->height[level] = prep_laz_integer_read(
        r, arena, &p->z_integer, &p->z_context[even_at_most(k, 18) + is_single], p->height[level]);
}

static uint32_t median_of_3(const int32_t v[3])
{
    int32_t low = prep_laz_lesser(v[0], v[1]), high = prep_laz_greater(v[0], v[1]);
    return (uint32_t)prep_laz_greater(low, prep_laz_lesser(high, v[2]));
}

PREP_LAZ_INLINE void read_old_point(prep_laz_range *r, prep_laz_arena *arena, point_state *p)
{
    uint32_t x =
        prep_laz_integer_read(r, arena, &p->x_integer, &p->x_context[0], median_of_3(p->x_step));
    uint32_t k = p->x_integer.magnitude;
    uint32_t y = prep_laz_integer_read(r, arena, &p->y_integer, &p->y_context[k < 19 ? k : 19],
                                       median_of_3(p->y_step));
    k = (k + p->y_integer.magnitude) / 2;
    p->x += x;
    p->y += y;
    p->z = prep_laz_integer_read(r, arena, &p->z_integer, &p->z_context[k < 19 ? k : 19], p->z);
    p->x_step[p->oldest] = (int32_t)x;
    p->y_step[p->oldest] = (int32_t)y;
    p->oldest = (p->oldest + 1) % 3;

    uint32_t changed = prep_laz_range_symbol(r, prep_laz_model_at(&p->changed, arena, 64));
    if (changed & 32)
        p->intensity = (uint16_t)prep_laz_integer_read(r, arena, &p->intensity_integer,
                                                       &p->intensity_context[0], p->intensity);
    if (changed & 16) p->returns = read_by_last(r, arena, p->returns_model, p->returns);
    if (changed & 8)
        p->classification = read_by_last(r, arena, p->classification_model, p->classification);
    if (changed & 4)
        p->angle = (uint8_t)prep_laz_integer_read(r, arena, &p->angle_integer,
                                                  &p->angle_context[k < 3], p->angle);
    if (changed & 2) p->user = read_by_last(r, arena, p->user_model, p->user);
    if (changed & 1)
        p->source = (uint16_t)prep_laz_integer_read(r, arena, &p->source_integer,
                                                    &p->source_context, p->source);
}

/* Version 1 knows one sequence of times only, and codes a multiple of the step, or all 64 bits. */
PREP_LAZ_INLINE void read_old_gps(prep_laz_range *r, prep_laz_arena *arena, prep_laz_gps *g)
{
    enum { MOST = 509, FULL = 510, SAME = 511 };
    uint32_t code, delta, step = (uint32_t)g->step[0];
    if (step == 0) {
        code = prep_laz_range_symbol(r, prep_laz_model_at(&g->first, arena, 3));
        if (code == 1) {
            g->step[0] = (int32_t)prep_laz_integer_read(r, arena, &g->integer, &g->context[0], 0);
            g->time[0] += (uint64_t)(int64_t)g->step[0];
        } else if (code == 2) {
            g->time[0] = prep_laz_range_bits_64(r);
        }
        return;
    }
    code = prep_laz_range_symbol(r, prep_laz_model_at(&g->multiple, arena, 512));
    if (code == SAME) return;
    if (code == FULL) {
        g->time[0] = prep_laz_range_bits_64(r);
        return;
    }
    uint32_t context = code == 1 ? 1 : code == 0 ? 2 : code < 10 ? 3 : code < 50 ? 4 : 5;
    uint32_t prediction = code == 0 ? (uint32_t)(g->step[0] / 4) : code * step;
    delta = prep_laz_integer_read(r, arena, &g->integer, &g->context[context], prediction);
    if (code == 1) {
        g->step[0] = (int32_t)delta;
        g->extremes[0] = 0;
    }
    if (code == 0 || code == MOST) prep_laz_gps_doubt(g, 0, delta);
    g->time[0] += (uint64_t)(int64_t)(int32_t)delta;
}

PREP_LAZ_INLINE void read_old_rgb(prep_laz_range *r, prep_laz_arena *arena, prep_laz_rgb *rgb,
                                  uint8_t *last)
{
    uint32_t changed = prep_laz_range_symbol(r, prep_laz_model_at(&rgb->changed, arena, 64));
    for (uint32_t i = 0; i < 6; i++) {
        if (changed >> i & 1)
            last[i] =
                (uint8_t)prep_laz_integer_read(r, arena, &rgb->integer, &rgb->context[i], last[i]);
    }
}

PREP_LAZ_INLINE void read_extra(prep_laz_range *r, prep_laz_rows *s, uint8_t *last, bool is_old)
{
    for (uint32_t i = 0; i < s->format.extra_size; i++) {
        prep_laz_model **model = &s->extra_model[i];
        last[i] = (uint8_t)(is_old ? prep_laz_integer_read(r, &s->arena, &s->extra_integer, model,
                                                           last[i])
                                   : prep_laz_byte_read(r, &s->arena, model, last[i]));
    }
}

static inline void put_point(const point_state *p, uint8_t *record)
{
    prep_put_le32(record, p->x);
    prep_put_le32(record + 4, p->y);
    prep_put_le32(record + 8, p->z);
    prep_put_le16(record + 12, p->intensity);
    record[14] = p->returns;
    record[15] = p->classification;
    record[16] = p->angle;
    record[17] = p->user;
    prep_put_le16(record + 18, p->source);
}

/* The compiler makes one of these for each version. */
PREP_LAZ_INLINE size_t read_rows(prep_laz_rows *s, uint8_t *record, size_t count, bool is_old)
{
    const prep_laz_format f = s->format;
    prep_laz_arena *arena = &s->arena;
    prep_laz_range r = s->stream.range;
    size_t i = 0;
    for (; i < count && prep_laz_ready(&s->stream, &r); i++, record += f.record_length) {
        if (is_old) read_old_point(&r, arena, &s->point);
        else read_point(&r, arena, &s->point);
        put_point(&s->point, record);
        if (f.gps_at != 0) {
            if (is_old) read_old_gps(&r, arena, &s->gps);
            else prep_laz_gps_read(&r, arena, &s->gps, true);
            prep_put_le64(record + f.gps_at, s->gps.time[s->gps.current]);
        }
        if (f.rgb_at != 0) {
            if (is_old) read_old_rgb(&r, arena, &s->rgb, s->last + f.rgb_at);
            else prep_laz_rgb_read(&r, arena, &s->rgb, s->last + f.rgb_at);
            memcpy(record + f.rgb_at, s->last + f.rgb_at, 6);
        }
        if (f.wave_at != 0) {
            s->stream.range = r;
            prep_laz_wave_read(&s->stream, arena, &s->wave, s->last + f.wave_at);
            r = s->stream.range;
            memcpy(record + f.wave_at, s->last + f.wave_at, PREP_LAZ_WAVE_SIZE);
        }
        if (f.extra_size != 0) {
            read_extra(&r, s, s->last + f.extra_at, is_old);
            memcpy(record + f.extra_at, s->last + f.extra_at, f.extra_size);
        }
    }
    s->stream.range = r;
    return i;
}

size_t prep_laz_rows_read(prep_laz_rows *s, uint8_t *records, size_t count)
{
    size_t got = s->format.version == 1 ? read_rows(s, records, count, true)
                                        : read_rows(s, records, count, false);
    return got - (got > 0 &&
                  prep_laz_stream_is_beyond(&s->stream)); /* the last record was made of nothing */
}
