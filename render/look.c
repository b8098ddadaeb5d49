#include "render/look.h"

#include "render/clip.h"
#include "render/scheme.h"
#include "render/shading.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void scale_points(rend_look *look, float step)
{
    float now = look->size_mode == REND_SIZE_FIXED ? fmaxf(look->point_px, 1) : 1;
    if (look->size_mode == REND_SIZE_FIXED || step > 0) now += step;
    look->size_mode = REND_SIZE_FIXED;
    look->point_px = fminf(fmaxf(now, 1), 32);
}

bool rend_look_press(rend_look *look, int key, bool shift)
{
    if (key == '+') scale_points(look, 1);
    else if (key == '-') scale_points(look, -1);
    else if (key == '0') look->size_mode = REND_SIZE_AUTO;
    else return rend_shading_press(look, key, shift);
    return true;
}

bool rend_look_press_colour(rend_look *look, int key, bool shift, const rend_choice *choices,
                            uint32_t count)
{
    double brightness = look->brightness > 0 ? look->brightness : 1;
    if (key == 'C') {
        rend_choice_step(choices, count, shift ? -1 : 1, look);
    } else if (key >= '1' && key <= '9') {
        rend_choice_use(&(rend_choice){.colour = (rend_colour)(key - '1')}, look);
    } else if (key == 'M') {
        look->map = (rend_map)(rend_choice_map(look) % (REND_MAP_COUNT - 1) + 1);
    } else if (key == ',' || key == '.') {
        look->brightness = brightness * (key == '.' ? 1.25 : 0.8);
    } else {
        return false;
    }
    return true;
}

void rend_look_cut(rend_look *look, const rend_camera *camera, const double *place)
{
    double right[3], up[3], back[3];
    if (!look->has_clip || place == NULL) look->clip = rend_clip_open();
    look->has_clip = place != NULL;
    rend_camera_axes(camera, right, up, back);
    if (place != NULL) rend_clip_cut(back, place, &look->clip);
}

void rend_look_keep(const rend_look *look, const rend_look *opening, rend_key *key)
{
    if (!rend_scheme_same(look, opening))
        snprintf(key->colour, sizeof key->colour, "%s", rend_choice_shown(look));
    key->clip = look->has_clip ? look->clip : rend_clip_open();
    key->has_clip = look->has_clip != opening->has_clip ||
                    (look->has_clip && memcmp(&look->clip, &opening->clip, sizeof look->clip) != 0);
}

void rend_look_recall(rend_look *look, const rend_look *opening, const char *colour,
                      const rend_box *clip, const mospt_dataset *dataset)
{
    rend_look other = *look;
    if (colour != NULL && colour[0] != '\0') rend_choice_recall(colour, opening, &other);
    if (rend_scheme_fits(dataset, &other, NULL)) *look = other;
    look->has_clip = clip != NULL || opening->has_clip;
    look->clip = clip != NULL ? *clip : opening->clip;
}

void rend_look_fit(rend_look *look, const mospt_dataset *dataset)
{
    if (!rend_scheme_fits(dataset, look, NULL))
        rend_choice_use(&(rend_choice){.colour = REND_COLOUR_RGB}, look);
}

void rend_look_text(const rend_look *look, char *out, size_t size)
{
    char shading[96];
    rend_shading_text(look, shading, sizeof shading);
    if (look->size_mode == REND_SIZE_FIXED)
        snprintf(out, size, "%s  %g px  %s", rend_choice_shown(look),
                 (double)fmaxf(look->point_px, 1), shading);
    else snprintf(out, size, "%s  %s", rend_choice_shown(look), shading);
}
