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

/* Whether a line is written with decimal commas: "1,5;2,5;3" or "1,5 2,5 3,5" or "\"1,5\",\"2,5\"".
 */
bool prep_text_has_decimal_commas(const char *text, const char *end);

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

enum {
    PREP_TEXT_SAMPLE_MAX = 2048,
    PREP_TEXT_QUOTE_SIZE = 60, /* of a line, in a message */
};

/* The lines that are looked at before the columns are understood: those of the start, and some from
 * all over the file. */
typedef struct {
    double (*values)[PREP_TEXT_COLUMNS_MAX]; /* [PREP_TEXT_SAMPLE_MAX], owned */
    uint64_t words[PREP_TEXT_SAMPLE_MAX];
    uint64_t line[PREP_TEXT_SAMPLE_MAX]; /* 0: not known */
    bool is_behind_head;
    const char *fault; /* why the data end early; NULL: they do not */
    uint32_t columns[PREP_TEXT_SAMPLE_MAX];
    uint32_t count;
    uint32_t decimal_commas; /* lines that have them */
    uint32_t split_lines;    /* lines with the line ends of old Macintoshes in them */
    bool is_counted;         /* the first line of numbers is a single integer */
    uint64_t counted;        /* points announced in the lines looked at */
    uint32_t count_lines;
    char first[PREP_TEXT_QUOTE_SIZE + 1]; /* start of the first line that is no comment */
    uint64_t first_line, header_line;
    char names[PREP_TEXT_COLUMNS_MAX][PREP_TEXT_NAME_MAX];
    uint32_t name_count;
    char comment[PREP_TEXT_COLUMNS_MAX]
                [PREP_TEXT_NAME_MAX]; /* names in the last comment before the points */
    uint32_t comment_count;
    prep_text_range range[PREP_TEXT_COLUMNS_MAX];
    uint32_t mode; /* the usual number of columns */
} prep_text_sample;

/* Looks at the lines, and goes back to the start.
 * sample   zeroed, with room for values
 * errors   MOSPT_EIO, MOSPT_ENOMEM */
bool prep_text_sample_take(prep_text_sample *sample, prep_input *input, mospt_err *err);

/* Finds the usual number of columns, and the range of each. */
void prep_text_sample_measure(prep_text_sample *sample);

/* Lines of so many columns. */
void prep_text_sample_count(const prep_text_sample *sample,
                            uint32_t lines[PREP_TEXT_COLUMNS_MAX + 2]);

/* Whether so many lines are one in twenty, and not just the last one of a file that was cut. */
bool prep_text_sample_is_share(const prep_text_sample *sample, uint32_t lines);

/* Whether a line tells of a column: one that is broken does not, one of another block does. */
bool prep_text_sample_tells(const prep_text_sample *sample, uint32_t line, uint32_t column);

/* Where the values of a column go in a batch, and what they were in the sample. */
typedef struct {
    uint32_t column, plane, component;
    bool is_shown;    /* colour of bytes: it is in the batch already, and only checked here */
    bool is_optional; /* lines may end before it */
    mospt_type type;
    double low, high; /* what `type` holds, and the sample held */
    bool is_integer;
    const char *name; /* borrowed from the schema */
} prep_text_target;

/* How lines become points. */
typedef struct {
    uint32_t needed;      /* columns that a line must have */
    uint32_t known;       /* columns in use; lines of another block may have fewer (PTS) */
    uint64_t needed_mask; /* those of them that must be no word */
    uint64_t header_line; /* number of the last line of names, units and titles; 0: there is none */
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

/* A comment, which may start with blanks, or the mark that DOS puts at the end of a file. */
bool prep_text_is_comment(const char *text, const char *end);

/* Takes the mark off that some programs put in front of UTF-8. */
void prep_text_strip_mark(const char **text, size_t *length);
