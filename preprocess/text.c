#include "preprocess/text.h"

#include <ctype.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    prep_text_columns columns;
    prep_text_blocks blocks;
    prep_text_block *block; /* borrowed: the one whose points are being handed out */
    uint64_t declared, taken, count_line, last_line;
    const char *fault;
    bool is_at_end;
} text_state;

/* What a person would say of lines that are no points. */
static bool refuse(const prep_scan *scan, const prep_text_sample *sample, mospt_err *err)
{
    mospt_where at = mospt_at_line(scan->path, sample->first_line);
    if (sample->fault != NULL) return mospt_err_set(err, MOSPT_EFORMAT, at, "%s", sample->fault);
    if (sample->first_line == 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(scan->path),
                             "no lines of numbers: nothing but comments and blank lines");
    if (sample->mode > 0 && sample->mode < 3)
        return mospt_err_set(err, MOSPT_EFORMAT, at, "%u column%s, a point needs x, y and z",
                             sample->mode, sample->mode == 1 ? "" : "s");
    return mospt_err_set(err, MOSPT_EFORMAT, at, "not lines of numbers: `%s`", sample->first);
}

/* Line ends and numbers as other machines and countries write them. */
static bool check_customs(const prep_scan *scan, const prep_text_sample *sample, mospt_err *err)
{
    mospt_where at = mospt_at_line(scan->path, sample->first_line);
    if (sample->split_lines * 2 > sample->count)
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "lines that end with CR alone, as on old Macintoshes, are not read; "
                             "write them with LF or CR LF");
    if (sample->decimal_commas * 4 > sample->count)
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "decimal commas are not read; write the numbers with points");
    return true;
}

static bool check_sample(const prep_scan *scan, const prep_text_sample *sample, bool has_names,
                         mospt_err *err)
{
    if (sample->count_lines > 1 && sample->count == 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(scan->path, sample->first_line),
                             "1 column, a point needs x, y and z");
    if (sample->count == 0 && (has_names || sample->is_counted))
        return mospt_err_set(err, MOSPT_EEMPTY, mospt_at_file(scan->path),
                             "the text file holds no points");
    return sample->count > 0 || refuse(scan, sample, err);
}

static bool is_point(const prep_text_sample *sample, uint32_t i, const prep_text_plan *plan)
{
    return sample->columns[i] >= plan->needed && sample->columns[i] <= PREP_TEXT_COLUMNS_MAX &&
           (sample->words[i] & plan->needed_mask) == 0;
}

/* Lines above the first point that are words for the most part: a title, a date, units.
 * returns  how many */
static uint32_t find_titles(const prep_text_sample *sample, prep_text_plan *plan)
{
    uint32_t n = 0;
    for (; n < sample->count && !is_point(sample, n, plan); n++) {
        uint32_t words = (uint32_t)__builtin_popcountll(sample->words[n]);
        if (words == 0 || 2 * words < sample->columns[n]) break;
        if (sample->line[n] > plan->header_line) plan->header_line = sample->line[n];
    }
    return n < sample->count ? n : 0;
}

/* Most lines must be points; one may always be something else, such as the last one of a file that
 * was cut. */
static bool check_share(const prep_scan *scan, const prep_text_sample *sample, text_state *text,
                        mospt_err *err)
{
    prep_text_plan *plan = &text->blocks.plan;
    uint32_t first = find_titles(sample, plan), bad = 0, bad_at = 0;
    for (uint32_t i = sample->count; i-- > first;) {
        if (is_point(sample, i, plan)) continue;
        bad++;
        bad_at = i;
    }
    uint32_t all = sample->count - first;
    if (bad < all && (bad <= 1 || bad * 20 <= all)) return true;
    if (bad == all || sample->fault != NULL) return refuse(scan, sample, err);
    return mospt_err_set(err, MOSPT_EFORMAT,
                         sample->line[bad_at] > 0 ? mospt_at_line(scan->path, sample->line[bad_at])
                                                  : mospt_at_file(scan->path),
                         "%u of %u lines that were looked at are no points of %u columns", bad, all,
                         plan->needed);
}

static bool columns_from_option(const prep_scan *scan, const char *option,
                                const prep_text_sample *sample, prep_text_columns *out,
                                mospt_err *err)
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

