/* render/asprs.h - the classes of points that the LAS specification names (LAS 1.4, table 17). */
#pragma once
#include <stdint.h>

/* NULL for a code that the specification leaves to the user or to the future. */
const char *rend_asprs_name(uint32_t code);

/* Colours as surveyors know them: ground is brown, vegetation green, water blue, noise magenta.
 * Any code has one. */
void rend_asprs_colour(uint32_t code, uint8_t rgb[3]);
