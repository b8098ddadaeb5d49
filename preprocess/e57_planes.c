#include "preprocess/e57_planes.h"

#include "preprocess/e57_bits.h"

#include <math.h>
#include <string.h>

/* Names that the field has for what E57 calls otherwise. */
static const char *const names[][2] = {
    {"rowIndex", "row_index"},
    {"columnIndex", "column_index"},
    {"returnIndex", "return_number"},
    {"returnCount", "number_of_returns"},
    {"timeStamp", "gps_time"},
    {"isColorInvalid", "color_invalid"},
    {"isIntensityInvalid", "intensity_invalid"},
    {"isTimeStampInvalid", "time_invalid"},
};

/* The narrowest type for the integers that a field's bits can make, which may be more than its
 * range admits. */
static mospt_type integer_type(const prep_e57_field *f, uint64_t bias)
{
    unsigned width = prep_e57_bits_width(f->low, f->high);
    uint64_t spread = width == 0 ? 0 : UINT64_MAX >> (64 - width);
    if (f->low >= 0) {
        uint64_t high = (uint64_t)f->low + spread;
        high = high > UINT64_MAX - bias ? UINT64_MAX : high + bias;
        return high <= UINT8_MAX    ? MOSPT_U8
               : high <= UINT16_MAX ? MOSPT_U16
               : high <= UINT32_MAX ? MOSPT_U32
                                    : MOSPT_U64;
    }
    if (width == 64) return MOSPT_I64;
    int64_t high = f->low + (int64_t)(spread + bias);
    if (f->low >= INT8_MIN && high <= INT8_MAX) return MOSPT_I8;
    if (f->low >= INT16_MIN && high <= INT16_MAX) return MOSPT_I16;
    return f->low >= INT32_MIN && high <= INT32_MAX ? MOSPT_I32 : MOSPT_I64;
}

/* Multiples of a scale stay apart in a float as long as they have a bit to spare. */
static mospt_type scaled_type(const prep_e57_field *f)
{
    const int64_t limit = INT64_C(1) << 22;
    bool fits = f->offset == 0 && f->low >= -limit && f->high <= limit && fabs(f->scale) > 1e-30 &&
                fabs(f->scale) < 1e30;
    return fits ? MOSPT_F32 : MOSPT_F64;
}

static mospt_type type_of(const prep_e57_points *p, int channel, uint64_t bias)
{
    const prep_e57_field *f = p->channel[channel].field;
    switch (f->kind) {
    case PREP_E57_INTEGER:
        return integer_type(f, bias);
    case PREP_E57_SCALED:
        return scaled_type(f);
    case PREP_E57_FLOAT:
        return MOSPT_F32;
    default:
        return MOSPT_F64;
    }
}

static void add_plane(prep_e57_points *p, prep_scan *scan, const char *name,
                      const prep_e57_plane *plane)
{
    int k = prep_scan_add_attribute(scan, name, plane->type, plane->components);
    if (k >= 0) p->plane[k] = *plane;
    else
        prep_scan_set_damage(scan, mospt_at_file(scan->path),
                             "more than %d attributes; `%.48s` and those after it are left out",
                             MOSPT_ATTRIBUTES_MAX, name);
}

static void add_single(prep_e57_points *p, prep_scan *scan, const char *name, int channel,
                       uint64_t bias)
{
    prep_e57_plane plane = {
        .type = type_of(p, channel, bias), .components = 1, .channel = {channel}, .bias = bias};
    add_plane(p, scan, name, &plane);
}

/* The brightest value of a colour. Declared limits say what the sensor could do, what it did, or
 * nothing true, so they are rounded up to ranges in use and believed as far as a sample goes. */
static double white_of(const prep_e57_field *f, double limit, double rgb_max)
{
    bool is_float = f->kind == PREP_E57_FLOAT || f->kind == PREP_E57_DOUBLE;
    double white = limit;
    if (!isfinite(white) || white <= 0)
        white = is_float ? f->most : (double)f->high * f->scale + f->offset;
    if (!(white > 0) || white > 1e30 || white < rgb_max)
        white = rgb_max <= 1 ? 1 : rgb_max <= 255 ? 255 : 65535;
    if (is_float && rgb_max <= 1 && white > 1) white = 1;
    if (white > 32767)
        return rgb_max <= 255  ? 255
               : white < 65535 ? 65535
                               : white; /* bytes are found in 16-bit fields, too */
    return white > 127 && white < 255 ? 255 : white;
}

static void choose_colours(prep_e57_points *p, const prep_e57_scan *desc, double rgb_max)
{
    for (int c = 0; c < 3; c++) {
        double black = desc->rgb_low[c];
        double white = white_of(p->channel[p->rgb[c]].field, desc->rgb_high[c], rgb_max);
        if (!(black < 0)) black = 0;
        p->rgb_scale[c] = (prep_scale){.low = black, .scale = 255 / (white - black)};
    }
}

