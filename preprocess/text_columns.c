#include "preprocess/text.h"

#include "preprocess/number.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

static inline bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

static inline bool is_separator(char c)
{
    return is_blank(c) || c == ',' || c == ';';
}

static inline const char *skip_blanks(const char *p, const char *end)
{
    while (p < end && is_blank(*p))
        p++;
    return p;
}

static const char *skip_word(const char *p, const char *end)
{
    if (*p == '"') {
        const char *close = memchr(p + 1, '"', (size_t)(end - p - 1));
        return close != NULL ? close + 1 : end;
    }
    while (p < end && !is_separator(*p))
        p++;
    return p;
}

/* "12,5" or "-0,25e3", which is one number to whoever wrote it. */
static bool is_decimal_comma(const char *p, const char *end)
{
    p += p < end && (*p == '-' || *p == '+');
    for (int part = 0; part < 2; part++) {
        const char *start = p;
        while (p < end && isdigit((unsigned char)*p))
            p++;
        if (p == start || (part == 0 && (p == end || *p != ','))) return false;
        p += part == 0;
    }
    return p == end || (*p | 32) == 'e';
}

bool prep_text_has_decimal_commas(const char *p, const char *end)
{
    size_t length = (size_t)(end - p);
    bool is_quoted = memchr(p, '"', length) != NULL, all = true;
    const char *marks = is_quoted ? "\"" : memchr(p, ';', length) != NULL ? ";" : " \t";
    int fields = 0, decimal = 0;
    for (const char *stop; p < end; p = stop + (stop < end)) {
        for (stop = p; stop < end && strchr(marks, *stop) == NULL;)
            stop++;
        const char *first = skip_blanks(p, stop), *last = stop;
        while (last > first && is_blank(last[-1]))
            last--;
        bool is_between = is_quoted && last - first == 1 && is_separator(*first);
        if (first == last || is_between) continue;
        bool has_comma = memchr(first, ',', (size_t)(last - first)) != NULL;
        if (has_comma && !is_decimal_comma(first, last)) return false;
        fields++;
        decimal += has_comma;
        all = all && has_comma;
    }
    return decimal > 0 && (fields > 2 || (all && fields > 1));
}

/* A column that is no plain number: empty, quoted, or a word. */
static const char *take_odd_column(const char *p, const char *end, double *value, bool *is_word)
{
    *value = (double)NAN;
    if (*p == ',' || *p == ';') return p;
    const char *next = skip_word(p, end);
    *is_word = true;
    if (*p == '"' && next - p >= 2) {
        const char *inner = skip_blanks(p + 1, next - 1);
        if (inner == next - 1) {
            *is_word = false;
        } else {
            double number;
            const char *stop = prep_number_parse(inner, next - 1, &number);
            if (stop != NULL && skip_blanks(stop, next - 1) == next - 1) {
                *value = number;
                *is_word = false;
            }
        }
    }
    return next;
}

uint32_t prep_text_split(const char *text, const char *end, double *values, uint64_t *words)
{
    uint32_t n = 0;
    uint64_t mask = 0;
    const char *p = skip_blanks(text, end);
    while (p < end) {
        if (n == PREP_TEXT_COLUMNS_MAX) {
            n++;
            break;
        }
        const char *q = prep_number_parse(p, end, &values[n]);
        if (q == NULL || (q < end && !is_separator(*q))) {
            if (prep_text_is_comment(p, end)) break;
            bool is_word = false;
            q = take_odd_column(p, end, &values[n], &is_word);
            if (is_word) mask |= 1ull << n;
        }
        n++;
        p = skip_blanks(q, end);
        if (p < end && (*p == ',' || *p == ';')) p = skip_blanks(p + 1, end);
    }
    *words = mask;
    return n;
}

static void copy_name(const char *p, const char *end, char out[PREP_TEXT_NAME_MAX])
{
    while (p < end && (is_blank(*p) || *p == '"'))
        p++;
    while (end > p && (is_blank(end[-1]) || end[-1] == '"'))
        end--;
    size_t n = (size_t)(end - p) < PREP_TEXT_NAME_MAX ? (size_t)(end - p) : PREP_TEXT_NAME_MAX - 1;
    memcpy(out, p, n);
    out[n] = '\0';
}

