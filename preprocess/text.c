#include "preprocess/text.h"

#include <ctype.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    LINE_BUFFER_SIZE = 256 * 1024,
    SAMPLE_HEAD = 1024, /* lines from the start of the file */
    SAMPLE_PLACES = 16, /* and some from places spread evenly over the rest */
    SAMPLE_LINES = 64,
    QUOTE_SIZE = 60, /* of a line, in a message */
    SAMPLE_MAX = SAMPLE_HEAD + SAMPLE_PLACES * SAMPLE_LINES,
};

typedef struct {
    prep_text_columns columns;
    prep_text_blocks blocks;
    prep_text_block *block; /* borrowed: the one whose points are being handed out */
    uint64_t declared, taken, count_line, last_line;
    const char *fault;
    bool is_at_end;
} text_state;

/* The lines that are looked at before the columns are understood. */
typedef struct {
    double (*values)[PREP_TEXT_COLUMNS_MAX]; /* [SAMPLE_MAX], owned */
    uint64_t words[SAMPLE_MAX];
    uint32_t columns[SAMPLE_MAX];
    uint32_t count;
    uint32_t decimal_commas; /* lines that have them */
    bool is_counted;         /* the first line of numbers is a single integer */
    uint64_t counted;        /* points announced in the lines looked at */
    uint32_t count_lines;
    char first[QUOTE_SIZE + 1]; /* start of the first line that is no comment */
    uint64_t first_line, header_line;
    char names[PREP_TEXT_COLUMNS_MAX][PREP_TEXT_NAME_MAX];
    uint32_t name_count;
    char comment[PREP_TEXT_COLUMNS_MAX]
                [PREP_TEXT_NAME_MAX]; /* names in the last comment before the points */
    uint32_t comment_count;
    prep_text_range range[PREP_TEXT_COLUMNS_MAX];
    uint32_t mode; /* the usual number of columns */
} text_sample;

/* "1,5;2,5;3,5" or "1,5 2,5 3,5": what separates is not the comma. */
static bool has_decimal_commas(const char *p, const char *end)
{
    int fields = 0;
    if (memchr(p, '.', (size_t)(end - p)) != NULL) return false;
    while (p < end) {
        while (p < end && (*p == ';' || *p == ' ' || *p == '\t'))
            p++;
        const char *start = p;
        int commas = 0, others = 0;
        for (; p < end && *p != ';' && *p != ' ' && *p != '\t'; p++) {
            commas += *p == ',';
            others += *p != ',' && !isdigit((unsigned char)*p) && *p != '-' && *p != '+';
        }
        if (p == start) break;
        bool is_number =
            others == 0 && commas == 1 && isdigit((unsigned char)p[-1]) && *start != ',';
        if (!is_number && (commas > 0 || others > 0)) return false;
        fields += is_number;
    }
    return fields >= 2;
}

static int popcount(uint64_t v)
{
    return __builtin_popcountll(v);
}

/* Before the first line of numbers: a line of words may name the columns. */
static bool take_as_names(text_sample *sample, const char *text, const char *end, uint64_t number,
                          uint32_t columns, uint64_t words)
{
    if (sample->count > 0 || sample->name_count > 0 || columns == 0) return false;
    if ((uint32_t)popcount(words) < (columns <= PREP_TEXT_COLUMNS_MAX ? columns : 1)) return false;
    sample->name_count = prep_text_split_names(text, end, sample->names);
    sample->header_line = number;
    return true;
}

/* The start of a line as it may be printed. */
static void quote(const char *text, size_t length, char out[QUOTE_SIZE + 1])
{
    size_t n = length < QUOTE_SIZE ? length : QUOTE_SIZE;
    for (size_t i = 0; i < n; i++)
        out[i] = text[i] >= ' ' && text[i] < 127 ? text[i] : text[i] == '\t' ? ' ' : '?';
    out[n] = '\0';
}

