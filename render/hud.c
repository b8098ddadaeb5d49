#include "render/hud.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *const HELP[] = {
    "left drag          orbit around the point under the cursor",
    "right drag         pan",
    "wheel              zoom to the cursor",
    "W A S D  arrows    fly;  Q E  down, up;  shift  faster",
    "R                  reset the view",
    "B  shift B  ] [    more, fewer points (budget)",
    "+ -                larger, smaller points;  0  automatic",
    "C  shift C         next, previous colours: all that the points carry",
    "1 to 9             RGB, intensity, elevation, classification, return, time, scan,",
    "                   density, distance to the scanner",
    "M  K               next colour map;  legend on and off",
    ", .                darker, brighter RGB",
    "L  ;  '            eye-dome lighting;  weaker, stronger",
    "O  G               next shape of splats;  next background",
    "U  I               average noisy points;  close holes in near surfaces",
    "V  shift V         cut away what is in front of the cursor;  show all again",
    "Z  shift Z         narrower, wider field of view",
    "P                  save a picture",
    "T  J               take the view as a keyframe;  play them",
    "N  X  < >          next keyframe (shift: the one before), delete it, move it in time",
    "F                  full screen",
    "H  F1              this help",
    "Esc  ctrl W        quit",
};
enum {
    HELP_COUNT = sizeof HELP / sizeof *HELP,
    LABELS_MAX = HELP_COUNT + 8 + REND_LEGEND_LABELS_MAX,
    LINE_MAX = 512
};

static const float WHITE[4] = {1, 1, 1, 1}, ORANGE[4] = {1, 0.75f, 0.35f, 1},
                   SHADE[4] = {0.05f, 0.06f, 0.07f, 0.72f};

typedef struct {
    rgl_label at[LABELS_MAX];
    uint32_t count;
} labels;

void rend_hud_count(uint64_t count, char out[16])
{
    if (count >= 10000000000) snprintf(out, 16, "%.1f G", (double)count / 1e9);
    else if (count >= 1000000) snprintf(out, 16, "%.2f M", (double)count / 1e6);
    else if (count >= 1000) snprintf(out, 16, "%.1f k", (double)count / 1e3);
    else snprintf(out, 16, "%" PRIu64, count);
}

static void panel(labels *l, float x, float y, float width, float height)
{
    rgl_label p = {.x = x, .y = y, .panel_size = {width, height}};
    memcpy(p.colour, SHADE, sizeof p.colour);
    l->at[l->count++] = p;
}

static void words(labels *l, float x, float y, const float colour[4], const char *text)
{
    rgl_label w = {.x = x, .y = y, .words = text};
    memcpy(w.colour, colour, sizeof w.colour);
    l->at[l->count++] = w;
}

static void figures_line(const rend_hud *hud, char line[LINE_MAX])
{
    const rend_figures *f = &hud->figures;
    char drawn[16], budget[16] = "all", loading[48] = "";
    rend_hud_count(f->points_drawn, drawn);
    if (hud->budget_points != REND_ALL) rend_hud_count(hud->budget_points, budget);
    if (f->pending > 0) snprintf(loading, sizeof loading, "  loading %" PRIu32, f->pending);
    snprintf(line, LINE_MAX,
             "%6.1f ms  %s of %s points  %" PRIu32 " nodes  RAM %" PRIu64 "/%" PRIu64
             " MB  GPU %" PRIu64 "/%" PRIu64 " MB  %s%s",
             hud->frame_ms, drawn, budget, f->nodes_drawn, f->ram_used / 1000000,
             f->ram_limit / 1000000, f->gpu_used / 1000000, f->gpu_limit / 1000000, hud->look,
             loading);
}

/* What is missing from the picture is said as long as it is missing. */
static bool warning_line(const rend_hud *hud, char line[LINE_MAX])
{
    const rend_figures *f = &hud->figures;
    if (hud->notice[0] != '\0') {
        snprintf(line, LINE_MAX, "%s", hud->notice);
        return true;
    }
    if (f->damaged_nodes == 0) return false;
    snprintf(line, LINE_MAX, "%" PRIu32 " damaged node%s, %" PRIu64 " points missing: %.300s",
             f->damaged_nodes, f->damaged_nodes > 1 ? "s" : "", f->damaged_points,
             f->damage.message);
    return true;
}

static void help_box(labels *l, const rgl_text *text, uint32_t width, uint32_t height)
{
    rgl_metrics m = rgl_text_metrics(text);
    float advance = m.advance, line = m.line, pad = line, bar = line + 2 * line / 3;
    /* A low window has it closer, below the line of figures. */
    float room = ((float)height - bar - 2 * pad) / HELP_COUNT;
    float spacing = fminf(1.1f * line, fmaxf(room, 0.8f * line));
    size_t longest = 0;
    for (int i = 0; i < HELP_COUNT; i++)
        if (strlen(HELP[i]) > longest) longest = strlen(HELP[i]);
    float w = (float)longest * advance + 2 * pad, h = HELP_COUNT * spacing + 2 * pad;
    float x = fmaxf(((float)width - w) / 2, 0), y = fmaxf(((float)height - h) / 2, bar);
    panel(l, x, y, w, h);
    for (int i = 0; i < HELP_COUNT; i++)
        words(l, x + pad, y + pad + (float)i * spacing, WHITE, HELP[i]);
}

bool rend_hud_draw(rgl_text *text, const rend_hud *hud, uint32_t width, uint32_t height,
                   mospt_err *err)
{
    labels l = {.count = 0};
    char figures[LINE_MAX], warning[LINE_MAX];
    rgl_metrics m = rgl_text_metrics(text);
    float line = m.line, advance = m.advance, pad = line / 3;
    static const char hint[] = "H help";
    figures_line(hud, figures);
    panel(&l, 0, 0, (float)width, line + 2 * pad);
    words(&l, pad, pad, WHITE, figures);
    float hint_x = (float)width - pad - (float)strlen(hint) * advance;
    if (hint_x > pad + (float)(strlen(figures) + 2) * advance) words(&l, hint_x, pad, WHITE, hint);
    if (warning_line(hud, warning)) {
        panel(&l, 0, line + 2 * pad, (float)strlen(warning) * advance + 2 * pad, line + 2 * pad);
        words(&l, pad, line + 3 * pad, ORANGE, warning);
    }
    if (hud->legend != NULL)
        l.count +=
            rend_legend_labels(hud->legend, &m, width, height, line + 2 * pad, l.at + l.count);
    if (hud->help) help_box(&l, text, width, height);
    return rgl_text_draw(text, width, height, l.at, l.count, err);
}