uint32_t prep_text_split_names(const char *text, const char *end, char names[][PREP_TEXT_NAME_MAX])
{
    const char *p = skip_blanks(text, end);
    while (p < end && (*p == '#' || *p == '/' || *p == '%'))
        p++;
    p = skip_blanks(p, end);
    while (end > p && (is_blank(end[-1]) || end[-1] == ',' || end[-1] == ';'))
        end--;
    const char *marks = " \t";
    if (memchr(p, '\t', (size_t)(end - p)) != NULL) marks = "\t";
    if (memchr(p, ';', (size_t)(end - p)) != NULL) marks = ";";
    if (memchr(p, ',', (size_t)(end - p)) != NULL) marks = ",";
    uint32_t n = 0;
    while (p < end && n < PREP_TEXT_COLUMNS_MAX) {
        const char *stop = p;
        while (stop < end && strchr(marks, *stop) == NULL)
            stop++;
        copy_name(p, stop, names[n++]);
        p = stop < end ? stop + 1 : end;
        if (marks[0] == ' ') p = skip_blanks(p, end);
    }
    return n;
}

int prep_text_columns_find(const prep_text_columns *columns, prep_text_meaning meaning)
{
    for (uint32_t c = 0; c < columns->count; c++) {
        if (columns->column[c].meaning == meaning) return (int)c;
    }
    return -1;
}

static bool has_xyz(const prep_text_columns *columns)
{
    return prep_text_columns_find(columns, PREP_TEXT_X) >= 0 &&
           prep_text_columns_find(columns, PREP_TEXT_Y) >= 0 &&
           prep_text_columns_find(columns, PREP_TEXT_Z) >= 0;
}

/* Lower case letters and digits only, without a unit in brackets: "Return_Number" and "X [m]" are
 * "returnnumber" and "x". */
static void simplify(const char *name, char out[PREP_TEXT_NAME_MAX])
{
    size_t n = 0;
    for (; *name != '\0' && *name != '[' && *name != '('; name++) {
        if (isalnum((unsigned char)*name)) out[n++] = (char)tolower((unsigned char)*name);
    }
    out[n] = '\0';
}

/* Smaller ranks are surer: "x" wins over "east", and that over "longitude". */
static const struct {
    const char *name;
    prep_text_meaning meaning;
    int rank;
} meanings[] = {
    {"x", PREP_TEXT_X, 0},
    {"y", PREP_TEXT_Y, 0},
    {"z", PREP_TEXT_Z, 0},
    {"easting", PREP_TEXT_X, 1},
    {"northing", PREP_TEXT_Y, 1},
    {"height", PREP_TEXT_Z, 2},
    {"east", PREP_TEXT_X, 1},
    {"north", PREP_TEXT_Y, 1},
    {"elevation", PREP_TEXT_Z, 1},
    {"xcoord", PREP_TEXT_X, 1},
    {"ycoord", PREP_TEXT_Y, 1},
    {"zcoord", PREP_TEXT_Z, 1},
    {"xcoordinate", PREP_TEXT_X, 1},
    {"ycoordinate", PREP_TEXT_Y, 1},
    {"zcoordinate", PREP_TEXT_Z, 1},
    {"cartesianx", PREP_TEXT_X, 1},
    {"cartesiany", PREP_TEXT_Y, 1},
    {"cartesianz", PREP_TEXT_Z, 1},
    {"lon", PREP_TEXT_X, 3},
    {"lat", PREP_TEXT_Y, 3},
    {"elev", PREP_TEXT_Z, 2},
    {"longitude", PREP_TEXT_X, 3},
    {"latitude", PREP_TEXT_Y, 3},
    {"altitude", PREP_TEXT_Z, 2},
    {"longitude*", PREP_TEXT_X, 4},
    {"latitude*", PREP_TEXT_Y, 4},
    {"elevation*", PREP_TEXT_Z, 4},
    {"alt", PREP_TEXT_Z, 3},
    {"h", PREP_TEXT_Z, 3},
    {"e", PREP_TEXT_X, 3},
    {"red", PREP_TEXT_R, 0},
    {"green", PREP_TEXT_G, 0},
    {"blue", PREP_TEXT_B, 0},
    {"r", PREP_TEXT_R, 1},
    {"g", PREP_TEXT_G, 1},
    {"b", PREP_TEXT_B, 1},
    {"rf", PREP_TEXT_R, 2},
    {"gf", PREP_TEXT_G, 2},
    {"bf", PREP_TEXT_B, 2},
    {"colorred", PREP_TEXT_R, 1},
    {"colorgreen", PREP_TEXT_G, 1},
    {"colorblue", PREP_TEXT_B, 1},
    {"nx", PREP_TEXT_NX, 0},
    {"ny", PREP_TEXT_NY, 0},
    {"nz", PREP_TEXT_NZ, 0},
    {"normalx", PREP_TEXT_NX, 1},
    {"normaly", PREP_TEXT_NY, 1},
    {"normalz", PREP_TEXT_NZ, 1},
    {"intensity", PREP_TEXT_INTENSITY, 0},
    {"scalarintensity", PREP_TEXT_INTENSITY, 1},
    {"reflectance", PREP_TEXT_INTENSITY, 2},
    {"i", PREP_TEXT_INTENSITY, 3},
};

