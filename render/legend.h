/* render/legend.h - what the colours of a picture mean: a bar with figures, or a list of names. */
#pragma once
#include "render/gl/font.h"
#include "render/ramp.h"

enum { REND_LEGEND_ROWS_MAX = 32, REND_LEGEND_TICKS = 5, REND_LEGEND_LABELS_MAX = 160 };

typedef struct {
    char title[96]; /* "": the colours speak for themselves, nothing is drawn */
    bool has_bar;
    rend_ramp ramp;
    char ticks[REND_LEGEND_TICKS][32]; /* from the low end of the ramp to the high one */
    struct {
        uint8_t rgb[3];
        char words[64];
    } rows[REND_LEGEND_ROWS_MAX];
    uint32_t row_count, rows_left_out;
    char note[64]; /* below the rest, "": none */
} rend_legend;

/* Lays the legend out at the right edge of a picture, over a panel of its own.
 * top      pixels that something else occupies
 * out      [REND_LEGEND_LABELS_MAX], pointing to words in `legend`; returns how many */
uint32_t rend_legend_labels(const rend_legend *legend, const rgl_metrics *metrics, uint32_t width,
                            uint32_t height, float top, rgl_label *out);

/* Draws it into a picture.
 * rgb      [width * height * 3], top row first
 * errors   MOSPT_EINVAL: no font; MOSPT_ENOMEM */
bool rend_legend_draw(const rend_legend *legend, uint32_t width, uint32_t height, uint8_t *rgb,
                      mospt_err *err);
