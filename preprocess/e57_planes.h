/* preprocess/e57_planes.h - what the points of an E57 scan carry besides their position: how colour
 * and intensity are shown, and the attribute planes that keep the raw values. */
#pragma once
#include "preprocess/e57_points.h"

/* Adds the attributes to the scan and chooses how colours are shown.
 * rgb_max          largest value in a sample, 0: the scan has no colour
 * return_index_min smallest value in a sample */
void prep_e57_planes_add(prep_e57_points *points, prep_scan *scan, const prep_e57_scan *desc,
                         double rgb_max, double return_index_min);

/* Appends the loaded block to the batch, without the points that are lost or marked invalid, which
 * are counted. */
void prep_e57_planes_emit(prep_e57_points *points, prep_scan *scan, uint32_t count,
                          prep_batch *batch);
