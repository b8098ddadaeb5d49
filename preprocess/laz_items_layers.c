#include "preprocess/laz_items.h"

#include <stdlib.h>
#include <string.h>

/* A block of points is decoded layer after layer, so that each keeps its decoder in registers; the
 * first layer leaves a note for each point that tells the others in which context they are. */
enum {
    BLOCK = 512,
    CHANNELS = 4,
    POINT_SIZE = 30,
    WINDOW_SIZE = 32 * 1024, /* of one layer at most */
    BYTE_WINDOW_SIZE = 4 * 1024,
    NOBODY = 255,
};

typedef enum {
    LAYER_XY,
    LAYER_Z,
    LAYER_CLASSIFICATION,
    LAYER_FLAGS,
    LAYER_INTENSITY,
    LAYER_ANGLE,
    LAYER_USER,
    LAYER_SOURCE,
    LAYER_GPS,
    LAYER_RGB,
    LAYER_NIR,
    LAYER_WAVE,
    LAYER_BYTE, /* and those of the other extra bytes */
} layer_kind;

static const char *const layer_damage[LAYER_BYTE + 1] = {
    "the layer of x and y does not end where it should",
    "the layer of z does not end where it should",
    "the layer of classifications does not end where it should",
    "the layer of flags does not end where it should",
    "the layer of intensities does not end where it should",
    "the layer of scan angles does not end where it should",
    "the layer of user data does not end where it should",
    "the layer of point sources does not end where it should",
    "the layer of GPS times does not end where it should",
    "the layer of colours does not end where it should",
    "the layer of near infrared does not end where it should",
    "the layer of wave packets does not end where it should",
    "a layer of extra bytes does not end where it should",
};

static const uint8_t layer_need[LAYER_BYTE + 1] = {
    4 * PREP_LAZ_STEP_MAX + 2 * PREP_LAZ_INTEGER_MAX,
    PREP_LAZ_INTEGER_MAX,
    PREP_LAZ_STEP_MAX,
    PREP_LAZ_STEP_MAX,
    PREP_LAZ_INTEGER_MAX,
    PREP_LAZ_INTEGER_MAX,
    PREP_LAZ_STEP_MAX,
    PREP_LAZ_INTEGER_MAX,
    PREP_LAZ_GPS_NEED,
    PREP_LAZ_RGB_NEED,
    3 * PREP_LAZ_STEP_MAX,
    PREP_LAZ_WAVE_NEED,
    PREP_LAZ_STEP_MAX,
};

/* One of six contexts per combination of return number (columns) and number of returns (rows), as
 * digits. */
static const char return_context[16][17] = {
    "0123453445555555", "1013333333333333", "2124444444433333", "3345444444444444",
    "4344544444444444", "5344454444444444", "3344445444444444", "4344444544444444",
    "4344444454444444", "5344444445444444", "5344444444544444", "5334444444455444",
    "5334444444455544", "5334444444445554", "5334444444444555", "5334444444444455",
};

/* What the other layers need to know of a point. */
typedef struct {
    uint8_t channel; /* whose context it is in */
    uint8_t from;    /* the channel that this one takes over from at its first point; NOBODY: it is
                        known */
    uint8_t item, item_last,
        item_from; /* the same for the layers of colours, packets and extra bytes: whose models,
                      whose last value, and where that comes from */
    uint8_t ends;  /* first return of its pulse: 1, last: 2 */
    uint8_t level; /* returns of the pulse that are missing, at most 7 */
    uint8_t z_context;
    bool has_new_time, has_new_angle, has_new_source;
} note;

/* Models and last values of one scanner channel. */
typedef struct {
    uint32_t x, y;
    uint8_t number, returns; /* return number, number of returns */
    bool had_new_time;
    prep_laz_median x_median[12], y_median[12];
    prep_laz_model *changed[8], *other_channel, *returns_model[16], *number_model[16], *number_step;
    prep_laz_integer x_integer, y_integer;
    prep_laz_model *x_context[2], *y_context[22];

    uint32_t z, heights[8];
    prep_laz_integer z_integer;
    prep_laz_model *z_context[20];

    uint8_t classification, flags, user;
    prep_laz_model *classification_model[64], *flags_model[64], *user_model[64];

    uint16_t intensity, angle, source, intensities[8];
    prep_laz_integer intensity_integer, angle_integer, source_integer;
    prep_laz_model *intensity_context[4], *angle_context[2], *source_context;

    prep_laz_gps gps;
    prep_laz_rgb rgb;
    prep_laz_model *nir_changed, *nir_byte[2];
    prep_laz_wave wave;
    uint8_t
        *last; /* [record_length], in `lasts`: colour, packet and extra bytes of the last record */
    prep_laz_model **extra_model; /* [extra_size], in `extra_models` */
} channel_state;

