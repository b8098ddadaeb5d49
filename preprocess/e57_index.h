/* preprocess/e57_index.h - which scans an E57 file holds: its header and its XML section. Internal
 * to the E57 reader.
 *
 * All of the XML is read to find one scan, and each scan in it looked at; a prep_scan_memory keeps
 * what it says for the next scan of the file. */
#pragma once
#include "preprocess/e57_points.h"

typedef struct {
    uint32_t major, minor; /* version of the file */
    uint32_t scan_count;   /* scans whose points can be read */
    prep_e57_scan *desc;   /* owned, the one that was asked for; NULL if there are not as many */
} prep_e57_found;

/* Finds scan `index` among those whose points can be read. Tells `scan` the coordinate reference
 * system and what is wrong with the file.
 * pages    initialised
 * out      written on success only
 * errors   MOSPT_EFORMAT, MOSPT_EEMPTY: no scan has points; MOSPT_EIO, MOSPT_ENOMEM */
bool prep_e57_find(prep_scan *scan, prep_e57_pages *pages, prep_scan_memory *memory, uint32_t index,
                   prep_e57_found *out, mospt_err *err);
