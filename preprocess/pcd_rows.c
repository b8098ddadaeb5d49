#include "preprocess/bytes.h"
#include "preprocess/number.h"
#include "preprocess/pcd.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum {
    ROWS_SIZE = 256 * 1024,
    LINE_SIZE = 128 * 1024,
    PLANE_SIZE = 32 * 1024, /* bytes of one field in a block */
    PLANE_ROWS = 8192,
    WALK_SIZE = 128 * 1024,
};

static bool is_compressed(const prep_pcd_rows *rows)
{
    return rows->header->encoding == PREP_PCD_COMPRESSED;
}

static uint64_t plane_start(const prep_pcd_rows *rows, uint32_t field)
{
    return rows->header->field[field].offset * rows->points;
}

/* Bytes of the data area that are in the file. */
static uint64_t data_size(const prep_scan *scan, uint64_t offset)
{
    uint64_t size = prep_input_size(scan->input);
    return size > offset ? size - offset : 0;
}

/* A file of which less than a thousandth is there was not cut: its count is wrong, and reading on
 * would make points of whatever follows them. */
static bool check_count(const prep_scan *scan, const prep_pcd_rows *rows, mospt_err *err)
{
    uint64_t packing = prep_input_is_gzip(scan->input) ? 1000 : 1; /* deflate packs no better */
    if (rows->points / 1000 / packing <= prep_input_size(scan->input)) return true;
    return mospt_err_set(
        err, MOSPT_EFORMAT, mospt_at_file(scan->path),
        "the header claims %" PRIu64 " points, far more than the file has room for", rows->points);
}

static void count_plain(const prep_scan *scan, prep_pcd_rows *rows)
{
    const prep_pcd_header *h = rows->header;
    uint64_t least = 0, left = data_size(scan, h->size);
    for (uint32_t i = 0; i < h->field_count; i++)
        least += rows->is_used[i] ? 2 * h->field[i].count : 0;
    /* the last line needs no end */
    uint64_t room = h->encoding == PREP_PCD_ASCII ? (left + 1) / least : left / h->record_size;
    rows->present = prep_input_is_gzip(scan->input) || room > rows->points ? rows->points : room;
}

/* One walk over the compressed data, in which the decoder is saved where it will be needed. */
typedef struct {
    uint64_t position;
    prep_pcd_lzf_mark *mark;
} stop;

static int compare_stops(const void *a, const void *b)
{
    uint64_t x = ((const stop *)a)->position, y = ((const stop *)b)->position;
    return (x > y) - (x < y);
}

static size_t list_stops(const prep_pcd_rows *rows, stop *out)
{
    size_t count = 0;
    for (uint32_t i = 0; i < rows->header->field_count; i++) {
        uint64_t size = prep_pcd_field_size(&rows->header->field[i]), start = plane_start(rows, i);
        if (rows->is_used[i]) out[count++] = (stop){start, &rows->start[i]};
        for (uint32_t k = 0; k < PREP_PCD_SAMPLE_PLACES && rows->is_sampled[i]; k++)
            out[count++] = (stop){start + rows->points / PREP_PCD_SAMPLE_PLACES * k * size,
                                  &rows->place[i * PREP_PCD_SAMPLE_PLACES + k]};
    }
    qsort(out, count, sizeof *out, compare_stops);
    return count;
}

static bool walk_stops(prep_pcd_rows *rows, prep_pcd_lzf *z, uint64_t size, mospt_err *err)
{
    stop *stops =
        malloc((size_t)rows->header->field_count * (PREP_PCD_SAMPLE_PLACES + 1) * sizeof *stops);
    if (stops == NULL) return mospt_err_nomem(err, rows->header->field_count * sizeof *stops);
    size_t count = list_stops(rows, stops);
    bool ok = true;
    for (size_t i = 0; ok && i < count; i++) {
        /* the code that is under way at the position may begin this far before it */
        uint64_t before =
            stops[i].position > PREP_PCD_LZF_STEP ? stops[i].position - PREP_PCD_LZF_STEP : 0;
        ok = prep_pcd_lzf_advance(z, before, err);
        if (ok) prep_pcd_lzf_save(z, stops[i].mark);
    }
    free(stops);
    return ok && prep_pcd_lzf_advance(z, size, err);
}

