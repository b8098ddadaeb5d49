#include "preprocess/laz_items.h"

#include <stdlib.h>
#include <string.h>

struct prep_laz_chunk {
    prep_laz_format format;
    prep_laz_rows *rows;     /* owned; one of the two */
    prep_laz_layers *layers; /* owned */
    uint8_t *first; /* [record_length], owned: record that opens the chunk, stored as it is */
    uint64_t offset, size;
    uint64_t points, done;
    bool ends_early, has_ended;
    const char *damage;
    uint64_t damage_byte;
    mospt_err err; /* of a read that failed underneath */
};

bool prep_laz_chunk_create(const prep_laz_format *format, prep_laz_chunk **out, mospt_err *err)
{
    prep_laz_chunk *c = calloc(1, sizeof *c);
    if (c == NULL) return mospt_err_nomem(err, sizeof *c);
    c->format = *format;
    c->has_ended = true;
    c->first = malloc(format->record_length);
    if (format->compressor == PREP_LAZ_LAYER_CHUNKS) c->layers = prep_laz_layers_create(format);
    else c->rows = prep_laz_rows_create(format);
    if (c->first == NULL || (c->layers == NULL && c->rows == NULL)) {
        prep_laz_chunk_destroy(c);
        return mospt_err_nomem(err, 1 << 20);
    }
    *out = c;
    return true;
}

void prep_laz_chunk_destroy(prep_laz_chunk *c)
{
    if (c == NULL) return;
    prep_laz_rows_destroy(c->rows);
    prep_laz_layers_destroy(c->layers);
    free(c->first);
    free(c);
}

static void set_damage(prep_laz_chunk *c, uint64_t byte, const char *sentence)
{
    if (c->damage != NULL) return;
    c->damage = sentence;
    c->damage_byte = byte;
}

static bool begin(prep_laz_chunk *c, prep_laz_source source, uint64_t points, bool ends_early,
                  mospt_err *err)
{
    c->offset = source.offset;
    c->size = source.size;
    c->points = points;
    c->done = 0;
    c->ends_early = ends_early;
    c->damage = NULL;
    c->err = (mospt_err){0};
    bool ok = c->layers != NULL ? prep_laz_layers_begin(c->layers, source, c->first, &c->err)
                                : prep_laz_rows_begin(c->rows, source, c->first, &c->err);
    c->has_ended = !ok;
    if (c->err.code != MOSPT_OK) {
        if (err != NULL) *err = c->err;
        return false;
    }
    if (!ok) set_damage(c, source.offset, "the chunk is too small to hold its first point");
    uint32_t own = ok && c->layers != NULL ? prep_laz_layers_count(c->layers) : 0;
    if (points == 0) c->points = own;
    if (own != 0 && own != c->points)
        set_damage(c, source.offset + c->format.record_length,
                   "the chunk claims another number of points than the file does");
    return true;
}

bool prep_laz_chunk_begin(prep_laz_chunk *c, prep_input *input, uint64_t offset, uint64_t size,
                          uint64_t points, bool ends_early, mospt_err *err)
{
    prep_laz_source source = {.input = input, .offset = offset, .size = size};
    return begin(c, source, points, ends_early, err);
}

static void end(prep_laz_chunk *c)
{
    uint64_t byte;
    c->has_ended = true;
    if (c->layers != NULL) {
        const char *damage = prep_laz_layers_damage(c->layers, &byte);
        if (damage != NULL) set_damage(c, byte, damage);
    }
    if (c->done < c->points)
        set_damage(c, c->offset + c->size, "the chunk ends before its last point");
    else if (c->rows != NULL && !c->ends_early && prep_laz_rows_left(c->rows) > 0)
        set_damage(c, prep_laz_chunk_end(c),
                   "the chunk is longer than its points, which may be wrong");
}

bool prep_laz_chunk_read(prep_laz_chunk *c, uint8_t *records, size_t count, size_t *got,
                         mospt_err *err)
{
    size_t done = 0;
    if (count > c->points - c->done) count = (size_t)(c->points - c->done);
    if (!c->has_ended && c->done == 0 && count > 0)
        memcpy(records, c->first, c->format.record_length), done = 1;
    if (!c->has_ended && done < count) {
        uint8_t *rest = records + done * c->format.record_length;
        done += c->layers != NULL ? prep_laz_layers_read(c->layers, rest, count - done)
                                  : prep_laz_rows_read(c->rows, rest, count - done);
    }
    c->done += done;
    *got = done;
    if (c->err.code != MOSPT_OK) {
        if (err != NULL) *err = c->err;
        return false;
    }
    if (!c->has_ended && (done < count || c->done == c->points)) end(c);
    return true;
}

const char *prep_laz_chunk_damage(const prep_laz_chunk *c, uint64_t *byte)
{
    *byte = c->damage_byte;
    return c->damage;
}

uint64_t prep_laz_chunk_end(const prep_laz_chunk *c)
{
    return c->offset + c->size - (c->rows != NULL ? prep_laz_rows_left(c->rows) : 0);
}

bool prep_laz_chunk_decode(const prep_laz_format *format, const uint8_t *bytes, size_t size,
                           uint64_t points, uint8_t *records, uint64_t *got, mospt_err *err)
{
    prep_laz_chunk *c;
    size_t n = 0;
    if (!prep_laz_chunk_create(format, &c, err)) return false;
    prep_laz_source source = {.bytes = bytes, .size = size};
    bool ok = begin(c, source, points, false, err) &&
              prep_laz_chunk_read(c, records, (size_t)points, &n, err);
    *got = n;
    prep_laz_chunk_destroy(c);
    return ok;
}
