#include "preprocess/number.h"
#include "preprocess/pcd.h"

#include <ctype.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { LINE_MAX_SIZE = 64 * 1024 };
static const uint64_t HEADER_MAX = 1 << 20;

/* The header as it is written; what belongs to a field is put together at its end. */
typedef struct {
    char text[LINE_MAX_SIZE + 1];
    char *rest; /* strtok's */
    uint64_t size[PREP_PCD_FIELDS_MAX], count[PREP_PCD_FIELDS_MAX];
    char type[PREP_PCD_FIELDS_MAX];
    uint32_t size_count, type_count, count_count;
    uint64_t width, height, points;
    bool has_width, has_height, has_points;
    uint64_t fields_line;
} header_draft;

static char *next_word(header_draft *d, bool is_first)
{
    return strtok_r(is_first ? d->text : NULL, " \t\r\v\f", &d->rest);
}

static bool parse_count(const char *word, uint64_t *out)
{
    uint64_t value = 0;
    if (word == NULL || *word == '\0') return false;
    for (const char *p = word; *p != '\0'; p++) {
        if (*p < '0' || *p > '9' || value > UINT64_MAX / 10 - 1) return false;
        value = value * 10 + (uint64_t)(*p - '0');
    }
    *out = value;
    return true;
}

static bool parse_fields(header_draft *d, prep_pcd_header *h, mospt_where at, mospt_err *err)
{
    h->field_count = 0;
    d->fields_line = at.place;
    for (char *w = next_word(d, false); w != NULL; w = next_word(d, false)) {
        if (h->field_count == PREP_PCD_FIELDS_MAX)
            return mospt_err_set(err, MOSPT_EFORMAT, at, "more than %d fields",
                                 PREP_PCD_FIELDS_MAX);
        snprintf(h->field[h->field_count++].name, PREP_PCD_NAME_MAX, "%.63s", w);
    }
    return true;
}

static bool parse_counts(header_draft *d, uint64_t *out, uint32_t *count, mospt_where at,
                         mospt_err *err)
{
    for (char *w = next_word(d, false); w != NULL && *count < PREP_PCD_FIELDS_MAX;
         w = next_word(d, false)) {
        if (!parse_count(w, &out[(*count)++]))
            return mospt_err_set(err, MOSPT_EFORMAT, at, "`%.60s` where a count is expected", w);
    }
    return true;
}

static bool parse_total(header_draft *d, uint64_t *out, bool *has, mospt_where at, mospt_err *err)
{
    const char *w = next_word(d, false);
    *has = parse_count(w, out);
    return *has || mospt_err_set(err, MOSPT_EFORMAT, at, "`%.60s` where a count is expected",
                                 w != NULL ? w : "");
}

static bool parse_viewpoint(header_draft *d, double out[7], mospt_where at, mospt_err *err)
{
    for (int i = 0; i < 7; i++) {
        const char *w = next_word(d, false);
        const char *end = w != NULL ? w + strlen(w) : NULL;
        if (w == NULL || prep_number_parse(w, end, &out[i]) != end)
            return mospt_err_set(err, MOSPT_EFORMAT, at, "VIEWPOINT needs 7 numbers");
    }
    return true;
}

static bool parse_encoding(header_draft *d, prep_pcd_header *h, mospt_where at, mospt_err *err)
{
    static const char *const names[] = {"ascii", "binary", "binary_compressed"};
    const char *w = next_word(d, false);
    for (int i = 0; i < 3 && w != NULL; i++) {
        if (strcasecmp(w, names[i]) != 0) continue;
        h->encoding = (prep_pcd_encoding)i;
        return true;
    }
    return mospt_err_set(err, MOSPT_EFORMAT, at, "PCD data that are `%.60s` are not known",
                         w != NULL ? w : "");
}

static bool is_word(const char *word, const char *a)
{
    return strcasecmp(word, a) == 0;
}

/* is_end   out, this was the line in front of the data */
static bool parse_line(header_draft *d, prep_pcd_header *h, mospt_where at, bool *is_end,
                       mospt_err *err)
{
    const char *key = next_word(d, true);
    if (key == NULL || *key == '#') return true;
    if (is_word(key, "VERSION")) {
        const char *w = next_word(d, false);
        snprintf(h->version, sizeof h->version, "%s%.5s", w != NULL && *w == '.' ? "0" : "",
                 w != NULL ? w : "");
    } else if (is_word(key, "FIELDS") || is_word(key, "COLUMNS")) {
        return parse_fields(d, h, at, err);
    } else if (is_word(key, "SIZE")) {
        return parse_counts(d, d->size, &d->size_count, at, err);
    } else if (is_word(key, "COUNT")) {
        return parse_counts(d, d->count, &d->count_count, at, err);
    } else if (is_word(key, "TYPE")) {
        for (char *w = next_word(d, false); w != NULL && d->type_count < PREP_PCD_FIELDS_MAX;
             w = next_word(d, false))
            d->type[d->type_count++] = w[1] == '\0' ? (char)toupper((unsigned char)*w) : '?';
    } else if (is_word(key, "WIDTH")) {
        return parse_total(d, &d->width, &d->has_width, at, err);
    } else if (is_word(key, "HEIGHT")) {
        return parse_total(d, &d->height, &d->has_height, at, err);
    } else if (is_word(key, "POINTS")) {
        return parse_total(d, &d->points, &d->has_points, at, err);
    } else if (is_word(key, "VIEWPOINT")) {
        return parse_viewpoint(d, h->viewpoint, at, err);
    } else if (is_word(key, "DATA")) {
        *is_end = true;
        return parse_encoding(d, h, at, err);
    } else if (!isalpha((unsigned char)*key)) {
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "not a line of a PCD header, which ends with DATA");
    }
    return true;
}

