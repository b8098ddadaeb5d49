#include "preprocess/ply.h"

#include "preprocess/column.h"
#include "preprocess/tone.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { SAMPLE_BLOCKS = 64, SAMPLE_ROWS = 256 };

/* Which scalar properties make up one plane of a batch. */
typedef struct {
    mospt_type type;
    uint32_t components;
    uint32_t at[3]; /* byte in the row */
} plane_source;

typedef struct {
    prep_ply_header header;
    prep_ply_rows rows;
    uint32_t at[PREP_PLY_PROPERTIES_MAX];     /* byte in the row, per property of the vertex */
    int xyz[3], rgb[3], normal[3], intensity; /* property index; -1: there is none */
    double rgb_scale;                         /* raw to 0..255 */
    prep_tone tone;
    plane_source plane[MOSPT_ATTRIBUTES_MAX];
    double *scratch; /* [rows.capacity], owned */
} ply_state;

static bool find_three(const ply_state *ply, const prep_ply_element *e, const char *const names[3],
                       int out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = prep_ply_find(&ply->header, e, names[c]);
    if (out[0] >= 0 && out[1] >= 0 && out[2] >= 0) return true;
    out[0] = out[1] = out[2] = -1;
    return false;
}

static bool find_vertex(prep_scan *scan, ply_state *ply, mospt_err *err)
{
    static const char *const xyz[3] = {"x", "y", "z"};
    const prep_ply_header *h = &ply->header;
    for (int round = 0; round < 2; round++) {
        for (uint32_t i = 0; i < h->element_count; i++) {
            const prep_ply_element *e = &h->element[i];
            bool fits = round == 0 ? strcasecmp(e->name, "vertex") == 0
                                   : strcasestr(e->name, "vertex") != NULL ||
                                         strcasestr(e->name, "point") != NULL;
            if (!fits || !find_three(ply, e, xyz, ply->xyz)) continue;
            ply->rows.header = h;
            ply->rows.vertex = e;
            return true;
        }
    }
    return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(scan->path, h->line_count),
                         "the PLY header has no vertices with x, y and z");
}

static mospt_type type_of(const ply_state *ply, int property)
{
    return ply->header.property[property].type;
}

static bool all_of_type(const ply_state *ply, const int property[3], mospt_type type)
{
    return property[0] >= 0 && type_of(ply, property[0]) == type &&
           type_of(ply, property[1]) == type && type_of(ply, property[2]) == type;
}

static void find_meanings(ply_state *ply)
{
    static const char *const rgb[][3] = {{"red", "green", "blue"},
                                         {"r", "g", "b"},
                                         {"diffuse_red", "diffuse_green", "diffuse_blue"}};
    static const char *const normal[3] = {"nx", "ny", "nz"};
    static const char *const intensity[] = {"intensity", "scalar_intensity"};
    const prep_ply_element *e = ply->rows.vertex;
    for (size_t i = 0; i < sizeof rgb / sizeof rgb[0]; i++) {
        if (find_three(ply, e, rgb[i], ply->rgb)) break;
    }
    if (find_three(ply, e, normal, ply->normal) && !all_of_type(ply, ply->normal, MOSPT_F32))
        ply->normal[0] = -1;
    ply->intensity = -1;
    for (size_t i = 0; i < 2 && ply->intensity < 0; i++)
        ply->intensity = prep_ply_find(&ply->header, e, intensity[i]);
}

static prep_column column_of(const ply_state *ply, int property)
{
    const prep_ply_element *e = ply->rows.vertex;
    return (prep_column){ply->rows.rows + ply->at[(uint32_t)property - e->first], e->row_size,
                         type_of(ply, property)};
}