static void take_line(text_sample *sample, const char *text, size_t length, uint64_t number)
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
    if (take_as_names(sample, text, end, number, columns, sample->words[i])) return;
    double count = sample->values[i][0];
    if (columns == 1 && sample->words[i] == 0 && count >= 0 && count == floor(count) &&
        (i == 0 || sample->is_counted)) {
        sample->is_counted = true;
        sample->count_lines++;
        if (count < 1e15) sample->counted += (uint64_t)count;
        return;
    }
    sample->decimal_commas += has_decimal_commas(text, end);
    sample->columns[i] = columns;
    sample->count++;
}

static bool take_lines(prep_lines *lines, text_sample *sample, uint32_t limit, bool skip_first,
                       mospt_err *err)
{
    const char *text;
    size_t length;
    if (skip_first && !prep_lines_next(lines, &text, &length, err)) return false;
    for (uint32_t n = 0; n < limit && sample->count < SAMPLE_MAX; n++) {
        if (!prep_lines_next(lines, &text, &length, err)) return false;
        if (text == NULL) break;
        /* the piece of a line that the buffer cut off says nothing */
        if (lines->in_long_line && lines->begin == lines->end && !lines->is_last) continue;
        if (lines->number == 1) prep_text_strip_mark(&text, &length);
        take_line(sample, text, length, lines->number);
    }
    return true;
}

static bool take_sample(prep_scan *scan, text_sample *sample, mospt_err *err)
{
    prep_lines lines;
    uint64_t size = prep_input_size(scan->input);
    if (!prep_lines_init(&lines, scan->input, LINE_BUFFER_SIZE, 0, err)) return false;
    bool ok = take_lines(&lines, sample, SAMPLE_HEAD, false, err);
    bool is_spread =
        sample->count > 0 && !prep_input_is_gzip(scan->input) && size > 4 * LINE_BUFFER_SIZE;
    prep_lines_fini(&lines);
    for (uint64_t k = 1; ok && is_spread && k < SAMPLE_PLACES; k++) {
        ok = prep_input_seek(scan->input, size / SAMPLE_PLACES * k, err) &&
             prep_lines_init(&lines, scan->input, 16 * 1024, 0, err);
        if (!ok) break;
        ok = take_lines(&lines, sample, SAMPLE_LINES, true, err);
        prep_lines_fini(&lines);
    }
    return ok && prep_input_seek(scan->input, 0, err);
}

static uint32_t usual_columns(const text_sample *sample)
{
    uint32_t votes[PREP_TEXT_COLUMNS_MAX + 2] = {0}, best = 0;
    for (uint32_t i = 0; i < sample->count; i++)
        votes[sample->columns[i]]++;
    for (uint32_t c = 1; c <= PREP_TEXT_COLUMNS_MAX; c++) {
        if (votes[c] > votes[best]) best = c;
    }
    return best;
}

