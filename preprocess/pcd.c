#include "preprocess/pcd.h"

#include "preprocess/tone.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { SAMPLE_ROWS = PREP_TONE_SAMPLES / PREP_PCD_SAMPLE_PLACES };

/* Which values make up one plane of a batch: all those of one field, or one of several fields each.
 */
typedef struct {
    mospt_type type;
    uint32_t components;
    bool is_array;
    int field[3];
    uint32_t byte; /* in the field's value */
} plane_source;

typedef struct {
    prep_pcd_header header;
    prep_pcd_rows rows;
    int rgb[3], packed, normal[3], intensity; /* field; -1: there is none */
    double rgb_scale;                         /* raw to 0..255 */
    prep_tone tone;
    plane_source plane[MOSPT_ATTRIBUTES_MAX];
    double *scratch; /* [rows.capacity], owned */
} pcd_state;

/* What a sample of the points says. */
typedef struct {
    double *intensity; /* [PREP_TONE_SAMPLES], owned */
    size_t count;
    uint32_t seen;
    double rgb_max;
    uint8_t alpha_min, alpha_max;
} pcd_sample;

/* A field with one value per point. */
static int find(const pcd_state *pcd, const char *name)
{
    for (uint32_t i = 0; i < pcd->header.field_count; i++) {
        const prep_pcd_field *f = &pcd->header.field[i];
        if (f->count == 1 && strcasecmp(f->name, name) == 0) return (int)i;
    }
    return -1;
}

static bool find_three(const pcd_state *pcd, const char *const names[3], int out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = find(pcd, names[c]);
    if (out[0] >= 0 && out[1] >= 0 && out[2] >= 0) return true;
    out[0] = out[1] = out[2] = -1;
    return false;
}

static mospt_type type_of(const pcd_state *pcd, int field)
{
    return pcd->header.field[field].type;
}

static bool all_of_type(const pcd_state *pcd, const int field[3], mospt_type type)
{
    return field[0] >= 0 && type_of(pcd, field[0]) == type && type_of(pcd, field[1]) == type &&
           type_of(pcd, field[2]) == type;
}

static bool find_meanings(prep_scan *scan, pcd_state *pcd, mospt_err *err)
{
    static const char *const xyz[3] = {"x", "y", "z"};
    static const char *const packed[] = {"rgb", "rgba"};
    static const char *const rgb[][3] = {{"r", "g", "b"}, {"red", "green", "blue"}};
    static const char *const normal[][3] = {{"normal_x", "normal_y", "normal_z"},
                                            {"nx", "ny", "nz"}};
    static const char *const intensity[] = {"intensity",   "intensities",  "i",
                                            "reflectance", "reflectivity", "remission"};
    if (!find_three(pcd, xyz, pcd->rows.xyz))
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(scan->path, pcd->header.line_count),
                             "the PCD file has no x, y and z");
    pcd->packed = pcd->intensity = -1;
    for (size_t i = 0; i < 2 && pcd->packed < 0; i++) {
        int field = find(pcd, packed[i]);
        if (field >= 0 && mospt_type_size(type_of(pcd, field)) == 4) pcd->packed = field;
    }
    pcd->rgb[0] = pcd->rgb[1] = pcd->rgb[2] = -1;
    for (size_t i = 0; i < 2 && pcd->packed < 0 && pcd->rgb[0] < 0; i++)
        find_three(pcd, rgb[i], pcd->rgb);
    for (size_t i = 0; i < 2; i++) {
        if (find_three(pcd, normal[i], pcd->normal) && all_of_type(pcd, pcd->normal, MOSPT_F32))
            break;
        pcd->normal[0] = pcd->normal[1] = pcd->normal[2] = -1;
    }
    for (size_t i = 0; i < sizeof intensity / sizeof intensity[0] && pcd->intensity < 0; i++)
        pcd->intensity = find(pcd, intensity[i]);
    return true;
}

