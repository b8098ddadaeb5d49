#include "render/caption.h"

#include <math.h>

enum { TITLE_LINES = 16, COUNTER_LINES = 36 }; /* of the picture's height */
#define FADE_S 0.5

bool rend_caption_init(uint32_t height, rend_caption *out, mospt_err *err)
{
    rend_caption c = {0};
    if (!rgl_font_init(fmaxf(10, (float)height / TITLE_LINES), &c.title, err)) return false;
    if (!rgl_font_init(fmaxf(8, (float)height / COUNTER_LINES), &c.counter, err)) {
        rend_caption_fini(&c);
        return false;
    }
    *out = c;
    return true;
}

void rend_caption_fini(rend_caption *caption)
{
    rgl_font_fini(&caption->title);
    rgl_font_fini(&caption->counter);
}

/* Words on a dark panel, `right` or left of the lower edge. */
static void draw_line(const rgl_font *font, uint32_t width, uint32_t height, const char *words,
                      float opacity, bool right, uint8_t *rgb)
{
    rgl_metrics m = rgl_font_metrics(font);
    float pad = m.line / 2, wide = (float)rgl_font_length(words) * m.advance + 2 * pad;
    float x = right ? (float)width - wide - pad : pad, y = (float)height - m.line - 3 * pad;
    const rgl_label labels[] = {
        {.x = x,
         .y = y,
         .colour = {0.05f, 0.06f, 0.07f, 0.6f * opacity},
         .panel_size = {wide, m.line + 2 * pad}},
        {.x = x + pad, .y = y + pad, .colour = {1, 1, 1, opacity}, .words = words},
    };
    rgl_font_draw(font, width, height, labels, 2, rgb);
}

void rend_caption_draw(const rend_caption *caption, uint32_t width, uint32_t height,
                       const char *title, double title_s, const char *counter, uint8_t *rgb)
{
    double opacity = fmin(fmin(title_s, REND_TITLE_S - title_s) / FADE_S, 1);
    if (title != NULL && title[0] != '\0' && opacity > 0)
        draw_line(&caption->title, width, height, title, (float)opacity, false, rgb);
    if (counter != NULL) draw_line(&caption->counter, width, height, counter, 1, true, rgb);
}