static void find_range(const text_sample *sample, uint32_t c, prep_text_range *out)
{
    uint32_t numbers = 0, words = 0;
    *out = (prep_text_range){.min = (double)NAN, .max = (double)NAN, .is_integer = true};
    for (uint32_t i = 0; i < sample->count; i++) {
        if (sample->columns[i] != sample->mode) continue;
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

/* What a person would say of lines that are no points. */
static bool refuse(const prep_scan *scan, const text_sample *sample, mospt_err *err)
{
    mospt_where at = mospt_at_line(scan->path, sample->first_line);
    if (sample->mode > 0 && sample->mode < 3)
        return mospt_err_set(err, MOSPT_EFORMAT, at, "%u column%s, a point needs x, y and z",
                             sample->mode, sample->mode == 1 ? "" : "s");
    return mospt_err_set(err, MOSPT_EFORMAT, at, "not lines of numbers: `%s`", sample->first);
}

static bool check_sample(const prep_scan *scan, const text_sample *sample, bool has_names,
                         mospt_err *err)
{
    if (sample->count_lines > 1 && sample->count == 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(scan->path, sample->first_line),
                             "1 column, a point needs x, y and z");
    if (sample->count == 0 && (has_names || sample->is_counted))
        return mospt_err_set(err, MOSPT_EEMPTY, mospt_at_file(scan->path),
                             "the text file holds no points");
    if (sample->count == 0) return refuse(scan, sample, err);
    if (sample->decimal_commas * 2 > sample->count)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(scan->path, sample->first_line),
                             "decimal commas are not read; write the numbers with points");
    return true;
}

/* Most lines must be points; one may always be something else, such as the last one of a file that
 * was cut. */
static bool check_share(const prep_scan *scan, const text_sample *sample, const text_state *text,
                        mospt_err *err)
{
    const prep_text_plan *plan = &text->blocks.plan;
    uint32_t good = 0;
    for (uint32_t i = 0; i < sample->count; i++) {
        bool ok = sample->columns[i] >= plan->needed &&
                  sample->columns[i] <= PREP_TEXT_COLUMNS_MAX &&
                  (sample->words[i] & plan->needed_mask) == 0;
        good += ok;
    }
    uint32_t bad = sample->count - good;
    return (good > 0 && (bad <= 1 || bad * 20 <= sample->count)) || refuse(scan, sample, err);
}

static bool columns_from_option(const prep_scan *scan, const char *option,
                                const text_sample *sample, prep_text_columns *out, mospt_err *err)
{
    char names[PREP_TEXT_COLUMNS_MAX][PREP_TEXT_NAME_MAX];
    uint32_t count = prep_text_split_names(option, option + strlen(option), names);
    if (!prep_text_columns_from_names(names, count, out))
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(scan->path),
                             "the columns `%.200s` name no x, y and z", option);
    if (count > sample->mode)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(scan->path, sample->first_line),
                             "%u columns, `%.200s` names %u", sample->mode, option, count);
    return true;
}

static bool columns_from_names(const prep_scan *scan, const text_sample *sample,
                               prep_text_columns *out, bool *is_title, mospt_err *err)
{
    char names[PREP_TEXT_COLUMNS_MAX][PREP_TEXT_NAME_MAX];
    memcpy(names, sample->names, sizeof names);
    *is_title = false;
    if (prep_text_columns_from_names(names, sample->name_count, out)) return true;
    /* words that do not go with the columns are a title, not their names */
    *is_title = sample->count > 0 && sample->name_count != sample->mode && sample->mode >= 3;
    return *is_title ||
           mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(scan->path, sample->header_line),
                         "neither points nor names of columns with x, y and z: `%s`",
                         sample->first);
}

static bool understand_columns(prep_scan *scan, text_sample *sample, const char *option,
                               text_state *text, mospt_err *err)
{
    prep_text_plan *plan = &text->blocks.plan;
    prep_text_columns *columns = &text->columns;
    bool has_names = sample->name_count > 0, is_title = false;
    sample->mode = usual_columns(sample);
    for (uint32_t c = 0; c < sample->mode; c++)
        find_range(sample, c, &sample->range[c]);
    if (has_names && option == NULL) {
        if (!columns_from_names(scan, sample, columns, &is_title, err)) return false;
        has_names = !is_title;
    }
    if (!check_sample(scan, sample, has_names, err)) return false;
    plan->header_line = is_title ? 0 : sample->header_line;
    if (option != NULL) return columns_from_option(scan, option, sample, columns, err);
    if (has_names) return true;
    if (sample->mode < 3) return refuse(scan, sample, err);
    if (sample->comment_count == sample->mode &&
        prep_text_columns_from_names(sample->comment, sample->comment_count, columns))
        return true;
    if (!prep_text_columns_from_extension(scan->path, sample->mode, columns))
        prep_text_columns_guess(sample->range, sample->mode, columns);
    return true;
}

static const struct {
    mospt_type type;
    double low, high;
} integers[] = {{MOSPT_U8, 0, 255},
                {MOSPT_U16, 0, 65535},
                {MOSPT_I16, -32768, 32767},
                {MOSPT_I32, -2147483648.0, 2147483647.0}};
