#include "preprocess/laz_layers.h"

#include <stdlib.h>
#include <string.h>

enum {
    WINDOW_SIZE = 32 * 1024, /* of one layer at most */
    BYTE_WINDOW_SIZE = 4 * 1024,
};

static const char *const layer_damage[PREP_LAZ_LAYER_BYTE + 1] = {
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

static const uint8_t layer_need[PREP_LAZ_LAYER_BYTE + 1] = {
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
    return PREP_LAZ_CHANNELS * (size + f->extra_size * prep_laz_model_size(256));
}

static prep_laz_layer_kind kind_of(uint32_t index)
{
    return index < PREP_LAZ_LAYER_BYTE ? (prep_laz_layer_kind)index : PREP_LAZ_LAYER_BYTE;
}

static bool has_layer(const prep_laz_format *f, uint32_t index)
{
    switch (kind_of(index)) {
    case PREP_LAZ_LAYER_RGB:
        return f->rgb_at != 0;
    case PREP_LAZ_LAYER_NIR:
        return f->nir_at != 0;
    case PREP_LAZ_LAYER_WAVE:
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
    s->layer_count = PREP_LAZ_LAYER_BYTE + format->extra_size;
    s->layers = calloc(s->layer_count, sizeof *s->layers);
    s->sizes = malloc(4 * (size_t)(s->layer_count + 1));
    s->lasts = malloc(PREP_LAZ_CHANNELS * (size_t)format->record_length);
    s->extra_models =
        calloc(PREP_LAZ_CHANNELS * (size_t)format->extra_size + 1, sizeof(prep_laz_model *));
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

static size_t window_capacity(const prep_laz_layer *l, uint32_t index)
{
    return prep_laz_stream_capacity(l->size, layer_need[kind_of(index)],
                                    index < PREP_LAZ_LAYER_BYTE ? WINDOW_SIZE : BYTE_WINDOW_SIZE);
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
        prep_laz_layer *l = &s->layers[i];
        *l = (prep_laz_layer){.offset = offset};
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
        prep_laz_layer *l = &s->layers[i];
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
        prep_laz_layer *l = &s->layers[i];
        if (l->size == 0) continue;
        size_t capacity = window_capacity(l, i),
               margin = prep_laz_stream_margin(layer_need[kind_of(i)]);
        prep_laz_source own = source;
        own.size = l->size;
        if (i != PREP_LAZ_LAYER_WAVE || !s->format.leaves_out_waves) {
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

static void begin_channel(prep_laz_channel *c, uint8_t *last, prep_laz_model **extra_model)
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
    prep_laz_channel *c = &s->channels[s->channel];
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
    memset(s->extra_models, 0,
           (PREP_LAZ_CHANNELS * (size_t)f->extra_size + 1) * sizeof(prep_laz_model *));
    for (uint32_t c = 0; c < PREP_LAZ_CHANNELS; c++)
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
    const prep_laz_layer *broken = NULL, *unused = NULL;
    for (uint32_t i = s->layer_count; i-- > 0;) {
        const prep_laz_layer *l = &s->layers[i];
        if (l->is_broken || (l->is_live && prep_laz_stream_is_beyond(&l->stream))) broken = l;
        else if (l->is_live && prep_laz_stream_left(&l->stream) > 0) unused = l;
    }
    const prep_laz_layer *found =
        broken != NULL ? broken : unused; /* where one breaks, others may be left half read */
    if (found == NULL) return NULL;
    *byte = found->offset;
    return layer_damage[kind_of((uint32_t)(found - s->layers))];
}

bool prep_laz_layers_measure(const prep_laz_format *f, prep_laz_source source, uint32_t *points,
                             uint64_t *size, mospt_err *err)
{
    uint8_t sizes[4 * (PREP_LAZ_LAYER_BYTE + PREP_LAZ_EXTRA_MAX + 1)];
    uint32_t layers = 0;
    for (uint32_t i = 0; i < PREP_LAZ_LAYER_BYTE + (uint32_t)f->extra_size; i++)
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
