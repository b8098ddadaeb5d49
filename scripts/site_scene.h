/* scripts/site_scene.h - what stands on the sample site: a ruined chapel in a walled yard, with a
 * well, graves and trees.
 *
 * x runs east along the nave, y north, z up, metres; the origin is in the nave, 0.55 m above the
 * ground. */
#pragma once
#include "scripts/site_cast.h"

/* One step of a random sequence; equal on every machine. */
uint32_t site_random(uint32_t *state);

/* Builds the site and the tree for its rays. The same seed gives the same site. */
bool site_scene_init(site_scene *scene, uint32_t seed, mospt_err *err);