static bool alloc_marks(prep_pcd_rows *rows, mospt_err *err)
{
    size_t fields = rows->header->field_count, places = 0;
    for (size_t i = 0; i < fields; i++)
        places = rows->is_sampled[i] ? (i + 1) * PREP_PCD_SAMPLE_PLACES : places;
    if (rows->start == NULL) rows->start = malloc(fields * sizeof *rows->start);
    if (rows->place == NULL) rows->place = malloc((places + 1) * sizeof *rows->place);
    return (rows->start != NULL && rows->place != NULL) ||
           mospt_err_nomem(err, (fields + places + 1) * sizeof *rows->start);
}

/* Unpacks everything once.
 * made     out, bytes that came out
 * is_whole out, exactly the points came out, and nothing is left over */
static bool walk_data(prep_scan *scan, prep_pcd_rows *rows, uint64_t *made, bool *is_whole,
                      mospt_err *err)
{
    uint64_t size = rows->points * rows->header->record_size;
    prep_pcd_lzf z;
    if (!prep_pcd_lzf_init(&z, scan->input, rows->packed_offset, rows->packed_size, WALK_SIZE, err))
        return false;
    bool ok = walk_stops(rows, &z, size, err);
    *made = z.made;
    *is_whole = z.made == size && !z.is_broken && z.taken == rows->packed_size;
    prep_pcd_lzf_fini(&z);
    return ok;
}

/* Points of which x, y and z are among the first `made` bytes. */
static uint64_t count_whole(const prep_pcd_rows *rows, uint64_t made)
{
    uint64_t least = rows->points;
    for (int a = 0; a < 3; a++) {
        uint32_t field = (uint32_t)rows->xyz[a];
        uint64_t start = plane_start(rows, field),
                 size = prep_pcd_field_size(&rows->header->field[field]);
        uint64_t count = made > start ? (made - start) / size : 0;
        if (count < least) least = count;
    }
    return least;
}

/* What a compressed file says of its size, in three places, and what is there. */
static bool judge_compressed(prep_scan *scan, prep_pcd_rows *rows, uint64_t packed,
                             uint64_t unpacked, mospt_err *err)
{
    const prep_pcd_header *h = rows->header;
    mospt_where at = mospt_at_byte(scan->path, h->size);
    uint64_t made, record = h->record_size;
    bool is_whole, is_cut = packed > rows->packed_size,
                   agrees = unpacked % record == 0 && unpacked / record == rows->points;
    if (rows->points > UINT32_MAX / record) {
        if (unpacked % record != 0)
            return mospt_err_set(err, MOSPT_EFORMAT, at,
                                 "compressed data of more than 4 GiB are claimed");
        rows->points = unpacked / record;
    }
    if (!walk_data(scan, rows, &made, &is_whole, err)) return false;
    if (!is_whole && !agrees && unpacked % record == 0 && unpacked / record != rows->points) {
        uint64_t points = rows->points;
        rows->points = unpacked / record;
        if (!walk_data(scan, rows, &made, &is_whole, err)) return false;
        if (!is_whole) {
            rows->points = points;
            if (!walk_data(scan, rows, &made, &is_whole, err)) return false;
        }
    }
    bool is_full = made == rows->points * record;
    rows->present = is_full ? rows->points : count_whole(rows, made);
    if (!is_whole && !is_cut)
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "the compressed data are damaged: they unpack to %s%" PRIu64
                             " bytes, %" PRIu64 " are expected",
                             is_full ? "more than " : "", made, rows->points * record);
    if (rows->present == 0)
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "the file ends before the first point is complete");
    return true;
}

