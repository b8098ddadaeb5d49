/* preprocess/e57.h - E57 (ASTM E2807), the exchange format of terrestrial scanners: several scans
 * in a file, each with its own pose and its own choice of fields.
 *
 * Scans are counted without those that hold no points; one that cannot be read at all is left out,
 * and said to be. Points are Cartesian or spherical, and moved by the scan's pose; those that the
 * file marks as invalid are counted as without return. Attributes: intensity, rgb (colours of more
 * than 8 bits, as integers) or rgb_float, normal (turned with the pose), row_index, column_index,
 * return_number (counted from 1, as in LAS; E57 counts from 0), number_of_returns, gps_time
 * (timeStamp: seconds since the scan began), color_invalid, intensity_invalid, time_invalid, and
 * the numbers of extensions under their own names. Pictures, blobs, strings and groupings are
 * passed over. The coordinate reference system is the file's coordinateMetadata. */
#pragma once
#include "preprocess/scan_format.h"

extern const prep_scan_format prep_e57_format;
