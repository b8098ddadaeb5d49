/* render/gl/text.h - lines of text over a picture, in the system's monospace font. */
#pragma once
#include "mospt/err.h"

typedef struct rgl_text rgl_text;

typedef struct {
    float x, y;        /* top left, pixels from the top left */
    float colour[4];   /* red, green, blue, opacity */
    const char *words; /* UTF-8, one line; what the font's Latin part does not have shows as '?' */
    float panel_size[2]; /* both above 0: a plain panel instead, `words` is not looked at */
} rgl_label;

/* Finds and rasterises the font. A context must be current.
 * size_px  height of a line
 * errors   MOSPT_EINVAL: no font; whoever asks can do without */
bool rgl_text_create(float size_px, rgl_text **out, mospt_err *err);
void rgl_text_destroy(rgl_text *text);

float rgl_text_line_height(const rgl_text *text); /* pixels */
float rgl_text_advance(const rgl_text *text);     /* of one character, pixels */

/* Draws labels into the window's back buffer, or the one bound last, in their order. */
bool rgl_text_draw(rgl_text *text, uint32_t width, uint32_t height, const rgl_label *labels,
                   uint32_t count, mospt_err *err);
