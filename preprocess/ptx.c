#include "preprocess/ptx.h"

#include "preprocess/lines.h"
#include "preprocess/number.h"
#include "preprocess/tone.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    LINE_SIZE = 256 * 1024,
    COLUMNS_MAX = 7,    /* x y z intensity r g b */
    SAMPLE_HEAD = 4096, /* lines from the start of the scan */
    SAMPLE_PLACES = 32, /* and some from places spread evenly over the rest */
    SAMPLE_LINES = 128,
    SAMPLE_SIZE = 16 * 1024, /* bytes that hold as many lines */
};

/* No scanner measures that far: points that all lie farther from its origin are in world
 * coordinates already. */
static const double RANGE_MAX = 10000;

typedef struct {
    prep_ptx_scan scan;
    bool has_more;
    int needed;       /* numbers that a point's line must have */
    bool is_singular; /* the matrix would flatten the scan, and is not used */
    double rgb_scale; /* raw to 0..255 */
    prep_tone tone;
    int intensity_plane, rgb_plane, row_plane, column_plane; /* -1: there is none */
    prep_lines lines;                                        /* owned */
    uint64_t row, column;                                    /* of the next line */
    uint64_t taken;                                          /* lines so far */
    bool is_at_end;
} ptx_state;

/* What a sample of the lines says. */
typedef struct {
    double *intensity;      /* [PREP_TONE_SAMPLES], owned */
    size_t count;           /* of points with intensity */
    uint32_t plain, points; /* points without intensity, all points; no-returns do not count */
    double rgb_max, nearest;
} ptx_sample;

static inline bool is_blank(char c)
{
    return (unsigned char)c <= ' ';
}

/* Numbers of a line, at most COLUMNS_MAX; 0 for a blank one, -1 where there is anything but
 * numbers. */
static int parse_line(const char *p, const char *end, double values[COLUMNS_MAX])
{
    for (int n = 0;; n++) {
        while (p < end && is_blank(*p))
            p++;
        if (p == end || n == COLUMNS_MAX) return n;
        p = prep_number_parse(p, end, &values[n]);
        if (p == NULL || (p < end && !is_blank(*p))) return -1;
    }
}

static bool is_no_return(const double *v)
{
    return v[0] == 0 && v[1] == 0 && v[2] == 0;
}

