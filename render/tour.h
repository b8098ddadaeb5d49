/* render/tour.h - camera paths that make themselves. */
#pragma once
#include "render/path.h"

/* Once around the whole site, in 30 seconds.
 * out      rend_path_fini() */
bool rend_tour_orbit(const mospt_dataset *dataset, double aspect, rend_path *out, mospt_err *err);

/* From scan position to scan position in the order of the scans, at eye height along free space
 * (render/space.h), at a walking pace; where no scan says where it was taken from, between places
 * that are free and far from each other.
 * out      rend_path_fini()
 * errors   MOSPT_ENOMEM, MOSPT_EIO, MOSPT_EFORMAT; MOSPT_EINVAL: there is no way to walk */
bool rend_tour_walk(const mospt_dataset *dataset, rend_path *out, mospt_err *err);
