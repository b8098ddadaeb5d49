/* preprocess/laz_ahead.h - a few threads that decode chunks ahead of the reader, who gets them in
 * order. Internal.
 *
 * There is one buffer more than there are threads, and a buffer holds one chunk, or part of one
 * that is larger than PREP_LAZ_PART_SIZE. Chunk i goes to buffer i modulo their number, so that
 * nobody runs ahead further than that. */
#pragma once
#include "preprocess/laz_table.h"

enum { PREP_LAZ_PART_SIZE = 4 * 1024 * 1024 };

typedef struct {
    const uint8_t *records; /* borrowed until the next part is asked for */
    size_t count;           /* 0: all chunks have been read */
    uint32_t place;         /* the chunk that they are from */
    const char *damage;     /* found at the end of this part; NULL: none */
    uint64_t damage_byte;
} prep_laz_part;

typedef struct prep_laz_ahead prep_laz_ahead; /* opaque; one thread at a time */

/* Starts the threads.
 * table    borrowed, with count > 0; not open
 * out      NULL if no thread could be started: then the caller has to do without */
bool prep_laz_ahead_create(prep_input *input, const prep_laz_format *format,
                           const prep_laz_table *table, uint32_t thread_count, prep_laz_ahead **out,
                           mospt_err *err);
void prep_laz_ahead_destroy(prep_laz_ahead *ahead);

/* The next part in order; parts without records are passed on only if they tell of damage.
 * errors   MOSPT_EIO, MOSPT_ENOMEM, from whichever thread */
bool prep_laz_ahead_next(prep_laz_ahead *ahead, prep_laz_part *out, mospt_err *err);
