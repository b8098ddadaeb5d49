#include "preprocess/text.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    LINE_BUFFER_SIZE = 256 * 1024,
    HEAD_LINES = 1024, /* from the start of the file */
    PLACES = 16,       /* and some from places spread evenly over the rest */
    PLACE_LINES = 64,
    PLACE_SIZE = 16 * 1024, /* bytes that hold as many lines */
    TAIL_SIZE = 2048,       /* the last place is as far from the end */
};
_Static_assert(HEAD_LINES + PLACES * PLACE_LINES == PREP_TEXT_SAMPLE_MAX, "room for all lines");

static bool are_names(const prep_text_sample *sample)
{
    char names[PREP_TEXT_COLUMNS_MAX][PREP_TEXT_NAME_MAX];
    prep_text_columns unused;
    memcpy(names, sample->names, sizeof names);
    return prep_text_columns_from_names(names, sample->name_count, &unused);
}

/* Before the first line of numbers: a line of words may name the columns, and have titles above it
 * and units below. */
static bool take_as_names(prep_text_sample *sample, const char *text, const char *end,
                          uint64_t number, uint32_t columns, uint64_t words)
{
    if (sample->count > 0 || columns == 0) return false;
    if ((uint32_t)__builtin_popcountll(words) < (columns <= PREP_TEXT_COLUMNS_MAX ? columns : 1))
        return false;
    if (sample->name_count == 0 || !are_names(sample))
        sample->name_count = prep_text_split_names(text, end, sample->names);
    sample->header_line = number;
    return true;
}

/* The start of a line as it may be printed. */
static void quote(const char *text, size_t length, char out[PREP_TEXT_QUOTE_SIZE + 1])
{
    size_t n = length < PREP_TEXT_QUOTE_SIZE ? length : PREP_TEXT_QUOTE_SIZE;
    for (size_t i = 0; i < n; i++)
        out[i] = text[i] >= ' ' && text[i] < 127 ? text[i] : text[i] == '\t' ? ' ' : '?';
    out[n] = '\0';
}

static void take_line(prep_text_sample *sample, const char *text, size_t length, uint64_t number)
{
    const char *end = text + length;
    if (prep_text_is_comment(text, end)) {
        if (sample->count == 0)
            sample->comment_count = prep_text_split_names(text, end, sample->comment);
        return;
    }
    uint32_t i = sample->count;
    uint32_t columns = prep_text_split(text, end, sample->values[i], &sample->words[i]);
    if (columns == 0) return;
    if (sample->first_line == 0) {
        sample->first_line = number;
        quote(text, length, sample->first);
    }
    bool has_decimal_commas = prep_text_has_decimal_commas(text, end);
    if (!has_decimal_commas && take_as_names(sample, text, end, number, columns, sample->words[i]))
        return;
    double count = sample->values[i][0];
    if (columns == 1 && sample->words[i] == 0 && count >= 0 && count == floor(count) &&
        (i == 0 || sample->is_counted)) {
        sample->is_counted = true;
        sample->count_lines++;
        if (count < 1e15) sample->counted += (uint64_t)count;
        return;
    }
    sample->decimal_commas += has_decimal_commas;
    sample->columns[i] = columns;
    sample->line[i] = sample->is_behind_head ? 0 : number;
    sample->count++;
}

/* A carriage return that ends a line by itself. */
static bool has_lone_return(const char *text, size_t length)
{
    const char *p = memchr(text, '\r', length);
    return p != NULL && p + 1 < text + length && p[1] != '\r';
}

static bool take_lines(prep_lines *lines, prep_text_sample *sample, uint32_t limit, bool skip_first,
                       mospt_err *err)
{
    const char *text;
    size_t length;
    if (skip_first && !prep_lines_next(lines, &text, &length, err)) return false;
    for (uint32_t n = 0; n < limit && sample->count < PREP_TEXT_SAMPLE_MAX; n++) {
        if (!prep_lines_next(lines, &text, &length, err)) return false;
        if (text == NULL) break;
        sample->split_lines += has_lone_return(text, length);
        /* the piece of a line that the buffer cut off says nothing */
        if (lines->in_long_line && lines->begin == lines->end && !lines->is_last) continue;
        if (lines->number == 1) prep_text_strip_mark(&text, &length);
        take_line(sample, text, length, lines->number);
    }
    return true;
}

