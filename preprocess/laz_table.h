/* preprocess/laz_table.h - where the chunks of a LAZ file are. Internal to the LAZ decoder.
 *
 * The chunk table stands behind the chunks, coded itself; a word before the first chunk says where.
 * A writer that was interrupted, or a damaged file, leaves none. Layered chunks are then found by
 * their heads; of the others only the first is known, and where it ends the next one begins. */
#pragma once
#include "preprocess/laz.h"

typedef struct {
    uint64_t offset, size, points;
} prep_laz_place;

typedef struct {
    prep_laz_place *places; /* [count], owned */
    uint32_t count, capacity;
    bool is_open; /* the last place reaches to `end`, and further chunks follow where its points end
                   */
    uint64_t end; /* of the compressed points, as far as it is known */
    uint64_t points; /* in all places, and in those that follow if the table is open */
} prep_laz_table;

/* Finds the chunks.
 * damage   out, MOSPT_OK or what is wrong although there are chunks
 * errors   MOSPT_EFORMAT: no chunk can be found; MOSPT_EIO, MOSPT_ENOMEM */
bool prep_laz_table_read(prep_input *input, const prep_las_header *header,
                         const prep_laz_format *format, prep_laz_table *out, mospt_err *damage,
                         mospt_err *err);
void prep_laz_table_fini(prep_laz_table *table);

/* Adds the chunk that follows the last one of an open table, whose points have been found to end at
 * `offset`. returns  false if there is none, or no memory for it, which alone sets err->code */
bool prep_laz_table_go_on(prep_laz_table *table, const prep_laz_format *format, uint64_t offset,
                          mospt_err *err);
