/* preprocess/frame.h - the grid of a site, and which points are too far away for it.
 *
 * The step is that of the finest LAS file, so that its positions are kept. Floating-point scans ask
 * for a step of at most the extent / 2^30; beside LAS, for that of LAS divided by a power of two.
 * One stray point must not cost the others their resolution: where the extent would ask for a step
 * that no scanner deserves, and most points lie close together, the grid is put around these. It
 * then reaches 2^30 steps from their middle, and what lies beyond is out of range. */
#pragma once
#include "mospt/grid.h"
#include "preprocess/source.h"

/* doubtful  out: header bounds reach too far for the wanted step, and have not been held against
 * the points yet */
bool prep_frame_grid(const prep_source *source, mospt_grid *out, bool *doubtful, mospt_err *err);

/* The box outside of which points are out of range.
 * returns  false: all are in range, or not all scans are measured, or they were with a range */
bool prep_frame_range(const prep_source *source, double low[3], double high[3]);
