/* preprocess/spool.h - sequences of records that stay in memory while there is room, and go to the
 * scratch disk after.
 *
 * These are the rejection files of Wimmer & Scheiblauer 2006, section 5.2, and whatever else a pass
 * sets aside. All of them share one store of equal blocks: so many in memory, the others in one
 * scratch file whose blocks are used again. */
#pragma once
#include "mospt/err.h"
#include "mospt/point.h"

enum { PREP_BLOCK_RECORDS_MIN = 16 };

typedef struct prep_store prep_store;

typedef struct {
    uint8_t *memory; /* of the store; NULL: the block is on the disk */
    uint64_t slot;   /* of the scratch file, if it is */
    uint32_t stored; /* bytes there; fewer than those of its records: they are compressed */
    uint32_t count;  /* records; 0: taken */
} prep_block;

typedef struct {
    prep_block *blocks; /* [block_count], owned; the last one, in memory, is being filled */
    uint32_t block_count, capacity;
    uint8_t *next, *end; /* room in the last block; NULL: it takes no more */
    uint64_t count;      /* records */
} prep_spool;            /* {0} is empty */

/* folder       where the scratch file is made; it has no name there, so nothing is left behind by a
 *              killed process
 * record_size  bytes, at least those of a vertex
 * block_size   bytes, at most; a block holds a power of two of records, and at least
 *              PREP_BLOCK_RECORDS_MIN
 * memory_size  bytes of full blocks that stay in memory; the blocks that are being filled come on
 *              top */
bool prep_store_create(const char *folder, size_t record_size, size_t block_size,
                       size_t memory_size, prep_store **out, mospt_err *err);
void prep_store_destroy(prep_store *store);

/* From now on, blocks are compressed before they go to the disk (LZ4, column by column), where that
 * makes them shorter: for a disk that is slower than the processor. */
void prep_store_compress(prep_store *store);

/* Most bytes of the scratch file that were in use at a time. */
uint64_t prep_store_scratch_peak(const prep_store *store);

/* log2 of the records that fit a block. */
uint32_t prep_store_block_shift(const prep_store *store);

/* Bytes of a block. */
size_t prep_store_block_size(const prep_store *store);

/* Memory that the next blocks come from and that nobody has touched, so that many threads can do it
 * before one fills them, see prep_pages_touch(). It is told once, and not at all where it would be
 * much of what may stay in memory.
 * ahead  bytes that will be filled
 * unit   bytes: it is told in multiples of so many, but where a piece of memory ends
 * size   out: bytes, 0 where there is none */
uint8_t *prep_store_untouched(prep_store *store, size_t ahead, size_t unit, size_t *size);

/* Makes room in a spool whose last block is full. Use prep_spool_append(). */
bool prep_spool_grow(prep_store *store, prep_spool *spool, mospt_err *err);

/* Appends one record.
 * record_size  of the store
 * threads      one per spool at a time, any number of spools */
static inline bool prep_spool_append(prep_store *store, prep_spool *spool, const uint8_t *record,
                                     size_t record_size, mospt_err *err)
{
    if (spool->next == spool->end && !prep_spool_grow(store, spool, err)) return false;
    mospt_record_copy(spool->next, record, record_size);
    spool->next += record_size;
    spool->count++;
    return true;
}

/* Ends the filling: the last block takes part in the sharing of memory like all others. */
bool prep_spool_seal(prep_store *store, prep_spool *spool, mospt_err *err);

/* Bytes that prep_spool_view() reads from the disk into memory. */
size_t prep_spool_size_on_disk(const prep_store *store, const prep_spool *spool);

/* Moves full blocks of a sealed spool to the disk until `size` bytes of others may stay in memory,
 * or none is left: for what is needed sooner. */
bool prep_spool_make_room(prep_store *store, prep_spool *spool, size_t size, mospt_err *err);

/* Makes all records of a sealed spool addressable, as they stand in its blocks.
 * buffer   [prep_spool_size_on_disk()]
 * blocks   out, [spool->block_count]: for mospt_records, with prep_store_block_shift(); valid until
 *          the spool is dropped */
bool prep_spool_view(prep_store *store, const prep_spool *spool, uint8_t *buffer,
                     const uint8_t **blocks, mospt_err *err);

/* Copies all records to `out`, [spool->count][record_size], in their order, and empties the spool.
 */
bool prep_spool_take(prep_store *store, prep_spool *spool, uint8_t *out, mospt_err *err);

/* Copies the records of one block of a sealed spool to `out`, [2^block_shift][record_size], and
 * frees it. Drop the spool when all are taken.
 * threads  any, each block by one */
bool prep_spool_take_block(prep_store *store, prep_spool *spool, uint32_t block, uint8_t *out,
                           uint32_t *count, mospt_err *err);

/* Frees what is left of a spool. */
void prep_spool_drop(prep_store *store, prep_spool *spool);