static bool type_of(char type, uint64_t size, mospt_type *out)
{
    static const struct {
        char type;
        uint64_t size;
        mospt_type ours;
    } types[] = {{'F', 4, MOSPT_F32}, {'F', 8, MOSPT_F64}, {'U', 1, MOSPT_U8}, {'U', 2, MOSPT_U16},
                 {'U', 4, MOSPT_U32}, {'U', 8, MOSPT_U64}, {'I', 1, MOSPT_I8}, {'I', 2, MOSPT_I16},
                 {'I', 4, MOSPT_I32}, {'I', 8, MOSPT_I64}};
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++) {
        if (types[i].type != type || types[i].size != size) continue;
        *out = types[i].ours;
        return true;
    }
    return false;
}

static bool make_fields(const header_draft *d, prep_pcd_header *h, mospt_where at, mospt_err *err)
{
    uint32_t n = h->field_count;
    at.place = d->fields_line;
    if (n == 0) return mospt_err_set(err, MOSPT_EFORMAT, at, "the PCD header names no FIELDS");
    if ((d->size_count != 0 && d->size_count != n) || (d->type_count != 0 && d->type_count != n) ||
        (d->count_count != 0 && d->count_count != n))
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "%u fields, but %u sizes, %u types and %u counts", n, d->size_count,
                             d->type_count, d->count_count);
    for (uint32_t i = 0; i < n; i++) {
        prep_pcd_field *f = &h->field[i];
        uint64_t size = d->size_count > 0 ? d->size[i] : 4,
                 count = d->count_count > 0 ? d->count[i] : 1;
        char type = d->type_count > 0 ? d->type[i] : 'F';
        if (!type_of(type, size, &f->type))
            return mospt_err_set(err, MOSPT_EFORMAT, at,
                                 "field `%s` is of type %c with %" PRIu64 " bytes", f->name,
                                 type >= ' ' && type < 127 ? type : '?', size);
        if (count > PREP_PCD_RECORD_MAX || h->record_size + size * count > PREP_PCD_RECORD_MAX)
            return mospt_err_set(err, MOSPT_EFORMAT, at, "more than %d bytes per point",
                                 PREP_PCD_RECORD_MAX);
        f->count = (uint32_t)count;
        f->offset = h->record_size;
        h->record_size += (uint32_t)(size * count);
    }
    return h->record_size > 0 || mospt_err_set(err, MOSPT_EFORMAT, at, "the points have no bytes");
}

static bool count_points(const header_draft *d, prep_pcd_header *h, mospt_where at, mospt_err *err)
{
    uint64_t height = d->has_height ? d->height : 1;
    if (!d->has_width && !d->has_points)
        return mospt_err_set(err, MOSPT_EFORMAT, at, "the PCD header has neither POINTS nor WIDTH");
    bool overflows = d->width > 0 && height > UINT64_MAX / d->width;
    h->grid_points = !d->has_width ? d->points : overflows ? UINT64_MAX : d->width * height;
    h->points = d->has_points && (d->points > 0 || !d->has_width) ? d->points : h->grid_points;
    return true;
}

static bool parse_lines(prep_lines *lines, header_draft *d, prep_pcd_header *h, mospt_err *err)
{
    mospt_where at = {.file = prep_input_path(lines->input), .kind = MOSPT_AT_LINE};
    for (bool is_end = false; !is_end;) {
        const char *text;
        size_t length;
        if (!prep_lines_next(lines, &text, &length, err)) return false;
        at.place = lines->number;
        h->size = prep_input_tell(lines->input) - (lines->end - lines->begin);
        h->line_count = lines->number;
        if (text == NULL)
            return mospt_err_set(err, MOSPT_EFORMAT, at,
                                 "the file ends inside the PCD header, before DATA");
        if (h->size > HEADER_MAX || length >= LINE_MAX_SIZE)
            return mospt_err_set(err, MOSPT_EFORMAT, at, "the PCD header does not end");
        memcpy(d->text, text, length);
        d->text[length] = '\0';
        if (!parse_line(d, h, at, &is_end, err)) return false;
    }
    return make_fields(d, h, at, err) && count_points(d, h, at, err);
}

bool prep_pcd_header_read(prep_input *input, prep_pcd_header *out, mospt_err *err)
{
    prep_lines lines;
    header_draft *draft = calloc(1, sizeof *draft);
    if (draft == NULL) return mospt_err_nomem(err, sizeof *draft);
    *out = (prep_pcd_header){.viewpoint = {[3] = 1}};
    bool ok =
        prep_input_seek(input, 0, err) && prep_lines_init(&lines, input, LINE_MAX_SIZE, 0, err);
    if (ok) {
        ok = parse_lines(&lines, draft, out, err);
        prep_lines_fini(&lines);
    }
    free(draft);
    return ok;
}