typedef struct {
    prep_laz_stream stream;
    uint64_t offset, size;
    bool is_live; /* there are bytes, and they have not run out */
    bool is_broken;
} layer;

struct prep_laz_layers {
    prep_laz_format format;
    prep_laz_arena arena;
    uint8_t *windows; /* [windows_size], owned */
    size_t windows_size;
    uint32_t layer_count, points;
    layer *layers;                 /* [layer_count], owned */
    uint8_t *sizes;                /* [4 * (layer_count + 1)], owned */
    uint8_t *lasts;                /* [CHANNELS * record_length], owned */
    prep_laz_model **extra_models; /* [CHANNELS * extra_size], owned */
    uint32_t channel;
    uint32_t known, item_known; /* bit per channel */
    uint32_t item;
    channel_state channels[CHANNELS];
    note notes[BLOCK];
};

static size_t arena_size(const prep_laz_format *f)
{
    size_t size =
        8 * prep_laz_model_size(128) + prep_laz_model_size(3) + 32 * prep_laz_model_size(16);
    size += prep_laz_model_size(13) + (2 * 64) * prep_laz_model_size(256) +
            64 * prep_laz_model_size(64);
    size += prep_laz_integer_size(32, 2) + prep_laz_integer_size(32, 22) +
            prep_laz_integer_size(32, 20);
    size +=
        prep_laz_integer_size(16, 4) + prep_laz_integer_size(16, 2) + prep_laz_integer_size(16, 1);
    size += prep_laz_gps_size();
    if (f->rgb_at != 0) size += prep_laz_rgb_size();
    if (f->nir_at != 0) size += prep_laz_model_size(4) + 2 * prep_laz_model_size(256);
    if (f->wave_at != 0) size += prep_laz_wave_size();
    return CHANNELS * (size + f->extra_size * prep_laz_model_size(256));
}

static layer_kind kind_of(uint32_t index)
{
    return index < LAYER_BYTE ? (layer_kind)index : LAYER_BYTE;
}

static bool has_layer(const prep_laz_format *f, uint32_t index)
{
    switch (kind_of(index)) {
    case LAYER_RGB:
        return f->rgb_at != 0;
    case LAYER_NIR:
        return f->nir_at != 0;
    case LAYER_WAVE:
        return f->wave_at != 0;
    default:
        return true;
    }
}

prep_laz_layers *prep_laz_layers_create(const prep_laz_format *format)
{
    prep_laz_layers *s = calloc(1, sizeof *s);
    if (s == NULL) return NULL;
    s->format = *format;
    s->layer_count = LAYER_BYTE + format->extra_size;
    s->layers = calloc(s->layer_count, sizeof *s->layers);
    s->sizes = malloc(4 * (size_t)(s->layer_count + 1));
    s->lasts = malloc(CHANNELS * (size_t)format->record_length);
    s->extra_models = calloc(CHANNELS * (size_t)format->extra_size + 1, sizeof(prep_laz_model *));
    s->arena.size = arena_size(format);
    s->arena.bytes = malloc(s->arena.size); /* touched only as far as it is used */
    if (s->layers != NULL && s->sizes != NULL && s->lasts != NULL && s->extra_models != NULL &&
        s->arena.bytes != NULL)
        return s;
    prep_laz_layers_destroy(s);
    return NULL;
}

void prep_laz_layers_destroy(prep_laz_layers *s)
{
    if (s == NULL) return;
    free(s->layers);
    free(s->sizes);
    free(s->lasts);
    free(s->extra_models);
    free(s->arena.bytes);
    free(s->windows);
    free(s);
}

