#include "preprocess/lines.h"

#include <stdlib.h>
#include <string.h>

bool prep_lines_init(prep_lines *lines, prep_input *input, size_t capacity, uint64_t number,
                     mospt_err *err)
{
    *lines = (prep_lines){.input = input, .capacity = capacity, .number = number};
    lines->buffer = malloc(capacity);
    return lines->buffer != NULL || mospt_err_nomem(err, capacity);
}

void prep_lines_fini(prep_lines *lines)
{
    free(lines->buffer);
    *lines = (prep_lines){0};
}

static bool refill(prep_lines *lines, mospt_err *err)
{
    size_t kept = lines->end - lines->begin, got;
    memmove(lines->buffer, lines->buffer + lines->begin, kept);
    lines->begin = 0;
    lines->end = kept;
    if (!prep_input_read(lines->input, lines->buffer + kept, lines->capacity - kept, &got, err))
        return false;
    lines->end += got;
    lines->is_last = got < lines->capacity - kept;
    return true;
}

bool prep_lines_next(prep_lines *lines, const char **text, size_t *length, mospt_err *err)
{
    char *newline = NULL;
    size_t kept = lines->end - lines->begin;
    if (kept > 0) newline = memchr(lines->buffer + lines->begin, '\n', kept);
    if (newline == NULL && !lines->is_last) {
        if (!refill(lines, err)) return false;
        if (lines->end > kept) newline = memchr(lines->buffer + kept, '\n', lines->end - kept);
    }
    *text = NULL;
    *length = 0;
    if (lines->begin == lines->end) return true;

    char *begin = lines->buffer + lines->begin;
    char *end = newline != NULL ? newline : lines->buffer + lines->end;
    lines->begin = (size_t)(end - lines->buffer) + (newline != NULL);
    if (!lines->in_long_line) lines->number++;
    lines->in_long_line = newline == NULL;
    if (end > begin && end[-1] == '\r') end--;
    *text = begin;
    *length = (size_t)(end - begin);
    return true;
}