static void add_plane(prep_scan *scan, ply_state *ply, const char *name, const int *property,
                      uint32_t components)
{
    int k = prep_scan_add_attribute(scan, name, type_of(ply, property[0]), components);
    if (k < 0) {
        prep_scan_set_damage(scan, mospt_at_line(scan->path, ply->header.line_count),
                             "more than %d attributes; `%s` and those after it are left out",
                             MOSPT_ATTRIBUTES_MAX, name);
        return;
    }
    plane_source source = {.type = type_of(ply, property[0]), .components = components};
    for (uint32_t c = 0; c < components; c++)
        source.at[c] = ply->at[(uint32_t)property[c] - ply->rows.vertex->first];
    ply->plane[k] = source;
}

static bool is_one_of(int property, const int set[3])
{
    return set[0] >= 0 && (property == set[0] || property == set[1] || property == set[2]);
}

/* A colour of bytes is in the batch as it is; wider ones keep their raw values beside it. */
static void add_colour(prep_scan *scan, ply_state *ply)
{
    if (all_of_type(ply, ply->rgb, MOSPT_U8)) return;
    if (all_of_type(ply, ply->rgb, MOSPT_U16)) add_plane(scan, ply, "rgb", ply->rgb, 3);
    else if (all_of_type(ply, ply->rgb, MOSPT_F32) || all_of_type(ply, ply->rgb, MOSPT_F64))
        add_plane(scan, ply, "rgb_float", ply->rgb, 3);
    else
        for (int c = 0; c < 3; c++)
            add_plane(scan, ply, ply->header.property[ply->rgb[c]].name, &ply->rgb[c], 1);
}

static void make_planes(prep_scan *scan, ply_state *ply)
{
    const prep_ply_element *e = ply->rows.vertex;
    if (ply->intensity >= 0) add_plane(scan, ply, "intensity", &ply->intensity, 1);
    if (ply->rgb[0] >= 0) add_colour(scan, ply);
    if (ply->normal[0] >= 0) add_plane(scan, ply, "normal", ply->normal, 3);
    for (uint32_t i = 0; i < e->property_count; i++) {
        int property = (int)(e->first + i);
        const prep_ply_property *p = &ply->header.property[property];
        if (p->is_list || property == ply->intensity || is_one_of(property, ply->xyz) ||
            is_one_of(property, ply->rgb) || is_one_of(property, ply->normal))
            continue;
        add_plane(scan, ply, p->name, &property, 1);
    }
}

typedef struct {
    double *intensity; /* [count], owned */
    size_t count;
    double rgb_max;
} ply_sample;

static void add_to_sample(ply_state *ply, uint32_t count, ply_sample *sample)
{
    if (count > PREP_TONE_SAMPLES - sample->count)
        count = (uint32_t)(PREP_TONE_SAMPLES - sample->count);
    for (int c = 0; c < 3 && ply->rgb[0] >= 0; c++) {
        prep_column column = column_of(ply, ply->rgb[c]);
        double *values = sample->intensity + sample->count;
        prep_column_to_f64(&column, count, values, 1);
        for (uint32_t i = 0; i < count; i++) {
            if (isfinite(values[i]) && values[i] > sample->rgb_max) sample->rgb_max = values[i];
        }
    }
    if (ply->intensity >= 0) {
        prep_column column = column_of(ply, ply->intensity);
        prep_column_to_f64(&column, count, sample->intensity + sample->count, 1);
    }
    sample->count += count;
}

static bool read_sample(prep_scan *scan, ply_state *ply, ply_sample *sample, mospt_err *err)
{
    bool can_jump = prep_ply_rows_is_seekable(scan, &ply->rows);
    uint64_t present = ply->rows.present;
    for (uint64_t b = 0; b < SAMPLE_BLOCKS; b++) {
        bool is_spread = can_jump && present > SAMPLE_BLOCKS * SAMPLE_ROWS;
        if (is_spread && !prep_ply_rows_seek(scan, &ply->rows, present / SAMPLE_BLOCKS * b, err))
            return false;
        uint32_t count;
        if (!prep_ply_rows_read(scan, &ply->rows, SAMPLE_ROWS, &count, err)) return false;
        if (count == 0) break;
        add_to_sample(ply, count, sample);
    }
    return true;
}

/* Looks at some vertices to learn how colour and intensity are meant, then goes back to the first.
 */
