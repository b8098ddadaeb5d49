#include "preprocess/ply.h"

#include "preprocess/bytes.h"
#include "preprocess/column.h"
#include "preprocess/number.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { ROWS_SIZE = 256 * 1024, BUFFER_SIZE = 128 * 1024, LINE_SIZE = 128 * 1024 };

static void stop_blocks(prep_ply_rows *rows)
{
    prep_ahead_destroy(rows->ahead);
    prep_line_cutter_fini(&rows->cutter);
    rows->ahead = NULL;
    rows->block = NULL;
    rows->last_line = rows->line;
    rows->fault = NULL;
}

static bool is_ascii(const prep_ply_rows *rows)
{
    return rows->header->encoding == PREP_PLY_ASCII;
}

static bool is_swapped(const prep_ply_rows *rows)
{
    return !is_ascii(rows) && (rows->header->encoding == PREP_PLY_BIG) != prep_host_is_big_endian();
}

bool prep_ply_rows_is_seekable(const prep_scan *scan, const prep_ply_rows *rows)
{
    return !is_ascii(rows) && !rows->vertex->has_lists && !prep_input_is_gzip(scan->input);
}

static bool alloc_buffers(prep_ply_rows *rows, mospt_err *err)
{
    uint32_t size = rows->vertex->row_size;
    rows->capacity = size < ROWS_SIZE ? ROWS_SIZE / size : 1;
    if (rows->rows == NULL) rows->rows = malloc((size_t)rows->capacity * size);
    if (rows->buffer == NULL) rows->buffer = malloc(BUFFER_SIZE);
    return (rows->rows != NULL && rows->buffer != NULL) ||
           mospt_err_nomem(err, ROWS_SIZE + BUFFER_SIZE);
}

void prep_ply_rows_release(prep_ply_rows *rows)
{
    stop_blocks(rows);
    free(rows->rows);
    free(rows->buffer);
    prep_lines_fini(&rows->lines);
    rows->rows = rows->buffer = NULL;
    rows->begin = rows->end = 0;
}

/* How far a step into the data came. */
typedef enum { STEP_OK, STEP_END, STEP_ERROR } step; /* END: the data ends, or makes no sense */

/* Makes `size` bytes lie in the buffer. */
static step need(prep_scan *scan, prep_ply_rows *rows, size_t size, mospt_err *err)
{
    if (rows->end - rows->begin >= size) return STEP_OK;
    size_t kept = rows->end - rows->begin, got;
    memmove(rows->buffer, rows->buffer + rows->begin, kept);
    if (!prep_input_read(scan->input, rows->buffer + kept, BUFFER_SIZE - kept, &got, err))
        return STEP_ERROR;
    rows->begin = 0;
    rows->end = kept + got;
    return rows->end >= size ? STEP_OK : STEP_END;
}

static uint64_t tell(const prep_scan *scan, const prep_ply_rows *rows)
{
    return prep_input_tell(scan->input) - (rows->end - rows->begin);
}

static step skip(prep_scan *scan, prep_ply_rows *rows, uint64_t size, mospt_err *err)
{
    if (size <= rows->end - rows->begin) {
        rows->begin += (size_t)size;
        return STEP_OK;
    }
    uint64_t at = tell(scan, rows), file = prep_input_size(scan->input);
    if (size > UINT64_MAX - at) return STEP_END;
    if (!prep_input_is_gzip(scan->input) && at + size > file) return STEP_END;
    rows->begin = rows->end = 0;
    if (!prep_input_seek(scan->input, at + size, err)) return STEP_ERROR;
    return prep_input_tell(scan->input) == at + size ? STEP_OK : STEP_END;
}

static step skip_list(prep_scan *scan, prep_ply_rows *rows, const prep_ply_property *p,
                      mospt_err *err)
{
    size_t size = mospt_type_size(p->count_type);
    step status = need(scan, rows, size, err);
    if (status != STEP_OK) return status;
    uint8_t bytes[8];
    memcpy(bytes, rows->buffer + rows->begin, size);
    rows->begin += size;
    prep_column column = {bytes, size, p->count_type};
    if (is_swapped(rows)) prep_column_swap(&column, 1);
    double count = mospt_type_read(p->count_type, bytes);
    if (!(count >= 0 && count < 1e15)) return STEP_END;
    return skip(scan, rows, (uint64_t)count * mospt_type_size(p->type), err);
}

