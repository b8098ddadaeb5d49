#include "preprocess/laz_layers.h"

#include <string.h>

/* One of six contexts per combination of return number (columns) and number of returns (rows), as
 * digits. */
static const char return_context[16][17] = {
    "0123453445555555", "1013333333333333", "2124444444433333", "3345444444444444",
    "4344544444444444", "5344454444444444", "3344445444444444", "4344444544444444",
    "4344444454444444", "5344444445444444", "5344444444544444", "5334444444455444",
    "5334444444455544", "5334444444445554", "5334444444444555", "5334444444444455",
};

/* Whether the layer has another value; once it has none, it keeps those it had. */
PREP_LAZ_INLINE bool layer_ready(prep_laz_layer *l, prep_laz_range *r)
{
    if (!l->is_live || prep_laz_ready(&l->stream, r)) return l->is_live;
    l->is_live = false;
    l->is_broken = true;
    return false;
}

/* A point that needed bytes behind the end of its layer was made of nothing. */
static size_t without_last_if_beyond(const prep_laz_layer *l, bool was_live, size_t count)
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
static void follow_channel(prep_laz_layers *s, bool has_changed, prep_laz_note *n)
{
    bool is_3 = s->format.version == 3;
    uint32_t item = is_3 && !has_changed ? 0 : s->channel;
    n->item_from = PREP_LAZ_NOBODY;
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

PREP_LAZ_INLINE prep_laz_channel *switch_channel(prep_laz_layers *s, prep_laz_range *r,
                                                 prep_laz_channel *c, prep_laz_note *n)
{
    uint32_t ahead =
        1 + prep_laz_range_symbol(r, prep_laz_model_at(&c->other_channel, &s->arena, 3));
    uint32_t channel = (s->channel + ahead) & 3;
    prep_laz_channel *to = &s->channels[channel];
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

PREP_LAZ_INLINE void read_returns(prep_laz_range *r, prep_laz_arena *arena, prep_laz_channel *c,
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

static inline uint32_t pulse_ends(const prep_laz_channel *c)
{
    return (c->number == 1 ? 1u : 0) | (c->number >= c->returns ? 2u : 0);
}

PREP_LAZ_INLINE void read_xy(prep_laz_range *r, prep_laz_arena *arena, prep_laz_channel *c,
                             prep_laz_note *n)
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
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_XY];
    bool was_live = l->is_live;
    prep_laz_range r = l->stream.range;
    size_t i = 0;
    for (; i < count && layer_ready(l, &r); i++, record += s->format.record_length) {
        prep_laz_channel *c = &s->channels[s->channel];
        prep_laz_note *n = &s->notes[i];
        uint32_t context = pulse_ends(c) | (uint32_t)c->had_new_time << 2;
        uint32_t changed =
            prep_laz_range_symbol(&r, prep_laz_model_at(&c->changed[context], &s->arena, 128));
        n->from = PREP_LAZ_NOBODY;
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
        prep_put_le32(record, c->x);
        prep_put_le32(record + 4, c->y);
        record[14] = (uint8_t)(c->number | c->returns << 4);
    }
    l->stream.range = r;
    return without_last_if_beyond(l, was_live, i);
}

static size_t read_z(prep_laz_layers *s, uint8_t *record, size_t count)
{
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_Z];
    bool was_live = l->is_live;
    prep_laz_range r = l->stream.range;
    size_t i = 0;
    for (; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        prep_laz_channel *c = &s->channels[n->channel];
        if (n->from != PREP_LAZ_NOBODY) {
            c->z = s->channels[n->from].z;
            for (uint32_t k = 0; k < 8; k++)
                c->heights[k] = c->z;
        }
        if (layer_ready(l, &r))
            c->z = c->heights[n->level] = prep_laz_integer_read(
                &r, &s->arena, &c->z_integer, &c->z_context[n->z_context], c->heights[n->level]);
        else if (l->is_broken) break;
        prep_put_le32(record + 8, c->z);
    }
    l->stream.range = r;
    return without_last_if_beyond(l, was_live, i);
}

static void read_classification(prep_laz_layers *s, uint8_t *record, size_t count)
{
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_CLASSIFICATION];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        prep_laz_channel *c = &s->channels[n->channel];
        if (n->from != PREP_LAZ_NOBODY) c->classification = s->channels[n->from].classification;
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
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_FLAGS];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        prep_laz_channel *c = &s->channels[n->channel];
        if (n->from != PREP_LAZ_NOBODY) c->flags = s->channels[n->from].flags;
        if (layer_ready(l, &r))
            c->flags = (uint8_t)prep_laz_range_symbol(
                &r, prep_laz_model_at(&c->flags_model[c->flags], &s->arena, 64));
        record[15] = (uint8_t)((c->flags & 15) | n->channel << 4 | (c->flags & 0x30) << 2);
    }
    l->stream.range = r;
}

