#include "preprocess/e57_points.h"

#include "preprocess/e57_bits.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const cartesian[3] = {"cartesianX", "cartesianY", "cartesianZ"};
static const char *const spherical[3] = {"sphericalRange", "sphericalAzimuth",
                                         "sphericalElevation"};
static const char *const colours[3] = {"colorRed", "colorGreen", "colorBlue"};
static const char *const normals[3] = {"normalX", "normalY", "normalZ"};

static int find_field(const prep_e57_scan *s, const char *name, bool any_prefix)
{
    for (uint32_t i = 0; i < s->field_count; i++) {
        const char *has = any_prefix ? prep_e57_local_name(s->field[i].name) : s->field[i].name;
        if (s->field[i].kind != PREP_E57_UNREAD && strcmp(has, name) == 0) return (int)i;
    }
    return -1;
}

static bool find_three(const prep_e57_scan *s, const char *const wanted[3], bool any_prefix,
                       int out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = find_field(s, wanted[c], any_prefix);
    return out[0] >= 0 && out[1] >= 0 && out[2] >= 0;
}

bool prep_e57_points_are_possible(const prep_e57_scan *scan, char *why, size_t size)
{
    int at[3];
    if (scan->fault[0] != '\0') snprintf(why, size, "%s", scan->fault);
    else if (!find_three(scan, cartesian, false, at) && !find_three(scan, spherical, false, at))
        snprintf(why, size, "its points have neither Cartesian nor spherical coordinates");
    else return true;
    return false;
}

static unsigned width_of(const prep_e57_field *f)
{
    if (f->kind == PREP_E57_FLOAT) return 32;
    if (f->kind == PREP_E57_DOUBLE) return 64;
    return prep_e57_bits_width(f->low, f->high);
}

int prep_e57_points_add_channel(prep_e57_points *p, const prep_e57_scan *s, int field)
{
    if (field < 0) return -1;
    for (uint32_t i = 0; i < p->channel_count; i++)
        if (p->channel[i].field == &s->field[field]) return (int)i;
    if (p->channel_count == PREP_E57_CHANNELS_MAX) return -1;
    prep_e57_channel *c = &p->channel[p->channel_count++];
    c->field = &s->field[field];
    c->stream = (prep_e57_stream){.index = (uint32_t)field, .width = width_of(c->field)};
    return (int)p->channel_count - 1;
}

static void add_three(prep_e57_points *p, const prep_e57_scan *s, const char *const wanted[3],
                      bool any_prefix, int out[3])
{
    int field[3];
    bool has = find_three(s, wanted, any_prefix, field);
    for (int c = 0; c < 3; c++)
        out[c] = has ? prep_e57_points_add_channel(p, s, field[c]) : -1;
}

static void find_meanings(prep_e57_points *p, const prep_e57_scan *s)
{
    add_three(p, s, cartesian, false, p->xyz);
    p->is_spherical = p->xyz[0] < 0;
    if (p->is_spherical) add_three(p, s, spherical, false, p->xyz);
    const char *invalid = p->is_spherical ? "sphericalInvalidState" : "cartesianInvalidState";
    p->invalid = prep_e57_points_add_channel(p, s, find_field(s, invalid, false));
    add_three(p, s, colours, false, p->rgb);
    p->rgb_invalid = prep_e57_points_add_channel(p, s, find_field(s, "isColorInvalid", false));
    p->intensity = prep_e57_points_add_channel(p, s, find_field(s, "intensity", false));
    p->intensity_invalid =
        prep_e57_points_add_channel(p, s, find_field(s, "isIntensityInvalid", false));
    add_three(p, s, normals, true, p->normal);
    p->return_index = prep_e57_points_add_channel(p, s, find_field(s, "returnIndex", false));
}

static bool are_finite(const double *v, int count)
{
    for (int i = 0; i < count; i++)
        if (!isfinite(v[i])) return false;
    return true;
}