static size_t window_capacity(const layer *l, uint32_t index)
{
    return prep_laz_stream_capacity(l->size, layer_need[kind_of(index)],
                                    index < LAYER_BYTE ? WINDOW_SIZE : BYTE_WINDOW_SIZE);
}

/* Reads how many points and bytes per layer follow the first record. */
static bool read_sizes(prep_laz_layers *s, prep_laz_source *source, mospt_err *err)
{
    const prep_laz_format *f = &s->format;
    uint32_t stored = 1;
    for (uint32_t i = 0; i < s->layer_count; i++)
        stored += has_layer(f, i);
    if (!prep_laz_source_take(source, s->sizes, 4 * (size_t)stored, err)) return false;
    const uint8_t *p = s->sizes;
    s->points = prep_le32(p);
    uint64_t offset = source->offset;
    for (uint32_t i = 0; i < s->layer_count; i++) {
        layer *l = &s->layers[i];
        *l = (layer){.offset = offset};
        if (!has_layer(f, i)) continue;
        l->size = prep_le32(p += 4);
        offset += l->size;
    }
    return true;
}

static bool alloc_windows(prep_laz_layers *s, uint64_t available, mospt_err *err)
{
    size_t size = 0;
    for (uint32_t i = 0; i < s->layer_count; i++) {
        layer *l = &s->layers[i];
        if (l->size > available) { /* what is not there cannot be decoded */
            l->is_broken = true;
            l->size = available;
        }
        available -= l->size;
        if (l->size > 0)
            size += window_capacity(l, i) + prep_laz_stream_margin(layer_need[kind_of(i)]);
    }
    if (size <= s->windows_size) return true;
    free(s->windows);
    s->windows = malloc(size);
    s->windows_size = s->windows != NULL ? size : 0;
    return s->windows != NULL || mospt_err_nomem(err, size);
}

static bool begin_streams(prep_laz_layers *s, prep_laz_source source, mospt_err *err)
{
    uint8_t *window = s->windows;
    for (uint32_t i = 0; i < s->layer_count; i++) {
        layer *l = &s->layers[i];
        if (l->size == 0) continue;
        size_t capacity = window_capacity(l, i),
               margin = prep_laz_stream_margin(layer_need[kind_of(i)]);
        prep_laz_source own = source;
        own.size = l->size;
        if (i != LAYER_WAVE || !s->format.leaves_out_waves) {
            mospt_err own_err = {0};
            l->is_live = prep_laz_stream_begin(&l->stream, own, window, capacity, margin, &own_err);
            l->stream.err = err;
            if (!l->is_live && own_err.code != MOSPT_OK) {
                if (err != NULL) *err = own_err;
                return false;
            }
            l->is_broken = l->is_broken || !l->is_live;
        }
        prep_laz_source_skip(&source, l->size);
        window += capacity + margin;
    }
    return true;
}

static void begin_channel(channel_state *c, uint8_t *last, prep_laz_model **extra_model)
{
    memset(c, 0, sizeof *c);
    c->last = last;
    c->extra_model = extra_model;
    prep_laz_integer_init(&c->x_integer, 32);
    prep_laz_integer_init(&c->y_integer, 32);
    prep_laz_integer_init(&c->z_integer, 32);
    prep_laz_integer_init(&c->intensity_integer, 16);
    prep_laz_integer_init(&c->angle_integer, 16);
    prep_laz_integer_init(&c->source_integer, 16);
    prep_laz_gps_init(&c->gps, 0);
    prep_laz_rgb_init(&c->rgb);
    prep_laz_wave_init(&c->wave);
}

static void take_first(prep_laz_layers *s, const uint8_t *p)
{
    s->channel = s->item = p[15] >> 4 & 3;
    s->known = s->item_known = 1u << s->channel;
    channel_state *c = &s->channels[s->channel];
    c->x = prep_le32(p);
    c->y = prep_le32(p + 4);
    c->z = prep_le32(p + 8);
    c->number = p[14] & 15;
    c->returns = p[14] >> 4;
    c->flags = (uint8_t)((p[15] & 15) | (p[15] >> 2 & 0x30));
    c->classification = p[16];
    c->user = p[17];
    c->intensity = prep_le16(p + 12);
    c->angle = prep_le16(p + 18);
    c->source = prep_le16(p + 20);
    c->gps.time[0] = prep_le64(p + s->format.gps_at);
    for (uint32_t i = 0; i < 8; i++) {
        c->heights[i] = c->z;
        c->intensities[i] = c->intensity;
    }
    memcpy(c->last, p, s->format.record_length);
}

