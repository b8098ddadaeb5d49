/* render/path_import.h - camera lists of other programs as camera paths.
 *
 * Potree: a saved project (JSON or JSON5); its first camera animation with at least two control
 * points; without one, its view, a path of one keyframe.
 *
 * Bundler: bundle.out, version 0.3, the camera list that photogrammetry programs write and
 * CloudCompare opens; cameras without a focal length are passed over. CloudCompare itself writes
 * none: it keeps viewports in its own BIN files.
 *
 * They give places and not times: a Potree animation lasts as long as it says, or else the camera
 * goes at a walking pace, and time is divided by the length of the way. */
#pragma once
#include "render/path.h"

/* True if the text looks like one of them. */
bool rend_path_is_foreign(const char *text);

/* file     its name, for errors
 * out      rend_path_fini(), also after an error
 * errors   MOSPT_ENOMEM, MOSPT_EFORMAT */
bool rend_path_import(const char *file, const char *text, rend_path *out, mospt_err *err);
