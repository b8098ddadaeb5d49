/* tests/scan_points.h - all points of a scan at once, and files for the readers to read. */
#pragma once
#include "preprocess/scan.h"

typedef struct {
    prep_scan_info info;
    uint64_t count, capacity;
    double *xyz;                          /* [count][3], owned */
    uint8_t *rgbi;                        /* [count][4], owned */
    uint8_t *plane[MOSPT_ATTRIBUTES_MAX]; /* owned */
    uint64_t dropped[PREP_DROP_REASONS];
    bool is_damaged;
    mospt_err damage;
} scan_points;

/* Reads every point of scan 0 in batches of `batch_size`. */
bool scan_points_read(const char *path, const prep_scan_options *options, uint32_t batch_size,
                      scan_points *out, mospt_err *err);
void scan_points_fini(scan_points *points);

/* One value of an attribute; NaN if there is no such attribute or component. */
double scan_points_value(const scan_points *points, const char *attribute, uint64_t index,
                         uint32_t component);

/* Type name of an attribute, "" if there is none. */
const char *scan_points_type(const scan_points *points, const char *attribute);

/* Writes a file in a folder that lives as long as the test program; returns its path, in a static
 * buffer. */
const char *scan_points_file(const char *name, const void *bytes, size_t size);
const char *scan_points_folder(void);

/* Reads bytes as a file of that name and expects an error of the kinds readers may give, or points;
 * returns whether there were any. `points`, if not NULL, is left to the caller. */
bool scan_points_survive(const char *name, const void *bytes, size_t size, uint64_t *count);

/* A small generator with a fixed sequence. */
uint32_t scan_points_random(uint64_t *state);
