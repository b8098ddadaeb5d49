/* render/gl/font.h - the system's monospace font as pixels, and labels drawn with it into a picture
 * in memory. render/gl/text.h draws the same labels into a window. */
#pragma once
#include "mospt/err.h"

typedef struct {
    float advance, line; /* of one character, of one line: pixels */
} rgl_metrics;

typedef struct {
    float x, y;        /* top left, pixels from the top left */
    float colour[4];   /* red, green, blue, opacity */
    const char *words; /* UTF-8, one line; what is neither Latin-1 nor a dash, quotation mark or the
                          like shows as '?' */
    float panel_size[2]; /* both above 0: a plain panel instead, `words` is not looked at */
} rgl_label;

typedef struct {
    int cell_width, cell_height; /* of one character, pixels */
    int columns, rows;           /* of characters in the atlas */
    uint8_t *atlas;              /* [columns * cell_width * rows * cell_height] coverage, owned */
} rgl_font;

/* Finds and rasterises the font.
 * size_px  height of a line
 * errors   MOSPT_EINVAL: no font; whoever asks can do without */
bool rgl_font_init(float size_px, rgl_font *out, mospt_err *err);
void rgl_font_fini(rgl_font *font);

rgl_metrics rgl_font_metrics(const rgl_font *font);

/* Characters of a line of UTF-8: so many advances wide. */
uint32_t rgl_font_length(const char *words);

/* Reads one character of UTF-8 and moves on.
 * texel    its top left corner in the atlas; returns false for a blank, which has none */
bool rgl_font_next(const rgl_font *font, const unsigned char **at, int texel[2]);

/* Draws labels over a picture, in their order.
 * rgb      [width * height * 3], top row first */
void rgl_font_draw(const rgl_font *font, uint32_t width, uint32_t height, const rgl_label *labels,
                   uint32_t count, uint8_t *rgb);
