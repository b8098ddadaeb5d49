/* render/still.h - a picture that waits for all it is made of: the same, byte for byte, however
 * small the caches are. threads  the one that has the context */
#pragma once
#include "render/picture.h"

/* Draws all that the budget allows, reading it through the caches in as many parts as they need. */
bool rend_still_draw(rend_picture *picture, const rend_view_of *view, mospt_err *err);

/* Has the loader read what rend_still_draw() will probably miss. */
bool rend_still_expect(rend_picture *picture, const rend_view_of *view, mospt_err *err);