static void add_to_sample(ptx_sample *sample, int columns, const double *v)
{
    if (columns < 3 || is_no_return(v)) return;
    sample->points++;
    sample->nearest = fmin(sample->nearest, sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
    if (columns == 3) {
        sample->plain++;
        return;
    }
    if (sample->count < PREP_TONE_SAMPLES) sample->intensity[sample->count++] = v[3];
    for (int c = 4; c < 7 && columns == 7; c++) {
        if (isfinite(v[c])) sample->rgb_max = fmax(sample->rgb_max, v[c]);
    }
}

/* Lines from `offset` on, the first of which is not whole unless the scan starts there. */
static bool sample_lines(prep_scan *scan, const ptx_state *ptx, uint64_t offset, uint32_t limit,
                         size_t buffer_size, ptx_sample *sample, mospt_err *err)
{
    prep_lines lines;
    const char *text;
    size_t length;
    if (!prep_input_seek(scan->input, offset, err)) return false;
    if (!prep_lines_init(&lines, scan->input, buffer_size, 0, err)) return false;
    bool ok = offset == ptx->scan.offset || prep_lines_next(&lines, &text, &length, err);
    for (uint32_t n = 0; ok && n < limit; n++) {
        if (prep_input_tell(scan->input) - (lines.end - lines.begin) >= ptx->scan.end) break;
        bool is_rest = lines.in_long_line;
        ok = prep_lines_next(&lines, &text, &length, err);
        if (!ok || text == NULL) break;
        double values[COLUMNS_MAX];
        if (!is_rest) add_to_sample(sample, parse_line(text, text + length, values), values);
    }
    prep_lines_fini(&lines);
    return ok;
}

static bool read_sample(prep_scan *scan, const ptx_state *ptx, ptx_sample *sample, mospt_err *err)
{
    const prep_ptx_scan *s = &ptx->scan;
    if (!sample_lines(scan, ptx, s->offset, SAMPLE_HEAD, LINE_SIZE, sample, err)) return false;
    uint64_t size = s->end - s->offset;
    if (prep_input_is_gzip(scan->input) || s->line_count <= SAMPLE_HEAD) return true;
    for (uint64_t k = 1; k < SAMPLE_PLACES; k++) {
        uint64_t offset = s->offset + size / SAMPLE_PLACES * k;
        if (!sample_lines(scan, ptx, offset, SAMPLE_LINES, SAMPLE_SIZE, sample, err)) return false;
    }
    return true;
}

static bool is_identity(const double *m)
{
    for (int i = 0; i < 16; i++) {
        if (m[i] != (i % 5 == 0 ? 1 : 0)) return false;
    }
    return true;
}

static bool is_singular(const double *m)
{
    double det = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
                 m[2] * (m[4] * m[9] - m[5] * m[8]);
    return !(fabs(det) > 1e-12) || !isfinite(det);
}

static void take_pose(prep_scan *scan, ptx_state *ptx, const ptx_sample *sample)
{
    const double *m = ptx->scan.matrix;
    ptx->is_singular = is_singular(m);
    bool is_known = !is_identity(m) || (sample->points > 0 && sample->nearest < RANGE_MAX);
    scan->info.has_pose = is_known && !ptx->is_singular;
    for (int r = 0; r < 3 && scan->info.has_pose; r++) {
        for (int c = 0; c < 4; c++)
            scan->info.pose[4 * r + c] = m[4 * c + r];
    }
    if (scan->info.has_pose) scan->info.pose[15] = 1;
}

/* The largest index that lines reach, which the grid's declared size may exceed by far. */
static mospt_type index_type(uint64_t last)
{
    return last <= UINT16_MAX ? MOSPT_U16 : MOSPT_U32;
}

static void make_planes(prep_scan *scan, ptx_state *ptx, const ptx_sample *sample)
{
    uint64_t rows = ptx->scan.rows > 0 ? ptx->scan.rows : 1,
             last = ptx->scan.line_count > 0 ? ptx->scan.line_count - 1 : 0;
    ptx->needed = 2 * (uint64_t)sample->plain > sample->points ? 3 : 4;
    ptx->intensity_plane = ptx->rgb_plane = -1;
    if (ptx->needed == 4)
        ptx->intensity_plane = prep_scan_add_attribute(scan, "intensity", MOSPT_F32, 1);
    if (sample->rgb_max > 255) ptx->rgb_plane = prep_scan_add_attribute(scan, "rgb", MOSPT_U16, 3);
    ptx->row_plane =
        prep_scan_add_attribute(scan, "row_index", index_type(last < rows ? last : rows - 1), 1);
    ptx->column_plane = prep_scan_add_attribute(scan, "column_index", index_type(last / rows), 1);
    ptx->rgb_scale = sample->rgb_max > 255 ? 255.0 / 65535 : 1;
    scan->info.has_rgb = sample->rgb_max > 0;
    scan->info.has_intensity = !ptx->tone.is_flat;
}

static bool understand(prep_scan *scan, ptx_state *ptx, mospt_err *err)
{
    ptx_sample sample = {.nearest = (double)INFINITY};
    sample.intensity = malloc(PREP_TONE_SAMPLES * sizeof *sample.intensity);
    if (sample.intensity == NULL)
        return mospt_err_nomem(err, PREP_TONE_SAMPLES * sizeof *sample.intensity);
    bool ok = read_sample(scan, ptx, &sample, err);
    ptx->tone = prep_tone_make(sample.intensity, sample.count);
    free(sample.intensity);
    if (!ok) return false;
    take_pose(scan, ptx, &sample);
    make_planes(scan, ptx, &sample);
    return true;
}

static bool ptx_open(prep_scan *scan, uint32_t index, const prep_scan_options *options,
                     mospt_err *err)
{
    prep_scan_info *info = &scan->info;
    ptx_state *ptx = calloc(1, sizeof *ptx);
    if (ptx == NULL) return mospt_err_nomem(err, sizeof *ptx);
    scan->state = ptx;
    if (!prep_ptx_find(scan->input, options->memory, index, &ptx->scan, &info->scan_count,
                       &ptx->has_more, err))
        return false;
    if (index >= info->scan_count) return true; /* scan.c says so */
    if (info->scan_count > 1) snprintf(info->name, sizeof info->name, "scan %u", index + 1);
    snprintf(info->format, sizeof info->format, "PTX, %" PRIu64 " x %" PRIu64, ptx->scan.columns,
             ptx->scan.rows);
    info->point_count = ptx->scan.line_count;
    info->is_text = true;
    return understand(scan, ptx, err);
}

static void write_index(prep_batch *batch, int plane, size_t i, uint64_t value)
{
    if (batch->plane_size[plane] == 2)
        memcpy(batch->plane[plane] + 2 * i, &(uint16_t){(uint16_t)value}, 2);
    else memcpy(batch->plane[plane] + 4 * i, &(uint32_t){(uint32_t)value}, 4);
}

static void show(const ptx_state *ptx, int columns, const double *v, uint8_t *rgbi)
{
    memset(rgbi, 255, 4);
    if (columns >= 4 && !ptx->tone.is_flat) memset(rgbi, prep_tone_apply(&ptx->tone, v[3]), 4);
    prep_scale scale = {.scale = ptx->rgb_scale};
    for (int c = 0; c < 3 && columns == 7; c++)
        rgbi[c] = prep_scale_apply(&scale, v[4 + c]);
}

static void store(const prep_scan *scan, const ptx_state *ptx, int columns, const double *v,
                  prep_batch *batch)
{
    const double *m = ptx->scan.matrix;
    size_t i = batch->count++;
    double *xyz = batch->xyz + 3 * i;
    if (ptx->is_singular) memcpy(xyz, v, 3 * sizeof *xyz);
    else
        for (int a = 0; a < 3; a++)
            xyz[a] = v[0] * m[a] + v[1] * m[4 + a] + v[2] * m[8 + a] + m[12 + a];
    show(ptx, scan->info.has_rgb ? columns : columns == 7 ? 4 : columns, v, batch->rgbi + 4 * i);
    if (ptx->intensity_plane >= 0)
        mospt_type_write(MOSPT_F32, v[3], batch->plane[ptx->intensity_plane] + 4 * i);
    for (int c = 0; c < 3 && ptx->rgb_plane >= 0; c++)
        mospt_type_write(MOSPT_U16, columns == 7 ? v[4 + c] : 0,
                         batch->plane[ptx->rgb_plane] + 6 * i + 2 * c);
    write_index(batch, ptx->row_plane, i, ptx->row);
    write_index(batch, ptx->column_plane, i, ptx->column);
}

static void take_line(prep_scan *scan, ptx_state *ptx, const char *text, const char *end,
                      prep_batch *batch)
{
    double values[COLUMNS_MAX];
    int columns = parse_line(text, end, values);
    if (columns == 0) return;
    if (columns < ptx->needed) {
        mospt_where here = mospt_at_line(scan->path, ptx->lines.number);
        scan->dropped[PREP_DROP_UNREADABLE]++;
        if (columns < 0)
            prep_scan_set_damage(scan, here, "not a point: something else than numbers");
        prep_scan_set_damage(scan, here, "not a point: %d number%s, %d are needed", columns,
                             columns == 1 ? "" : "s", ptx->needed);
    } else if (is_no_return(values)) {
        scan->dropped[PREP_DROP_NO_RETURN]++;
    } else {
        store(scan, ptx, columns, values, batch);
    }
    ptx->taken++;
    ptx->row++;
    if (ptx->row < ptx->scan.rows) return;
    ptx->row = 0;
    ptx->column++;
}

static bool is_declared(const prep_ptx_scan *s, uint64_t count)
{
    if (s->columns == 0 || s->rows == 0) return count == 0;
    return s->columns <= count && s->columns * s->rows == count && count / s->rows == s->columns;
}

static void finish(prep_scan *scan, ptx_state *ptx)
{
    const prep_ptx_scan *s = &ptx->scan;
    const char *fault = prep_input_fault(scan->input);
    mospt_where here = mospt_at_line(scan->path, ptx->lines.number);
    ptx->is_at_end = true;
    scan->dropped[PREP_DROP_UNREADABLE] += s->lost_count;
    if (fault != NULL) prep_scan_set_damage(scan, here, "%s", fault);
    if (s->lost_line > 0)
        prep_scan_set_damage(scan, mospt_at_line(scan->path, s->lost_line),
                             "the header of a scan is damaged: %" PRIu64 " lines are left out",
                             s->lost_count);
    if (!is_declared(s, ptx->taken))
        prep_scan_set_damage(scan, here,
                             "the scan's header claims %" PRIu64 " x %" PRIu64 " points, %" PRIu64
                             " lines are there",
                             s->columns, s->rows, ptx->taken);
    if (ptx->is_singular)
        prep_scan_set_damage(
            scan, mospt_at_line(scan->path, s->line),
            "the scan's matrix is singular; its points are left in the scanner's coordinates");
    if (ptx->has_more)
        prep_scan_set_damage(scan, here, "more than %d scans; those behind are left out",
                             PREP_PTX_SCANS_MAX);
}

static bool start_lines(prep_scan *scan, ptx_state *ptx, mospt_err *err)
{
    return prep_input_seek(scan->input, ptx->scan.offset, err) &&
           prep_lines_init(&ptx->lines, scan->input, LINE_SIZE, ptx->scan.line, err);
}

static bool ptx_read(prep_scan *scan, prep_batch *batch, mospt_err *err)
{
    ptx_state *ptx = scan->state;
    prep_lines *lines = &ptx->lines;
    if (ptx->is_at_end) return true;
    if (lines->buffer == NULL && !start_lines(scan, ptx, err)) return false;
    while (batch->count < batch->capacity) {
        const char *text = NULL;
        size_t length;
        bool is_rest = lines->in_long_line;
        bool is_inside = prep_input_tell(scan->input) - (lines->end - lines->begin) < ptx->scan.end;
        if (is_inside && !prep_lines_next(lines, &text, &length, err)) return false;
        if (text == NULL) {
            finish(scan, ptx);
            break;
        }
        if (!is_rest) take_line(scan, ptx, text, text + length, batch);
    }
    return true;
}

static bool ptx_rewind(prep_scan *scan, mospt_err *err)
{
    (void)err;
    ptx_state *ptx = scan->state;
    prep_lines_fini(&ptx->lines);
    ptx->row = ptx->column = ptx->taken = 0;
    ptx->is_at_end = false;
    return true;
}

static void ptx_close(prep_scan *scan)
{
    ptx_state *ptx = scan->state;
    if (ptx == NULL) return;
    prep_lines_fini(&ptx->lines);
    free(ptx);
}

const prep_scan_format prep_ptx_format = {ptx_open, ptx_read, ptx_rewind, ptx_close};
