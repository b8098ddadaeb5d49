#include "preprocess/las.h"

#include "mospt/strided.h"
#include "mospt/turn.h"
#include "mospt/wide.h"
#include "preprocess/bytes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { INTENSITY_AT = 12 };

enum { FIELD_COPY, FIELD_BITS, FIELD_FLAGS_OLD, FIELD_FLAGS_NEW };

/* Records that are decoded field by field while they are in the first cache. */
enum { BLOCK = 256 };

/* Of a sample, so many records are kept at most: enough to tell what all have in common. */
enum { KEPT_POINTS = 1024, KEPT_SIZE = 256 * 1024 };

/* Described extra bytes beyond this are left out: no scanner writes them, and they multiply the
 * memory of every batch. */
enum { EXTRA_ROW_MAX = 1024 };

/* Bytes in a record where the optional parts begin; 0: the format does not have them. */
static const struct {
    uint8_t gps, rgb, nir;
} part[PREP_LAS_FORMATS] = {
    {0, 0, 0},  {20, 0, 0},  {0, 20, 0},   {20, 28, 0}, {20, 0, 0},   {20, 28, 0},
    {22, 0, 0}, {22, 30, 0}, {22, 30, 36}, {22, 0, 0},  {22, 30, 36},
};

bool prep_las_sample_init(prep_las_sample *sample, const prep_las_header *header, uint32_t looks,
                          mospt_err *err)
{
    size_t kept = KEPT_SIZE / header->record_length;
    if (kept > KEPT_POINTS) kept = KEPT_POINTS;
    *sample = (prep_las_sample){.kept_of_look = looks > 0 ? kept / looks : 0};
    sample->intensity = malloc(PREP_TONE_SAMPLES * sizeof *sample->intensity);
    sample->kept = malloc(kept * header->record_length);
    if (sample->intensity != NULL && sample->kept != NULL) return true;
    prep_las_sample_fini(sample);
    return mospt_err_nomem(err, KEPT_SIZE);
}

void prep_las_sample_fini(prep_las_sample *sample)
{
    free(sample->intensity), free(sample->kept);
    *sample = (prep_las_sample){0};
}

void prep_las_sample_add(prep_las_sample *sample, const prep_las_header *header,
                         const uint8_t *records, size_t count)
{
    uint32_t rgb_at = part[header->point_format].rgb;
    size_t length = header->record_length,
           kept = count < sample->kept_of_look ? count : sample->kept_of_look;
    memcpy(sample->kept + sample->kept_count * length, records, kept * length);
    sample->kept_count += kept;
    for (size_t i = 0; i < count; i++) {
        const uint8_t *p = records + i * length;
        if (sample->count < PREP_TONE_SAMPLES)
            sample->intensity[sample->count++] = prep_le16(p + 12);
        for (uint32_t c = 0; rgb_at != 0 && c < 3; c++) {
            uint16_t value = prep_le16(p + rgb_at + 2 * c);
            if (value > sample->rgb_max) sample->rgb_max = value;
        }
    }
}

static void add_field(prep_scan *scan, prep_las_layout *layout, const char *name, mospt_type type,
                      uint32_t components, prep_las_field field)
{
    int index = prep_scan_add_attribute(scan, name, type, components);
    if (index < 0) return;
    field.components = (uint16_t)components;
    field.size = (uint8_t)mospt_type_size(type);
    layout->field[index] = field;
    layout->field_count = (uint32_t)index + 1;
}

static void add_copy(prep_scan *scan, prep_las_layout *layout, const char *name, mospt_type type,
                     uint32_t components, uint32_t at)
{
    add_field(scan, layout, name, type, components,
              (prep_las_field){.kind = FIELD_COPY, .at = (uint16_t)at});
}

static void add_bits(prep_scan *scan, prep_las_layout *layout, const char *name, uint16_t at,
                     uint8_t shift, uint8_t mask)
{
    prep_las_field field = {.kind = FIELD_BITS, .at = at, .shift = shift, .mask = mask};
    add_field(scan, layout, name, MOSPT_U8, 1, field);
}

static void add_standard_old(prep_scan *scan, prep_las_layout *layout)
{
    add_bits(scan, layout, "return_number", 14, 0, 7);
    add_bits(scan, layout, "number_of_returns", 14, 3, 7);
    add_bits(scan, layout, "classification", 15, 0, 31);
    add_field(scan, layout, "flags", MOSPT_U8, 1,
              (prep_las_field){.kind = FIELD_FLAGS_OLD, .at = 14});
    add_copy(scan, layout, "scan_angle", MOSPT_I8, 1, 16);
    add_copy(scan, layout, "user_data", MOSPT_U8, 1, 17);
    add_copy(scan, layout, "point_source", MOSPT_U16, 1, 18);
}

