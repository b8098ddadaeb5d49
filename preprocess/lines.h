/* preprocess/lines.h - a text input line by line, in a buffer of fixed size; or in blocks of whole
 * lines, which several threads can take apart. */
#pragma once
#include "preprocess/input.h"

typedef struct {
    prep_input *input; /* borrowed */
    char *buffer;      /* [capacity], owned */
    size_t capacity, begin, end;
    uint64_t number; /* of the line last returned, counted from 1 */
    bool is_last;    /* the input has nothing more than what is in the buffer */
    bool in_long_line;
} prep_lines;

/* Starts at the input's present place, which `number` lines precede. */
bool prep_lines_init(prep_lines *lines, prep_input *input, size_t capacity, uint64_t number,
                     mospt_err *err);
void prep_lines_fini(prep_lines *lines);

/* The next line, without its end (LF, CR LF). A line longer than the buffer comes in pieces under
 * one number. text     out, [*length], valid until the next call; NULL at the end of the input
 * errors   MOSPT_EIO, MOSPT_ENOMEM */
bool prep_lines_next(prep_lines *lines, const char **text, size_t *length, mospt_err *err);

enum {
    PREP_LINE_BLOCK_SIZE = 1 << 20,   /* smaller ones lose in changes of thread what they gain */
    PREP_LINE_THREADS_SIZE = 2 << 20, /* of a file, from which on threads are worth their start */
};

/* Lines of a text. A line that is longer than a block comes in pieces, each a block of its own but
 * for the last, which others may follow. */
typedef struct {
    char *text; /* [size], owned */
    size_t size, capacity;
    uint64_t line;      /* number of the last line that starts before it */
    uint64_t last_line; /* number of the last line that starts before its end */
    bool continues;     /* its first line starts before it */
    bool is_last;
    const char *fault; /* why the input ends with it too early; NULL if it does not */
} prep_line_block;

/* Cuts an input into blocks. */
typedef struct {
    prep_input *input; /* borrowed */
    char *kept;        /* [kept_size], owned: the start of a line whose end was not read yet */
    size_t kept_size, kept_capacity;
    uint64_t line;
    bool is_in_line;
} prep_line_cutter;

/* Starts at the input's present place, which `line` lines precede. */
void prep_line_cutter_init(prep_line_cutter *cutter, prep_input *input, uint64_t line);
void prep_line_cutter_fini(prep_line_cutter *cutter);

/* Reads the next block. A block with is_last may be empty.
 * block    zeroed, or from an earlier call
 * errors   MOSPT_EIO, MOSPT_ENOMEM */
bool prep_line_cutter_next(prep_line_cutter *cutter, prep_line_block *block, mospt_err *err);
void prep_line_block_fini(prep_line_block *block);

/* Walks over the lines of a block. */
typedef struct {
    size_t at;       /* byte of the block where the next line starts */
    uint64_t number; /* of the line last returned */
} prep_line_cursor;

/* The next line of a block, without its end; false behind the last one.
 * cursor   zeroed before the first call */
bool prep_line_block_next(const prep_line_block *block, prep_line_cursor *cursor, const char **text,
                          size_t *length);

/* Threads that are worth having for the lines of this input; 0: none. */
uint32_t prep_line_threads(const prep_input *input);
