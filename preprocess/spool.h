/* preprocess/spool.h - sequences of records that stay in memory while there is room, and go to the
 * scratch disk after.
 *
 * These are the rejection files of Wimmer & Scheiblauer 2006, section 5.2, and whatever else a pass
 * sets aside. All of them share one store of equal blocks: so many in memory, the others in one
 * scratch file whose blocks are used again. */
#pragma once
#include "mospt/err.h"

typedef struct prep_store prep_store;

typedef struct {
    uint8_t *memory; /* owned by the store; NULL: the block is on the disk */
    uint64_t slot;   /* of the scratch file, if it is */
    uint32_t count;  /* records */
} prep_block;

typedef struct {
    prep_block *blocks; /* [block_count], owned; the last one, in memory, is being filled */
    uint32_t block_count, capacity;
    bool open;      /* the last block still takes records */
    uint64_t count; /* records */
} prep_spool;       /* {0} is empty */

/* folder         where the scratch file is made; it has no name there, so nothing is left behind by
 * a killed process block_size     bytes memory_size    bytes of full blocks that stay in memory;
 * the blocks that are being filled come on top */
bool prep_store_create(const char *folder, size_t record_size, size_t block_size,
                       size_t memory_size, prep_store **out, mospt_err *err);
void prep_store_destroy(prep_store *store);

/* Most bytes of the scratch file that were in use at a time. */
uint64_t prep_store_scratch_peak(const prep_store *store);

/* Records that fit a block. */
uint32_t prep_store_block_capacity(const prep_store *store);

/* Appends one record. threads: one per spool at a time, any number of spools */
bool prep_spool_append(prep_store *store, prep_spool *spool, const uint8_t *record, mospt_err *err);

/* Ends the filling: the last block takes part in the sharing of memory like all others. */
bool prep_spool_seal(prep_store *store, prep_spool *spool, mospt_err *err);

/* Copies all records to `out`, [spool->count][record_size], in their order, and empties the spool.
 */
bool prep_spool_take(prep_store *store, prep_spool *spool, uint8_t *out, mospt_err *err);

/* Copies the records of one block to `out`, [block capacity][record_size], and frees it. Blocks are
 * taken in rising order; the spool is empty after the last one. */
bool prep_spool_take_block(prep_store *store, prep_spool *spool, uint32_t block, uint8_t *out,
                           uint32_t *count, mospt_err *err);

/* Frees what is left of a spool. */
void prep_spool_drop(prep_store *store, prep_spool *spool);