static void add_standard_new(prep_scan *scan, prep_las_layout *layout)
{
    add_bits(scan, layout, "return_number", 14, 0, 15);
    add_bits(scan, layout, "number_of_returns", 14, 4, 15);
    add_copy(scan, layout, "classification", MOSPT_U8, 1, 16);
    add_field(scan, layout, "flags", MOSPT_U8, 1,
              (prep_las_field){.kind = FIELD_FLAGS_NEW, .at = 15});
    add_bits(scan, layout, "scanner_channel", 15, 4, 3);
    add_copy(scan, layout, "scan_angle", MOSPT_I16, 1, 18);
    add_copy(scan, layout, "user_data", MOSPT_U8, 1, 17);
    add_copy(scan, layout, "point_source", MOSPT_U16, 1, 20);
}

/* Bytes that nobody describes are kept as they are, for whoever knows what they mean. */
static void add_undescribed(prep_scan *scan, prep_las_layout *layout, uint32_t at, uint32_t size)
{
    if (size == 0) return;
    add_copy(scan, layout, "extra_bytes", MOSPT_U8, size < 255 ? size : 255, at);
    if (size > 255)
        prep_scan_set_damage(
            scan, mospt_at_byte(scan->path, 105),
            "%u bytes of every record are not described; the first 255 of them are kept", size);
}

static void add_extra(prep_scan *scan, prep_las_layout *layout, const prep_las_header *h)
{
    uint32_t at = prep_las_record_size(h->point_format), row = 0;
    for (uint32_t i = 0; i < h->extra_count; i++) {
        const prep_las_extra *e = &h->extra[i];
        uint32_t size = e->components * (uint32_t)mospt_type_size(e->type);
        if (row + size > EXTRA_ROW_MAX || scan->info.attributes.count == MOSPT_ATTRIBUTES_MAX) {
            prep_scan_set_damage(scan, mospt_at_byte(scan->path, 105),
                                 "%u bytes of extra attributes in every record are too many; "
                                 "`%.32s` and those after "
                                 "it are left out",
                                 h->record_length - prep_las_record_size(h->point_format), e->name);
            return;
        }
        add_copy(scan, layout, e->name, e->type, e->components, at);
        at += size;
        row += size;
    }
    add_undescribed(scan, layout, at, h->record_length - at);
}

void prep_las_layout_make(prep_scan *scan, const prep_las_header *header, prep_las_sample *sample,
                          prep_las_layout *out)
{
    uint8_t format = header->point_format;
    prep_las_layout layout = {.record_length = header->record_length, .rgb_at = part[format].rgb};
    memcpy(layout.scale, header->scale, sizeof layout.scale);
    memcpy(layout.offset, header->offset, sizeof layout.offset);
    layout.tone = prep_tone_make(sample->intensity, sample->count);
    layout.has_intensity = !layout.tone.is_flat;
    layout.has_rgb = sample->rgb_max > 0;
    layout.rgb_is_16 = sample->rgb_max > 255;

    add_copy(scan, &layout, "intensity", MOSPT_U16, 1, 12);
    if (format < 6) add_standard_old(scan, &layout);
    else add_standard_new(scan, &layout);
    if (part[format].gps != 0) add_copy(scan, &layout, "gps_time", MOSPT_F64, 1, part[format].gps);
    if (layout.has_rgb) add_copy(scan, &layout, "rgb", MOSPT_U16, 3, part[format].rgb);
    if (part[format].nir != 0) add_copy(scan, &layout, "nir", MOSPT_U16, 1, part[format].nir);
    add_extra(scan, &layout, header);
    scan->info.has_rgb = layout.has_rgb;
    scan->info.has_intensity = layout.has_intensity;
    *out = layout;
}

void prep_las_describe(prep_scan *scan, const prep_las_header *h)
{
    prep_scan_info *info = &scan->info;
    snprintf(info->format, sizeof info->format, "%s 1.%u, point format %u",
             h->is_compressed ? "LAZ" : "LAS", h->version_minor, h->point_format);
    info->point_count = h->present;
    info->has_bounds = h->has_bounds;
    snprintf(info->crs, sizeof info->crs, "%s", h->crs);
    info->step = prep_scan_common_step(h->scale);
    for (int a = 0; a < 3; a++) {
        info->offset[a] = h->offset[a];
        info->low[a] = h->low[a];
        info->high[a] = h->high[a];
    }
}