static void tell_sizes(prep_scan *scan, const prep_pcd_rows *rows, uint64_t packed,
                       uint64_t unpacked)
{
    const prep_pcd_header *h = rows->header;
    mospt_where at = mospt_at_byte(scan->path, h->size);
    if (rows->points != h->points || rows->present < rows->points)
        prep_scan_set_damage(scan, at,
                             "the header claims %" PRIu64 " points, %" PRIu64 " are there",
                             h->points, rows->present);
    if (packed > rows->packed_size)
        prep_scan_set_damage(
            scan, at, "%" PRIu64 " bytes of compressed data are claimed, %" PRIu64 " are there",
            packed, rows->packed_size);
    if (unpacked != rows->points * h->record_size)
        prep_scan_set_damage(scan, at,
                             "the compressed data claim to unpack to %" PRIu64
                             " bytes, but it is %" PRIu64,
                             unpacked, rows->points * h->record_size);
}

static bool locate_compressed(prep_scan *scan, prep_pcd_rows *rows, mospt_err *err)
{
    uint8_t sizes[8];
    size_t got;
    uint64_t offset = rows->header->size;
    if (prep_input_is_gzip(scan->input))
        return mospt_err_set(
            err, MOSPT_EFORMAT, mospt_at_file(scan->path),
            "compressed PCD data inside gzip are not read; unpack the file with gunzip first");
    if (!prep_input_read_at(scan->input, offset, sizes, sizeof sizes, &got, err)) return false;
    if (got < sizeof sizes)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, offset),
                             "the file ends before its points");
    uint64_t packed = prep_le32(sizes), unpacked = prep_le32(sizes + 4);
    rows->packed_offset = offset + sizeof sizes;
    uint64_t room = data_size(scan, rows->packed_offset);
    rows->packed_size = packed < room ? packed : room;
    if (!alloc_marks(rows, err) || !judge_compressed(scan, rows, packed, unpacked, err))
        return false;
    tell_sizes(scan, rows, packed, unpacked);
    return true;
}

static uint32_t widest_used(const prep_pcd_rows *rows)
{
    uint32_t widest = 1;
    for (uint32_t i = 0; i < rows->header->field_count; i++) {
        uint32_t size = prep_pcd_field_size(&rows->header->field[i]);
        if (rows->is_used[i] && size > widest) widest = size;
    }
    return widest;
}

bool prep_pcd_rows_locate(prep_scan *scan, prep_pcd_rows *rows, mospt_err *err)
{
    uint32_t size = rows->header->record_size;
    rows->points = rows->header->points;
    rows->capacity = size < ROWS_SIZE ? ROWS_SIZE / size : 1;
    if (is_compressed(rows)) {
        rows->capacity = PLANE_SIZE / widest_used(rows) < PLANE_ROWS
                             ? PLANE_SIZE / widest_used(rows)
                             : PLANE_ROWS;
        return locate_compressed(scan, rows, err);
    }
    if (!check_count(scan, rows, err)) return false;
    count_plain(scan, rows);
    return true;
}

void prep_pcd_rows_rewind(prep_pcd_rows *rows)
{
    prep_pcd_rows_release(rows);
    rows->next = 0;
    rows->count = 0;
    rows->is_at_end = false;
}

static bool alloc_planes(prep_scan *scan, prep_pcd_rows *rows, const bool *wanted, mospt_err *err)
{
    const prep_pcd_header *h = rows->header;
    rows->plane = calloc(h->field_count, sizeof *rows->plane);
    if (rows->plane == NULL) return mospt_err_nomem(err, h->field_count * sizeof *rows->plane);
    for (uint32_t i = 0; i < h->field_count; i++) {
        size_t piece = (size_t)rows->capacity * prep_pcd_field_size(&h->field[i]);
        if (wanted[i] &&
            !prep_pcd_lzf_init(&rows->plane[i], scan->input, rows->packed_offset, rows->packed_size,
                               piece > PREP_PCD_LZF_STEP ? piece : PREP_PCD_LZF_STEP, err))
            return false;
    }
    return true;
}