static bool take_sample(prep_scan *scan, ply_state *ply, mospt_err *err)
{
    ply_sample sample = {.intensity = malloc(PREP_TONE_SAMPLES * sizeof *sample.intensity)};
    if (sample.intensity == NULL)
        return mospt_err_nomem(err, PREP_TONE_SAMPLES * sizeof *sample.intensity);
    bool ok = read_sample(scan, ply, &sample, err);
    bool is_empty = sample.count == 0;
    ply->tone = prep_tone_make(sample.intensity, ply->intensity >= 0 ? sample.count : 0);
    free(sample.intensity);

    /* the sample's faults are found again, and counted, when the points are read */
    memset(scan->dropped, 0, sizeof scan->dropped);
    scan->is_damaged = false;
    if (!ok) return false;
    if (is_empty)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, ply->rows.offset),
                             "not one of %" PRIu64 " vertices can be read",
                             ply->rows.vertex->count);

    bool is_float = ply->rgb[0] >= 0 && (type_of(ply, ply->rgb[0]) == MOSPT_F32 ||
                                         type_of(ply, ply->rgb[0]) == MOSPT_F64);
    ply->rgb_scale = is_float && sample.rgb_max <= 1 ? 255
                     : sample.rgb_max > 255          ? 255.0 / 65535
                                                     : 1;
    scan->info.has_rgb = sample.rgb_max > 0;
    scan->info.has_intensity = !ply->tone.is_flat;
    return prep_ply_rows_seek(scan, &ply->rows, 0, err);
}

static void describe(prep_scan *scan, const ply_state *ply)
{
    static const char *const names[] = {"ascii", "binary little endian", "binary big endian"};
    snprintf(scan->info.format, sizeof scan->info.format, "PLY %s", names[ply->header.encoding]);
    scan->info.point_count = ply->rows.present;
    scan->info.is_text = ply->header.encoding == PREP_PLY_ASCII || prep_input_is_gzip(scan->input);
}

/* Rows behind the vertices, where nothing else has a place. */
static void note_unclaimed(prep_scan *scan, const ply_state *ply)
{
    const prep_ply_header *h = &ply->header;
    const prep_ply_element *e = ply->rows.vertex;
    uint64_t end = ply->rows.offset + e->count * e->row_size, size = prep_input_size(scan->input);
    if (h->encoding == PREP_PLY_ASCII || e->has_lists || prep_input_is_gzip(scan->input) ||
        e != &h->element[h->element_count - 1] || ply->rows.present < e->count || size <= end ||
        (size - end) % e->row_size != 0)
        return;
    prep_scan_set_damage(scan, mospt_at_byte(scan->path, end),
                         "the header claims %" PRIu64
                         " vertices; what follows has room for %" PRIu64
                         " more, which are left out",
                         e->count, (size - end) / e->row_size);
}

static void release(ply_state *ply)
{
    prep_ply_rows_release(&ply->rows);
    free(ply->scratch);
    ply->scratch = NULL;
}

/* A file of which less than a thousandth is there was not cut: its count is wrong, and reading on
 * would make points of whatever follows them. */
static bool check_count(const prep_scan *scan, const prep_ply_element *e, mospt_err *err)
{
    uint64_t packing = prep_input_is_gzip(scan->input) ? 1000 : 1; /* deflate packs no better */
    if (e->count / 1000 / packing <= prep_input_size(scan->input)) return true;
    return mospt_err_set(
        err, MOSPT_EFORMAT, mospt_at_file(scan->path),
        "the header claims %" PRIu64 " vertices, far more than the file has room for", e->count);
}