/* Colours whose every value is what is shown need no plane of their own. */
static bool are_shown_as_they_are(const prep_e57_points *p)
{
    for (int c = 0; c < 3; c++) {
        const prep_e57_field *f = p->channel[p->rgb[c]].field;
        if (f->kind != PREP_E57_INTEGER || integer_type(f, 0) != MOSPT_U8) return false;
        if (p->rgb_scale[c].low != 0 || p->rgb_scale[c].scale != 1) return false;
    }
    return true;
}

static void add_colours(prep_e57_points *p, prep_scan *scan)
{
    if (are_shown_as_they_are(p)) return;
    prep_e57_plane plane = {.components = 3, .channel = {p->rgb[0], p->rgb[1], p->rgb[2]}};
    bool are_integers = true;
    for (int c = 0; c < 3; c++) {
        mospt_type type = type_of(p, p->rgb[c], 0);
        are_integers = are_integers && p->channel[p->rgb[c]].field->kind == PREP_E57_INTEGER;
        plane.type = c == 0 ? type : mospt_type_common(plane.type, type);
    }
    if (are_integers && mospt_type_size(plane.type) == 1)
        plane.type = mospt_type_common(plane.type, MOSPT_U16);
    add_plane(p, scan, are_integers ? "rgb" : "rgb_float", &plane);
}

/* The rest keeps its own name, unless the field has another one for it. */
static void add_others(prep_e57_points *p, prep_scan *scan, const prep_e57_scan *desc,
                       bool counts_from_one)
{
    for (uint32_t i = 0; i < desc->field_count; i++) {
        const char *full = desc->field[i].name, *name = prep_e57_local_name(full);
        bool is_coordinate =
            strncmp(full, "cartesian", 9) == 0 || strncmp(full, "spherical", 9) == 0;
        bool is_used = false;
        for (int c = 0; c < 3; c++) {
            int used[2] = {p->rgb[c], p->normal[c]};
            for (int k = 0; k < 2; k++)
                is_used = is_used || (used[k] >= 0 && p->channel[used[k]].field == &desc->field[i]);
        }
        is_used =
            is_used || (p->intensity >= 0 && p->channel[p->intensity].field == &desc->field[i]);
        if (is_coordinate || is_used || desc->field[i].kind == PREP_E57_UNREAD) continue;
        int channel = prep_e57_points_add_channel(p, desc, (int)i);
        if (channel < 0) continue;
        for (size_t n = 0; n < sizeof names / sizeof names[0]; n++)
            if (strcmp(full, names[n][0]) == 0) name = names[n][1];
        bool is_return = channel == p->return_index && desc->field[i].kind == PREP_E57_INTEGER;
        add_single(p, scan, name, channel, is_return && !counts_from_one ? 1 : 0);
    }
}

void prep_e57_planes_add(prep_e57_points *p, prep_scan *scan, const prep_e57_scan *desc,
                         double rgb_max, double return_index_min)
{
    scan->info.has_rgb = p->rgb[0] >= 0 && rgb_max > 0;
    if (p->intensity >= 0) add_single(p, scan, "intensity", p->intensity, 0);
    if (scan->info.has_rgb) {
        choose_colours(p, desc, rgb_max);
        add_colours(p, scan);
    }
    if (p->normal[0] >= 0) {
        prep_e57_plane plane = {MOSPT_F32, 3, {p->normal[0], p->normal[1], p->normal[2]}, 0, true};
        add_plane(p, scan, "normal", &plane);
    }
    add_others(p, scan, desc, return_index_min >= 1);
}

/* Whether a flag is set; no flag is never set. */
static bool is_flagged(const prep_e57_points *p, int channel, uint32_t i)
{
    return channel >= 0 &&
           (uint64_t)p->channel[channel].field->low + p->channel[channel].raw[i] != 0;
}

static void show_intensity(prep_e57_points *p, const prep_scan *scan, uint32_t count, uint8_t *rgbi)
{
    memset(rgbi, 255, 4 * (size_t)count);
    if (!scan->info.has_intensity) return;
    prep_e57_points_values(p, p->intensity, count, p->scratch, 1);
    for (uint32_t i = 0; i < count; i++) {
        if (is_flagged(p, p->intensity_invalid, i)) continue;
        memset(rgbi + 4 * (size_t)i, prep_tone_apply(&p->tone, p->scratch[i]), 4);
    }
}