/* Lines of the start, and from places all over the rest, none of them twice. */
bool prep_text_sample_take(prep_text_sample *sample, prep_input *input, mospt_err *err)
{
    prep_lines lines;
    uint64_t size = prep_input_size(input);
    if (!prep_lines_init(&lines, input, LINE_BUFFER_SIZE, 0, err)) return false;
    bool ok = take_lines(&lines, sample, HEAD_LINES, false, err);
    uint64_t end = prep_input_tell(input) - (lines.end - lines.begin);
    bool is_spread =
        sample->count > 0 && !prep_input_is_gzip(input) && !lines.in_long_line && end < size;
    prep_lines_fini(&lines);
    sample->is_behind_head = true;
    uint64_t tail = size - end < TAIL_SIZE ? size - end : TAIL_SIZE;
    uint64_t stride = is_spread ? (size - end - tail) / (PLACES - 1) : 0;
    for (uint64_t k = 0, place = end; ok && is_spread && k < PLACES; k++, place += stride) {
        if (place < end) place = end;
        ok = prep_input_seek(input, place, err) &&
             prep_lines_init(&lines, input, PLACE_SIZE, 0, err);
        if (!ok) break;
        ok = take_lines(&lines, sample, PLACE_LINES, place > end, err);
        end = prep_input_tell(input) - (lines.end - lines.begin);
        prep_lines_fini(&lines);
    }
    sample->fault = prep_input_fault(input);
    return ok && prep_input_seek(input, 0, err);
}

void prep_text_sample_count(const prep_text_sample *sample,
                            uint32_t votes[PREP_TEXT_COLUMNS_MAX + 2])
{
    memset(votes, 0, (PREP_TEXT_COLUMNS_MAX + 2) * sizeof *votes);
    for (uint32_t i = 0; i < sample->count; i++)
        votes[sample->columns[i]]++;
}

bool prep_text_sample_is_share(const prep_text_sample *sample, uint32_t lines)
{
    return lines > 1 && lines * 20 >= sample->count;
}

/* The blocks of a PTS file may differ: those with the most columns count. */
static uint32_t usual_columns(const prep_text_sample *sample)
{
    uint32_t votes[PREP_TEXT_COLUMNS_MAX + 2], best = 0;
    prep_text_sample_count(sample, votes);
    for (uint32_t c = 1; c <= PREP_TEXT_COLUMNS_MAX; c++) {
        if (votes[c] > votes[best] ||
            (sample->is_counted && prep_text_sample_is_share(sample, votes[c])))
            best = c;
    }
    return best;
}

bool prep_text_sample_tells(const prep_text_sample *sample, uint32_t i, uint32_t c)
{
    return sample->columns[i] == sample->mode ||
           (sample->is_counted && sample->columns[i] > c && sample->columns[i] < sample->mode);
}

static void find_range(const prep_text_sample *sample, uint32_t c, prep_text_range *out)
{
    uint32_t numbers = 0, words = 0;
    *out = (prep_text_range){.min = (double)NAN, .max = (double)NAN, .is_integer = true};
    for (uint32_t i = 0; i < sample->count; i++) {
        if (!prep_text_sample_tells(sample, i, c)) continue;
        bool is_word = sample->words[i] >> c & 1;
        words += is_word;
        double v = sample->values[i][c];
        if (!isfinite(v)) {
            out->has_gaps = out->has_gaps || !is_word;
            continue;
        }
        numbers++;
        if (!(v >= out->min)) out->min = v;
        if (!(v <= out->max)) out->max = v;
        out->is_integer = out->is_integer && v == floor(v);
    }
    out->is_integer = out->is_integer && numbers > 0;
    out->is_word = words > numbers;
}

void prep_text_sample_measure(prep_text_sample *sample)
{
    sample->mode = usual_columns(sample);
    for (uint32_t c = 0; c < sample->mode; c++)
        find_range(sample, c, &sample->range[c]);
}