bool prep_laz_layers_begin(prep_laz_layers *s, prep_laz_source source, uint8_t *first,
                           mospt_err *err)
{
    const prep_laz_format *f = &s->format;
    s->points = 0;
    if (!prep_laz_source_take(&source, first, f->record_length, err)) return false;
    if (!read_sizes(s, &source, err)) return false;
    if (!alloc_windows(s, source.size, err)) return false;
    s->arena.used = 0;
    memset(s->extra_models, 0, (CHANNELS * (size_t)f->extra_size + 1) * sizeof(prep_laz_model *));
    for (uint32_t c = 0; c < CHANNELS; c++)
        begin_channel(&s->channels[c], s->lasts + c * (size_t)f->record_length,
                      s->extra_models + c * (size_t)f->extra_size);
    take_first(s, first);
    return begin_streams(s, source, err);
}

uint32_t prep_laz_layers_count(const prep_laz_layers *s)
{
    return s->points;
}

const char *prep_laz_layers_damage(const prep_laz_layers *s, uint64_t *byte)
{
    const layer *broken = NULL, *unused = NULL;
    for (uint32_t i = s->layer_count; i-- > 0;) {
        const layer *l = &s->layers[i];
        if (l->is_broken || (l->is_live && prep_laz_stream_is_beyond(&l->stream))) broken = l;
        else if (l->is_live && prep_laz_stream_left(&l->stream) > 0) unused = l;
    }
    const layer *found =
        broken != NULL ? broken : unused; /* where one breaks, others may be left half read */
    if (found == NULL) return NULL;
    *byte = found->offset;
    return layer_damage[kind_of((uint32_t)(found - s->layers))];
}

bool prep_laz_layers_measure(const prep_laz_format *f, prep_laz_source source, uint32_t *points,
                             uint64_t *size, mospt_err *err)
{
    uint8_t sizes[4 * (LAYER_BYTE + PREP_LAZ_EXTRA_MAX + 1)];
    uint32_t layers = 0;
    for (uint32_t i = 0; i < LAYER_BYTE + (uint32_t)f->extra_size; i++)
        layers += has_layer(f, i);
    if (source.size < f->record_length) return false;
    prep_laz_source_skip(&source, f->record_length);
    if (!prep_laz_source_take(&source, sizes, 4 * (size_t)(layers + 1), err)) return false;
    *points = prep_le32(sizes);
    *size = f->record_length + 4 * (uint64_t)(layers + 1);
    for (uint32_t i = 1; i <= layers; i++)
        *size += prep_le32(sizes + 4 * i);
    return true;
}

/* Whether the layer has another value; once it has none, it keeps those it had. */
PREP_LAZ_INLINE bool layer_ready(layer *l, prep_laz_range *r)
{
    if (!l->is_live || prep_laz_ready(&l->stream, r)) return l->is_live;
    l->is_live = false;
    l->is_broken = true;
    return false;
}

/* A point that needed bytes behind the end of its layer was made of nothing. */
static size_t without_last_if_beyond(const layer *l, bool was_live, size_t count)
{
    return count - (count > 0 && was_live && prep_laz_stream_is_beyond(&l->stream));
}

static inline uint32_t even_at_most(uint32_t magnitude, uint32_t most)
{
    return magnitude < most ? magnitude & ~1u : most;
}

/* Where the channel changes, colours and the like change theirs. Version 3 does so for that one
 * point only and returns to channel 0 with the next; and it goes on from the last value of the
 * channel before, where the new one has some already. Version 4 is as one would expect. */
static void follow_channel(prep_laz_layers *s, bool has_changed, note *n)
{
    bool is_3 = s->format.version == 3;
    uint32_t item = is_3 && !has_changed ? 0 : s->channel;
    n->item_from = NOBODY;
    n->item_last = (uint8_t)s->item;
    if (item != s->item) {
        bool is_new = !(s->item_known >> item & 1);
        if (is_new) n->item_from = (uint8_t)s->item;
        if (is_new || !is_3) n->item_last = (uint8_t)item;
        s->item_known |= 1u << item;
        s->item = item;
    }
    n->item = (uint8_t)item;
}