static bool columns_from_names(const prep_scan *scan, const prep_text_sample *sample,
                               prep_text_columns *out, bool *is_title, mospt_err *err)
{
    char names[PREP_TEXT_COLUMNS_MAX][PREP_TEXT_NAME_MAX];
    memcpy(names, sample->names, sizeof names);
    *is_title = false;
    if (prep_text_columns_from_names(names, sample->name_count, out)) return true;
    /* words that do not go with the columns are a title, not their names */
    *is_title = sample->count > 0 && sample->name_count != sample->mode && sample->mode >= 3;
    return *is_title ||
           mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(scan->path, sample->first_line),
                         "neither points nor names of columns with x, y and z: `%s`",
                         sample->first);
}

static bool understand_columns(prep_scan *scan, prep_text_sample *sample, const char *option,
                               text_state *text, mospt_err *err)
{
    prep_text_plan *plan = &text->blocks.plan;
    prep_text_columns *columns = &text->columns;
    bool has_names = sample->name_count > 0, is_title = false;
    prep_text_sample_measure(sample);
    if (sample->count > 0 && !check_customs(scan, sample, err)) return false;
    if (has_names && option == NULL) {
        if (!columns_from_names(scan, sample, columns, &is_title, err)) return false;
        has_names = !is_title;
    }
    if (!check_sample(scan, sample, has_names, err)) return false;
    plan->header_line = sample->header_line;
    if (option != NULL) return columns_from_option(scan, option, sample, columns, err);
    if (has_names) return true;
    if (sample->mode < 3) return refuse(scan, sample, err);
    if (sample->comment_count == sample->mode &&
        prep_text_columns_from_names(sample->comment, sample->comment_count, columns))
        return true;
    for (uint32_t c = 0; c < sample->mode && sample->count == 1; c++)
        sample->range[c].is_word = false; /* a single line with a word is a note, not a point */
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

static void add_colour(prep_scan *scan, text_state *text, const prep_text_sample *sample)
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

static bool add_intensity(prep_scan *scan, text_state *text, const prep_text_sample *sample,
                          mospt_err *err)
{
    prep_text_plan *plan = &text->blocks.plan;
    double *values = malloc(PREP_TEXT_SAMPLE_MAX * sizeof *values);
    if (values == NULL) return mospt_err_nomem(err, PREP_TEXT_SAMPLE_MAX * sizeof *values);
    size_t n = 0;
    for (uint32_t i = 0; i < sample->count; i++) {
        if (prep_text_sample_tells(sample, i, (uint32_t)plan->intensity))
            values[n++] = sample->values[i][plan->intensity];
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

static bool make_planes(prep_scan *scan, text_state *text, const prep_text_sample *sample,
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
    for (uint32_t k = 0; k < plan->target_count; k++)
        plan->target[k].is_optional = plan->target[k].column >= plan->needed;
    return true;
}

/* Columns of labels cannot be kept; columns at the end of the names that no line has are none. */
static void find_needed(text_state *text, const prep_text_sample *sample)
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

/* Columns that the lines of some blocks do not have. */
static void find_optional(text_state *text, const prep_text_sample *sample)
{
    prep_text_plan *plan = &text->blocks.plan;
    uint32_t votes[PREP_TEXT_COLUMNS_MAX + 2], least = 0;
    plan->known = plan->needed;
    prep_text_sample_count(sample, votes);
    for (int m = PREP_TEXT_X; m <= PREP_TEXT_Z; m++) {
        int column = prep_text_columns_find(&text->columns, (prep_text_meaning)m);
        if (column >= (int)least) least = (uint32_t)column + 1;
    }
    for (uint32_t c = plan->needed; sample->is_counted && c-- > least;)
        if (prep_text_sample_is_share(sample, votes[c])) plan->needed = c;
}

static bool understand(prep_scan *scan, prep_text_sample *sample, const char *option,
                       text_state *text, mospt_err *err)
{
    if (!understand_columns(scan, sample, option, text, err)) return false;
    find_needed(text, sample);
    find_optional(text, sample);
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
    prep_text_sample *sample = calloc(1, sizeof *sample);
    if (sample == NULL) return mospt_err_nomem(err, sizeof *sample);
    sample->values = malloc((PREP_TEXT_SAMPLE_MAX + 1) * sizeof *sample->values);
    bool ok = sample->values != NULL ||
              mospt_err_nomem(err, (PREP_TEXT_SAMPLE_MAX + 1) * sizeof *sample->values);
    ok = ok && prep_text_sample_take(sample, scan->input, err) &&
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