/* Attributes that have a name of their own in the field. */
static const struct {
    const char *name, *attribute;
    mospt_type type;
} attributes[] = {
    {"classification", "classification", MOSPT_U8},
    {"class", "classification", MOSPT_U8},
    {"scalarclassification", "classification", MOSPT_U8},
    {"returnnumber", "return_number", MOSPT_U8},
    {"numberofreturns", "number_of_returns", MOSPT_U8},
    {"userdata", "user_data", MOSPT_U8},
    {"pointsourceid", "point_source", MOSPT_U16},
    {"pointsource", "point_source", MOSPT_U16},
    {"gpstime", "gps_time", MOSPT_F64},
    {"scanangle", "scan_angle", MOSPT_F32},
    {"scananglerank", "scan_angle", MOSPT_F32},
    {"scanchannel", "scanner_channel", MOSPT_U8},
    {"nir", "nir", MOSPT_U16},
    {"infrared", "nir", MOSPT_U16},
};

static bool name_matches(const char *simple, const char *pattern)
{
    size_t n = strlen(pattern);
    if (pattern[n - 1] == '*') return strncmp(simple, pattern, n - 1) == 0;
    return strcmp(simple, pattern) == 0;
}

static void set_attribute(prep_text_columns *columns, uint32_t c, const char *name)
{
    char simple[PREP_TEXT_NAME_MAX];
    simplify(name, simple);
    columns->column[c].meaning = PREP_TEXT_ATTRIBUTE;
    columns->column[c].type = MOSPT_F64;
    snprintf(columns->column[c].name, PREP_TEXT_NAME_MAX, "%s", name);
    for (size_t i = 0; i < sizeof attributes / sizeof attributes[0]; i++) {
        if (strcmp(simple, attributes[i].name) != 0) continue;
        columns->column[c].type = attributes[i].type;
        snprintf(columns->column[c].name, PREP_TEXT_NAME_MAX, "%s", attributes[i].attribute);
    }
}

/* The surest column of each meaning gets it. */
static void give_meaning(char names[][PREP_TEXT_NAME_MAX], prep_text_meaning meaning,
                         prep_text_columns *columns)
{
    int best_rank = 100, best = -1;
    for (uint32_t c = 0; c < columns->count; c++) {
        char simple[PREP_TEXT_NAME_MAX];
        simplify(names[c], simple);
        for (size_t i = 0; i < sizeof meanings / sizeof meanings[0]; i++) {
            if (meanings[i].meaning != meaning || meanings[i].rank >= best_rank) continue;
            if (!name_matches(simple, meanings[i].name)) continue;
            best_rank = meanings[i].rank;
            best = (int)c;
        }
    }
    if (best >= 0) columns->column[best].meaning = meaning;
}

/* A red without green and blue is no colour, nor is nx alone a normal: what is incomplete stays an
 * attribute. */
static void keep_whole(char names[][PREP_TEXT_NAME_MAX], prep_text_meaning first,
                       prep_text_columns *columns)
{
    int at[3], found = 0;
    for (int k = 0; k < 3; k++) {
        at[k] = prep_text_columns_find(columns, (prep_text_meaning)((int)first + k));
        found += at[k] >= 0;
    }
    for (int k = 0; k < 3 && found < 3; k++) {
        if (at[k] >= 0) set_attribute(columns, (uint32_t)at[k], names[at[k]]);
    }
}

bool prep_text_columns_from_names(char names[][PREP_TEXT_NAME_MAX], uint32_t count,
                                  prep_text_columns *out)
{
    *out = (prep_text_columns){.count = count};
    for (uint32_t c = 0; c < count; c++) {
        if (strcmp(names[c], "-") != 0) set_attribute(out, c, names[c]);
    }
    for (int m = PREP_TEXT_X; m <= PREP_TEXT_NZ; m++)
        give_meaning(names, (prep_text_meaning)m, out);
    keep_whole(names, PREP_TEXT_R, out);
    keep_whole(names, PREP_TEXT_NX, out);
    return has_xyz(out);
}

