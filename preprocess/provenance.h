/* preprocess/provenance.h - what a dataset says of the scans that it was built from. */
#pragma once
#include "mospt/dataset.h"
#include "preprocess/pack.h"
#include "preprocess/source.h"

/* Fills in sources, coordinate reference system, bounds, checksum and position error.
 * metadata  with its grid
 * source    whose points have all been read
 * of_scan   [source->scan_count]
 * crs       NULL: that of the first scan which names one */
bool prep_provenance_fill(mospt_metadata *metadata, const prep_source *source,
                          const prep_pack_sums *of_scan, const char *crs, mospt_err *err);

/* Hash of all that decides what the dataset will be: the scans as they lie on the disk, and what is
 * done with them.
 * metadata  grid, schema, inner_depth and add_threshold
 * dedupe    whether duplicates are left out */
uint64_t prep_provenance_hash(const mospt_metadata *metadata, const prep_source *source,
                              bool dedupe);