PREP_LAZ_INLINE channel_state *switch_channel(prep_laz_layers *s, prep_laz_range *r,
                                              channel_state *c, note *n)
{
    uint32_t ahead =
        1 + prep_laz_range_symbol(r, prep_laz_model_at(&c->other_channel, &s->arena, 3));
    uint32_t channel = (s->channel + ahead) & 3;
    channel_state *to = &s->channels[channel];
    if (!(s->known >> channel & 1)) {
        n->from = (uint8_t)s->channel;
        to->x = c->x;
        to->y = c->y;
        to->number = c->number;
        to->returns = c->returns;
        s->known |= 1u << channel;
    }
    s->channel = channel;
    return to;
}

PREP_LAZ_INLINE void read_returns(prep_laz_range *r, prep_laz_arena *arena, channel_state *c,
                                  uint32_t changed)
{
    bool has_new_time = changed >> 4 & 1;
    uint32_t number = c->number;
    if (changed & 4)
        c->returns = (uint8_t)prep_laz_range_symbol(
            r, prep_laz_model_at(&c->returns_model[c->returns], arena, 16));
    switch (changed & 3) {
    case 0:
        return;
    case 1:
        number += 1;
        break;
    case 2:
        number += 15;
        break;
    default:
        if (has_new_time)
            number =
                prep_laz_range_symbol(r, prep_laz_model_at(&c->number_model[number], arena, 16));
        else number += 2 + prep_laz_range_symbol(r, prep_laz_model_at(&c->number_step, arena, 13));
        break;
    }
    c->number = number & 15;
}

static inline uint32_t pulse_ends(const channel_state *c)
{
    return (c->number == 1 ? 1u : 0) | (c->number >= c->returns ? 2u : 0);
}

PREP_LAZ_INLINE void read_xy(prep_laz_range *r, prep_laz_arena *arena, channel_state *c, note *n)
{
    bool is_single = c->returns == 1;
    uint32_t group = (uint32_t)(return_context[c->returns][c->number] - '0') << 1 | n->has_new_time;
    prep_laz_median *x = &c->x_median[group], *y = &c->y_median[group];
    uint32_t step = prep_laz_integer_read(r, arena, &c->x_integer, &c->x_context[is_single],
                                          (uint32_t)x->sorted[2]);
    c->x += step;
    prep_laz_median_add(x, (int32_t)step);
    uint32_t k = c->x_integer.magnitude;
    step = prep_laz_integer_read(r, arena, &c->y_integer,
                                 &c->y_context[even_at_most(k, 20) + is_single],
                                 (uint32_t)y->sorted[2]);
    c->y += step;
    prep_laz_median_add(y, (int32_t)step);
    k = (k + c->y_integer.magnitude) / 2;
    n->z_context = (uint8_t)(even_at_most(k, 18) + is_single);
}

/* The first layer: channel, returns, which others have changed, x and y. */
static size_t read_first_layer(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_XY];
    bool was_live = l->is_live;
    prep_laz_range r = l->stream.range;
    size_t i = 0;
    for (; i < count && layer_ready(l, &r); i++, record += s->format.record_length) {
        channel_state *c = &s->channels[s->channel];
        note *n = &s->notes[i];
        uint32_t context = pulse_ends(c) | (uint32_t)c->had_new_time << 2;
        uint32_t changed =
            prep_laz_range_symbol(&r, prep_laz_model_at(&c->changed[context], &s->arena, 128));
        n->from = NOBODY;
        if (changed & 64) c = switch_channel(s, &r, c, n);
        follow_channel(s, changed >> 6, n);
        read_returns(&r, &s->arena, c, changed);
        n->has_new_source = changed >> 5 & 1;
        n->has_new_time = c->had_new_time = changed >> 4 & 1;
        n->has_new_angle = changed >> 3 & 1;
        n->channel = (uint8_t)s->channel;
        n->ends = (uint8_t)pulse_ends(c);
        uint32_t level = c->returns > c->number ? c->returns - c->number : c->number - c->returns;
        n->level = (uint8_t)(level < 7 ? level : 7);
        read_xy(&r, &s->arena, c, n);
        prep_laz_put32(record, c->x);
        prep_laz_put32(record + 4, c->y);
        record[14] = (uint8_t)(c->number | c->returns << 4);
    }
    l->stream.range = r;
    return without_last_if_beyond(l, was_live, i);
}