static bool go_to_mark(prep_pcd_lzf *z, const prep_pcd_lzf_mark *mark, uint64_t position,
                       mospt_err *err)
{
    prep_pcd_lzf_restore(z, mark);
    uint64_t skip = position - z->made;
    if (skip > PREP_PCD_LZF_STEP) { /* the data end before it: there is nothing to read here */
        z->is_finished = true;
        return true;
    }
    if (!prep_pcd_lzf_need(z, (size_t)skip, err)) return false;
    prep_pcd_lzf_take(z, (size_t)skip);
    return true;
}

static bool start_reading(prep_scan *scan, prep_pcd_rows *rows, mospt_err *err)
{
    const prep_pcd_header *h = rows->header;
    if (is_compressed(rows)) {
        if (!alloc_planes(scan, rows, rows->is_used, err)) return false;
        for (uint32_t i = 0; i < h->field_count; i++) {
            if (rows->is_used[i] &&
                !go_to_mark(&rows->plane[i], &rows->start[i], plane_start(rows, i), err))
                return false;
        }
        return true;
    }
    rows->rows = malloc((size_t)rows->capacity * h->record_size);
    if (rows->rows == NULL) return mospt_err_nomem(err, (size_t)rows->capacity * h->record_size);
    if (!prep_input_seek(scan->input, h->size, err)) return false;
    return h->encoding != PREP_PCD_ASCII ||
           prep_lines_init(&rows->lines, scan->input, LINE_SIZE, h->line_count, err);
}

/* Takes the block at hand from the planes and unpacks the next one. */
static bool read_planes(prep_pcd_rows *rows, const bool *wanted, uint32_t want, mospt_err *err)
{
    uint64_t left = rows->present - rows->next;
    uint32_t count = want < left ? want : (uint32_t)left;
    for (uint32_t i = 0; i < rows->header->field_count; i++) {
        size_t size = prep_pcd_field_size(&rows->header->field[i]);
        if (!wanted[i]) continue;
        prep_pcd_lzf_take(&rows->plane[i], rows->count * size);
        if (!prep_pcd_lzf_need(&rows->plane[i], count * size, err)) return false;
    }
    rows->count = count;
    rows->next += count;
    return true;
}

static bool read_records(prep_scan *scan, prep_pcd_rows *rows, uint32_t want, mospt_err *err)
{
    size_t size = rows->header->record_size, got;
    uint64_t left = rows->points - rows->next;
    if (want > left) want = (uint32_t)left;
    if (!prep_input_read(scan->input, rows->rows, want * size, &got, err)) return false;
    rows->count = (uint32_t)(got / size);
    rows->next += rows->count;
    rows->is_at_end = got < want * size;
    return true;
}

static inline bool is_separator(char c)
{
    return c == ' ' || c == '\t' || c == ',' || c == '\r';
}

/* Integers of 64 bits, which a double does not hold: times in nanoseconds. */
static const char *parse_integer(const char *p, const char *end, mospt_type type, uint8_t *out)
{
    bool is_negative = p < end && *p == '-';
    uint64_t value = 0, limit = type == MOSPT_U64 ? UINT64_MAX : (uint64_t)INT64_MAX;
    p += p < end && (*p == '-' || *p == '+');
    const char *start = p;
    for (; p < end && (unsigned char)(*p - '0') < 10; p++) {
        uint64_t digit = (uint64_t)(*p - '0');
        value = value > (limit - digit) / 10 ? limit : value * 10 + digit;
    }
    if (p == start || (p < end && !is_separator(*p))) return NULL;
    if (is_negative) value = type == MOSPT_U64 ? 0 : 0 - value;
    memcpy(out, &value, sizeof value);
    return p;
}

