/* render/look.h - a look in a window: its keys, the cut through the site, what keyframes keep of
 * it, and what is said about it. What concerns splats alone is in render/shading.h. */
#pragma once
#include "render/choice.h"
#include "render/path.h"

/* Changes a look by a key: + and - point size, 0 automatic, and those of render/shading.h.
 * shift    backwards
 * returns  false if it is none of these keys */
bool rend_look_press(rend_look *look, int key, bool shift);

/* Likewise what colours show: C the next of the choices, 1 to 9, M colour map, , and . brightness.
 * Whether the dataset has them, rend_scheme_fits() knows.
 * choices  [count] */
bool rend_look_press_colour(rend_look *look, int key, bool shift, const rend_choice *choices,
                            uint32_t count);

/* Looks into the site: what is in front of a place goes, along the axis that the eye looks along
 * most.
 * place    world; NULL: nothing is cut away any more */
void rend_look_cut(rend_look *look, const rend_camera *camera, const double *place);

/* Notes in a keyframe what has changed since the window opened. */
void rend_look_keep(const rend_look *look, const rend_look *opening, rend_key *key);

/* The look of a moment on a path.
 * opening  as the window opened
 * colour   NULL, "" or what the dataset cannot show: as it is
 * clip     NULL: as when the window opened */
void rend_look_recall(rend_look *look, const rend_look *opening, const char *colour,
                      const rend_box *clip, const mospt_dataset *dataset);

/* Colours that another dataset cannot show become those that every one has. */
void rend_look_fit(rend_look *look, const mospt_dataset *dataset);

/* Colours, size and shading in words. */
void rend_look_text(const rend_look *look, char *out, size_t size);