static void decode_xyz(const prep_las_layout *l, const uint8_t *p, uint32_t count, double *xyz)
{
    double sx = l->scale[0], sy = l->scale[1], sz = l->scale[2];
    double ox = l->offset[0], oy = l->offset[1], oz = l->offset[2];
    size_t stride = l->record_length;
    for (uint32_t i = 0; i < count; i++, p += stride, xyz += 3) {
        xyz[0] = (int32_t)prep_le32(p) * sx + ox;
        xyz[1] = (int32_t)prep_le32(p + 4) * sy + oy;
        xyz[2] = (int32_t)prep_le32(p + 8) * sz + oz;
    }
}

static uint8_t intensity_of(const prep_las_layout *l, const uint8_t *record)
{
    return l->has_intensity ? prep_tone_apply(&l->tone, prep_le16(record + INTENSITY_AT)) : 255;
}

static void show_intensity(const prep_las_layout *l, const uint8_t *p, uint32_t count, uint8_t *out)
{
    for (uint32_t i = 0; i < count; i++, p += l->record_length, out += 4)
        memset(out, intensity_of(l, p), 4);
}

/* Colours of 16 bits, channel by channel, and intensity as they are shown: four bytes, the first of
 * which is the lowest. */
MOSPT_WIDE static void show_block(uint16_t rgb[3][BLOCK], const uint8_t *intensity, uint32_t count,
                                  uint32_t *shown)
{
    for (uint32_t i = 0; i < count; i++) {
        uint32_t r = prep_tone_from_16(rgb[0][i]), g = prep_tone_from_16(rgb[1][i]);
        uint32_t b = prep_tone_from_16(rgb[2][i]), a = intensity[i];
        shown[i] = r | g << 8 | b << 16 | a << 24;
    }
}

/* At most BLOCK points. */
static void show_rgb_16(const prep_las_layout *l, const uint8_t *p, uint32_t count, uint8_t *out)
{
    uint16_t rgb[3][BLOCK], raw[BLOCK];
    uint8_t intensity[BLOCK];
    uint32_t shown[BLOCK];
    const uint8_t *colour = p + l->rgb_at;
    for (uint32_t i = 0; i < count; i++, p += l->record_length, colour += l->record_length) {
        raw[i] = prep_le16(p + INTENSITY_AT);
        for (int c = 0; c < 3; c++)
            rgb[c][i] = prep_le16(colour + 2 * c);
    }
    if (l->has_intensity) prep_tone_apply_16(&l->tone, raw, count, intensity);
    else memset(intensity, UINT8_MAX, count);
    show_block(rgb, intensity, count, shown);
    for (uint32_t i = 0; i < count; i++)
        prep_put_le32(out + 4 * (size_t)i, shown[i]);
}

static uint8_t at_most_255(uint16_t v)
{
    return v < 255 ? (uint8_t)v : 255;
}

static void show_rgb_8(const prep_las_layout *l, const uint8_t *p, uint32_t count, uint8_t *out)
{
    size_t stride = l->record_length, at = l->rgb_at;
    for (uint32_t i = 0; i < count; i++, p += stride, out += 4) {
        uint8_t rgbi[4] = {at_most_255(prep_le16(p + at)), at_most_255(prep_le16(p + at + 2)),
                           at_most_255(prep_le16(p + at + 4)), intensity_of(l, p)};
        memcpy(out, rgbi, sizeof rgbi);
    }
}

/* A field that is not narrow: its bytes are copied as they are.
 * p        the field in the first record */
static void copy_wide(const prep_las_field *f, const uint8_t *p, size_t stride, uint32_t count,
                      uint8_t *out)
{
    size_t size = f->size, row = size * f->components;
    mospt_copy_strided(out, row, p, stride, row, count);
    if (!prep_host_is_big_endian()) return;
    for (size_t i = 0; i < count * row; i += size)
        for (size_t k = 0; k < size / 2; k++) {
            uint8_t byte = out[i + k];
            out[i + k] = out[i + size - 1 - k];
            out[i + size - 1 - k] = byte;
        }
}

/* Bytes of a record that a narrow field is made of; 0: it is not narrow. */
static uint32_t narrow_size(const prep_las_field *f)
{
    if (f->kind == FIELD_FLAGS_OLD) return 2;
    if (f->kind != FIELD_COPY) return 1;
    return f->components == 1 && f->size <= 2 ? f->size : 0;
}