static const char *parse_value(const char *p, const char *end, mospt_type type, uint8_t *out)
{
    double value;
    if (type == MOSPT_U64 || type == MOSPT_I64) {
        const char *after = parse_integer(p, end, type, out);
        if (after != NULL) return after;
    }
    p = prep_number_parse(p, end, &value);
    if (p == NULL || (p < end && !is_separator(*p))) return NULL;
    if (type == MOSPT_F32) memcpy(out, &(float){(float)value}, 4);
    else mospt_type_write(type, value, out);
    return p;
}

/* The values of one line, of which those behind the last field in use may be missing; -1 for one
 * that is no point, 0 for a blank one. */
static int parse_row(const prep_pcd_rows *rows, const char *p, const char *end, uint8_t *row)
{
    const prep_pcd_header *h = rows->header;
    uint32_t last = h->field_count;
    while (last > 0 && !rows->is_used[last - 1])
        last--;
    memset(row, 0, h->record_size);
    while (p < end && is_separator(*p))
        p++;
    if (p == end || *p == '#') return 0;
    for (uint32_t i = 0; i < last; i++) {
        const prep_pcd_field *f = &h->field[i];
        size_t size = mospt_type_size(f->type);
        for (uint32_t c = 0; c < f->count; c++) {
            p = parse_value(p, end, f->type, row + f->offset + c * size);
            if (p == NULL) return -1;
            while (p < end && is_separator(*p))
                p++;
        }
    }
    return 1;
}

static bool read_lines(prep_scan *scan, prep_pcd_rows *rows, uint32_t want, mospt_err *err)
{
    rows->count = 0;
    while (rows->count < want && !rows->is_at_end) {
        const char *text;
        size_t length;
        bool is_rest = rows->lines.in_long_line;
        if (!prep_lines_next(&rows->lines, &text, &length, err)) return false;
        rows->is_at_end = text == NULL;
        if (text == NULL || is_rest) continue;
        uint8_t *row = rows->rows + (size_t)rows->count * rows->header->record_size;
        int status = parse_row(rows, text, text + length, row);
        if (status == 0) continue;
        rows->next++;
        if (status > 0) {
            rows->count++;
            continue;
        }
        scan->dropped[PREP_DROP_UNREADABLE]++;
        prep_scan_set_damage(scan, mospt_at_line(scan->path, rows->lines.number),
                             "not the numbers of a point");
    }
    return true;
}

static void swap_rows(prep_pcd_rows *rows)
{
    for (uint32_t i = 0; i < rows->header->field_count; i++) {
        if (!rows->is_used[i] || (is_compressed(rows) && rows->plane[i].out == NULL)) continue;
        for (uint32_t c = 0; c < rows->header->field[i].count; c++) {
            prep_column column = prep_pcd_rows_column(rows, (int)i, c);
            prep_column_swap(&column, rows->count);
        }
    }
}

static void tell_end(prep_scan *scan, const prep_pcd_rows *rows)
{
    bool is_ascii = rows->header->encoding == PREP_PCD_ASCII;
    mospt_where at = is_ascii ? mospt_at_line(scan->path, rows->lines.number)
                              : mospt_at_byte(scan->path, prep_input_tell(scan->input));
    const char *fault = prep_input_fault(scan->input);
    if (fault != NULL) prep_scan_set_damage(scan, at, "%s", fault);
    if (rows->next != rows->points)
        prep_scan_set_damage(scan, at,
                             "the header claims %" PRIu64 " points, %" PRIu64 " are there",
                             rows->points, rows->next);
}

static bool read_block(prep_scan *scan, prep_pcd_rows *rows, const bool *wanted, uint32_t want,
                       mospt_err *err)
{
    if (want > rows->capacity) want = rows->capacity;
    if (is_compressed(rows)) return read_planes(rows, wanted, want, err);
    return rows->header->encoding == PREP_PCD_ASCII ? read_lines(scan, rows, want, err)
                                                    : read_records(scan, rows, want, err);
}

