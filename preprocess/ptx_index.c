#include "preprocess/number.h"
#include "preprocess/ptx.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    WINDOW_SIZE = 256 * 1024,
    HEADER_SIZE_MAX = 4096,
    HEADER_LINES = 10,
    COUNT_LINE_MAX = 32, /* a line that holds one integer and nothing else is not longer */
};

/* How many numbers stand on each line of a header. */
static const int header_shape[HEADER_LINES] = {1, 1, 3, 3, 3, 3, 4, 4, 4, 4};

typedef struct {
    prep_ptx_scan *scans; /* [count], owned */
    uint32_t count, capacity;
    bool has_more;
} scan_list;

/* The part of the file that is looked at. */
typedef struct {
    prep_input *input;
    char *buffer; /* [WINDOW_SIZE], owned */
    size_t begin, end;
    uint64_t offset; /* of buffer[begin] */
    uint64_t number; /* lines before it */
    bool is_last, in_long_line;
} walk;

static bool refill(walk *w, mospt_err *err)
{
    size_t kept = w->end - w->begin, got;
    memmove(w->buffer, w->buffer + w->begin, kept);
    if (!prep_input_read(w->input, w->buffer + kept, WINDOW_SIZE - kept, &got, err)) return false;
    w->begin = 0;
    w->end = kept + got;
    w->is_last = got < WINDOW_SIZE - kept;
    return true;
}

static inline bool is_blank(char c)
{
    return (unsigned char)c <= ' ';
}

static bool is_blank_line(const char *p, const char *end)
{
    while (p < end && is_blank(*p))
        p++;
    return p == end;
}

/* No line of a point holds a single integer; the first two of a header do. */
static bool is_count(const char *p, const char *end, uint64_t *out)
{
    uint64_t value = 0;
    int digits = 0;
    while (p < end && is_blank(*p))
        p++;
    for (; p < end && (unsigned char)(*p - '0') < 10 && digits < 18; p++, digits++)
        value = value * 10 + (uint64_t)(*p - '0');
    if (digits == 0 || !is_blank_line(p, end)) return false;
    *out = value;
    return true;
}

/* Exactly `count` finite numbers. */
static bool parse_numbers(const char *p, const char *end, int count, double *out)
{
    for (int i = 0; i < count; i++) {
        while (p < end && is_blank(*p))
            p++;
        p = prep_number_parse(p, end, &out[i]);
        if (p == NULL || (p < end && !is_blank(*p)) || !isfinite(out[i])) return false;
    }
    return is_blank_line(p, end);
}

static bool parse_header_line(int i, const char *p, const char *end, prep_ptx_scan *out)
{
    double values[4];
    if (i < 2) return is_count(p, end, i == 0 ? &out->columns : &out->rows);
    if (!parse_numbers(p, end, header_shape[i], values)) return false;
    if (i >= 6) memcpy(out->matrix + 4 * (i - 6), values, sizeof values);
    return true;
}

/* Parses a header.
 * size     out, bytes and
 * lines    lines that were understood, blank ones included
 * returns  the number of its lines that were understood */
static int parse_header(const char *text, const char *end, prep_ptx_scan *out, size_t *size,
                        uint64_t *lines)
{
    int done = 0;
    const char *p = text;
    *size = *lines = 0;
    while (p < end && done < HEADER_LINES) {
        const char *newline = memchr(p, '\n', (size_t)(end - p));
        const char *line_end = newline != NULL ? newline : end;
        if (!is_blank_line(p, line_end)) {
            if (!parse_header_line(done, p, line_end, out)) break;
            done++;
        }
        p = newline != NULL ? newline + 1 : end;
        ++*lines;
        *size = (size_t)(p - text);
    }
    return done;
}

static bool add_scan(scan_list *list, const prep_ptx_scan *scan, mospt_err *err)
{
    if (list->count == list->capacity) {
        uint32_t capacity = list->capacity > 0 ? 2 * list->capacity : 16;
        prep_ptx_scan *grown = realloc(list->scans, capacity * sizeof *grown);
        if (grown == NULL) return mospt_err_nomem(err, capacity * sizeof *grown);
        list->scans = grown;
        list->capacity = capacity;
    }
    list->scans[list->count++] = *scan;
    return true;
}

static void consume(walk *w, size_t size, uint64_t lines)
{
    w->begin += size;
    w->offset += size;
    w->number += lines;
}

static bool refuse(const walk *w, int understood, uint64_t lines, mospt_err *err)
{
    static const char *const meaning[HEADER_LINES] = {
        "the number of columns", "the number of rows",   "the scanner's position",
        "the scanner's x axis",  "the scanner's y axis", "the scanner's z axis",
        "a row of the matrix",   "a row of the matrix",  "a row of the matrix",
        "a row of the matrix"};
    return mospt_err_set(err, MOSPT_EFORMAT,
                         mospt_at_line(prep_input_path(w->input), w->number + lines + 1),
                         "not the header of a PTX scan: %s expected here", meaning[understood]);
}