static bool ply_open(prep_scan *scan, uint32_t index, const prep_scan_options *options,
                     mospt_err *err)
{
    (void)index, (void)options;
    ply_state *ply = calloc(1, sizeof *ply);
    if (ply == NULL) return mospt_err_nomem(err, sizeof *ply);
    scan->state = ply;
    if (!prep_ply_header_read(scan->input, &ply->header, err)) return false;
    if (!find_vertex(scan, ply, err)) return false;
    const prep_ply_element *e = ply->rows.vertex;
    if (e->count == 0)
        return mospt_err_set(err, MOSPT_EEMPTY, mospt_at_file(scan->path),
                             "the PLY file holds no vertices");
    uint32_t at = 0;
    for (uint32_t i = 0; i < e->property_count; i++) {
        const prep_ply_property *p = &ply->header.property[e->first + i];
        ply->at[i] = at;
        if (!p->is_list) at += (uint32_t)mospt_type_size(p->type);
    }
    find_meanings(ply);
    if (!check_count(scan, e, err)) return false;
    if (!prep_ply_rows_locate(scan, &ply->rows, err)) return false;
    describe(scan, ply);
    if (!take_sample(scan, ply, err)) return false;
    note_unclaimed(scan, ply);
    make_planes(scan, ply);
    release(ply);
    ply->rows.may_split = true;
    return true;
}

static void show(const prep_scan *scan, ply_state *ply, uint32_t count, uint8_t *rgbi)
{
    double *values = ply->scratch;
    memset(rgbi, 255, 4 * (size_t)count);
    if (scan->info.has_intensity) {
        prep_column column = column_of(ply, ply->intensity);
        prep_column_to_f64(&column, count, values, 1);
        for (uint32_t i = 0; i < count; i++)
            memset(rgbi + 4 * (size_t)i, prep_tone_apply(&ply->tone, values[i]), 4);
    }
    prep_scale scale = {.scale = ply->rgb_scale};
    for (int c = 0; c < 3 && scan->info.has_rgb; c++) {
        prep_column column = column_of(ply, ply->rgb[c]);
        if (column.type == MOSPT_U8) {
            prep_column_copy(&column, count, rgbi + c, 4);
            continue;
        }
        prep_column_to_f64(&column, count, values, 1);
        for (uint32_t i = 0; i < count; i++)
            rgbi[4 * (size_t)i + (size_t)c] = prep_scale_apply(&scale, values[i]);
    }
}

static void decode(const prep_scan *scan, ply_state *ply, uint32_t count, prep_batch *batch)
{
    size_t first = batch->count;
    for (int a = 0; a < 3; a++) {
        prep_column column = column_of(ply, ply->xyz[a]);
        prep_column_to_f64(&column, count, batch->xyz + 3 * first + a, 3);
    }
    show(scan, ply, count, batch->rgbi + 4 * first);
    for (uint32_t k = 0; k < batch->plane_count; k++) {
        const plane_source *source = &ply->plane[k];
        uint8_t *out = batch->plane[k] + first * batch->plane_size[k];
        for (uint32_t c = 0; c < source->components; c++) {
            prep_column column = {ply->rows.rows + source->at[c], ply->rows.vertex->row_size,
                                  source->type};
            prep_column_copy(&column, count, out + c * mospt_type_size(source->type),
                             batch->plane_size[k]);
        }
    }
    batch->count += count;
}

static bool ply_read(prep_scan *scan, prep_batch *batch, mospt_err *err)
{
    ply_state *ply = scan->state;
    while (batch->count < batch->capacity) {
        uint32_t count;
        if (!prep_ply_rows_read(scan, &ply->rows, batch->capacity - batch->count, &count, err))
            return false;
        if (count == 0) break;
        if (ply->scratch == NULL) ply->scratch = malloc(ply->rows.capacity * sizeof *ply->scratch);
        if (ply->scratch == NULL)
            return mospt_err_nomem(err, ply->rows.capacity * sizeof *ply->scratch);
        decode(scan, ply, count, batch);
    }
    return true;
}

static bool ply_rewind(prep_scan *scan, mospt_err *err)
{
    ply_state *ply = scan->state;
    return prep_ply_rows_seek(scan, &ply->rows, 0, err);
}

static void ply_close(prep_scan *scan)
{
    ply_state *ply = scan->state;
    if (ply == NULL) return;
    release(ply);
    free(ply);
}

const prep_scan_format prep_ply_format = {ply_open, ply_read, ply_rewind, ply_close};