/* Text may tell more of a coordinate than the 4 bytes that it is said to have can hold. */
static void widen_coordinates(pcd_state *pcd)
{
    prep_pcd_header *h = &pcd->header;
    for (int a = 0; a < 3 && h->encoding == PREP_PCD_ASCII; a++)
        h->field[pcd->rows.xyz[a]].type = MOSPT_F64;
    h->record_size = 0;
    for (uint32_t i = 0; i < h->field_count; i++) {
        h->field[i].offset = h->record_size;
        h->record_size += prep_pcd_field_size(&h->field[i]);
    }
}

static bool is_padding(const prep_pcd_field *f)
{
    return strcmp(f->name, "_") == 0 || f->count == 0;
}

static void choose_fields(pcd_state *pcd)
{
    for (uint32_t i = 0; i < pcd->header.field_count; i++) {
        const prep_pcd_field *f = &pcd->header.field[i];
        pcd->rows.is_used[i] = !is_padding(f) && f->count <= PREP_PCD_COUNT_MAX;
    }
    const int shown[] = {pcd->packed, pcd->rgb[0], pcd->rgb[1], pcd->rgb[2], pcd->intensity};
    for (size_t i = 0; i < sizeof shown / sizeof shown[0]; i++) {
        if (shown[i] >= 0) pcd->rows.is_sampled[shown[i]] = true;
    }
}

static void add_plane(prep_scan *scan, pcd_state *pcd, const char *name, plane_source source)
{
    int k = prep_scan_add_attribute(scan, name, source.type, source.components);
    if (k >= 0) pcd->plane[k] = source;
    else
        prep_scan_set_damage(
            scan, mospt_at_line(scan->path, pcd->header.line_count),
            "more attributes than can be kept; `%s` and those after it are left out", name);
}

static void add_field(prep_scan *scan, pcd_state *pcd, const char *name, int field)
{
    const prep_pcd_field *f = &pcd->header.field[field];
    add_plane(scan, pcd, name, (plane_source){f->type, f->count, true, {field}, 0});
}

static void add_three(prep_scan *scan, pcd_state *pcd, const char *name, const int field[3])
{
    add_plane(scan, pcd, name,
              (plane_source){type_of(pcd, field[0]), 3, false, {field[0], field[1], field[2]}, 0});
}

/* A colour of bytes is in the batch as it is; wider ones keep their raw values beside it. */
static void add_colour(prep_scan *scan, pcd_state *pcd, const pcd_sample *sample)
{
    uint32_t alpha_byte = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__ ? 0 : 3;
    if (pcd->packed >= 0 && sample->alpha_min < sample->alpha_max)
        add_plane(scan, pcd, "alpha", (plane_source){MOSPT_U8, 1, true, {pcd->packed}, alpha_byte});
    if (pcd->rgb[0] < 0 || all_of_type(pcd, pcd->rgb, MOSPT_U8)) return;
    if (all_of_type(pcd, pcd->rgb, MOSPT_U16)) add_three(scan, pcd, "rgb", pcd->rgb);
    else if (all_of_type(pcd, pcd->rgb, MOSPT_F32) || all_of_type(pcd, pcd->rgb, MOSPT_F64))
        add_three(scan, pcd, "rgb_float", pcd->rgb);
    else
        for (int c = 0; c < 3; c++)
            add_field(scan, pcd, pcd->header.field[pcd->rgb[c]].name, pcd->rgb[c]);
}

static bool is_one_of(int field, const int set[3])
{
    return field == set[0] || field == set[1] || field == set[2];
}

static void make_planes(prep_scan *scan, pcd_state *pcd, const pcd_sample *sample)
{
    if (pcd->intensity >= 0) add_field(scan, pcd, "intensity", pcd->intensity);
    add_colour(scan, pcd, sample);
    if (pcd->normal[0] >= 0) add_three(scan, pcd, "normal", pcd->normal);
    for (uint32_t i = 0; i < pcd->header.field_count; i++) {
        const prep_pcd_field *f = &pcd->header.field[i];
        int field = (int)i;
        if (is_padding(f) || field == pcd->intensity || field == pcd->packed ||
            is_one_of(field, pcd->rows.xyz) || is_one_of(field, pcd->rgb) ||
            is_one_of(field, pcd->normal))
            continue;
        if (f->count <= PREP_PCD_COUNT_MAX) add_field(scan, pcd, f->name, field);
        else
            prep_scan_set_damage(scan, mospt_at_line(scan->path, pcd->header.line_count),
                                 "`%s` has %u values per point, and is left out: %d can be kept",
                                 f->name, f->count, PREP_PCD_COUNT_MAX);
    }
}