static bool finish_block(prep_scan *scan, prep_pcd_rows *rows, uint32_t *count)
{
    bool is_binary = rows->header->encoding != PREP_PCD_ASCII;
    if (is_binary && prep_host_is_big_endian())
        swap_rows(rows); /* PCL writes what its machine has, which is little */
    if (rows->is_at_end) tell_end(scan, rows);
    *count = rows->count;
    return true;
}

bool prep_pcd_rows_read(prep_scan *scan, prep_pcd_rows *rows, uint32_t want, uint32_t *count,
                        mospt_err *err)
{
    *count = 0;
    if (rows->is_at_end) return true;
    bool is_started = is_compressed(rows) ? rows->plane != NULL : rows->rows != NULL;
    if (!is_started && !start_reading(scan, rows, err)) return false;
    return read_block(scan, rows, rows->is_used, want, err) && finish_block(scan, rows, count);
}

static bool sample_planes(prep_scan *scan, prep_pcd_rows *rows, uint32_t place, uint32_t want,
                          mospt_err *err)
{
    const prep_pcd_header *h = rows->header;
    if (rows->plane == NULL && !alloc_planes(scan, rows, rows->is_sampled, err)) return false;
    rows->count = 0;
    rows->next = rows->points / PREP_PCD_SAMPLE_PLACES * place;
    if (rows->next > rows->present) rows->next = rows->present;
    for (uint32_t i = 0; i < h->field_count; i++) {
        uint64_t at = plane_start(rows, i) + rows->points / PREP_PCD_SAMPLE_PLACES * place *
                                                 prep_pcd_field_size(&h->field[i]);
        if (rows->is_sampled[i] &&
            !go_to_mark(&rows->plane[i], &rows->place[i * PREP_PCD_SAMPLE_PLACES + place], at, err))
            return false;
    }
    return read_block(scan, rows, rows->is_sampled, want, err);
}

bool prep_pcd_rows_sample(prep_scan *scan, prep_pcd_rows *rows, uint32_t place, uint32_t want,
                          uint32_t *count, mospt_err *err)
{
    *count = 0;
    if (is_compressed(rows)) {
        if (!sample_planes(scan, rows, place, want, err)) return false;
        return finish_block(scan, rows, count);
    }
    bool can_jump = rows->header->encoding == PREP_PCD_BINARY && !prep_input_is_gzip(scan->input);
    if (rows->is_at_end || (rows->rows == NULL && !start_reading(scan, rows, err)))
        return rows->is_at_end;
    if (can_jump && rows->present > (uint64_t)want * PREP_PCD_SAMPLE_PLACES) {
        rows->next = rows->present / PREP_PCD_SAMPLE_PLACES * place;
        if (!prep_input_seek(scan->input,
                             rows->header->size + rows->next * rows->header->record_size, err))
            return false;
    }
    return read_block(scan, rows, rows->is_sampled, want, err) && finish_block(scan, rows, count);
}

prep_column prep_pcd_rows_column(const prep_pcd_rows *rows, int field, uint32_t component)
{
    const prep_pcd_field *f = &rows->header->field[field];
    size_t at = component * mospt_type_size(f->type);
    if (is_compressed(rows))
        return (prep_column){rows->plane[field].out + rows->plane[field].begin + at,
                             prep_pcd_field_size(f), f->type};
    return (prep_column){rows->rows + f->offset + at, rows->header->record_size, f->type};
}

void prep_pcd_rows_release(prep_pcd_rows *rows)
{
    for (uint32_t i = 0; rows->plane != NULL && i < rows->header->field_count; i++)
        prep_pcd_lzf_fini(&rows->plane[i]);
    free(rows->plane);
    free(rows->place);
    free(rows->rows);
    prep_lines_fini(&rows->lines);
    rows->plane = NULL;
    rows->place = NULL;
    rows->rows = NULL;
}

void prep_pcd_rows_fini(prep_pcd_rows *rows)
{
    if (rows->header == NULL) return;
    prep_pcd_rows_release(rows);
    free(rows->start);
    rows->start = NULL;
}
