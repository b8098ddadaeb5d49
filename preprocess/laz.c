#include "preprocess/laz.h"

#include "preprocess/bytes.h"
#include "preprocess/laz_ahead.h"
#include "preprocess/laz_table.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    BLOCK_SIZE = 256 * 1024, /* of records, where no other threads decode */
    VLR_SIZE = 54,
    FORMAT_SIZE_MAX = 256, /* more than any list of items has */
    LASZIP_RECORD = 22204,
};

struct prep_laz {
    prep_input *input; /* borrowed */
    prep_laz_format format;
    prep_laz_table table;
    uint32_t thread_count;
    mospt_err table_damage, damage; /* MOSPT_OK: none */

    prep_laz_ahead *ahead; /* owned; decodes, if there are chunks enough for several threads */
    prep_laz_chunk *chunk; /* owned; decodes otherwise */
    uint8_t *block;        /* [block_records * record_length], owned */
    size_t block_records;
    uint32_t place; /* chunk that is being decoded without other threads */
    bool is_within; /* and has been begun with */
    bool is_at_end;
    prep_laz_part part;
    size_t part_used; /* records of it that have been delivered */
};

static bool read_format(prep_input *in, const prep_las_header *h, prep_laz_format *out,
                        mospt_err *err)
{
    uint64_t at = h->header_size;
    for (uint32_t i = 0; i < h->vlr_count && at + VLR_SIZE <= h->data_offset; i++) {
        uint8_t p[FORMAT_SIZE_MAX];
        size_t got;
        if (!prep_input_read_at(in, at, p, VLR_SIZE, &got, err)) return false;
        size_t size = prep_le16(p + 20);
        if (got < VLR_SIZE || size > h->data_offset - at - VLR_SIZE) break;
        if (memcmp(p + 2, "laszip encoded", 15) == 0 && prep_le16(p + 18) == LASZIP_RECORD) {
            if (!prep_input_read_at(in, at + VLR_SIZE, p, size < sizeof p ? size : sizeof p, &got,
                                    err))
                return false;
            return prep_laz_format_parse(h, prep_input_path(in), p, got, at + VLR_SIZE, out, err);
        }
        at += VLR_SIZE + size;
    }
    return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(prep_input_path(in), 104),
                         "the points are compressed, but the record that says how is missing");
}

static uint32_t choose_threads(uint32_t wanted)
{
    if (wanted == 0) {
        long processors = sysconf(_SC_NPROCESSORS_ONLN);
        wanted = processors > 0 ? (uint32_t)processors : 1;
    }
    return wanted < PREP_LAZ_THREADS_MAX ? wanted : PREP_LAZ_THREADS_MAX;
}

bool prep_laz_open(prep_input *input, const prep_las_header *header, uint32_t threads,
                   prep_laz **out, mospt_err *err)
{
    prep_laz *laz = calloc(1, sizeof *laz);
    if (laz == NULL) return mospt_err_nomem(err, sizeof *laz);
    laz->input = input;
    laz->thread_count = choose_threads(threads);
    if (!read_format(input, header, &laz->format, err) ||
        !prep_laz_table_read(input, header, &laz->format, &laz->table, &laz->table_damage, err)) {
        prep_laz_close(laz);
        return false;
    }
    laz->damage = laz->table_damage;
    *out = laz;
    return true;
}

/* Lets go of everything that reading takes. */
static void stop_reading(prep_laz *laz)
{
    prep_laz_ahead_destroy(laz->ahead);
    prep_laz_chunk_destroy(laz->chunk);
    free(laz->block);
    laz->ahead = NULL;
    laz->chunk = NULL;
    laz->block = NULL;
    laz->part = (prep_laz_part){0};
    laz->part_used = 0;
}

void prep_laz_close(prep_laz *laz)
{
    if (laz == NULL) return;
    stop_reading(laz);
    prep_laz_table_fini(&laz->table);
    free(laz);
}

const prep_laz_format *prep_laz_format_of(const prep_laz *laz)
{
    return &laz->format;
}

void prep_laz_leave_out_waves(prep_laz *laz)
{
    laz->format.leaves_out_waves = true;
}

uint64_t prep_laz_point_count(const prep_laz *laz)
{
    return laz->table.points;
}

const mospt_err *prep_laz_damage(const prep_laz *laz)
{
    return laz->damage.code != MOSPT_OK ? &laz->damage : NULL;
}