enum { INTEGER_COUNT = sizeof integers / sizeof integers[0] };

/* The type in which every value of the sample keeps its own, also those that are missing. */
static mospt_type fit_type(const prep_text_range *r, mospt_type wanted, bool is_intensity)
{
    if (wanted == MOSPT_F32 || wanted == MOSPT_F64) return wanted;
    for (size_t i = 0; i < INTEGER_COUNT && r->is_integer && !r->has_gaps; i++) {
        mospt_type type = integers[i].type;
        bool is_wanted = is_intensity ? type != MOSPT_U8 : type == wanted;
        if (is_wanted && r->min >= integers[i].low && r->max <= integers[i].high) return type;
    }
    bool is_wide = r->max > 1 << FLT_MANT_DIG || r->min < -(1 << FLT_MANT_DIG);
    return is_intensity && !is_wide ? MOSPT_F32 : MOSPT_F64;
}

static void set_limits(prep_text_target *target)
{
    target->low = -DBL_MAX;
    target->high = target->type == MOSPT_F32 ? (double)FLT_MAX : DBL_MAX;
    for (size_t i = 0; i < INTEGER_COUNT; i++) {
        if (integers[i].type != target->type) continue;
        target->is_integer = true;
        target->low = integers[i].low;
        target->high = integers[i].high;
    }
}

static void add_target(prep_scan *scan, text_state *text, const char *name, mospt_type type,
                       const int *columns, uint32_t components)
{
    prep_text_plan *plan = &text->blocks.plan;
    int plane = prep_scan_add_attribute(scan, name, type, components);
    for (uint32_t c = 0; c < components && plane >= 0; c++) {
        prep_text_target *target = &plan->target[plan->target_count++];
        *target = (prep_text_target){.column = (uint32_t)columns[c],
                                     .plane = (uint32_t)plane,
                                     .component = c,
                                     .type = type,
                                     .name = scan->info.attributes.at[plane].name};
        set_limits(target);
    }
}

/* A colour of bytes, or none at all, has no plane of its own. */
static void add_shown_colour(prep_scan *scan, text_state *text)
{
    prep_text_plan *plan = &text->blocks.plan;
    for (int k = 0; k < 3; k++)
        plan->target[plan->target_count++] =
            (prep_text_target){.column = (uint32_t)plan->rgb[k],
                               .is_shown = true,
                               .type = MOSPT_U8,
                               .high = scan->info.has_rgb ? 255 : 0,
                               .is_integer = true,
                               .name = "colour"};
}

static void add_colour(prep_scan *scan, text_state *text, const text_sample *sample)
{
    prep_text_plan *plan = &text->blocks.plan;
    double low = 0, max = 0;
    bool is_integer = true;
    for (int k = 0; k < 3; k++) {
        const prep_text_range *r = &sample->range[plan->rgb[k]];
        if (r->max > max) max = r->max;
        if (r->min < low) low = r->min;
        is_integer = is_integer && r->is_integer;
    }
    plan->rgb_scale = !is_integer && max <= 1 ? 255 : max > 255 ? 255.0 / 65535 : 1;
    scan->info.has_rgb = max > 0;
    if (!scan->info.has_rgb) {
        plan->rgb_scale = 0;
        add_shown_colour(scan, text);
    } else if (is_integer && max > 255 && max <= 65535 && low >= 0)
        add_target(scan, text, "rgb", MOSPT_U16, plan->rgb, 3);
    else if (!is_integer || max > 65535 || low < 0)
        add_target(scan, text, "rgb_float", MOSPT_F32, plan->rgb, 3);
    else add_shown_colour(scan, text);
}

