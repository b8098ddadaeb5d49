#include "preprocess/lines.h"

#include "preprocess/ahead.h"

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

void prep_line_cutter_init(prep_line_cutter *cutter, prep_input *input, uint64_t line)
{
    *cutter = (prep_line_cutter){.input = input, .line = line};
}

void prep_line_cutter_fini(prep_line_cutter *cutter)
{
    free(cutter->kept);
    *cutter = (prep_line_cutter){0};
}

void prep_line_block_fini(prep_line_block *block)
{
    free(block->text);
    *block = (prep_line_block){0};
}

/* Sums of a byte each, as many as a byte can count, are what compilers make vectors of. */
static uint64_t count_newlines(const char *text, size_t size)
{
    uint64_t count = 0;
    for (size_t i = 0; i < size;) {
        size_t stop = size - i < UINT8_MAX ? size : i + UINT8_MAX;
        uint8_t part = 0;
        for (; i < stop; i++)
            part = (uint8_t)(part + (text[i] == '\n'));
        count += part;
    }
    return count;
}

/* Moves what follows the last end of a line out of the block, to the front of the next one. A line
 * that fills all of it stays. */
static bool keep_tail(prep_line_cutter *c, prep_line_block *block, mospt_err *err)
{
    const char *newline = memrchr(block->text, '\n', block->size);
    if (newline == NULL) return true;
    size_t whole = (size_t)(newline - block->text) + 1, rest = block->size - whole;
    if (c->kept_capacity < rest) {
        free(c->kept);
        c->kept = malloc(rest);
        c->kept_capacity = c->kept != NULL ? rest : 0;
        if (c->kept == NULL) return mospt_err_nomem(err, rest);
    }
    if (rest > 0) memcpy(c->kept, block->text + whole, rest);
    c->kept_size = rest;
    block->size = whole;
    return true;
}

bool prep_line_cutter_next(prep_line_cutter *c, prep_line_block *block, mospt_err *err)
{
    if (block->text == NULL) {
        block->text = malloc(PREP_LINE_BLOCK_SIZE);
        if (block->text == NULL) return mospt_err_nomem(err, PREP_LINE_BLOCK_SIZE);
        block->capacity = PREP_LINE_BLOCK_SIZE;
    }
    size_t got, want = block->capacity - c->kept_size;
    if (c->kept_size > 0) memcpy(block->text, c->kept, c->kept_size);
    if (!prep_input_read(c->input, block->text + c->kept_size, want, &got, err)) return false;
    block->size = c->kept_size + got;
    block->is_last = got < want;
    block->fault = block->is_last ? prep_input_fault(c->input) : NULL;
    c->kept_size = 0;
    if (!block->is_last && !keep_tail(c, block, err)) return false;

    bool is_whole = block->size > 0 && block->text[block->size - 1] == '\n';
    block->continues = c->is_in_line;
    block->line = c->line;
    if (block->size > 0)
        c->line += count_newlines(block->text, block->size) + !block->continues - is_whole;
    block->last_line = c->line;
    if (block->size > 0) c->is_in_line = !is_whole;
    return true;
}

bool prep_line_block_next(const prep_line_block *block, prep_line_cursor *cursor, const char **text,
                          size_t *length)
{
    if (cursor->at == block->size) return false;
    const char *begin = block->text + cursor->at, *stop = block->text + block->size;
    const char *end = memchr(begin, '\n', (size_t)(stop - begin));
    if (cursor->at == 0) cursor->number = block->line + !block->continues;
    else cursor->number++;
    cursor->at = end != NULL ? (size_t)(end - block->text) + 1 : block->size;
    if (end == NULL) end = stop;
    if (end > begin && end[-1] == '\r') end--;
    *text = begin;
    *length = (size_t)(end - begin);
    return true;
}

uint32_t prep_line_threads(const prep_input *input)
{
    /* text packs to about a quarter */
    uint64_t least =
        prep_input_is_gzip(input) ? PREP_LINE_THREADS_SIZE / 4 : PREP_LINE_THREADS_SIZE;
    return prep_input_size(input) < least ? 0 : prep_ahead_thread_count();
}