/* One element of binary data; its scalars go to `row` unless that is NULL. */
static step read_binary(prep_scan *scan, prep_ply_rows *rows, const prep_ply_element *e,
                        uint8_t *row, mospt_err *err)
{
    for (uint32_t i = 0; i < e->property_count; i++) {
        const prep_ply_property *p = &rows->header->property[e->first + i];
        size_t size = mospt_type_size(p->type);
        step status = p->is_list ? skip_list(scan, rows, p, err) : need(scan, rows, size, err);
        if (status != STEP_OK) return status;
        if (p->is_list) continue;
        if (row != NULL) {
            memcpy(row, rows->buffer + rows->begin, size);
            row += size;
        }
        rows->begin += size;
    }
    return STEP_OK;
}

/* The next line that is not blank. */
static bool next_line(prep_ply_rows *rows, const char **text, const char **end, mospt_err *err)
{
    size_t length;
    do {
        if (!prep_lines_next(&rows->lines, text, &length, err)) return false;
        *end = *text + length;
        while (*text < *end && (**text == ' ' || **text == '\t'))
            (*text)++;
    } while (*text != NULL && *text == *end);
    return true;
}

static step skip_ascii(prep_ply_rows *rows, uint64_t count, mospt_err *err)
{
    for (uint64_t i = 0; i < count; i++) {
        const char *text, *end;
        if (!next_line(rows, &text, &end, err)) return STEP_ERROR;
        if (text == NULL) return STEP_END;
    }
    return STEP_OK;
}

static step skip_element(prep_scan *scan, prep_ply_rows *rows, const prep_ply_element *e,
                         mospt_err *err)
{
    if (e->property_count == 0) return STEP_OK;
    if (is_ascii(rows)) return skip_ascii(rows, e->count, err);
    if (!e->has_lists)
        return e->count > UINT64_MAX / e->row_size ? STEP_END
                                                   : skip(scan, rows, e->count * e->row_size, err);
    for (uint64_t i = 0; i < e->count; i++) {
        step status = read_binary(scan, rows, e, NULL, err);
        if (status != STEP_OK) return status;
    }
    return STEP_OK;
}

static bool start_at(prep_scan *scan, prep_ply_rows *rows, uint64_t offset, mospt_err *err)
{
    stop_blocks(rows);
    rows->begin = rows->end = 0;
    rows->is_at_end = false;
    return prep_input_seek(scan->input, offset, err);
}

/* As many points as the file may hold: a count from the header is not believed beyond that. */
static uint64_t count_present(prep_scan *scan, const prep_ply_rows *rows)
{
    uint64_t size = prep_input_size(scan->input),
             left = size > rows->offset ? size - rows->offset : 0;
    uint64_t least = is_ascii(rows) ? 2 * rows->vertex->property_count : rows->vertex->row_size;
    if (prep_input_is_gzip(scan->input)) return rows->vertex->count;
    /* the last line needs no end */
    uint64_t room = is_ascii(rows) ? (left + 1) / least : left / least;
    return room < rows->vertex->count ? room : rows->vertex->count;
}

bool prep_ply_rows_locate(prep_scan *scan, prep_ply_rows *rows, mospt_err *err)
{
    const prep_ply_header *h = rows->header;
    if (!alloc_buffers(rows, err)) return false;
    if (!start_at(scan, rows, h->size, err)) return false;
    if (is_ascii(rows) &&
        !prep_lines_init(&rows->lines, scan->input, LINE_SIZE, h->line_count, err))
        return false;
    for (const prep_ply_element *e = h->element; e != rows->vertex; e++) {
        step status = skip_element(scan, rows, e, err);
        if (status == STEP_ERROR) return false;
        if (status == STEP_END)
            return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, tell(scan, rows)),
                                 "the data of element `%s` does not end before the file does",
                                 e->name);
    }
    rows->offset = tell(scan, rows);
    if (is_ascii(rows)) {
        rows->offset = prep_input_tell(scan->input) - (rows->lines.end - rows->lines.begin);
        rows->line = rows->lines.number;
        prep_lines_fini(&rows->lines);
    }
    rows->present = count_present(scan, rows);
    /* lists before the vertices were read ahead of where they end */
    return prep_ply_rows_seek(scan, rows, 0, err);
}

