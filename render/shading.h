/* render/shading.h - the part of a look that says how splats become a picture: its names, its keys
 * in a window, and what is said about it. */
#pragma once
#include "render/options.h"

#include <stddef.h>

/* "auto", "square" ..., as on the command line. */
const char *rend_shading_shape_name(rend_shape shape);
bool rend_shading_shape_from_name(const char *name, rend_shape *out);

/* Changes a look by a key: O shape, U blending, I holes, L lighting, ; and ' its strength, G
 * background.
 * shift    backwards
 * returns  false if it is none of these keys */
bool rend_shading_press(rend_look *look, int key, bool shift);

/* What differs from the usual, in words, as in "paraboloid, blend 1 %"; "" if nothing does. */
void rend_shading_text(const rend_look *look, char *out, size_t size);