static size_t read_z(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_Z];
    bool was_live = l->is_live;
    prep_laz_range r = l->stream.range;
    size_t i = 0;
    for (; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        channel_state *c = &s->channels[n->channel];
        if (n->from != NOBODY) {
            c->z = s->channels[n->from].z;
            for (uint32_t k = 0; k < 8; k++)
                c->heights[k] = c->z;
        }
        if (layer_ready(l, &r))
            c->z = c->heights[n->level] = prep_laz_integer_read(
                &r, &s->arena, &c->z_integer, &c->z_context[n->z_context], c->heights[n->level]);
        else if (l->is_broken) break;
        prep_laz_put32(record + 8, c->z);
    }
    l->stream.range = r;
    return without_last_if_beyond(l, was_live, i);
}

static void read_classification(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_CLASSIFICATION];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        channel_state *c = &s->channels[n->channel];
        if (n->from != NOBODY) c->classification = s->channels[n->from].classification;
        uint32_t context = (c->classification & 31u) << 1 | (n->ends == 3);
        if (layer_ready(l, &r))
            c->classification = (uint8_t)prep_laz_range_symbol(
                &r, prep_laz_model_at(&c->classification_model[context], &s->arena, 256));
        record[16] = c->classification;
    }
    l->stream.range = r;
}

static void read_flags(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_FLAGS];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        channel_state *c = &s->channels[n->channel];
        if (n->from != NOBODY) c->flags = s->channels[n->from].flags;
        if (layer_ready(l, &r))
            c->flags = (uint8_t)prep_laz_range_symbol(
                &r, prep_laz_model_at(&c->flags_model[c->flags], &s->arena, 64));
        record[15] = (uint8_t)((c->flags & 15) | n->channel << 4 | (c->flags & 0x30) << 2);
    }
    l->stream.range = r;
}

static void read_intensity(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_INTENSITY];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        channel_state *c = &s->channels[n->channel];
        if (n->from != NOBODY) {
            c->intensity = s->channels[n->from].intensity;
            for (uint32_t k = 0; k < 8; k++)
                c->intensities[k] = c->intensity;
        }
        if (layer_ready(l, &r)) {
            uint16_t *last = &c->intensities[n->ends << 1 | n->has_new_time];
            *last = (uint16_t)prep_laz_integer_read(&r, &s->arena, &c->intensity_integer,
                                                    &c->intensity_context[n->ends], *last);
            c->intensity = *last;
        }
        prep_laz_put16(record + 12, c->intensity);
    }
    l->stream.range = r;
}

static void read_angle(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_ANGLE];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        channel_state *c = &s->channels[n->channel];
        if (n->from != NOBODY) c->angle = s->channels[n->from].angle;
        if (n->has_new_angle && layer_ready(l, &r))
            c->angle = (uint16_t)prep_laz_integer_read(
                &r, &s->arena, &c->angle_integer, &c->angle_context[n->has_new_time], c->angle);
        prep_laz_put16(record + 18, c->angle);
    }
    l->stream.range = r;
}

static void read_user(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_USER];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        channel_state *c = &s->channels[n->channel];
        if (n->from != NOBODY) c->user = s->channels[n->from].user;
        if (layer_ready(l, &r))
            c->user = (uint8_t)prep_laz_range_symbol(
                &r, prep_laz_model_at(&c->user_model[c->user / 4], &s->arena, 256));
        record[17] = c->user;
    }
    l->stream.range = r;
}

static void read_source(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_SOURCE];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        channel_state *c = &s->channels[n->channel];
        if (n->from != NOBODY) c->source = s->channels[n->from].source;
        if (n->has_new_source && layer_ready(l, &r))
            c->source = (uint16_t)prep_laz_integer_read(&r, &s->arena, &c->source_integer,
                                                        &c->source_context, c->source);
        prep_laz_put16(record + 20, c->source);
    }
    l->stream.range = r;
}

