/* tests/laz_twins.h - real LAZ files, and the LAS that they were made from. */
#pragma once
#include <stdbool.h>
#include <stddef.h>

extern const size_t laz_twins_count;

/* Path of a file of pair `i`.
 * which    0: the LAZ, 1: the LAS
 * returns  false if it is not there: neither in $IPTS_SHARED/scans nor in ../shared/scans */
bool laz_twins_path(size_t i, int which, char *out, size_t size);