/* At a line with a single integer: a header, a damaged one, or just a line. */
static bool take_count_line(walk *w, scan_list *list, bool *is_header, mospt_err *err)
{
    prep_ptx_scan scan = {0};
    size_t size;
    uint64_t lines;
    int understood = parse_header(w->buffer + w->begin, w->buffer + w->end, &scan, &size, &lines);
    *is_header = understood == HEADER_LINES;
    if (*is_header) {
        if (list->count == PREP_PTX_SCANS_MAX) {
            list->has_more = true;
            return true;
        }
        consume(w, size, lines);
        scan.offset = scan.end = w->offset;
        scan.line = w->number;
        return add_scan(list, &scan, err);
    }
    if (list->count == 0) return refuse(w, understood, lines, err);
    prep_ptx_scan *last = &list->scans[list->count - 1];
    if (understood >= 2 && last->lost_line == 0) last->lost_line = w->number + 1;
    return true;
}

static bool take_line(walk *w, scan_list *list, const char *end, mospt_err *err)
{
    const char *p = w->buffer + w->begin;
    if (w->in_long_line || is_blank_line(p, end)) return true;
    if (list->count == 0) return refuse(w, 0, 0, err);
    prep_ptx_scan *last = &list->scans[list->count - 1];
    if (last->lost_line > 0) last->lost_count++;
    else last->line_count++;
    return true;
}

static void skip_mark(walk *w)
{
    if (w->end - w->begin >= 3 && memcmp(w->buffer, "\xef\xbb\xbf", 3) == 0) consume(w, 3, 0);
}

static bool find_headers(walk *w, scan_list *list, mospt_err *err)
{
    if (!refill(w, err)) return false;
    skip_mark(w);
    while (!list->has_more) {
        char *p = w->buffer + w->begin;
        size_t have = w->end - w->begin;
        char *newline = have > 0 ? memchr(p, '\n', have) : NULL;
        if (newline == NULL && !w->is_last && have < WINDOW_SIZE) {
            if (!refill(w, err)) return false;
            continue;
        }
        if (have == 0) break;
        char *end = newline != NULL ? newline : p + have;
        uint64_t count;
        if (end - p <= COUNT_LINE_MAX && !w->in_long_line && is_count(p, end, &count)) {
            if (!w->is_last && have < HEADER_SIZE_MAX) {
                if (!refill(w, err)) return false;
                continue;
            }
            bool is_header;
            if (!take_count_line(w, list, &is_header, err)) return false;
            if (is_header) continue;
        }
        if (!take_line(w, list, end, err)) return false;
        consume(w, (size_t)(end - p) + (newline != NULL), newline != NULL);
        w->in_long_line = newline == NULL;
        if (list->count > 0 && list->scans[list->count - 1].lost_line == 0)
            list->scans[list->count - 1].end = w->offset;
    }
    return true;
}

/* A scan of no points is none, unless the file holds nothing else. */
static bool drop_empty(walk *w, scan_list *list, mospt_err *err)
{
    uint32_t kept = 0;
    bool has_lines = false, declares = false;
    const char *path = prep_input_path(w->input);
    for (uint32_t i = 0; i < list->count; i++) {
        const prep_ptx_scan *s = &list->scans[i];
        bool is_declared = s->columns > 0 && s->rows > 0;
        has_lines = has_lines || s->line_count > 0;
        declares = declares || is_declared || s->lost_line > 0;
        if (s->line_count > 0 || s->lost_line > 0 || is_declared) list->scans[kept++] = *s;
    }
    if (list->count == 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(path),
                             "no PTX file: nothing but blank lines");
    if (!has_lines && declares)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(path, w->number),
                             "the file ends before the first point of a scan");
    if (!has_lines)
        return mospt_err_set(err, MOSPT_EEMPTY, mospt_at_file(path),
                             "the PTX file holds no points");
    list->count = kept;
    return true;
}

static void free_list(void *index)
{
    scan_list *list = index;
    free(list->scans);
    free(list);
}

static scan_list *walk_file(prep_input *input, mospt_err *err)
{
    scan_list *list = calloc(1, sizeof *list);
    walk w = {.input = input, .buffer = malloc(WINDOW_SIZE)};
    bool ok = list != NULL && w.buffer != NULL;
    if (!ok) mospt_err_nomem(err, WINDOW_SIZE);
    ok = ok && prep_input_seek(input, 0, err) && find_headers(&w, list, err) &&
         drop_empty(&w, list, err);
    free(w.buffer);
    if (ok) return list;
    if (list != NULL) free_list(list);
    return NULL;
}

bool prep_ptx_find(prep_input *input, prep_scan_memory *memory, uint32_t index, prep_ptx_scan *out,
                   uint32_t *scan_count, bool *has_more, mospt_err *err)
{
    const scan_list *known = prep_scan_memory_recall(memory, input, free_list);
    scan_list *walked = known == NULL ? walk_file(input, err) : NULL;
    const scan_list *list = known != NULL ? known : walked;
    if (list == NULL) return false;
    if (index < list->count) *out = list->scans[index];
    *scan_count = list->count;
    *has_more = list->has_more;
    if (walked != NULL) prep_scan_memory_keep(memory, input, walked, free_list);
    return true;
}
