#include "preprocess/ply.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { LINE_MAX_SIZE = 16 * 1024, WORDS_MAX = 6 };
static const uint64_t HEADER_MAX = 1 << 20;

typedef struct {
    char text[LINE_MAX_SIZE + 1];
    char *word[WORDS_MAX];
    int count;
} split_line;

static void split(split_line *line, const char *text, size_t length)
{
    if (length > LINE_MAX_SIZE) length = LINE_MAX_SIZE;
    for (size_t i = 0; i < length; i++) /* names end up in messages and file formats */
        line->text[i] =
            (text[i] >= ' ' && text[i] < 127) || text[i] == '\t' || text[i] == '\r' ? text[i] : '_';
    line->text[length] = '\0';
    line->count = 0;
    char *rest = NULL;
    for (char *w = strtok_r(line->text, " \t\r\v\f", &rest); w != NULL && line->count < WORDS_MAX;
         w = strtok_r(NULL, " \t\r\v\f", &rest))
        line->word[line->count++] = w;
}

static bool parse_type(const char *word, mospt_type *out)
{
    static const struct {
        const char *name;
        mospt_type type;
    } types[] = {
        {"char", MOSPT_I8},   {"uchar", MOSPT_U8},   {"short", MOSPT_I16},   {"ushort", MOSPT_U16},
        {"int", MOSPT_I32},   {"uint", MOSPT_U32},   {"float", MOSPT_F32},   {"double", MOSPT_F64},
        {"int8", MOSPT_I8},   {"uint8", MOSPT_U8},   {"int16", MOSPT_I16},   {"uint16", MOSPT_U16},
        {"int32", MOSPT_I32}, {"uint32", MOSPT_U32}, {"int64", MOSPT_I64},   {"uint64", MOSPT_U64},
        {"long", MOSPT_I64},  {"ulong", MOSPT_U64},  {"float32", MOSPT_F32}, {"float64", MOSPT_F64},
    };
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++) {
        if (strcasecmp(word, types[i].name) != 0) continue;
        *out = types[i].type;
        return true;
    }
    return false;
}

static bool parse_count(const char *word, uint64_t *out)
{
    uint64_t value = 0;
    for (const char *p = word; *p != '\0'; p++) {
        if (*p < '0' || *p > '9' || value > UINT64_MAX / 10 - 1) return false;
        value = value * 10 + (uint64_t)(*p - '0');
    }
    *out = value;
    return true;
}

static bool parse_format(prep_ply_header *h, const split_line *l, mospt_where at, mospt_err *err)
{
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    for (int i = 0; i < 3 && l->count > 1; i++) {
        if (strcasecmp(l->word[1], names[i]) != 0) continue;
        h->encoding = (prep_ply_encoding)i;
        return true;
    }
    return mospt_err_set(err, MOSPT_EFORMAT, at, "the PLY format `%.60s` is not known",
                         l->count > 1 ? l->word[1] : "");
}

static bool parse_element(prep_ply_header *h, const split_line *l, mospt_where at, mospt_err *err)
{
    prep_ply_element e = {.first = h->property_count};
    if (l->count < 3 || !parse_count(l->word[2], &e.count))
        return mospt_err_set(err, MOSPT_EFORMAT, at, "an element needs a name and a count");
    if (h->element_count == PREP_PLY_ELEMENTS_MAX)
        return mospt_err_set(err, MOSPT_EFORMAT, at, "more than %d elements",
                             PREP_PLY_ELEMENTS_MAX);
    snprintf(e.name, sizeof e.name, "%.63s", l->word[1]);
    h->element[h->element_count++] = e;
    return true;
}