/* Where only one of rotation and translation is there, the other does nothing; a quaternion of no
 * length, too. */
static void find_pose(prep_e57_points *p, const prep_e57_scan *s)
{
    double w = 1, x = 0, y = 0, z = 0;
    const double *q = s->rotation, *t = s->translation;
    bool has_q = are_finite(q, 4), has_t = are_finite(t, 3);
    double length = has_q ? sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) : 0;
    has_q = isfinite(length) && length > 1e-12;
    if (has_q) w = q[0] / length, x = q[1] / length, y = q[2] / length, z = q[3] / length;
    const double m[12] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                          has_t ? t[0] : 0,        2 * (x * y + w * z),     1 - 2 * (x * x + z * z),
                          2 * (y * z - w * x),     has_t ? t[1] : 0,        2 * (x * z - w * y),
                          2 * (y * z + w * x),     1 - 2 * (x * x + y * y), has_t ? t[2] : 0};
    memcpy(p->pose, m, sizeof m);
    p->has_pose = has_q || has_t;
    p->has_rotation = has_q && (x != 0 || y != 0 || z != 0);
}

void prep_e57_points_init(prep_e57_points *points, const prep_e57_scan *scan)
{
    *points = (prep_e57_points){0};
    find_meanings(points, scan);
    find_pose(points, scan);
}

void prep_e57_points_release(prep_e57_points *p)
{
    for (uint32_t i = 0; i < p->channel_count; i++) {
        free(p->channel[i].stream.bytes);
        free(p->channel[i].raw);
        p->channel[i].stream.bytes = NULL;
        p->channel[i].raw = NULL;
    }
    free(p->scratch);
    free(p->keep);
    free(p->lost);
    p->scratch = NULL;
    p->keep = p->lost = NULL;
}

uint64_t prep_e57_points_bits(const prep_e57_points *points)
{
    uint64_t bits = 0;
    for (uint32_t i = 0; i < points->channel_count; i++)
        bits += points->channel[i].stream.width;
    return bits;
}

void prep_e57_points_start(prep_e57_points *p, const prep_e57_vector *vector)
{
    for (uint32_t i = 0; i < p->channel_count; i++) {
        prep_e57_stream *s = &p->channel[i].stream;
        prep_e57_stream_start(s, vector, s->index, s->width);
    }
}

static bool allocate(prep_e57_points *p, mospt_err *err)
{
    bool ok = true;
    for (uint32_t i = 0; i < p->channel_count; i++) {
        prep_e57_channel *c = &p->channel[i];
        if (c->raw == NULL) c->raw = malloc(PREP_E57_BLOCK * sizeof *c->raw);
        ok = ok && c->raw != NULL;
    }
    if (p->scratch == NULL) p->scratch = malloc(PREP_E57_BLOCK * sizeof *p->scratch);
    if (p->keep == NULL) p->keep = malloc(PREP_E57_BLOCK);
    if (p->lost == NULL) p->lost = malloc(PREP_E57_BLOCK);
    if (ok && p->scratch != NULL && p->keep != NULL && p->lost != NULL) return true;
    return mospt_err_nomem(err, PREP_E57_BLOCK * sizeof *p->scratch);
}

static void find_lost(prep_e57_points *p, const prep_e57_stream *stream, uint32_t count)
{
    if (!p->has_lost) memset(p->lost, 0, count);
    if (prep_e57_stream_mark_holes(stream, count, p->lost)) p->has_lost = true;
}

