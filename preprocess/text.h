/* preprocess/text.h - points as lines of numbers: .xyz .txt .asc .csv .pts .3d and whatever else
 * people call them.
 *
 * Columns are separated by blanks, tabs, commas or semicolons, also mixed. What they mean is said,
 * in this order, by the caller (--columns), by a line of names, by the letters of an extension such
 * as .xyzcirn, and failing these by their number and a sample of their values. Columns without a
 * meaning of their own become attributes. */
#pragma once
#include "preprocess/ahead.h"
#include "preprocess/lines.h"
#include "preprocess/scan_format.h"
#include "preprocess/tone.h"

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
    bool has_gaps; /* some lines have no number there */
    bool is_word;  /* more often a word than a number */
} prep_text_range;

/* Meanings from the number of columns and the range of their values. */
void prep_text_columns_guess(const prep_text_range *ranges, uint32_t count, prep_text_columns *out);

/* Where the values of a column go in a batch, and what they were in the sample. */
typedef struct {
    uint32_t column, plane, component;
    bool is_shown; /* colour of bytes: it is in the batch already, and only checked here */
    mospt_type type;
    double low, high; /* what `type` holds, and the sample held */
    bool is_integer;
    const char *name; /* borrowed from the schema */
} prep_text_target;

/* How lines become points. */
typedef struct {
    uint32_t needed;      /* columns that a line must have */
    uint64_t needed_mask; /* those of them that must be no word */
    uint64_t header_line; /* number of the line with the names; 0: there is none */
    bool has_counts;      /* lines with a single integer announce how many points follow (PTS) */
    int xyz[3], rgb[3], intensity; /* columns, -1: there is none */
    double rgb_scale;              /* raw to 0..255; 0: no colour */
    prep_tone tone;
    prep_text_target target[PREP_TEXT_COLUMNS_MAX];
    uint32_t target_count;
    const mospt_schema *schema; /* borrowed */
} prep_text_plan;

/* A block of lines, and what they hold. */
typedef struct {
    prep_line_block lines;
    prep_batch points;
    uint32_t handed_out; /* the reader's */
    uint64_t unreadable; /* lines that are no points */
    uint64_t declared;   /* points announced in this block */
    uint64_t count_line; /* number of the last line that announced any; 0: none did */
    uint64_t fault_line; /* number of the first line with something wrong; 0: there is none */
    char fault[256];     /* what that is */
} prep_text_block;

typedef struct {
    prep_text_plan plan;
    prep_line_cutter cutter;
    prep_ahead *ahead; /* owned; NULL before the first block */
} prep_text_blocks;

/* The next block from the input's present place on; from the first call on, the input is in use by
 * other threads until prep_text_blocks_stop().
 * out      borrowed until the next call; NULL at the end
 * errors   MOSPT_EIO, MOSPT_ENOMEM */
bool prep_text_blocks_next(prep_text_blocks *blocks, prep_input *input, prep_text_block **out,
                           mospt_err *err);
void prep_text_blocks_stop(prep_text_blocks *blocks);

/* A comment, which may start with blanks. */
bool prep_text_is_comment(const char *text, const char *end);

/* Takes the mark off that some programs put in front of UTF-8. */
void prep_text_strip_mark(const char **text, size_t *length);