static bool parse_property(prep_ply_header *h, const split_line *l, mospt_where at, mospt_err *err)
{
    prep_ply_property p = {0};
    if (h->element_count == 0)
        return mospt_err_set(err, MOSPT_EFORMAT, at, "a property before any element");
    if (h->property_count == PREP_PLY_PROPERTIES_MAX)
        return mospt_err_set(err, MOSPT_EFORMAT, at, "more than %d properties",
                             PREP_PLY_PROPERTIES_MAX);
    p.is_list = l->count > 1 && strcasecmp(l->word[1], "list") == 0;
    int first = p.is_list ? 2 : 1;
    if (l->count < first + 2 + (p.is_list ? 1 : 0))
        return mospt_err_set(err, MOSPT_EFORMAT, at, "a property needs a type and a name");
    if (p.is_list && !parse_type(l->word[first++], &p.count_type))
        return mospt_err_set(err, MOSPT_EFORMAT, at, "the type `%.60s` is not known",
                             l->word[first - 1]);
    if (!parse_type(l->word[first], &p.type))
        return mospt_err_set(err, MOSPT_EFORMAT, at, "the type `%.60s` is not known",
                             l->word[first]);
    snprintf(p.name, sizeof p.name, "%.63s", l->word[first + 1]);

    prep_ply_element *e = &h->element[h->element_count - 1];
    e->has_lists = e->has_lists || p.is_list;
    if (!p.is_list) e->row_size += (uint32_t)mospt_type_size(p.type);
    e->property_count++;
    h->property[h->property_count++] = p;
    return true;
}

static bool parse_lines(prep_lines *lines, split_line *l, prep_ply_header *h, mospt_err *err)
{
    mospt_where at = {.file = prep_input_path(lines->input), .kind = MOSPT_AT_LINE};
    bool has_format = false;
    for (;;) {
        const char *text;
        size_t length;
        if (!prep_lines_next(lines, &text, &length, err)) return false;
        at.place = lines->number;
        uint64_t read = prep_input_tell(lines->input) - (lines->end - lines->begin);
        if (text == NULL)
            return mospt_err_set(err, MOSPT_EFORMAT, at, "the file ends inside the PLY header");
        if (read > HEADER_MAX)
            return mospt_err_set(err, MOSPT_EFORMAT, at, "the PLY header does not end");
        split(l, text, length);
        if (lines->number == 1 && (l->count == 0 || strcmp(l->word[0], "ply") != 0))
            return mospt_err_set(err, MOSPT_EFORMAT, at,
                                 "no PLY file: the first line is not `ply`");
        if (l->count == 0) continue;
        const char *key = l->word[0];
        if (strcmp(key, "format") == 0) {
            if (!parse_format(h, l, at, err)) return false;
            has_format = true;
        } else if (strcmp(key, "element") == 0) {
            if (!parse_element(h, l, at, err)) return false;
        } else if (strcmp(key, "property") == 0) {
            if (!parse_property(h, l, at, err)) return false;
        } else if (strcmp(key, "end_header") == 0) {
            h->size = read;
            h->line_count = lines->number;
            break;
        }
    }
    return has_format || mospt_err_set(err, MOSPT_EFORMAT, at, "the PLY header names no format");
}

bool prep_ply_header_read(prep_input *input, prep_ply_header *out, mospt_err *err)
{
    prep_lines lines;
    split_line *line = malloc(sizeof *line);
    if (line == NULL) return mospt_err_nomem(err, sizeof *line);
    memset(out, 0, sizeof *out);
    bool ok =
        prep_input_seek(input, 0, err) && prep_lines_init(&lines, input, LINE_MAX_SIZE, 0, err);
    if (ok) {
        ok = parse_lines(&lines, line, out, err);
        prep_lines_fini(&lines);
    }
    free(line);
    return ok;
}

int prep_ply_find(const prep_ply_header *header, const prep_ply_element *element, const char *name)
{
    for (uint32_t i = 0; i < element->property_count; i++) {
        const prep_ply_property *p = &header->property[element->first + i];
        if (!p->is_list && strcasecmp(p->name, name) == 0) return (int)(element->first + i);
    }
    return -1;
}
