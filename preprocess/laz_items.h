/* preprocess/laz_items.h - the parts of a compressed record. Internal to the LAZ decoder.
 *
 * "LAZ Specification 1.4", sections on the items. Two families: point formats 0 to 5 are coded
 * record by record (rows), all parts from one stream of bytes; 6 to 10 are coded part by part
 * (layers), each from its own. Both predict every part from the records before it, and share what
 * is below. A state belongs to one chunk: it is cleared where the next one begins. */
#pragma once
#include "preprocess/bytes.h"
#include "preprocess/laz.h"
#include "preprocess/laz_stream.h"

/* Bytes that a part takes at most, for prep_laz_stream_margin(). */
enum {
    PREP_LAZ_GPS_HOPS = 4, /* a writer that changes to another sequence goes there at once */
    PREP_LAZ_GPS_NEED = (PREP_LAZ_GPS_HOPS + 5) * PREP_LAZ_STEP_MAX + PREP_LAZ_INTEGER_MAX,
    PREP_LAZ_RGB_NEED = 7 * 2 * PREP_LAZ_STEP_MAX,
    PREP_LAZ_WAVE_NEED = 6 * PREP_LAZ_STEP_MAX + 6 * PREP_LAZ_INTEGER_MAX,
    PREP_LAZ_POINT_NEED = 4 * PREP_LAZ_STEP_MAX + 6 * PREP_LAZ_INTEGER_MAX,
    PREP_LAZ_BYTE_NEED = 2 * PREP_LAZ_STEP_MAX,
    PREP_LAZ_WAVE_SIZE = 29,
};

/* The median of the last five values, roughly: of five sorted ones the largest and the smallest
 * give way in turn. */
typedef struct {
    int32_t sorted[5];
    bool keeps_largest;
} prep_laz_median;

/* Up to four interleaved sequences of times, each with the step between its last two. */
typedef struct {
    uint32_t current, newest;
    uint64_t time[4];
    int32_t step[4];
    uint32_t extremes[4]; /* how often in a row the step was of no use */
    prep_laz_model *first, *multiple;
    prep_laz_integer integer;
    prep_laz_model *context[9];
} prep_laz_gps;

/* Models of a colour. Its bytes: red, green, blue, each the low byte first. */
typedef struct {
    prep_laz_model *changed, *byte[6];
    prep_laz_integer integer; /* version 1 only */
    prep_laz_model *context[6];
} prep_laz_rgb;

typedef struct {
    prep_laz_model *index, *how[4];
    uint32_t how_last;
    uint32_t step;
    prep_laz_integer offset, size, location, xyz;
    prep_laz_model *offset_context, *size_context, *location_context, *xyz_context[3];
} prep_laz_wave;

size_t prep_laz_gps_size(void); /* bytes of the arena that the models of a part take at most */
size_t prep_laz_rgb_size(void);
size_t prep_laz_wave_size(void);

void prep_laz_gps_init(prep_laz_gps *gps, uint64_t time);
void prep_laz_rgb_init(prep_laz_rgb *rgb);
void prep_laz_wave_init(prep_laz_wave *wave);

/* Reads the packet that follows `packet` and puts it there. */
void prep_laz_wave_read(prep_laz_stream *stream, prep_laz_arena *arena, prep_laz_wave *wave,
                        uint8_t *packet);

/* Point formats 0 to 5. */
typedef struct prep_laz_rows prep_laz_rows;
prep_laz_rows *prep_laz_rows_create(const prep_laz_format *format); /* NULL: no memory */
void prep_laz_rows_destroy(prep_laz_rows *rows);
/* Takes the first record of a chunk from the source, and prepares for the others.
 * returns  false if the source is too small for it */
bool prep_laz_rows_begin(prep_laz_rows *rows, prep_laz_source source, uint8_t *first,
                         mospt_err *err);
/* Reads the following records; fewer than `count` where the bytes end. */
size_t prep_laz_rows_read(prep_laz_rows *rows, uint8_t *records, size_t count);
uint64_t
prep_laz_rows_left(const prep_laz_rows *rows); /* bytes of the source that were not needed */

/* Point formats 6 to 10; the same, but a layer that is damaged leaves the others alone as long as
 * it is neither x, y nor z. */
typedef struct prep_laz_layers prep_laz_layers;
prep_laz_layers *prep_laz_layers_create(const prep_laz_format *format);
void prep_laz_layers_destroy(prep_laz_layers *layers);
/* errors   MOSPT_ENOMEM, MOSPT_EIO in `err`; its code is left alone if the source is too small */
bool prep_laz_layers_begin(prep_laz_layers *layers, prep_laz_source source, uint8_t *first,
                           mospt_err *err);
