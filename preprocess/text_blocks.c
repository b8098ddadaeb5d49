#include "preprocess/text.h"

#include <ctype.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

bool prep_text_is_comment(const char *text, const char *end)
{
    const char *p = text;
    while (p < end && (*p == ' ' || *p == '\t'))
        p++;
    if (p == end) return false;
    /* a semicolon may as well stand behind an empty column */
    if (*p == ';')
        return p + 1 == end || ((p[1] == ' ' || p[1] == ';' || isalpha((unsigned char)p[1])) &&
                                memchr(p + 2, ';', (size_t)(end - p - 2)) == NULL);
    return *p == '#' || *p == '%' || *p == 26 || (*p == '/' && p + 1 < end && p[1] == '/');
}

void prep_text_strip_mark(const char **text, size_t *length)
{
    if (*length < 3 || memcmp(*text, "\xef\xbb\xbf", 3) != 0) return;
    *text += 3;
    *length -= 3;
}

/* NaN fits no integer, but a colour that is not there may be black. */
static bool fits(const prep_text_target *t, double value)
{
    if (!t->is_integer) return !(fabs(value) > t->high) || isinf(value);
    return (value >= t->low && value <= t->high && value == (double)(int64_t)value) ||
           ((t->is_shown || t->is_optional) && isnan(value));
}

/* The types were chosen from a sample; what it did not show must not be lost without a word. */
static void tell_misfit(prep_text_block *block, const prep_text_target *t, double value,
                        uint64_t line)
{
    if (block->fault_line > 0) return;
    block->fault_line = line;
    if (t->is_shown && t->high == 0)
        snprintf(block->fault, sizeof block->fault,
                 "%s %.9g is lost: in the sample of the lines, it was always 0", t->name, value);
    else
        snprintf(block->fault, sizeof block->fault,
                 "%s %.9g does not fit %s, chosen from a sample of the lines", t->name, value,
                 mospt_type_name(t->type));
}

static void store(const prep_text_plan *plan, const double *values, uint64_t line,
                  prep_text_block *block)
{
    prep_batch *batch = &block->points;
    size_t i = batch->count++;
    uint8_t *rgbi = batch->rgbi + 4 * i;
    for (int a = 0; a < 3; a++)
        batch->xyz[3 * i + (size_t)a] = values[plan->xyz[a]];
    bool has_tone = plan->intensity >= 0 && !plan->tone.is_flat &&
                    !(plan->intensity >= (int)plan->needed && isnan(values[plan->intensity]));
    memset(rgbi, has_tone ? prep_tone_apply(&plan->tone, values[plan->intensity]) : 255, 4);
    bool has_colour =
        plan->rgb_scale > 0 && !(plan->rgb[0] >= (int)plan->needed && isnan(values[plan->rgb[0]]));
    if (has_colour) {
        prep_scale scale = {.scale = plan->rgb_scale};
        for (int c = 0; c < 3; c++)
            rgbi[c] = prep_scale_apply(&scale, values[plan->rgb[c]]);
    }
    for (uint32_t k = 0; k < plan->target_count; k++) {
        const prep_text_target *t = &plan->target[k];
        double value = values[t->column];
        if (!fits(t, value)) tell_misfit(block, t, value, line);
        if (t->is_shown) continue;
        uint8_t *out = batch->plane[t->plane] + i * batch->plane_size[t->plane];
        mospt_type_write(t->type, value, out + t->component * mospt_type_size(t->type));
    }
}

/* A line that is no point: a count that announces the next points, or one that cannot be read. */
static void take_other(const prep_text_plan *plan, uint32_t columns, const double *values,
                       uint64_t words, const prep_line_cursor *cursor, prep_text_block *block)
{
    if (plan->has_counts && columns == 1 && words == 0 && values[0] >= 0 && values[0] < 1e15) {
        block->declared += (uint64_t)values[0];
        block->count_line = cursor->number;
        return;
    }
    block->unreadable++;
    if (block->fault_line > 0) return;
    block->fault_line = cursor->number;
    if (block->lines.fault != NULL && cursor->at == block->lines.size) /* the line that it cut */
        snprintf(block->fault, sizeof block->fault, "%s", block->lines.fault);
    else
        snprintf(block->fault, sizeof block->fault, "not a point: %u column%s%s, %u are needed",
                 columns, columns == 1 ? "" : "s",
                 (words & plan->needed_mask) != 0 ? " with words" : "", plan->needed);
}

/* Room for the points of as many bytes. A column takes a byte at least, and so does a line's end.
 */
static bool make_room(const prep_text_plan *plan, prep_text_block *block, mospt_err *err)
{
    uint32_t most = (uint32_t)(block->lines.size / (plan->needed + 1)) + 1;
    block->points.count = 0;
    if (block->points.capacity >= most) return true;
    prep_batch_fini(&block->points);
    return prep_batch_init(&block->points, plan->schema, most, err);
}

static bool parse(const void *context, void *memory, mospt_err *err)
{
    const prep_text_plan *plan = &((const prep_text_blocks *)context)->plan;
    prep_text_block *block = memory;
    prep_line_cursor cursor = {0};
    const char *line;
    size_t length;
    block->handed_out = 0;
    block->unreadable = block->declared = block->count_line = block->fault_line = 0;
    if (!make_room(plan, block, err)) return false;
    while (prep_line_block_next(&block->lines, &cursor, &line, &length)) {
        double values[PREP_TEXT_COLUMNS_MAX];
        uint64_t words;
        if (cursor.number == 1) prep_text_strip_mark(&line, &length);
        if (prep_text_is_comment(line, line + length)) continue;
        uint32_t columns = prep_text_split(line, line + length, values, &words);
        if (columns == 0 || (cursor.number <= plan->header_line && words != 0)) continue;
        for (uint32_t c = columns; c < plan->known; c++)
            values[c] = (double)NAN;
        bool is_point = columns >= plan->needed && columns <= PREP_TEXT_COLUMNS_MAX &&
                        (words & plan->needed_mask) == 0;
        if (is_point) store(plan, values, cursor.number, block);
        else take_other(plan, columns, values, words, &cursor, block);
    }
    return true;
}

static bool fill(void *context, void *block, bool *is_last, mospt_err *err)
{
    prep_text_blocks *blocks = context;
    prep_line_block *lines = &((prep_text_block *)block)->lines;
    if (!prep_line_cutter_next(&blocks->cutter, lines, err)) return false;
    *is_last = lines->is_last;
    return true;
}

static void fini(void *memory)
{
    prep_text_block *block = memory;
    prep_line_block_fini(&block->lines);
    prep_batch_fini(&block->points);
}

bool prep_text_blocks_next(prep_text_blocks *blocks, prep_input *input, prep_text_block **out,
                           mospt_err *err)
{
    if (blocks->ahead == NULL) {
        prep_ahead_task task = {blocks, sizeof(prep_text_block), fill, parse, fini};
        prep_line_cutter_init(&blocks->cutter, input, 0);
        if (!prep_ahead_create(&task, prep_line_threads(input), &blocks->ahead, err)) return false;
    }
    void *block;
    if (!prep_ahead_next(blocks->ahead, &block, err)) return false;
    *out = block;
    return true;
}

void prep_text_blocks_stop(prep_text_blocks *blocks)
{
    prep_ahead_destroy(blocks->ahead);
    prep_line_cutter_fini(&blocks->cutter);
    blocks->ahead = NULL;
}