static void note_damage(prep_laz *laz, uint32_t place, const char *sentence, uint64_t byte)
{
    if (sentence == NULL || laz->damage.code != MOSPT_OK) return;
    mospt_err_set(&laz->damage, MOSPT_EFORMAT, mospt_at_byte(prep_input_path(laz->input), byte),
                  "chunk %" PRIu32 ": %s", place, sentence);
}

static bool prepare(prep_laz *laz, mospt_err *err)
{
    if (laz->ahead != NULL || laz->chunk != NULL) return true;
    laz->place = 0;
    laz->is_within = false;
    if (laz->thread_count > 1 && laz->table.count > 1 && !laz->table.is_open &&
        !prep_laz_ahead_create(laz->input, &laz->format, &laz->table, laz->thread_count,
                               &laz->ahead, err))
        return false;
    if (laz->ahead != NULL) return true;
    laz->block_records = (size_t)BLOCK_SIZE / laz->format.record_length;
    if (laz->block_records == 0) laz->block_records = 1;
    size_t size = laz->block_records * laz->format.record_length;
    laz->block = malloc(size);
    if (laz->block == NULL) return mospt_err_nomem(err, size);
    return prep_laz_chunk_create(&laz->format, &laz->chunk, err);
}

/* Notes what a chunk has come to, and where the next one begins if no table said so. */
static bool end_place(prep_laz *laz, mospt_err *err)
{
    uint64_t byte;
    const char *damage = prep_laz_chunk_damage(laz->chunk, &byte);
    note_damage(laz, laz->place, damage, byte);
    laz->is_within = false;
    laz->place++;
    if (laz->place < laz->table.count || !laz->table.is_open || damage != NULL) return true;
    mospt_err failed = {0};
    if (prep_laz_table_go_on(&laz->table, &laz->format, prep_laz_chunk_end(laz->chunk), &failed))
        return true;
    if (failed.code == MOSPT_OK) return true;
    if (err != NULL) *err = failed;
    return false;
}

/* Decodes some records of the chunk whose turn it is. */
static bool decode_here(prep_laz *laz, mospt_err *err)
{
    laz->part = (prep_laz_part){.records = laz->block};
    while (laz->part.count == 0 && laz->place < laz->table.count) {
        const prep_laz_place *p = &laz->table.places[laz->place];
        bool ends_early = laz->table.is_open || laz->format.compressor == PREP_LAZ_ROWS;
        if (!laz->is_within && !prep_laz_chunk_begin(laz->chunk, laz->input, p->offset, p->size,
                                                     p->points, ends_early, err))
            return false;
        laz->is_within = true;
        if (!prep_laz_chunk_read(laz->chunk, laz->block, laz->block_records, &laz->part.count, err))
            return false;
        if (laz->part.count < laz->block_records && !end_place(laz, err)) return false;
    }
    return true;
}

bool prep_laz_read(prep_laz *laz, size_t most, const uint8_t **records, size_t *count,
                   mospt_err *err)
{
    *records = NULL;
    *count = 0;
    while (laz->part_used == laz->part.count && !laz->is_at_end) {
        laz->part_used = 0;
        laz->part.count = 0;
        if (!prepare(laz, err)) return false;
        if (laz->ahead != NULL ? !prep_laz_ahead_next(laz->ahead, &laz->part, err)
                               : !decode_here(laz, err))
            return false;
        note_damage(laz, laz->part.place, laz->part.damage, laz->part.damage_byte);
        laz->is_at_end = laz->part.count == 0 && laz->part.damage == NULL;
    }
    if (laz->is_at_end) {
        stop_reading(laz);
        return true;
    }
    *count = laz->part.count - laz->part_used;
    if (*count > most) *count = most;
    *records = laz->part.records + laz->part_used * laz->format.record_length;
    laz->part_used += *count;
    return true;
}

void prep_laz_rewind(prep_laz *laz)
{
    stop_reading(laz);
    laz->is_at_end = false;
    laz->damage = laz->table_damage;
}

uint32_t prep_laz_chunk_count(const prep_laz *laz)
{
    return laz->table.is_open ? 1 : laz->table.count;
}

bool prep_laz_look(prep_laz *laz, uint32_t place, uint8_t *records, size_t count, size_t *got,
                   mospt_err *err)
{
    const prep_laz_place *p = &laz->table.places[place];
    prep_laz_chunk *chunk;
    *got = 0;
    if (!prep_laz_chunk_create(&laz->format, &chunk, err)) return false;
    bool ok = prep_laz_chunk_begin(chunk, laz->input, p->offset, p->size, p->points, true, err) &&
              prep_laz_chunk_read(chunk, records, count, got, err);
    prep_laz_chunk_destroy(chunk);
    return ok;
}