/* A packed colour is 32 bits, whatever the header says they are. */
static prep_column packed_column(const pcd_state *pcd)
{
    prep_column column = prep_pcd_rows_column(&pcd->rows, pcd->packed, 0);
    column.type = MOSPT_U32;
    return column;
}

static void sample_packed(const pcd_state *pcd, uint32_t count, pcd_sample *sample)
{
    prep_column column = packed_column(pcd);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v;
        memcpy(&v, column.at + i * column.stride, sizeof v);
        uint8_t alpha = (uint8_t)(v >> 24);
        if ((v & 0xffffff) != 0) sample->rgb_max = 255;
        if (alpha < sample->alpha_min) sample->alpha_min = alpha;
        if (alpha > sample->alpha_max) sample->alpha_max = alpha;
    }
}

static void add_to_sample(const pcd_state *pcd, uint32_t count, pcd_sample *sample)
{
    double *values = sample->intensity + sample->count;
    sample->seen += count;
    if (count > PREP_TONE_SAMPLES - sample->count)
        count = (uint32_t)(PREP_TONE_SAMPLES - sample->count);
    if (pcd->packed >= 0) sample_packed(pcd, count, sample);
    for (int c = 0; c < 3 && pcd->rgb[0] >= 0; c++) {
        prep_column column = prep_pcd_rows_column(&pcd->rows, pcd->rgb[c], 0);
        prep_column_to_f64(&column, count, values, 1);
        for (uint32_t i = 0; i < count; i++) {
            if (isfinite(values[i]) && values[i] > sample->rgb_max) sample->rgb_max = values[i];
        }
    }
    if (pcd->intensity < 0) return;
    prep_column column = prep_pcd_rows_column(&pcd->rows, pcd->intensity, 0);
    prep_column_to_f64(&column, count, values, 1);
    sample->count += count;
}

static bool read_sample(prep_scan *scan, pcd_state *pcd, pcd_sample *sample, mospt_err *err)
{
    for (uint32_t place = 0; place < PREP_PCD_SAMPLE_PLACES; place++) {
        uint32_t count;
        if (!prep_pcd_rows_sample(scan, &pcd->rows, place, SAMPLE_ROWS, &count, err)) return false;
        if (count == 0) break;
        add_to_sample(pcd, count, sample);
    }
    return true;
}

/* Looks at some points to learn how colour and intensity are meant, then goes back to the first. */
static bool take_sample(prep_scan *scan, pcd_state *pcd, pcd_sample *sample, mospt_err *err)
{
    bool was_damaged = scan->is_damaged;
    *sample = (pcd_sample){.alpha_min = 255};
    sample->intensity = malloc(PREP_TONE_SAMPLES * sizeof *sample->intensity);
    if (sample->intensity == NULL)
        return mospt_err_nomem(err, PREP_TONE_SAMPLES * sizeof *sample->intensity);
    bool ok = read_sample(scan, pcd, sample, err);
    pcd->tone = prep_tone_make(sample->intensity, sample->count);
    free(sample->intensity);
    sample->intensity = NULL;

    /* the sample's faults are found again, and counted, when the points are read */
    memset(scan->dropped, 0, sizeof scan->dropped);
    scan->is_damaged = was_damaged;
    if (!ok) return false;
    if (sample->seen == 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, pcd->header.size),
                             "not one of %" PRIu64 " points can be read", pcd->header.points);
    prep_pcd_rows_rewind(&pcd->rows);
    bool is_float = pcd->rgb[0] >= 0 && (type_of(pcd, pcd->rgb[0]) == MOSPT_F32 ||
                                         type_of(pcd, pcd->rgb[0]) == MOSPT_F64);
    pcd->rgb_scale = is_float && sample->rgb_max <= 1 ? 255
                     : sample->rgb_max > 255          ? 255.0 / 65535
                                                      : 1;
    scan->info.has_rgb = sample->rgb_max > 0;
    scan->info.has_intensity = !pcd->tone.is_flat;
    return true;
}

