/* preprocess/laz_layers.h - the state of a layered chunk (point formats 6 to 10). Internal to
 * laz_layers.c, which sets it up, and laz_items_layers.c, which reads points with it.
 *
 * Every part of a point has a layer of bytes of its own, and four sets of models, one per scanner
 * channel. A block of points is decoded layer after layer, so that each keeps its decoder in
 * registers; the first layer leaves a note for each point that tells the others where they are. */
#pragma once
#include "preprocess/laz_items.h"

enum {
    PREP_LAZ_BLOCK = 512,
    PREP_LAZ_CHANNELS = 4,
    PREP_LAZ_NOBODY = 255, /* no channel */
};

typedef enum {
    PREP_LAZ_LAYER_XY,
    PREP_LAZ_LAYER_Z,
    PREP_LAZ_LAYER_CLASSIFICATION,
    PREP_LAZ_LAYER_FLAGS,
    PREP_LAZ_LAYER_INTENSITY,
    PREP_LAZ_LAYER_ANGLE,
    PREP_LAZ_LAYER_USER,
    PREP_LAZ_LAYER_SOURCE,
    PREP_LAZ_LAYER_GPS,
    PREP_LAZ_LAYER_RGB,
    PREP_LAZ_LAYER_NIR,
    PREP_LAZ_LAYER_WAVE,
    PREP_LAZ_LAYER_BYTE, /* and those of the other extra bytes */
} prep_laz_layer_kind;

/* What the other layers need to know of a point. */
typedef struct {
    uint8_t channel; /* whose context it is in */
    uint8_t from;    /* channel that this one begins like; NOBODY: it has begun before */
    /* The same for the layers of colours, packets and extra bytes: */
    uint8_t item, item_last; /* channel whose models, and whose last value they use */
    uint8_t item_from;       /* channel that the last value is to be taken from; NOBODY: none */
    uint8_t ends;            /* first return of its pulse: 1, last: 2 */
    uint8_t level;           /* returns of the pulse that are missing, at most 7 */
    uint8_t z_context;
    bool has_new_time, has_new_angle, has_new_source;
} prep_laz_note;

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
    uint8_t *last; /* [record_length], in `lasts`: the last colour, packet, extra bytes */
    prep_laz_model **extra_model; /* [extra_size], in `extra_models` */
} prep_laz_channel;

typedef struct {
    prep_laz_stream stream;
    uint64_t offset, size;
    bool is_live; /* there are bytes, and they have not run out */
    bool is_broken;
} prep_laz_layer;

struct prep_laz_layers {
    prep_laz_format format;
    prep_laz_arena arena;
    uint8_t *windows; /* [windows_size], owned */
    size_t windows_size;
    uint32_t layer_count, points;
    prep_laz_layer *layers;        /* [layer_count], owned */
    uint8_t *sizes;                /* [4 * (layer_count + 1)], owned */
    uint8_t *lasts;                /* [CHANNELS * record_length], owned */
    prep_laz_model **extra_models; /* [CHANNELS * extra_size], owned */
    uint32_t channel;
    uint32_t known, item_known; /* bit per channel */
    uint32_t item;
    prep_laz_channel channels[PREP_LAZ_CHANNELS];
    prep_laz_note notes[PREP_LAZ_BLOCK];
};