bool prep_e57_points_load(prep_e57_points *p, prep_e57_vector *vector, uint32_t count,
                          uint32_t *got, mospt_err *err)
{
    *got = 0;
    if (!allocate(p, err)) return false;
    for (uint32_t i = 0; i < p->channel_count; i++) {
        uint32_t available;
        if (!prep_e57_stream_fill(&p->channel[i].stream, vector, count, &available, err))
            return false;
        if (available < count) count = available;
    }
    p->has_lost = false;
    for (uint32_t i = 0; i < p->channel_count; i++) {
        prep_e57_channel *c = &p->channel[i];
        if (c->stream.hole_count > 0) find_lost(p, &c->stream, count);
        prep_e57_bits_unpack(c->stream.bytes, c->stream.bit, c->stream.width, count, c->raw);
        prep_e57_stream_take(&c->stream, count);
    }
    *got = count;
    return true;
}

static float raw_float(uint64_t raw)
{
    uint32_t bits = (uint32_t)raw;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static double raw_double(uint64_t raw)
{
    double value;
    memcpy(&value, &raw, sizeof value);
    return value;
}

void prep_e57_points_values(const prep_e57_points *p, int channel, uint32_t count, double *out,
                            size_t step)
{
    const prep_e57_field *f = p->channel[channel].field;
    const uint64_t *raw = p->channel[channel].raw;
    uint64_t low = (uint64_t)f->low;
    double scale = f->scale, offset = f->offset;
    switch (f->kind) {
    case PREP_E57_FLOAT:
        for (uint32_t i = 0; i < count; i++)
            out[i * step] = (double)raw_float(raw[i]);
        break;
    case PREP_E57_DOUBLE:
        for (uint32_t i = 0; i < count; i++)
            out[i * step] = raw_double(raw[i]);
        break;
    case PREP_E57_SCALED:
        for (uint32_t i = 0; i < count; i++)
            out[i * step] = (double)(int64_t)(low + raw[i]) * scale + offset;
        break;
    default:
        for (uint32_t i = 0; i < count; i++)
            out[i * step] = (double)(int64_t)(low + raw[i]);
        break;
    }
}

static void from_spherical(double *xyz, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++, xyz += 3) {
        double range = xyz[0], azimuth = xyz[1], elevation = xyz[2];
        double flat = range * cos(elevation);
        xyz[0] = flat * cos(azimuth);
        xyz[1] = flat * sin(azimuth);
        xyz[2] = range * sin(elevation);
    }
}

static void move(const double *m, double *xyz, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++, xyz += 3) {
        double x = xyz[0], y = xyz[1], z = xyz[2];
        xyz[0] = m[0] * x + m[1] * y + m[2] * z + m[3];
        xyz[1] = m[4] * x + m[5] * y + m[6] * z + m[7];
        xyz[2] = m[8] * x + m[9] * y + m[10] * z + m[11];
    }
}

static void shift(const double *m, double *xyz, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++, xyz += 3)
        xyz[0] += m[3], xyz[1] += m[7], xyz[2] += m[11];
}

void prep_e57_points_xyz(const prep_e57_points *p, uint32_t count, double *xyz)
{
    for (int a = 0; a < 3; a++)
        prep_e57_points_values(p, p->xyz[a], count, xyz + a, 3);
    if (p->is_spherical) from_spherical(xyz, count);
    if (p->has_rotation) move(p->pose, xyz, count);
    else if (p->has_pose) shift(p->pose, xyz, count);
}

bool prep_e57_points_keep(const prep_e57_points *p, uint32_t count, uint8_t *keep)
{
    uint32_t kept = count;
    memset(keep, 1, count);
    if (p->invalid >= 0) {
        uint64_t valid =
            0 - (uint64_t)p->channel[p->invalid].field->low; /* raw value that stands for 0 */
        const uint64_t *raw = p->channel[p->invalid].raw;
        kept = 0;
        for (uint32_t i = 0; i < count; i++) {
            keep[i] = raw[i] == valid; /* 1: only the direction is known, 2: nothing is */
            kept += keep[i];
        }
    }
    for (uint32_t i = 0; i < count && p->has_lost; i++) {
        kept -= keep[i] & p->lost[i];
        keep[i] &= !p->lost[i];
    }
    return kept == count;
}
