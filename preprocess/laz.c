#include "preprocess/laz.h"

#include "preprocess/ahead.h"
#include "preprocess/bytes.h"
#include "preprocess/laz_table.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum {
    PART_SIZE = 256 * 1024,            /* of records, which one thread decodes and delivers */
    PART_SIZE_AHEAD = 4 * 1024 * 1024, /* where others decode ahead: holds most chunks as a whole */
    VLR_SIZE = 54,
    FORMAT_SIZE_MAX = 256, /* more than any list of items has */
    LASZIP_RECORD = 22204,
};

/* A chunk that is being decoded, and what has been decoded of it and not yet delivered. */
typedef struct {
    prep_laz_chunk *chunk; /* owned */
    prep_laz_place place;
    uint32_t number;  /* of the chunk; that of chunks: there is none */
    uint8_t *records; /* [capacity], owned */
    size_t capacity, count;
    uint64_t done; /* records of the chunk so far */
    bool has_more; /* records than fit */
    const char *damage;
    uint64_t damage_byte;
} block;

struct prep_laz {
    prep_input *input; /* borrowed */
    prep_laz_format format;
    prep_laz_table table;
    uint32_t thread_count;
    mospt_err table_damage, damage; /* MOSPT_OK: none */

    prep_ahead *ahead; /* owned; NULL: nothing has been read */
    size_t part_records;
    uint32_t next;     /* chunk to begin with; of whoever fills a block */
    block *block;      /* borrowed from `ahead`; NULL before the first */
    size_t block_used; /* records of it that have been delivered */
    bool is_at_end;
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

bool prep_laz_open(prep_input *input, const prep_las_header *header, uint32_t threads,
                   prep_laz **out, mospt_err *err)
{
    prep_laz *laz = calloc(1, sizeof *laz);
    if (laz == NULL) return mospt_err_nomem(err, sizeof *laz);
    laz->input = input;
    laz->thread_count = threads > 0 ? threads : prep_ahead_thread_count();
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
    prep_ahead_destroy(laz->ahead);
    laz->ahead = NULL;
    laz->block = NULL;
    laz->block_used = 0;
    laz->next = 0;
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

static void note_damage(prep_laz *laz, const block *b)
{
    if (b->damage == NULL || laz->damage.code != MOSPT_OK) return;
    mospt_err_set(&laz->damage, MOSPT_EFORMAT,
                  mospt_at_byte(prep_input_path(laz->input), b->damage_byte),
                  "chunk %" PRIu32 ": %s", b->number, b->damage);
}

/* Where no table says it, the next chunk begins where the last one has ended, which there is only
 * one block to know of.
 * has_next  out */
static bool find_next(prep_laz *laz, const block *last, bool *has_next, mospt_err *err)
{
    mospt_err failed = {0};
    *has_next =
        laz->next < laz->table.count ||
        (laz->table.is_open && last->chunk != NULL && last->damage == NULL &&
         prep_laz_table_go_on(&laz->table, &laz->format, prep_laz_chunk_end(last->chunk), &failed));
    if (failed.code == MOSPT_OK) return true;
    if (err != NULL) *err = failed;
    return false;
}

static bool fill(void *context, void *memory, bool *is_last, mospt_err *err)
{
    prep_laz *laz = context;
    block *b = memory;
    bool has_next;
    if (!find_next(laz, b, &has_next, err)) return false;
    *is_last = !has_next;
    b->number = laz->next;
    if (has_next) b->place = laz->table.places[laz->next++];
    return true;
}

static bool make_room(block *b, size_t count, size_t record_length, mospt_err *err)
{
    if (b->capacity >= count) return true;
    free(b->records);
    b->records = malloc(count * record_length);
    b->capacity = b->records != NULL ? count : 0;
    return b->records != NULL || mospt_err_nomem(err, count * record_length);
}

/* Decodes the next records of a chunk. */
static bool decode(const prep_laz *laz, block *b, mospt_err *err)
{
    size_t most = laz->part_records;
    if (b->place.points < most) most = (size_t)b->place.points;
    if (!make_room(b, most, laz->format.record_length, err) ||
        !prep_laz_chunk_read(b->chunk, b->records, most, &b->count, err))
        return false;
    b->done += b->count;
    b->has_more = b->count == most && b->done < b->place.points;
    if (!b->has_more) b->damage = prep_laz_chunk_damage(b->chunk, &b->damage_byte);
    return true;
}

static bool work(const void *context, void *memory, mospt_err *err)
{
    const prep_laz *laz = context;
    block *b = memory;
    b->count = 0;
    b->done = 0;
    b->has_more = false;
    b->damage = NULL;
    if (b->number == laz->table.count) return true;
    bool ends_early = laz->table.is_open || laz->format.compressor == PREP_LAZ_ROWS;
    return (b->chunk != NULL || prep_laz_chunk_create(&laz->format, &b->chunk, err)) &&
           prep_laz_chunk_begin(b->chunk, laz->input, b->place.offset, b->place.size,
                                b->place.points, ends_early, err) &&
           decode(laz, b, err);
}

static void fini(void *memory)
{
    block *b = memory;
    prep_laz_chunk_destroy(b->chunk);
    free(b->records);
}

static bool start_reading(prep_laz *laz, mospt_err *err)
{
    const prep_ahead_task task = {laz, sizeof(block), fill, work, fini};
    uint32_t threads = laz->table.is_open ? 0 : laz->thread_count;
    if (threads > laz->table.count) threads = laz->table.count;
    if (threads <= 1) threads = 0;
    size_t size = threads > 0 ? PART_SIZE_AHEAD : PART_SIZE;
    laz->part_records = size / laz->format.record_length;
    if (laz->part_records == 0) laz->part_records = 1;
    return prep_ahead_create(&task, threads, &laz->ahead, err);
}

/* What does not fit into the part of a chunk that was decoded ahead is decoded here. */
static bool next_part(prep_laz *laz, mospt_err *err)
{
    void *memory = laz->block;
    laz->block_used = 0;
    if (laz->ahead == NULL && !start_reading(laz, err)) return false;
    if (laz->block != NULL && laz->block->has_more) {
        if (!decode(laz, laz->block, err)) return false;
    } else if (!prep_ahead_next(laz->ahead, &memory, err)) {
        laz->block = NULL;
        return false;
    }
    laz->block = memory;
    laz->is_at_end = laz->block == NULL || laz->block->number == laz->table.count;
    if (!laz->is_at_end) note_damage(laz, laz->block);
    return true;
}

bool prep_laz_read(prep_laz *laz, size_t most, const uint8_t **records, size_t *count,
                   mospt_err *err)
{
    *records = NULL;
    *count = 0;
    while (!laz->is_at_end && (laz->block == NULL || laz->block_used == laz->block->count)) {
        if (!next_part(laz, err)) return false;
    }
    if (laz->is_at_end) {
        stop_reading(laz);
        return true;
    }
    *count = laz->block->count - laz->block_used;
    if (*count > most) *count = most;
    *records = laz->block->records + laz->block_used * laz->format.record_length;
    laz->block_used += *count;
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

uint64_t prep_laz_chunk_first(const prep_laz *laz, uint32_t chunk)
{
    uint64_t first = 0;
    for (uint32_t i = 0; i < chunk; i++)
        first += laz->table.places[i].points;
    return first;
}

/* The chunk of a point, and how many points stand before it there; table.count if it is unknown. */
static uint32_t find_chunk(const prep_laz *laz, uint64_t point, uint64_t *lead)
{
    uint32_t chunk = 0, count = laz->table.count;
    while (chunk < count && point >= laz->table.places[chunk].points)
        point -= laz->table.places[chunk++].points;
    *lead = point;
    return chunk;
}

uint64_t prep_laz_lead(const prep_laz *laz, uint64_t point)
{
    uint64_t lead;
    return find_chunk(laz, point, &lead) < laz->table.count ? lead : UINT64_MAX;
}

/* Reads `count` records of a chunk behind the first `lead`. */
static bool look_into(prep_laz *laz, prep_laz_chunk *chunk, uint32_t number, uint64_t lead,
                      uint8_t *records, size_t count, size_t *got, mospt_err *err)
{
    const prep_laz_place *p = &laz->table.places[number];
    *got = 0;
    if (!prep_laz_chunk_begin(chunk, laz->input, p->offset, p->size, p->points, true, err))
        return false;
    while (lead > 0) {
        size_t skipped;
        if (!prep_laz_chunk_read(chunk, records, lead < count ? (size_t)lead : count, &skipped,
                                 err))
            return false;
        if (skipped == 0) return true;
        lead -= skipped;
    }
    return prep_laz_chunk_read(chunk, records, count, got, err);
}

bool prep_laz_look(prep_laz *laz, uint64_t point, uint8_t *records, size_t count, size_t *got,
                   mospt_err *err)
{
    uint64_t lead;
    uint32_t number = find_chunk(laz, point, &lead);
    prep_laz_chunk *chunk;
    bool ok = true, is_whole = true;
    *got = 0;
    if (!prep_laz_chunk_create(&laz->format, &chunk, err)) return false;
    for (; ok && is_whole && *got < count && number < laz->table.count; number++) {
        uint64_t there = laz->table.places[number].points - lead;
        size_t want = there < count - *got ? (size_t)there : count - *got, n;
        ok = look_into(laz, chunk, number, lead, records + *got * laz->format.record_length, want,
                       &n, err);
        is_whole = n == want;
        *got += n;
        lead = 0;
    }
    prep_laz_chunk_destroy(chunk);
    return ok;
}
