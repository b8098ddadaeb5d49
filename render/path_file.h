/* render/path_file.h - camera paths on disk.
 *
 * One readable JSON file, a line for each keyframe:
 *
 *   {"format": "instantpoints camera path", "version": 1, "abrupt": false, "keys": [
 *     {"time": 0, "eye": [1, 2, 3], "target": [4, 5, 6], "up": [0, 0, 1], "fov": 60,
 *      "budget": 2000000, "colour": "rgb", "clip": [0, 0, null, 9, 9, 2.5]}]}
 *
 * Times in seconds, places in the coordinates of the scans, "fov" the vertical field of view in
 * degrees, "clip" the box outside of which nothing is shown, low and high x, y, z, null where a
 * side is open. "up", "fov", "budget" (a number or "all"), "colour", "clip" and "abrupt" may be
 * left out. A member that is not known is an error: it would be a misspelt one. */
#pragma once
#include "render/path.h"

/* Reads such a file, or one of those that render/path_import.h knows; the content decides.
 * out      rend_path_fini()
 * errors   MOSPT_EIO, MOSPT_ENOMEM, MOSPT_EFORMAT with the line or the keyframe */
bool rend_path_read(const char *file, rend_path *out, mospt_err *err);

/* Replaces the file, all or nothing. */
bool rend_path_write(const rend_path *path, const char *file, mospt_err *err);