static void take_pose(prep_scan_info *info, const double *v)
{
    double w = v[3], x = v[4], y = v[5], z = v[6], n = w * w + x * x + y * y + z * z;
    bool is_identity = v[0] == 0 && v[1] == 0 && v[2] == 0 && x == 0 && y == 0 && z == 0;
    if (is_identity || !(n > 0) || !isfinite(n) || !isfinite(v[0] + v[1] + v[2])) return;
    double s = 2 / n;
    const double pose[16] = {1 - s * (y * y + z * z),
                             s * (x * y - z * w),
                             s * (x * z + y * w),
                             v[0],
                             s * (x * y + z * w),
                             1 - s * (x * x + z * z),
                             s * (y * z - x * w),
                             v[1],
                             s * (x * z - y * w),
                             s * (y * z + x * w),
                             1 - s * (x * x + y * y),
                             v[2],
                             0,
                             0,
                             0,
                             1};
    memcpy(info->pose, pose, sizeof pose);
    info->has_pose = true;
}

static void describe(prep_scan *scan, const pcd_state *pcd)
{
    static const char *const names[] = {"ascii", "binary", "binary compressed"};
    const prep_pcd_header *h = &pcd->header;
    snprintf(scan->info.format, sizeof scan->info.format, "PCD %s%s%s", h->version,
             h->version[0] != '\0' ? " " : "", names[h->encoding]);
    scan->info.point_count = pcd->rows.present;
    scan->info.is_text = h->encoding == PREP_PCD_ASCII || prep_input_is_gzip(scan->input);
    take_pose(&scan->info, h->viewpoint);
    if (h->grid_points != h->points)
        prep_scan_set_damage(scan, mospt_at_line(scan->path, h->line_count),
                             "WIDTH and HEIGHT make %" PRIu64 " points, POINTS are %" PRIu64,
                             h->grid_points, h->points);
    uint64_t end = h->size + h->points * h->record_size, size = prep_input_size(scan->input);
    bool is_plain = h->encoding == PREP_PCD_BINARY && !prep_input_is_gzip(scan->input);
    if (is_plain && pcd->rows.present == h->points && size > end &&
        (size - end) % h->record_size == 0)
        prep_scan_set_damage(scan, mospt_at_byte(scan->path, end),
                             "the header claims %" PRIu64 " points; what follows has room for "
                             "%" PRIu64 " more, which are left out",
                             h->points, (size - end) / h->record_size);
}

static bool pcd_open(prep_scan *scan, uint32_t index, const prep_scan_options *options,
                     mospt_err *err)
{
    (void)index, (void)options;
    pcd_state *pcd = calloc(1, sizeof *pcd);
    if (pcd == NULL) return mospt_err_nomem(err, sizeof *pcd);
    scan->state = pcd;
    pcd_sample sample;
    if (!prep_pcd_header_read(scan->input, &pcd->header, err)) return false;
    if (!find_meanings(scan, pcd, err)) return false;
    if (pcd->header.points == 0)
        return mospt_err_set(err, MOSPT_EEMPTY, mospt_at_file(scan->path),
                             "the PCD file holds no points");
    widen_coordinates(pcd);
    pcd->rows.header = &pcd->header;
    choose_fields(pcd);
    if (!prep_pcd_rows_locate(scan, &pcd->rows, err)) return false;
    if (!take_sample(scan, pcd, &sample, err)) return false;
    describe(scan, pcd);
    make_planes(scan, pcd, &sample);
    return true;
}

