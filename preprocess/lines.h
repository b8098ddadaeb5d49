/* preprocess/lines.h - a text input line by line, in a buffer of fixed size. */
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