static void read_intensity(prep_laz_layers *s, uint8_t *record, size_t count)
{
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_INTENSITY];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        prep_laz_channel *c = &s->channels[n->channel];
        if (n->from != PREP_LAZ_NOBODY) {
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
        prep_put_le16(record + 12, c->intensity);
    }
    l->stream.range = r;
}

static void read_angle(prep_laz_layers *s, uint8_t *record, size_t count)
{
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_ANGLE];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        prep_laz_channel *c = &s->channels[n->channel];
        if (n->from != PREP_LAZ_NOBODY) c->angle = s->channels[n->from].angle;
        if (n->has_new_angle && layer_ready(l, &r))
            c->angle = (uint16_t)prep_laz_integer_read(
                &r, &s->arena, &c->angle_integer, &c->angle_context[n->has_new_time], c->angle);
        prep_put_le16(record + 18, c->angle);
    }
    l->stream.range = r;
}

static void read_user(prep_laz_layers *s, uint8_t *record, size_t count)
{
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_USER];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        prep_laz_channel *c = &s->channels[n->channel];
        if (n->from != PREP_LAZ_NOBODY) c->user = s->channels[n->from].user;
        if (layer_ready(l, &r))
            c->user = (uint8_t)prep_laz_range_symbol(
                &r, prep_laz_model_at(&c->user_model[c->user / 4], &s->arena, 256));
        record[17] = c->user;
    }
    l->stream.range = r;
}

static void read_source(prep_laz_layers *s, uint8_t *record, size_t count)
{
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_SOURCE];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        prep_laz_channel *c = &s->channels[n->channel];
        if (n->from != PREP_LAZ_NOBODY) c->source = s->channels[n->from].source;
        if (n->has_new_source && layer_ready(l, &r))
            c->source = (uint16_t)prep_laz_integer_read(&r, &s->arena, &c->source_integer,
                                                        &c->source_context, c->source);
        prep_put_le16(record + 20, c->source);
    }
    l->stream.range = r;
}

static void read_gps(prep_laz_layers *s, uint8_t *record, size_t count)
{
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_GPS];
    prep_laz_range r = l->stream.range;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        prep_laz_gps *g = &s->channels[n->channel].gps;
        if (n->from != PREP_LAZ_NOBODY) {
            const prep_laz_gps *from = &s->channels[n->from].gps;
            g->time[0] = from->time[from->current];
        }
        if (n->has_new_time && layer_ready(l, &r)) prep_laz_gps_read(&r, &s->arena, g, false);
        prep_put_le64(record + s->format.gps_at, g->time[g->current]);
    }
    l->stream.range = r;
}

/* A channel's last colour, packet or extra bytes, for the layers that follow_channel() leads. */
static uint8_t *last_of(prep_laz_layers *s, const prep_laz_note *n, uint32_t at, uint32_t size)
{
    uint8_t *last = s->channels[n->item_last].last + at;
    if (n->item_from != PREP_LAZ_NOBODY) memcpy(last, s->channels[n->item_from].last + at, size);
    return last;
}

static void read_rgb(prep_laz_layers *s, uint8_t *record, size_t count)
{
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_RGB];
    prep_laz_range r = l->stream.range;
    uint32_t at = s->format.rgb_at;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        uint8_t *last = last_of(s, n, at, 6);
        if (layer_ready(l, &r)) prep_laz_rgb_read(&r, &s->arena, &s->channels[n->item].rgb, last);
        memcpy(record + at, last, 6);
    }
    l->stream.range = r;
}

static void read_nir(prep_laz_layers *s, uint8_t *record, size_t count)
{
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_NIR];
    prep_laz_range r = l->stream.range;
    uint32_t at = s->format.nir_at;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        prep_laz_channel *c = &s->channels[n->item];
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
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_WAVE];
    uint32_t at = s->format.wave_at;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
        uint8_t *last = last_of(s, n, at, PREP_LAZ_WAVE_SIZE);
        if (layer_ready(l, &l->stream.range))
            prep_laz_wave_read(&l->stream, &s->arena, &s->channels[n->item].wave, last);
        memcpy(record + at, last, PREP_LAZ_WAVE_SIZE);
    }
}

static void read_byte(prep_laz_layers *s, uint32_t index, uint8_t *record, size_t count)
{
    prep_laz_layer *l = &s->layers[PREP_LAZ_LAYER_BYTE + index];
    prep_laz_range r = l->stream.range;
    uint32_t at = s->format.extra_at + index;
    for (size_t i = 0; i < count; i++, record += s->format.record_length) {
        const prep_laz_note *n = &s->notes[i];
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
        size_t n = count - done < PREP_LAZ_BLOCK ? count - done : PREP_LAZ_BLOCK;
        size_t got = read_block(s, records + done * s->format.record_length, n);
        done += got;
        if (got < n) break;
    }
    return done;
}
