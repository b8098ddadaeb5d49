/* render/gl/text.h - lines of text over a window's picture. */
#pragma once
#include "render/gl/font.h"

typedef struct rgl_text rgl_text;

/* Finds the font. A context must be current.
 * size_px  height of a line
 * errors   MOSPT_EINVAL: no font; whoever asks can do without */
bool rgl_text_create(float size_px, rgl_text **out, mospt_err *err);
void rgl_text_destroy(rgl_text *text);

rgl_metrics rgl_text_metrics(const rgl_text *text);

/* Draws labels into the window's back buffer, or the one bound last, in their order. */
bool rgl_text_draw(rgl_text *text, uint32_t width, uint32_t height, const rgl_label *labels,
                   uint32_t count, mospt_err *err);