bool prep_ply_rows_seek(prep_scan *scan, prep_ply_rows *rows, uint64_t vertex, mospt_err *err)
{
    rows->next = vertex;
    return start_at(scan, rows, rows->offset + vertex * rows->vertex->row_size, err);
}

/* The values of one line; false if it has too few, or something that is no number. */
static bool parse_row(const prep_ply_rows *rows, const char *p, const char *end, uint8_t *row)
{
    const prep_ply_element *e = rows->vertex;
    for (uint32_t i = 0; i < e->property_count; i++) {
        const prep_ply_property *property = &rows->header->property[e->first + i];
        double value, count = 1;
        if (property->is_list) {
            p = prep_number_parse(p, end, &count);
            if (p == NULL || !(count >= 0 && count < 1e9)) return false;
            while (p < end && (*p == ' ' || *p == '\t'))
                p++;
        }
        for (uint32_t k = 0; k < (uint32_t)count; k++) {
            p = prep_number_parse(p, end, &value);
            if (p == NULL || (p < end && *p != ' ' && *p != '\t' && *p != '\r')) return false;
            while (p < end && (*p == ' ' || *p == '\t' || *p == '\r'))
                p++;
        }
        if (property->is_list) continue;
        mospt_type_write(property->type, value, row);
        row += mospt_type_size(property->type);
    }
    return true;
}

/* At least a digit and a blank, or the end of the line, for each property. */
static bool make_room(const prep_ply_element *e, prep_ply_block *block, mospt_err *err)
{
    size_t size = (block->lines.size / (2 * e->property_count) + 1) * e->row_size;
    if (block->size >= size) return true;
    free(block->rows);
    block->rows = malloc(size);
    block->size = block->rows != NULL ? size : 0;
    return block->rows != NULL || mospt_err_nomem(err, size);
}

/* Takes the first `limit` vertices from a block. */
static void parse_block(const prep_ply_rows *rows, prep_ply_block *block, uint64_t limit)
{
    prep_line_cursor cursor = {0};
    const char *text;
    size_t length, row_size = rows->vertex->row_size;
    block->seen = block->bad_line = 0;
    block->count = block->handed_out = 0;
    while (block->seen < limit && prep_line_block_next(&block->lines, &cursor, &text, &length)) {
        const char *end = text + length;
        while (text < end && (*text == ' ' || *text == '\t'))
            text++;
        if (text == end) continue;
        block->seen++;
        if (parse_row(rows, text, end, block->rows + block->count * row_size)) block->count++;
        else if (block->bad_line == 0) block->bad_line = cursor.number;
    }
}

static bool work_on_block(const void *context, void *block, mospt_err *err)
{
    const prep_ply_rows *rows = context;
    if (!make_room(rows->vertex, block, err)) return false;
    parse_block(rows, block, UINT64_MAX);
    return true;
}

static bool fill_block(void *context, void *block, bool *is_last, mospt_err *err)
{
    prep_ply_rows *rows = context;
    prep_line_block *lines = &((prep_ply_block *)block)->lines;
    if (!prep_line_cutter_next(&rows->cutter, lines, err)) return false;
    *is_last = lines->is_last;
    return true;
}

static void fini_block(void *block)
{
    prep_line_block_fini(&((prep_ply_block *)block)->lines);
    free(((prep_ply_block *)block)->rows);
}

static bool start_blocks(prep_scan *scan, prep_ply_rows *rows, mospt_err *err)
{
    prep_ahead_task task = {rows, sizeof(prep_ply_block), fill_block, work_on_block, fini_block};
    uint32_t threads = rows->may_split ? prep_line_threads(scan->input) : 0;
    if (!prep_input_seek(scan->input, rows->offset, err)) return false;
    prep_line_cutter_init(&rows->cutter, scan->input, rows->line);
    return prep_ahead_create(&task, threads, &rows->ahead, err);
}