static bool add_intensity(prep_scan *scan, text_state *text, const text_sample *sample,
                          mospt_err *err)
{
    prep_text_plan *plan = &text->blocks.plan;
    double *values = malloc(SAMPLE_MAX * sizeof *values);
    if (values == NULL) return mospt_err_nomem(err, SAMPLE_MAX * sizeof *values);
    size_t n = 0;
    for (uint32_t i = 0; i < sample->count; i++) {
        if (sample->columns[i] == sample->mode) values[n++] = sample->values[i][plan->intensity];
    }
    plan->tone = prep_tone_make(values, n);
    free(values);
    scan->info.has_intensity = !plan->tone.is_flat;
    mospt_type type = fit_type(&sample->range[plan->intensity], MOSPT_U16, true);
    add_target(scan, text, "intensity", type, &plan->intensity, 1);
    return true;
}

/* All three or none: a line of names may be longer than the lines below it. */
static void find_three(const prep_text_columns *columns, prep_text_meaning first, int out[3])
{
    bool is_whole = true;
    for (int k = 0; k < 3; k++) {
        out[k] = prep_text_columns_find(columns, (prep_text_meaning)((int)first + k));
        is_whole = is_whole && out[k] >= 0;
    }
    if (!is_whole) out[0] = out[1] = out[2] = -1;
}

static bool make_planes(prep_scan *scan, text_state *text, const text_sample *sample,
                        mospt_err *err)
{
    prep_text_plan *plan = &text->blocks.plan;
    const prep_text_columns *columns = &text->columns;
    int normal[3];
    find_three(columns, PREP_TEXT_X, plan->xyz);
    find_three(columns, PREP_TEXT_R, plan->rgb);
    find_three(columns, PREP_TEXT_NX, normal);
    plan->intensity = prep_text_columns_find(columns, PREP_TEXT_INTENSITY);
    if (plan->intensity >= 0 && !add_intensity(scan, text, sample, err)) return false;
    if (plan->rgb[0] >= 0) add_colour(scan, text, sample);
    if (normal[0] >= 0) add_target(scan, text, "normal", MOSPT_F32, normal, 3);
    for (uint32_t c = 0; c < columns->count; c++) {
        int column = (int)c;
        if (columns->column[c].meaning != PREP_TEXT_ATTRIBUTE) continue;
        mospt_type type = fit_type(&sample->range[c], columns->column[c].type, false);
        add_target(scan, text, columns->column[c].name, type, &column, 1);
    }
    return true;
}

/* Columns of labels cannot be kept; columns at the end of the names that no line has are none. */
static void find_needed(text_state *text, const text_sample *sample)
{
    prep_text_plan *plan = &text->blocks.plan;
    prep_text_columns *columns = &text->columns;
    if (columns->count > sample->mode) columns->count = sample->mode;
    for (uint32_t c = 0; c < columns->count; c++) {
        prep_text_meaning *meaning = &columns->column[c].meaning;
        if (*meaning == PREP_TEXT_ATTRIBUTE && sample->range[c].is_word) *meaning = PREP_TEXT_SKIP;
        if (*meaning == PREP_TEXT_SKIP) continue;
        plan->needed = c + 1;
        plan->needed_mask |= 1ull << c;
    }
}

static bool understand(prep_scan *scan, text_sample *sample, const char *option, text_state *text,
                       mospt_err *err)
{
    if (!understand_columns(scan, sample, option, text, err)) return false;
    find_needed(text, sample);
    if (!check_share(scan, sample, text, err)) return false;
    for (int m = PREP_TEXT_X; m <= PREP_TEXT_Z; m++) {
        if (prep_text_columns_find(&text->columns, (prep_text_meaning)m) < 0)
            return refuse(scan, sample, err);
    }
    text->blocks.plan.has_counts = sample->is_counted;
    text->blocks.plan.schema = &scan->info.attributes;
    uint64_t room = prep_input_size(scan->input) / 6 +
                    1; /* a point takes at least "0 0 0" and the end of a line */
    if (sample->counted < room) scan->info.point_count = sample->counted;
    snprintf(scan->info.format, sizeof scan->info.format, "text, %u columns", sample->mode);
    scan->info.is_text = true;
    return make_planes(scan, text, sample, err);
}

