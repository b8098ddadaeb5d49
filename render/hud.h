/* render/hud.h - the words over the picture in a window: one line of figures, the legend of
 * the colours, and the help. */
#pragma once
#include "render/gl/text.h"
#include "render/stage.h"

typedef struct {
    rend_figures figures;
    double frame_ms;
    uint64_t budget_points;
    const char *look;          /* what was set by hand: colour mode, splat size */
    const char *notice;        /* something that just happened; "": nothing */
    const rend_legend *legend; /* NULL: not shown */
    bool help;
} rend_hud;

/* Draws over the window's picture.
 * scale    pixels for what is one pixel on a common screen */
bool rend_hud_draw(rgl_text *text, const rend_hud *hud, uint32_t width, uint32_t height,
                   mospt_err *err);

/* "1.23 M", "45.6 k": at most eight bytes and a zero. */
void rend_hud_count(uint64_t count, char out[16]);