/* Columns of the bytes of a block, MOSPT_TURN of each record from `at` on. */
typedef struct {
    size_t at;
    uint8_t column[MOSPT_TURN][BLOCK];
} columns;

static void turn(const uint8_t *p, size_t stride, uint32_t count, size_t at, columns *out)
{
    mospt_row rows[MOSPT_TURN];
    out->at = at;
    for (uint32_t start = 0; start < count; start += MOSPT_TURN) {
        for (uint32_t i = 0; i < MOSPT_TURN; i++) /* what is behind the last one does not matter */
            memcpy(&rows[i], p + (start + i < count ? start + i : start) * stride + at, MOSPT_TURN);
        mospt_turn(rows, out->column[0] + start, BLOCK);
    }
}

static void join(const uint8_t *restrict low, const uint8_t *restrict high, uint32_t count,
                 uint8_t *restrict out)
{
    for (uint32_t i = 0; i < count; i++) {
        uint16_t value = (uint16_t)(low[i] | high[i] << 8);
        memcpy(out + 2 * (size_t)i, &value, sizeof value);
    }
}

/* Flags of the two bytes in which formats below 6 have them. */
static void join_flags(const uint8_t *restrict first, const uint8_t *restrict second,
                       uint32_t count, uint8_t *restrict out)
{
    for (uint32_t i = 0; i < count; i++)
        out[i] = (uint8_t)(second[i] >> 5 | (first[i] >> 6 & 1) << 4 | first[i] >> 7 << 5);
}

static void take_flags(const uint8_t *restrict from, uint32_t count, uint8_t *restrict out)
{
    for (uint32_t i = 0; i < count; i++)
        out[i] = (uint8_t)((from[i] & 15) | (from[i] >> 6 & 1) << 4 | from[i] >> 7 << 5);
}

static void take_bits(const uint8_t *restrict from, uint32_t shift, uint32_t mask, uint32_t count,
                      uint8_t *restrict out)
{
    for (uint32_t i = 0; i < count; i++)
        out[i] = (uint8_t)(from[i] >> shift & mask);
}

/* A field of a byte or two, from columns that have it. */
static void unpack_narrow(const prep_las_field *f, const columns *c, uint32_t count, uint8_t *out)
{
    const uint8_t *first = c->column[f->at - c->at];
    switch (f->kind) {
    case FIELD_BITS:
        take_bits(first, f->shift, f->mask, count, out);
        return;
    case FIELD_FLAGS_OLD:
        join_flags(first, c->column[f->at - c->at + 1], count, out);
        return;
    case FIELD_FLAGS_NEW:
        take_flags(first, count, out);
        return;
    default:
        if (f->size == 1) memcpy(out, first, count);
        else join(first, c->column[f->at - c->at + 1], count, out);
    }
}

/* Of points [begin, begin + count) of all. */
static void unpack_block(const prep_las_layout *l, const uint8_t *records, uint32_t begin,
                         uint32_t count, const prep_places *to)
{
    uint8_t *rgbi = to->rgbi + 4 * (size_t)begin;
    size_t stride = l->record_length;
    columns c = {.at = stride}; /* none yet */
    records += begin * stride;
    if (to->xyz != NULL) decode_xyz(l, records, count, to->xyz + 3 * (size_t)begin);
    if (l->has_rgb && l->rgb_is_16) show_rgb_16(l, records, count, rgbi);
    else if (l->has_rgb) show_rgb_8(l, records, count, rgbi);
    else show_intensity(l, records, count, rgbi);
    for (uint32_t k = 0; k < l->field_count; k++) {
        const prep_las_field *f = &l->field[k];
        size_t narrow = narrow_size(f), row = (size_t)f->size * f->components;
        if (to->plane[k] == NULL) continue;
        uint8_t *out = to->plane[k] + begin * row;
        if (narrow == 0) {
            copy_wide(f, records + f->at, stride, count, out);
            continue;
        }
        if ((size_t)f->at < c.at || f->at + narrow > c.at + MOSPT_TURN)
            turn(records, stride, count,
                 (size_t)f->at + MOSPT_TURN <= stride ? f->at : stride - MOSPT_TURN, &c);
        unpack_narrow(f, &c, count, out);
    }
}

void prep_las_unpack(const void *layout, const uint8_t *records, uint32_t count,
                     const prep_places *to)
{
    for (uint32_t begin = 0, n; begin < count; begin += n) {
        n = count - begin < BLOCK ? count - begin : BLOCK;
        unpack_block(layout, records, begin, n, to);
    }
}
