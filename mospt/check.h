/* mospt/check.h - proof that a dataset holds what it says: every byte, every point, every promise
 * of the structure. */
#pragma once
#include "mospt/dataset.h"

typedef struct {
    /* Told of each thing that is wrong, in one sentence with file and place. */
    void (*found)(void *context, const mospt_err *what);
    /* Told after each node; returns false to stop. NULL: none. */
    bool (*progress)(void *context, uint32_t nodes_done, uint32_t nodes);
    void *context;
} mospt_check_options;

typedef struct {
    uint64_t points, bytes; /* that were looked at */
    uint64_t findings;
} mospt_check_result;

/* Reads everything: checksums, every point inside its node's cube, the prefix property of each
 * level (one point for each occupied cell), no two points of a rejecting octant in one finest cell,
 * children at least as large as the threshold, payloads that fill their files, bounds, points per
 * source, and the conservation checksum. errors   only what keeps it from looking on: MOSPT_ENOMEM,
 * MOSPT_ECANCELLED; all else is found */
bool mospt_check(const mospt_dataset *dataset, const mospt_check_options *options,
                 mospt_check_result *out, mospt_err *err);