static void read_gps(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_GPS];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        prep_laz_gps *g = &s->channels[n->channel].gps;
        if (n->from != NOBODY) {
            const prep_laz_gps *from = &s->channels[n->from].gps;
            g->time[0] = from->time[from->current];
        }
        if (n->has_new_time && layer_ready(l, &r)) prep_laz_gps_read(&r, &s->arena, g, false);
        prep_laz_put64(record + s->format.gps_at, g->time[g->current]);
    }
    l->stream.range = r;
}

/* A channel's last colour, packet or extra bytes, for the layers that follow_channel() leads. */
static uint8_t *last_of(prep_laz_layers *s, const note *n, uint32_t at, uint32_t size)
{
    uint8_t *last = s->channels[n->item_last].last + at;
    if (n->item_from != NOBODY) memcpy(last, s->channels[n->item_from].last + at, size);
    return last;
}

static void read_rgb(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_RGB];
    prep_laz_range r = l->stream.range;
    uint32_t at = s->format.rgb_at;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        uint8_t *last = last_of(s, n, at, 6);
        if (layer_ready(l, &r)) prep_laz_rgb_read(&r, &s->arena, &s->channels[n->item].rgb, last);
        memcpy(record + at, last, 6);
    }
    l->stream.range = r;
}

static void read_nir(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_NIR];
    prep_laz_range r = l->stream.range;
    uint32_t at = s->format.nir_at;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        channel_state *c = &s->channels[n->item];
        uint8_t *last = last_of(s, n, at, 2);
        if (layer_ready(l, &r)) {
            uint32_t changed =
                prep_laz_range_symbol(&r, prep_laz_model_at(&c->nir_changed, &s->arena, 4));
            for (uint32_t k = 0; k < 2; k++) {
                if (changed >> k & 1)
                    last[k] = (uint8_t)prep_laz_byte_read(&r, &s->arena, &c->nir_byte[k], last[k]);
            }
        }
        memcpy(record + at, last, 2);
    }
    l->stream.range = r;
}

static void read_wave(prep_laz_layers *s, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_WAVE];
    uint32_t at = s->format.wave_at;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        uint8_t *last = last_of(s, n, at, PREP_LAZ_WAVE_SIZE);
        if (layer_ready(l, &l->stream.range))
            prep_laz_wave_read(&l->stream, &s->arena, &s->channels[n->item].wave, last);
        memcpy(record + at, last, PREP_LAZ_WAVE_SIZE);
    }
}

static void read_byte(prep_laz_layers *s, uint32_t index, uint8_t *record, size_t count)
{
    layer *l = &s->layers[LAYER_BYTE + index];
    prep_laz_range r = l->stream.range;
    uint32_t at = s->format.extra_at + index;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const note *n = &s->notes[i];
        uint8_t *last = last_of(s, n, at, 1);
        if (layer_ready(l, &r))
            *last = (uint8_t)prep_laz_byte_read(&r, &s->arena,
                                                &s->channels[n->item].extra_model[index], *last);
        record[at] = *last;
    }
    l->stream.range = r;
}

static size_t read_block(prep_laz_layers *s, uint8_t *records, size_t count)
{
    count = read_first_layer(s, records, count);
    count = read_z(s, records, count);
    read_classification(s, records, count);
    read_flags(s, records, count);
    read_intensity(s, records, count);
    read_angle(s, records, count);
    read_user(s, records, count);
    read_source(s, records, count);
    read_gps(s, records, count);
    if (s->format.rgb_at != 0) read_rgb(s, records, count);
    if (s->format.nir_at != 0) read_nir(s, records, count);
    if (s->format.wave_at != 0) read_wave(s, records, count);
    for (uint32_t i = 0; i < s->format.extra_size; i++)
        read_byte(s, i, records, count);
    return count;
}

size_t prep_laz_layers_read(prep_laz_layers *s, uint8_t *records, size_t count)
{
    size_t done = 0;
    while (done < count) {
        size_t n = count - done < BLOCK ? count - done : BLOCK;
        size_t got = read_block(s, records + done * s->format.record_length, n);
        done += got;
        if (got < n) break;
    }
    return done;
}