/* Goes on to the next block of lines, and counts what is in it. */
static bool next_block(prep_scan *scan, prep_ply_rows *rows, mospt_err *err)
{
    void *memory;
    if (rows->ahead == NULL && !start_blocks(scan, rows, err)) return false;
    rows->block = NULL;
    if (!prep_ahead_next(rows->ahead, &memory, err)) return false;
    prep_ply_block *block = memory;
    rows->is_at_end = block == NULL;
    if (block == NULL) return true;

    /* lines behind the vertices belong to other elements */
    uint64_t left = rows->vertex->count - rows->next;
    if (block->seen > left) parse_block(rows, block, left);
    rows->block = block;
    rows->next += block->seen;
    rows->last_line = block->lines.last_line;
    rows->fault = block->lines.fault;
    scan->dropped[PREP_DROP_UNREADABLE] += block->seen - block->count;
    if (block->bad_line > 0)
        prep_scan_set_damage(scan, mospt_at_line(scan->path, block->bad_line),
                             "not the %u numbers of a vertex", rows->vertex->property_count);
    return true;
}

static bool read_ascii(prep_scan *scan, prep_ply_rows *rows, uint32_t want, uint32_t *count,
                       mospt_err *err)
{
    size_t size = rows->vertex->row_size;
    while (*count < want) {
        prep_ply_block *block = rows->block;
        uint32_t ready = block != NULL ? block->count - block->handed_out : 0;
        if (ready == 0) {
            if (rows->is_at_end || rows->next == rows->vertex->count) break;
            if (!next_block(scan, rows, err)) return false;
            continue;
        }
        if (ready > want - *count) ready = want - *count;
        memcpy(rows->rows + *count * size, block->rows + block->handed_out * size, ready * size);
        block->handed_out += ready;
        *count += ready;
    }
    return true;
}

static bool read_lists(prep_scan *scan, prep_ply_rows *rows, uint32_t want, uint32_t *count,
                       mospt_err *err)
{
    uint32_t done = 0;
    size_t size = rows->vertex->row_size;
    for (; done < want; done++, rows->next++) {
        step status = read_binary(scan, rows, rows->vertex, rows->rows + done * size, err);
        if (status == STEP_ERROR) return false;
        rows->is_at_end = status == STEP_END;
        if (rows->is_at_end) break;
    }
    *count = done;
    return true;
}

static bool read_packed(prep_scan *scan, prep_ply_rows *rows, uint32_t want, uint32_t *count,
                        mospt_err *err)
{
    size_t size = rows->vertex->row_size, got;
    if (!prep_input_read(scan->input, rows->rows, want * size, &got, err)) return false;
    *count = (uint32_t)(got / size);
    rows->next += *count;
    rows->is_at_end = got < want * size;
    return true;
}

static void swap_rows(prep_ply_rows *rows, uint32_t count)
{
    const prep_ply_element *e = rows->vertex;
    uint8_t *at = rows->rows;
    for (uint32_t i = 0; i < e->property_count; i++) {
        const prep_ply_property *p = &rows->header->property[e->first + i];
        if (p->is_list) continue;
        prep_column column = {at, e->row_size, p->type};
        prep_column_swap(&column, count);
        at += mospt_type_size(p->type);
    }
}

static void tell_early_end(prep_scan *scan, const prep_ply_rows *rows)
{
    mospt_where at = is_ascii(rows) ? mospt_at_line(scan->path, rows->last_line)
                                    : mospt_at_byte(scan->path, tell(scan, rows));
    const char *fault = is_ascii(rows) ? rows->fault : prep_input_fault(scan->input);
    prep_scan_set_damage(
        scan, at, "%s: the header claims %" PRIu64 " vertices, %" PRIu64 " are there",
        fault != NULL ? fault : "the data ends here", rows->vertex->count, rows->next);
}

bool prep_ply_rows_read(prep_scan *scan, prep_ply_rows *rows, uint32_t want, uint32_t *count,
                        mospt_err *err)
{
    *count = 0;
    if (!alloc_buffers(rows, err)) return false;
    if (rows->is_at_end) return true;
    if (want > rows->capacity) want = rows->capacity;
    bool ok;
    if (is_ascii(rows)) {
        ok = read_ascii(scan, rows, want, count, err);
    } else {
        uint64_t left = rows->vertex->count - rows->next;
        if (left == 0) return true;
        if (want > left) want = (uint32_t)left;
        ok = rows->vertex->has_lists ? read_lists(scan, rows, want, count, err)
                                     : read_packed(scan, rows, want, count, err);
    }
    if (!ok) return false;
    if (is_swapped(rows)) swap_rows(rows, *count);
    if (rows->is_at_end) tell_early_end(scan, rows);
    return true;
}
