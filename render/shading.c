#include "render/shading.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *const shape_names[REND_SHAPE_COUNT] = {[REND_SHAPE_AUTO] = "auto",
                                                          [REND_SHAPE_SQUARE] = "square",
                                                          [REND_SHAPE_ROUND] = "round",
                                                          [REND_SHAPE_PARABOLOID] = "paraboloid"};

static const float slabs[] = {0, 0.003f, 0.01f, 0.03f};
static const uint32_t fills[] = {0, 1, 2, 3, 5};
static const float strengths[] = {0.25f, 0.5f, 1, 2, 4};
/* Of the background, from top to bottom. */
static const float backgrounds[][2][3] = {
    {{0, 0, 0}, {0, 0, 0}},
    {{1, 1, 1}, {1, 1, 1}},
    {{0.53f, 0.65f, 0.78f}, {0.85f, 0.87f, 0.88f}},
};
#define COUNT(array) ((int)(sizeof(array) / sizeof *(array)))

const char *rend_shading_shape_name(rend_shape shape)
{
    return shape_names[shape];
}

bool rend_shading_shape_from_name(const char *name, rend_shape *out)
{
    for (int s = 0; s < REND_SHAPE_COUNT; s++) {
        if (strcmp(name, shape_names[s]) != 0) continue;
        *out = (rend_shape)s;
        return true;
    }
    return false;
}

static int turn(int at, int step, int count)
{
    return (at + step + count) % count;
}

/* The next of a list, from whatever value it has now. */
static float next_of(const float *values, int count, float now, int step)
{
    int at = 0;
    while (at + 1 < count && values[at] < now)
        at++;
    return values[turn(at, step, count)];
}

static void step_strength(rend_look *look, int step)
{
    int at = 0, last = COUNT(strengths) - 1;
    float now = look->edl_strength > 0 ? look->edl_strength : 1;
    while (at < last && strengths[at] < now)
        at++;
    at += step;
    look->edl_strength = strengths[at < 0 ? 0 : at > last ? last : at];
    look->no_edl = false;
}

/* The usual one comes before the first of the list. */
static void step_background(rend_look *look, int step)
{
    int at = 0;
    for (int b = 0; b < COUNT(backgrounds); b++)
        if (look->has_background &&
            memcmp(look->background_top, backgrounds[b][0], sizeof look->background_top) == 0)
            at = b + 1;
    at = turn(at, step, COUNT(backgrounds) + 1);
    look->has_background = at > 0;
    if (at == 0) return;
    memcpy(look->background_top, backgrounds[at - 1][0], sizeof look->background_top);
    memcpy(look->background_bottom, backgrounds[at - 1][1], sizeof look->background_bottom);
}

static void step_fill(rend_look *look, int step)
{
    int at = 0;
    while (at + 1 < COUNT(fills) && fills[at] < look->fill_px)
        at++;
    look->fill_px = fills[turn(at, step, COUNT(fills))];
}

bool rend_shading_press(rend_look *look, int key, bool shift)
{
    int step = shift ? -1 : 1;
    if (key == 'O') look->shape = (rend_shape)turn((int)look->shape, step, REND_SHAPE_COUNT);
    else if (key == 'U') look->blend_slab = next_of(slabs, COUNT(slabs), look->blend_slab, step);
    else if (key == 'I') step_fill(look, step);
    else if (key == 'L') look->no_edl = !look->no_edl;
    else if (key == ';') step_strength(look, -1);
    else if (key == '\'') step_strength(look, 1);
    else if (key == 'G') step_background(look, step);
    else return false;
    return true;
}

static void add(char *out, size_t size, const char *text)
{
    size_t used = strlen(out);
    snprintf(out + used, size - used, "%s%s", used > 0 ? ", " : "", text);
}

void rend_shading_text(const rend_look *look, char *out, size_t size)
{
    char part[40];
    out[0] = '\0';
    if (look->shape != REND_SHAPE_AUTO) add(out, size, shape_names[look->shape]);
    if (look->blend_slab > 0) {
        snprintf(part, sizeof part, "blend %.2g %%", 100 * (double)look->blend_slab);
        add(out, size, part);
    }
    if (look->fill_px > 0) {
        snprintf(part, sizeof part, "fill %u px", look->fill_px);
        add(out, size, part);
    }
    if (look->no_edl) add(out, size, "no lighting");
    else if (look->edl_strength > 0 && look->edl_strength != 1) {
        snprintf(part, sizeof part, "lighting %.2g", (double)look->edl_strength);
        add(out, size, part);
    }
}