static void show_packed(const pcd_state *pcd, uint32_t count, uint8_t *rgbi)
{
    prep_column column = packed_column(pcd);
    for (uint32_t i = 0; i < count; i++, rgbi += 4) {
        uint32_t v;
        memcpy(&v, column.at + i * column.stride, sizeof v);
        rgbi[0] = (uint8_t)(v >> 16);
        rgbi[1] = (uint8_t)(v >> 8);
        rgbi[2] = (uint8_t)v;
    }
}

static void show(const prep_scan *scan, pcd_state *pcd, uint32_t count, uint8_t *rgbi)
{
    double *values = pcd->scratch;
    memset(rgbi, 255, 4 * (size_t)count);
    if (scan->info.has_intensity) {
        prep_column column = prep_pcd_rows_column(&pcd->rows, pcd->intensity, 0);
        prep_column_to_f64(&column, count, values, 1);
        for (uint32_t i = 0; i < count; i++)
            memset(rgbi + 4 * (size_t)i, prep_tone_apply(&pcd->tone, values[i]), 4);
    }
    if (!scan->info.has_rgb) return;
    if (pcd->packed >= 0) show_packed(pcd, count, rgbi);
    prep_scale scale = {.scale = pcd->rgb_scale};
    for (int c = 0; c < 3 && pcd->packed < 0; c++) {
        prep_column column = prep_pcd_rows_column(&pcd->rows, pcd->rgb[c], 0);
        if (column.type == MOSPT_U8) {
            prep_column_copy(&column, count, rgbi + c, 4);
            continue;
        }
        prep_column_to_f64(&column, count, values, 1);
        for (uint32_t i = 0; i < count; i++)
            rgbi[4 * (size_t)i + (size_t)c] = prep_scale_apply(&scale, values[i]);
    }
}

static void decode(const prep_scan *scan, pcd_state *pcd, uint32_t count, prep_batch *batch)
{
    size_t first = batch->count;
    for (int a = 0; a < 3; a++) {
        prep_column column = prep_pcd_rows_column(&pcd->rows, pcd->rows.xyz[a], 0);
        prep_column_to_f64(&column, count, batch->xyz + 3 * first + a, 3);
    }
    show(scan, pcd, count, batch->rgbi + 4 * first);
    for (uint32_t k = 0; k < batch->plane_count; k++) {
        const plane_source *source = &pcd->plane[k];
        uint8_t *out = batch->plane[k] + first * batch->plane_size[k];
        for (uint32_t c = 0; c < source->components; c++) {
            prep_column column = prep_pcd_rows_column(
                &pcd->rows, source->field[source->is_array ? 0 : c], source->is_array ? c : 0);
            column.at += source->byte;
            column.type = source->type;
            prep_column_copy(&column, count, out + c * mospt_type_size(source->type),
                             batch->plane_size[k]);
        }
    }
    batch->count += count;
}

static bool pcd_read(prep_scan *scan, prep_batch *batch, mospt_err *err)
{
    pcd_state *pcd = scan->state;
    if (pcd->scratch == NULL) pcd->scratch = malloc(pcd->rows.capacity * sizeof *pcd->scratch);
    if (pcd->scratch == NULL)
        return mospt_err_nomem(err, pcd->rows.capacity * sizeof *pcd->scratch);
    while (batch->count < batch->capacity) {
        uint32_t count;
        if (!prep_pcd_rows_read(scan, &pcd->rows, batch->capacity - batch->count, &count, err))
            return false;
        if (count == 0) break;
        decode(scan, pcd, count, batch);
    }
    return true;
}

static bool pcd_rewind(prep_scan *scan, mospt_err *err)
{
    (void)err;
    pcd_state *pcd = scan->state;
    prep_pcd_rows_rewind(&pcd->rows);
    return true;
}

static void pcd_close(prep_scan *scan)
{
    pcd_state *pcd = scan->state;
    if (pcd == NULL) return;
    prep_pcd_rows_fini(&pcd->rows);
    free(pcd->scratch);
    free(pcd);
}

const prep_scan_format prep_pcd_format = {pcd_open, pcd_read, pcd_rewind, pcd_close};
