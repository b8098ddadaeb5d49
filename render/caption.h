/* render/caption.h - words over the frames of a film: a title, and a counter. */
#pragma once
#include "render/gl/font.h"

#define REND_TITLE_S 4.0 /* how long a title stays */

typedef struct {
    rgl_font title, counter;
} rend_caption;

/* Sizes follow the height of the picture.
 * out      rend_caption_fini()
 * errors   MOSPT_EINVAL: no font, MOSPT_ENOMEM */
bool rend_caption_init(uint32_t height, rend_caption *out, mospt_err *err);
void rend_caption_fini(rend_caption *caption);

/* title    with its age in seconds; NULL: none
 * counter  NULL: none
 * rgb      [width * height * 3], top row first */
void rend_caption_draw(const rend_caption *caption, uint32_t width, uint32_t height,
                       const char *title, double title_s, const char *counter, uint8_t *rgb);