bool prep_text_columns_from_extension(const char *path, uint32_t count, prep_text_columns *out)
{
    static const struct {
        char letter;
        const char *name;
    } letters[] = {{'c', "classification"},
                   {'i', "intensity"},
                   {'r', "return_number"},
                   {'n', "number_of_returns"},
                   {'t', "gps_time"},
                   {'a', "scan_angle"},
                   {'u', "user_data"},
                   {'p', "point_source"},
                   {'R', "red"},
                   {'G', "green"},
                   {'B', "blue"}};
    size_t length = strlen(path);
    if (length > 3 && strcasecmp(path + length - 3, ".gz") == 0) length -= 3;
    size_t dot = length;
    while (dot > 0 && path[dot - 1] != '.' && path[dot - 1] != '/')
        dot--;
    if (length - dot != count || count < 4 || count > PREP_TEXT_COLUMNS_MAX) return false;
    if (strncmp(path + dot, "xyz", 3) != 0) return false;

    char names[PREP_TEXT_COLUMNS_MAX][PREP_TEXT_NAME_MAX] = {"x", "y", "z"};
    bool has_rgb = count >= 6 && strncmp(path + dot + 3, "rgb", 3) == 0;
    for (uint32_t c = 3; c < count; c++) {
        bool is_rgb = has_rgb && c < 6;
        char letter = is_rgb ? "RGB"[c - 3] : path[dot + c];
        size_t i = 0;
        while (i < sizeof letters / sizeof letters[0] && letters[i].letter != letter)
            i++;
        if (i == sizeof letters / sizeof letters[0]) return false;
        snprintf(names[c], PREP_TEXT_NAME_MAX, "%s", letters[i].name);
    }
    return prep_text_columns_from_names(names, count, out);
}

static bool are_bytes(const prep_text_range *r, uint32_t first)
{
    for (uint32_t c = first; c < first + 3; c++) {
        if (!r[c].is_integer || !(r[c].min >= 0) || !(r[c].max <= 255)) return false;
    }
    return true;
}

/* Colours of 16 bits, or shares of 1. */
static bool are_wide(const prep_text_range *r, uint32_t first)
{
    bool words = true, shares = true;
    for (uint32_t c = first; c < first + 3; c++) {
        if (!(r[c].min >= 0) || !(r[c].max > r[c].min)) return false;
        words = words && r[c].is_integer && r[c].max > 255 && r[c].max <= 65535;
        shares = shares && !r[c].is_integer && r[c].max <= 1;
    }
    return words || shares;
}

/* Components of unit vectors, written with a few digits. */
static bool are_units(const prep_text_range *r, uint32_t first)
{
    for (uint32_t c = first; c < first + 3; c++) {
        if (!(r[c].min >= -1.001) || !(r[c].max <= 1.001)) return false;
    }
    return true;
}

static void set_run(prep_text_columns *columns, uint32_t first, prep_text_meaning meaning,
                    uint32_t count)
{
    for (uint32_t k = 0; k < count; k++)
        columns->column[first + k].meaning = (prep_text_meaning)((uint32_t)meaning + k);
}

/* A label before the numbers and any behind them are no columns of theirs. */
static void leave_out_labels(const prep_text_range *ranges, uint32_t *first, uint32_t *end)
{
    while (*end > *first + 3 && ranges[*end - 1].is_word)
        --*end;
    *first += *end > *first + 3 && ranges[*first].is_word;
}

void prep_text_columns_guess(const prep_text_range *ranges, uint32_t count, prep_text_columns *out)
{
    uint32_t first = 0, end = count;
    leave_out_labels(ranges, &first, &end);
    const prep_text_range *r = ranges + first;
    count = end - first;
    *out = (prep_text_columns){.count = end};
    for (uint32_t c = first + 3; c < end; c++) {
        char name[PREP_TEXT_NAME_MAX];
        snprintf(name, sizeof name, "column_%u", c + 1);
        set_attribute(out, c, name);
    }
    set_run(out, first, PREP_TEXT_X, 3);
    if (count == 4) {
        set_run(out, first + 3, PREP_TEXT_INTENSITY, 1);
    } else if (count == 6 && (are_bytes(r, 3) || are_wide(r, 3))) {
        set_run(out, first + 3, PREP_TEXT_R, 3);
    } else if (count == 6 && are_units(r, 3)) {
        set_run(out, first + 3, PREP_TEXT_NX, 3);
    } else if (count == 7 && (are_bytes(r, 4) || (!are_bytes(r, 3) && are_wide(r, 4)))) {
        set_run(out, first + 3, PREP_TEXT_INTENSITY, 1);
        set_run(out, first + 4, PREP_TEXT_R, 3);
    } else if (count == 7 && (are_bytes(r, 3) || are_wide(r, 3))) {
        set_run(out, first + 3, PREP_TEXT_R, 3);
        set_run(out, first + 6, PREP_TEXT_INTENSITY, 1);
    } else if (count == 9 && are_bytes(r, 3) && are_units(r, 6)) {
        set_run(out, first + 3, PREP_TEXT_R, 3);
        set_run(out, first + 6, PREP_TEXT_NX, 3);
    } else if (count == 10 && are_bytes(r, 4) && are_units(r, 7)) {
        set_run(out, first + 3, PREP_TEXT_INTENSITY, 1);
        set_run(out, first + 4, PREP_TEXT_R, 3);
        set_run(out, first + 7, PREP_TEXT_NX, 3);
    }
}
