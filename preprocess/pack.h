/* preprocess/pack.h - from a batch of a scan to records of the dataset: grid coordinates, and
 * attributes by its schema. */
#pragma once
#include "mospt/payload.h"
#include "preprocess/batch.h"
#include "preprocess/implied.h"

typedef struct {
    const mospt_grid *grid;     /* borrowed */
    const mospt_schema *schema; /* borrowed, of the dataset; its attributes have the types of those
                                   of the scan, or wider ones */
    const mospt_schema *planes; /* borrowed, of the scan */
    uint32_t scan;              /* index of the source */
} prep_packer;

/* Sums over packed points; start with prep_pack_sums_empty. */
typedef struct {
    uint64_t hash;            /* as mospt_hash_records() */
    double position_error;    /* metres */
    uint32_t low[3], high[3]; /* grid coordinates; low > high while there are no points */
    bool outside;             /* a point was outside the root cube: nothing of this batch counts */
    prep_differing differs;   /* from what the schema says of attributes that are not in planes */
} prep_pack_sums;

extern const prep_pack_sums prep_pack_sums_empty;
void prep_pack_sums_add(prep_pack_sums *sums, const prep_pack_sums *more);

/* Packs points [begin, end) of a batch.
 * records  out, [end - begin][mospt_record_size()]
 * sums     these points are added to them
 * threads  any */
void prep_pack(const prep_packer *packer, const prep_batch *batch, uint32_t begin, uint32_t end,
               uint8_t *records, prep_pack_sums *sums);
