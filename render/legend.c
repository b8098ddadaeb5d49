#include "render/legend.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* The longest line, characters; longer names keep their end, which tells files apart. */
enum { WORDS_MAX = 44, BAR_STRIPS = 64 };
#define FONT_PER_HEIGHT (14.0f / 720) /* as in a window of that height */
#define FONT_PX_MIN 11.0f

typedef struct {
    rgl_label *at; /* [REND_LEGEND_LABELS_MAX] */
    uint32_t count;
} labels;

static void add_panel(labels *l, float x, float y, float width, float height, const float colour[4])
{
    rgl_label p = {.x = x, .y = y, .panel_size = {width, height}};
    memcpy(p.colour, colour, sizeof p.colour);
    l->at[l->count++] = p;
}

static void add_patch(labels *l, float x, float y, float width, float height, const uint8_t rgb[3])
{
    const float colour[4] = {(float)rgb[0] / 255, (float)rgb[1] / 255, (float)rgb[2] / 255, 1};
    add_panel(l, x, y, width, height, colour);
}

static void add_words(labels *l, float x, float y, const char *words)
{
    size_t length = strlen(words);
    rgl_label w = {.x = x, .y = y, .colour = {1, 1, 1, 1}, .words = words};
    if (length > WORDS_MAX) w.words += length - WORDS_MAX;
    while (((unsigned char)w.words[0] & 0xc0) == 0x80) /* not in the middle of a character */
        w.words++;
    l->at[l->count++] = w;
}

static size_t shown_length(const char *words)
{
    size_t length = strlen(words);
    return length < WORDS_MAX ? length : WORDS_MAX;
}

static size_t longest_line(const rend_legend *l, size_t patch)
{
    size_t longest = shown_length(l->title), note = shown_length(l->note);
    if (note > longest) longest = note;
    for (uint32_t r = 0; r < l->row_count; r++) {
        size_t length = shown_length(l->rows[r].words) + patch;
        if (length > longest) longest = length;
    }
    for (int t = 0; l->has_bar && t < REND_LEGEND_TICKS; t++) {
        size_t length = shown_length(l->ticks[t]) + patch;
        if (length > longest) longest = length;
    }
    return longest;
}

/* The high end on top. */
static void add_bar(labels *l, const rend_legend *legend, float x, float y, float line,
                    float advance, float height)
{
    float strip = height / BAR_STRIPS;
    for (int s = 0; s < BAR_STRIPS; s++) {
        int step = (REND_RAMP_STEPS - 1) * (BAR_STRIPS - 1 - s) / (BAR_STRIPS - 1);
        add_patch(l, x, y + (float)s * strip, 2 * advance, strip, legend->ramp.rgb[step]);
    }
    for (int t = 0; t < REND_LEGEND_TICKS; t++) {
        float at = height * (1 - (float)t / (REND_LEGEND_TICKS - 1));
        if (legend->ticks[t][0] != '\0')
            add_words(l, x + 3 * advance, y + at - line / 2, legend->ticks[t]);
    }
}

uint32_t rend_legend_labels(const rend_legend *legend, const rgl_metrics *metrics, uint32_t width,
                            uint32_t height, float top, rgl_label *out)
{
    static const float shade[4] = {0.05f, 0.06f, 0.07f, 0.72f};
    static const char *const more = "... and more";
    labels l = {.at = out};
    if (legend->title[0] == '\0') return 0;
    float line = metrics->line, advance = metrics->advance, pad = line / 2;
    /* As many rows as the picture has room for, beside title and notes. */
    float room = ((float)height - top - 4 * pad) / line - 4.5f;
    uint32_t rows = room < (float)legend->row_count ? (uint32_t)fmaxf(room, 0) : legend->row_count;
    bool some_left = legend->rows_left_out > 0 || rows < legend->row_count;
    float bar = legend->has_bar ? fmaxf(fminf(10 * line, room * line), 2 * line) : 0;
    float inner = (float)longest_line(legend, 3) * advance;
    float high = line * ((float)rows + 1.5f + (float)some_left + (legend->note[0] != '\0')) +
                 (legend->has_bar ? bar + line : 0);
    float x = (float)width - inner - 3 * pad, y = top + pad;
    add_panel(&l, x, y, inner + 2 * pad, high + 2 * pad, shade);
    x = floorf(x + pad), y = floorf(y + pad);
    add_words(&l, x, y, legend->title);
    y += 1.5f * line;
    if (legend->has_bar) {
        add_bar(&l, legend, x, y + line / 2, line, advance, bar);
        y += bar + line;
    }
    for (uint32_t r = 0; r < rows; r++, y += line) {
        add_patch(&l, x, y + 0.15f * line, 2 * advance, 0.7f * line, legend->rows[r].rgb);
        add_words(&l, x + 3 * advance, y, legend->rows[r].words);
    }
    if (some_left) add_words(&l, x, y, more), y += line;
    if (legend->note[0] != '\0') add_words(&l, x, y, legend->note);
    return l.count;
}

bool rend_legend_draw(const rend_legend *legend, uint32_t width, uint32_t height, uint8_t *rgb,
                      mospt_err *err)
{
    rgl_label labels_of[REND_LEGEND_LABELS_MAX];
    rgl_font font;
    if (!rgl_font_init(fmaxf(FONT_PER_HEIGHT * (float)height, FONT_PX_MIN), &font, err))
        return false;
    rgl_metrics metrics = rgl_font_metrics(&font);
    uint32_t count = rend_legend_labels(legend, &metrics, width, height, 0, labels_of);
    rgl_font_draw(&font, width, height, labels_of, count, rgb);
    rgl_font_fini(&font);
    return true;
}