static void show_colour(prep_e57_points *p, const prep_scan *scan, uint32_t count, uint8_t *rgbi)
{
    for (int c = 0; c < 3 && scan->info.has_rgb; c++) {
        prep_scale scale = p->rgb_scale[c];
        prep_e57_points_values(p, p->rgb[c], count, p->scratch, 1);
        for (uint32_t i = 0; i < count; i++) {
            if (is_flagged(p, p->rgb_invalid, i)) continue;
            rgbi[4 * (size_t)i + (size_t)c] = prep_scale_apply(&scale, p->scratch[i]);
        }
    }
}

#define WRITE(ENUM, T, VALUE)                                                                      \
    case ENUM:                                                                                     \
        for (uint32_t i = 0; i < count; i++, out += stride) {                                      \
            T v = (T)(VALUE);                                                                      \
            memcpy(out, &v, sizeof v);                                                             \
        }                                                                                          \
        break

static void write_integers(mospt_type type, const uint64_t *raw, uint64_t low, uint32_t count,
                           uint8_t *out, size_t stride)
{
    switch (type) {
        WRITE(MOSPT_U8, uint8_t, low + raw[i]);
        WRITE(MOSPT_I8, int8_t, low + raw[i]);
        WRITE(MOSPT_U16, uint16_t, low + raw[i]);
        WRITE(MOSPT_I16, int16_t, low + raw[i]);
        WRITE(MOSPT_U32, uint32_t, low + raw[i]);
        WRITE(MOSPT_I32, int32_t, low + raw[i]);
        WRITE(MOSPT_U64, uint64_t, low + raw[i]);
        WRITE(MOSPT_I64, int64_t, low + raw[i]);
        WRITE(MOSPT_F32, float, (int64_t)(low + raw[i]));
        WRITE(MOSPT_F64, double, (int64_t)(low + raw[i]));
    case MOSPT_TYPE_COUNT:
        break;
    }
}

static void write_doubles(mospt_type type, const double *values, uint32_t count, uint8_t *out,
                          size_t stride)
{
    switch (type) {
        WRITE(MOSPT_F32, float, values[i]);
        WRITE(MOSPT_F64, double, values[i]);
    default:
        break;
    }
}
#undef WRITE

/* Directions turn with the scan, as its points do. */
static void turn(const double *m, uint32_t count, uint8_t *normal)
{
    for (uint32_t i = 0; i < count; i++, normal += 3 * sizeof(float)) {
        float n[3];
        memcpy(n, normal, sizeof n);
        double x = (double)n[0], y = (double)n[1], z = (double)n[2];
        n[0] = (float)(m[0] * x + m[1] * y + m[2] * z);
        n[1] = (float)(m[4] * x + m[5] * y + m[6] * z);
        n[2] = (float)(m[8] * x + m[9] * y + m[10] * z);
        memcpy(normal, n, sizeof n);
    }
}

static void write_plane(prep_e57_points *p, const prep_e57_plane *plane, uint32_t count,
                        uint8_t *out)
{
    size_t size = mospt_type_size(plane->type), stride = size * plane->components;
    for (uint32_t c = 0; c < plane->components; c++) {
        const prep_e57_channel *channel = &p->channel[plane->channel[c]];
        if (channel->field->kind == PREP_E57_INTEGER) {
            write_integers(plane->type, channel->raw, (uint64_t)channel->field->low + plane->bias,
                           count, out + c * size, stride);
            continue;
        }
        prep_e57_points_values(p, plane->channel[c], count, p->scratch, 1);
        write_doubles(plane->type, p->scratch, count, out + c * size, stride);
    }
    if (plane->is_normal && p->has_rotation) turn(p->pose, count, out);
}

void prep_e57_planes_emit(prep_e57_points *p, prep_scan *scan, uint32_t count, prep_batch *batch)
{
    size_t first = batch->count;
    prep_batch block = *batch; /* the part of the batch that is appended */
    block.xyz += 3 * first;
    block.rgbi += 4 * first;
    block.count = count;
    prep_e57_points_xyz(p, count, block.xyz);
    show_intensity(p, scan, count, block.rgbi);
    show_colour(p, scan, count, block.rgbi);
    for (uint32_t k = 0; k < batch->plane_count; k++) {
        block.plane[k] += first * batch->plane_size[k];
        write_plane(p, &p->plane[k], count, block.plane[k]);
    }
    if (!prep_e57_points_keep(p, count, p->keep)) prep_batch_compact(&block, p->keep);
    uint32_t lost = 0;
    for (uint32_t i = 0; i < count && p->has_lost; i++)
        lost += p->lost[i];
    scan->dropped[PREP_DROP_UNREADABLE] += lost;
    scan->dropped[PREP_DROP_NO_RETURN] += count - block.count - lost;
    batch->count += block.count;
}