static bool text_open(prep_scan *scan, uint32_t index, const prep_scan_options *options,
                      mospt_err *err)
{
    (void)index;
    text_state *text = calloc(1, sizeof *text);
    if (text == NULL) return mospt_err_nomem(err, sizeof *text);
    scan->state = text;
    text_sample *sample = calloc(1, sizeof *sample);
    if (sample == NULL) return mospt_err_nomem(err, sizeof *sample);
    sample->values = malloc((SAMPLE_MAX + 1) * sizeof *sample->values);
    bool ok =
        sample->values != NULL || mospt_err_nomem(err, (SAMPLE_MAX + 1) * sizeof *sample->values);
    ok = ok && take_sample(scan, sample, err) &&
         understand(scan, sample, options->columns, text, err);
    free(sample->values);
    free(sample);
    return ok;
}

/* Adds up what a new block holds besides points. */
static void account(prep_scan *scan, text_state *text, const prep_text_block *block)
{
    scan->dropped[PREP_DROP_UNREADABLE] += block->unreadable;
    text->taken += block->points.count + block->unreadable; /* it is there, though of no use */
    text->declared += block->declared;
    if (block->count_line > 0) text->count_line = block->count_line;
    text->last_line = block->lines.last_line;
    if (block->lines.fault != NULL) text->fault = block->lines.fault;
    if (block->fault_line > 0)
        prep_scan_set_damage(scan, mospt_at_line(scan->path, block->fault_line), "%s",
                             block->fault);
}

static void finish(prep_scan *scan, text_state *text)
{
    text->is_at_end = true;
    if (text->fault != NULL)
        prep_scan_set_damage(scan, mospt_at_line(scan->path, text->last_line), "%s", text->fault);
    if (text->taken < text->declared)
        prep_scan_set_damage(scan, mospt_at_line(scan->path, text->count_line),
                             "%" PRIu64 " points are announced, %" PRIu64 " are there",
                             text->declared, text->taken);
}

/* Copies points of the block to the batch, as many as it has room for. */
static void hand_out(prep_text_block *block, prep_batch *batch)
{
    const prep_batch *from = &block->points;
    size_t first = block->handed_out, at = batch->count, n = from->count - first;
    if (n > batch->capacity - at) n = batch->capacity - at;
    memcpy(batch->xyz + 3 * at, from->xyz + 3 * first, n * 3 * sizeof *batch->xyz);
    memcpy(batch->rgbi + 4 * at, from->rgbi + 4 * first, n * 4);
    for (uint32_t k = 0; k < batch->plane_count; k++) {
        size_t size = batch->plane_size[k];
        memcpy(batch->plane[k] + at * size, from->plane[k] + first * size, n * size);
    }
    batch->count += (uint32_t)n;
    block->handed_out += (uint32_t)n;
}

static bool text_read(prep_scan *scan, prep_batch *batch, mospt_err *err)
{
    text_state *text = scan->state;
    while (batch->count < batch->capacity && !text->is_at_end) {
        if (text->block != NULL && text->block->handed_out < text->block->points.count) {
            hand_out(text->block, batch);
            continue;
        }
        if (!prep_text_blocks_next(&text->blocks, scan->input, &text->block, err)) return false;
        if (text->block != NULL) account(scan, text, text->block);
        else finish(scan, text);
    }
    return true;
}

static void stop(text_state *text)
{
    prep_text_blocks_stop(&text->blocks);
    text->block = NULL;
    text->declared = text->taken = text->count_line = text->last_line = 0;
    text->fault = NULL;
    text->is_at_end = false;
}

static bool text_rewind(prep_scan *scan, mospt_err *err)
{
    stop(scan->state);
    return prep_input_seek(scan->input, 0, err);
}

static void text_close(prep_scan *scan)
{
    text_state *text = scan->state;
    if (text == NULL) return;
    stop(text);
    free(text);
}

const prep_scan_format prep_text_format = {text_open, text_read, text_rewind, text_close};
