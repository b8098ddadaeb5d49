/* preprocess/dedupe.h - of all points at one position, only the first.
 *
 * Nothing is lost unless someone asks for it. Then all points are divided among octants until those
 * of each fit in memory, sorted there, and what is left goes on in Morton order: whatever the
 * memory and the threads, always the same points in the same order. */
#pragma once
#include "preprocess/pack.h"
#include "preprocess/pass.h"

/* What is left of one scan. */
typedef struct {
    uint64_t dropped;    /* points */
    prep_pack_sums sums; /* of the others; no position_error, which is that of all */
} prep_dedupe_scan;

/* env      divides; of the pass
 * divided  a pass into which all points were inserted; freed, also after a failure
 * scans    out, [scan_count], by the attribute "scan"
 * kept     out, sealed */
bool prep_dedupe(const prep_pass_env *env, prep_pass *divided, prep_dedupe_scan *scans,
                 uint32_t scan_count, prep_spool *kept, mospt_err *err);