size_t prep_laz_layers_read(prep_laz_layers *layers, uint8_t *records, size_t count);
uint32_t
prep_laz_layers_count(const prep_laz_layers *layers); /* points, as the chunk itself says */
/* Reads the head of the chunk at the start of the source: its points, and its size, whether or not
 * the source has them. returns  false if the source is too small, or if reading failed, which alone
 * sets err->code */
bool prep_laz_layers_measure(const prep_laz_format *format, prep_laz_source source,
                             uint32_t *points, uint64_t *size, mospt_err *err);
/* A layer that ended too early or was not used up; NULL if there is none. Ask at the end of the
 * chunk. byte     out, where it begins */
const char *prep_laz_layers_damage(const prep_laz_layers *layers, uint64_t *byte);

/* Whether another point can be read from the stream of which `r` is the decoder. */
PREP_LAZ_INLINE bool prep_laz_ready(prep_laz_stream *stream, prep_laz_range *r)
{
    if (__builtin_expect(r->next <= stream->limit, 1)) return true;
    stream->range = *r;
    bool ok = prep_laz_stream_refill(stream);
    *r = stream->range;
    return ok;
}

static inline int32_t prep_laz_lesser(int32_t a, int32_t b)
{
    return a < b ? a : b;
}
static inline int32_t prep_laz_greater(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

/* Sorts a value in. The side that a value joins loses its end the next time. */
static inline void prep_laz_median_add(prep_laz_median *m, int32_t v)
{
    const int32_t a = m->sorted[0], b = m->sorted[1], c = m->sorted[2], d = m->sorted[3],
                  e = m->sorted[4];
    if (!m->keeps_largest) {
        m->sorted[0] = prep_laz_lesser(a, v);
        m->sorted[1] = prep_laz_greater(a, prep_laz_lesser(b, v));
        m->sorted[2] = prep_laz_greater(b, prep_laz_lesser(c, v));
        m->sorted[3] = prep_laz_greater(c, prep_laz_lesser(d, v));
        m->sorted[4] = prep_laz_greater(d, v);
        m->keeps_largest = v >= c;
    } else {
        m->sorted[0] = prep_laz_lesser(b, v);
        m->sorted[1] = prep_laz_lesser(c, prep_laz_greater(b, v));
        m->sorted[2] = prep_laz_lesser(d, prep_laz_greater(c, v));
        m->sorted[3] = prep_laz_lesser(e, prep_laz_greater(d, v));
        m->sorted[4] = prep_laz_greater(e, v);
        m->keeps_largest = v > c;
    }
}

/* A new step is accepted when the old one has failed to predict four times in a row. */
static inline void prep_laz_gps_doubt(prep_laz_gps *g, uint32_t i, uint32_t delta)
{
    if (++g->extremes[i] <= 3) return;
    g->step[i] = (int32_t)delta;
    g->extremes[i] = 0;
}

/* The next time is some multiple of the step away; `code` says which: 0 to 500, or -1 to -10 as 501
 * to 510. */
PREP_LAZ_INLINE void prep_laz_gps_multiple(prep_laz_range *r, prep_laz_arena *arena,
                                           prep_laz_gps *g, uint32_t code)
{
    enum { MOST = 500, LEAST_CODE = 510 };
    uint32_t i = g->current;
    int32_t times = code <= MOST ? (int32_t)code : MOST - (int32_t)code;
    uint32_t context = code == 1           ? 1
                       : code == 0         ? 7
                       : code < 10         ? 2
                       : code < MOST       ? 3
                       : code == MOST      ? 4
                       : code < LEAST_CODE ? 5
                                           : 6;
    uint32_t prediction = (uint32_t)times * (uint32_t)g->step[i];
    uint32_t delta = prep_laz_integer_read(r, arena, &g->integer, &g->context[context], prediction);
    if (code == 1) g->extremes[i] = 0;
    if (code == 0 || code == MOST || code == LEAST_CODE) prep_laz_gps_doubt(g, i, delta);
    g->time[i] += (uint64_t)(int64_t)(int32_t)delta;
}

/* The next time has nothing to do with the others and begins a sequence. */
PREP_LAZ_INLINE void prep_laz_gps_far(prep_laz_range *r, prep_laz_arena *arena, prep_laz_gps *g)
{
    uint32_t high = (uint32_t)(g->time[g->current] >> 32);
    high = prep_laz_integer_read(r, arena, &g->integer, &g->context[8], high);
    g->newest = g->current = (g->newest + 1) & 3;
    g->time[g->current] = (uint64_t)high << 32 | prep_laz_range_bits(r, 32);
    g->step[g->current] = 0;
    g->extremes[g->current] = 0;
}

/* Reads the time that follows g->time[g->current]. Versions 2 and 3.
 * has_same   the codes include one for a time that is the same as before (version 2) */
PREP_LAZ_INLINE void prep_laz_gps_read(prep_laz_range *r, prep_laz_arena *arena, prep_laz_gps *g,
                                       bool has_same)
{
    enum { FAR_CODE = 511 };
    for (uint32_t hop = 0; hop < PREP_LAZ_GPS_HOPS; hop++) {
        uint32_t i = g->current, code;
        if (g->step[i] == 0) {
            code = prep_laz_range_symbol(r, prep_laz_model_at(&g->first, arena, 5 + has_same));
            if (has_same && code-- == 0) return;
            if (code == 0) {
                uint32_t delta = prep_laz_integer_read(r, arena, &g->integer, &g->context[0], 0);
                g->step[i] = (int32_t)delta;
                g->time[i] += (uint64_t)(int64_t)g->step[i];
                g->extremes[i] = 0;
                return;
            }
            code += FAR_CODE - 1;
        } else {
            code = prep_laz_range_symbol(r, prep_laz_model_at(&g->multiple, arena, 515 + has_same));
            if (has_same && code == FAR_CODE) return;
            if (has_same && code > FAR_CODE) code--;
            if (code < FAR_CODE) {
                prep_laz_gps_multiple(r, arena, g, code);
                return;
            }
        }
        if (code == FAR_CODE) {
            prep_laz_gps_far(r, arena, g);
            return;
        }
        g->current = (i + code - FAR_CODE) & 3;
    }
}

static inline uint32_t prep_laz_clamp_8(int32_t v)
{
    return v < 0 ? 0 : v > 255 ? 255 : (uint32_t)v;
}

PREP_LAZ_INLINE uint32_t prep_laz_byte_read(prep_laz_range *r, prep_laz_arena *arena,
                                            prep_laz_model **model, uint32_t last)
{
    return (last + prep_laz_range_symbol(r, prep_laz_model_at(model, arena, 256))) & 255;
}

/* Low bytes (at = 0) or high bytes (at = 1) of green and blue: green moves as red did, blue as both
 * did on average. */
PREP_LAZ_INLINE void prep_laz_rgb_follow(prep_laz_range *r, prep_laz_arena *arena,
                                         prep_laz_rgb *rgb, uint8_t *last, uint32_t red,
                                         uint32_t changed, uint32_t at)
{
    int32_t move = (int32_t)red - last[at];
    if (changed >> (2 + at) & 1) {
        uint32_t green = prep_laz_clamp_8(move + last[2 + at]);
        green = prep_laz_byte_read(r, arena, &rgb->byte[2 + at], green);
        if (changed >> (4 + at) & 1) move = (move + (int32_t)green - last[2 + at]) / 2;
        last[2 + at] = (uint8_t)green;
    } else {
        move /= 2;
    }
    if (changed >> (4 + at) & 1) {
        uint32_t blue = prep_laz_clamp_8(move + last[4 + at]);
        last[4 + at] = (uint8_t)prep_laz_byte_read(r, arena, &rgb->byte[4 + at], blue);
    }
    last[at] = (uint8_t)red;
}

/* Reads the colour that follows `last` and puts it there. Versions 2 and 3. */
PREP_LAZ_INLINE void prep_laz_rgb_read(prep_laz_range *r, prep_laz_arena *arena, prep_laz_rgb *rgb,
                                       uint8_t *last)
{
    uint32_t changed = prep_laz_range_symbol(r, prep_laz_model_at(&rgb->changed, arena, 128));
    uint32_t low = last[0], high = last[1];
    if (changed & 1) low = prep_laz_byte_read(r, arena, &rgb->byte[0], low);
    if (changed & 2) high = prep_laz_byte_read(r, arena, &rgb->byte[1], high);
    if (changed & 64) {
        prep_laz_rgb_follow(r, arena, rgb, last, low, changed, 0);
        prep_laz_rgb_follow(r, arena, rgb, last, high, changed, 1);
    } else {
        last[0] = last[2] = last[4] = (uint8_t)low;
        last[1] = last[3] = last[5] = (uint8_t)high;
    }
}
