/* preprocess/text.h - points as lines of numbers: .xyz .txt .asc .csv .pts .3d and whatever else
 * people call them.
 *
 * Columns are separated by blanks, tabs, commas or semicolons, also mixed. What they mean is said,
 * in this order, by the caller (--columns), by a line of names, by the letters of an extension such
 * as .xyzcirn, and failing these by their number and a sample of their values. Columns without a
 * meaning of their own become attributes. */
#pragma once
#include "preprocess/scan_format.h"

extern const prep_scan_format prep_text_format;

enum { PREP_TEXT_COLUMNS_MAX = 64, PREP_TEXT_NAME_MAX = 48 };

/* Splits a line at its separators and parses the columns.
 * values   out, [PREP_TEXT_COLUMNS_MAX]; NaN for an empty column or one that is no number
 * words    out, bit c is set where column c is neither empty nor a number
 * returns  the number of columns; PREP_TEXT_COLUMNS_MAX + 1 if there are more than that */
uint32_t prep_text_split(const char *text, const char *end, double *values, uint64_t *words);

/* The same line as names: at commas, semicolons or tabs if it has any, else at blanks; quotes and a
 * leading comment mark are taken off. */
uint32_t prep_text_split_names(const char *text, const char *end, char names[][PREP_TEXT_NAME_MAX]);

typedef enum {
    PREP_TEXT_SKIP,
    PREP_TEXT_X,
    PREP_TEXT_Y,
    PREP_TEXT_Z,
    PREP_TEXT_R,
    PREP_TEXT_G,
    PREP_TEXT_B,
    PREP_TEXT_INTENSITY,
    PREP_TEXT_NX,
    PREP_TEXT_NY,
    PREP_TEXT_NZ,
    PREP_TEXT_ATTRIBUTE,
    PREP_TEXT_MEANINGS,
} prep_text_meaning;

typedef struct {
    struct {
        prep_text_meaning meaning;
        char name[PREP_TEXT_NAME_MAX]; /* attributes only */
        mospt_type type;               /* attributes only: what their values should fit */
    } column[PREP_TEXT_COLUMNS_MAX];
    uint32_t count;
} prep_text_columns;

/* Column of a meaning, -1 if there is none. */
int prep_text_columns_find(const prep_text_columns *columns, prep_text_meaning meaning);

/* Meanings from names; true if x, y and z are among them. */
bool prep_text_columns_from_names(char names[][PREP_TEXT_NAME_MAX], uint32_t count,
                                  prep_text_columns *out);

/* Meanings from the letters of an extension ("xyzcirn"); true if it names exactly `count` columns.
 */
bool prep_text_columns_from_extension(const char *path, uint32_t count, prep_text_columns *out);

/* What a sample says of one column. */
typedef struct {
    double min, max; /* NaN if it holds no number */
    bool is_integer;
    bool is_word; /* more often a word than a number */
} prep_text_range;

/* Meanings from the number of columns and the range of their values. */
void prep_text_columns_guess(const prep_text_range *ranges, uint32_t count, prep_text_columns *out);
