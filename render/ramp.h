/* render/ramp.h - colours for values: maps from low to high, and hues that are easy to tell apart.
 */
#pragma once
#include "render/options.h"

enum { REND_RAMP_STEPS = 256 };

typedef struct {
    uint8_t rgb[REND_RAMP_STEPS][3];
} rend_ramp;

/* A map from its low to its high end. The darkest and lightest parts of some are left out:
 * eye-dome lighting needs something to darken.
 * map      not REND_MAP_USUAL */
void rend_ramp_fill(rend_map map, rend_ramp *out);

/* Each channel by itself: out = (in * brightness) ^ (1 / gamma), of 0 to 1. */
void rend_ramp_curve(double brightness, double gamma, rend_ramp *out);

/* Colour number `index` of a series in which neighbours differ most, all about equally bright. */
void rend_ramp_hue(uint32_t index, uint8_t rgb[3]);

const char *rend_ramp_name(rend_map map); /* "viridis" ...; NULL for REND_MAP_USUAL */
bool rend_ramp_from_name(const char *name, rend_map *out);
