/* scripts/site_rooms.h - a house of many rooms: what stands in one hides what is in all others.
 *
 * A square of rooms on two floors, doors in line from room to room, windows in the outer walls, and
 * furniture. Floors, ceilings and walls are 0.2 m thick. x east, y north, z up, metres; the origin
 * is in the middle, on the lower floor. */
#pragma once
#include "scripts/site_cast.h"

/* Builds the house and the tree for its rays.
 * across   rooms along each side */
bool site_rooms_init(site_scene *scene, uint32_t across, uint32_t seed, mospt_err *err);

/* Where a scanner stands: room after room, and again from elsewhere in each when all are done.
 * tripod   metres above the floor */
site_vec site_rooms_position(uint32_t across, uint32_t index, float tripod);
