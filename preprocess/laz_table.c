#include "preprocess/laz_table.h"

#include "preprocess/laz_items.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* The record "laszip encoded": u16 compressor, u16 coder, u8 u8 u16 version, u32 options, u32
 * points of a chunk, i64 i64 special records, u16 number of items, and for each u16 type, u16 size,
 * u16 version. */
enum {
    RECORD_SIZE = 34,
    ITEM_SIZE = 6,
    ITEM_BYTE = 0,
    ITEM_POINT10 = 6,
    ITEM_GPSTIME11,
    ITEM_RGB12,
    ITEM_WAVEPACKET13,
    ITEM_POINT14,
    ITEM_RGB14,
    ITEM_RGBNIR14,
    ITEM_WAVEPACKET14,
    ITEM_BYTE14,
    ITEMS_MAX = 5,
    VARIABLE = -1, /* as u32: chunks differ in size */
    POINTER_SIZE = 8,
    TABLE_HEAD_SIZE = 8,
    TABLE_WINDOW_SIZE = 64 * 1024,
    TABLE_NEED = 2 * PREP_LAZ_INTEGER_MAX,
};

typedef struct {
    uint16_t type, size;
} item;

/* What the items of a point format must be; there is only one way. */
static uint32_t list_items(const prep_las_header *h, item items[ITEMS_MAX], prep_laz_format *f)
{
    uint8_t format = h->point_format;
    bool has_gps = format == 1 || (format >= 3 && format <= 5),
         has_rgb = format == 2 || format == 3 || format == 5;
    uint16_t n = 0, at = 0;
    if (format < 6) {
        items[n++] = (item){ITEM_POINT10, at = 20};
        if (has_gps) items[n++] = (item){ITEM_GPSTIME11, 8}, f->gps_at = at, at += 8;
        if (has_rgb) items[n++] = (item){ITEM_RGB12, 6}, f->rgb_at = at, at += 6;
        if (format >= 4) items[n++] = (item){ITEM_WAVEPACKET13, 29}, f->wave_at = at, at += 29;
    } else {
        items[n++] = (item){ITEM_POINT14, at = 30};
        f->gps_at = 22;
        if (format == 7) items[n++] = (item){ITEM_RGB14, 6}, f->rgb_at = at, at += 6;
        if (format == 8 || format == 10) {
            items[n++] = (item){ITEM_RGBNIR14, 8};
            f->rgb_at = at;
            f->nir_at = at + 6;
            at += 8;
        }
        if (format >= 9) items[n++] = (item){ITEM_WAVEPACKET14, 29}, f->wave_at = at, at += 29;
    }
    f->extra_at = at;
    f->extra_size = (uint16_t)(h->record_length - at);
    if (f->extra_size > 0) items[n++] = (item){format < 6 ? ITEM_BYTE : ITEM_BYTE14, f->extra_size};
    return n;
}

static bool is_version_known(const prep_laz_format *f, uint16_t type, uint16_t version)
{
    if (f->compressor == PREP_LAZ_LAYER_CHUNKS) return version == f->version;
    return type == ITEM_WAVEPACKET13 ? version == 1 || version == f->version
                                     : version == f->version;
}

static bool check_items(const uint8_t *record, const item *wanted, uint32_t count, mospt_where at,
                        prep_laz_format *f, mospt_err *err)
{
    at.place += 32;
    if (prep_le16(record + 32) != count)
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "points are compressed as %u items, point format %u needs %u",
                             prep_le16(record + 32), f->point_format, count);
    f->version = (uint8_t)(prep_le16(record + RECORD_SIZE + 4) & 255);
    bool is_layered = f->compressor == PREP_LAZ_LAYER_CHUNKS;
    at.place += 2;
    for (uint32_t i = 0; i < count; i++, at.place += ITEM_SIZE) {
        const uint8_t *p = record + RECORD_SIZE + ITEM_SIZE * i;
        uint16_t type = prep_le16(p), size = prep_le16(p + 2), version = prep_le16(p + 4);
        if (type != wanted[i].type || size != wanted[i].size)
            return mospt_err_set(err, MOSPT_EFORMAT, at,
                                 "item %u of a compressed point is type %u of %u bytes, point "
                                 "format %u needs type %u of %u",
                                 i, type, size, f->point_format, wanted[i].type, wanted[i].size);
        if (!is_version_known(f, type, version) || version < (is_layered ? 3 : 1) ||
            version > (is_layered ? 4 : 2))
            return mospt_err_set(err, MOSPT_EFORMAT, at, "version %u of item type %u is not known",
                                 version, type);
    }
    return true;
}

bool prep_laz_format_parse(const prep_las_header *h, const char *file, const uint8_t *record,
                           size_t size, uint64_t offset, prep_laz_format *out, mospt_err *err)
{
    mospt_where at = mospt_at_byte(file, offset);
    item items[ITEMS_MAX];
    prep_laz_format f = {.point_format = h->point_format, .record_length = h->record_length};
    uint32_t count = list_items(h, items, &f);
    if (size < RECORD_SIZE || size < RECORD_SIZE + ITEM_SIZE * (size_t)prep_le16(record + 32))
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "the description of the compression has only %zu bytes", size);
    uint16_t compressor = prep_le16(record), coder = prep_le16(record + 2);
    if (compressor < PREP_LAZ_ROWS || compressor > PREP_LAZ_LAYER_CHUNKS || coder != 0)
        return mospt_err_set(err, MOSPT_EFORMAT, at, "compressor %u with coder %u is not known",
                             compressor, coder);
    f.compressor = (prep_laz_compressor)compressor;
    if ((f.compressor == PREP_LAZ_LAYER_CHUNKS) != (h->point_format >= 6))
        return mospt_err_set(err, MOSPT_EFORMAT, at, "compressor %u is not for point format %u",
                             compressor, h->point_format);
    if (f.extra_size > PREP_LAZ_EXTRA_MAX)
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "%u extra bytes per compressed point, at most %d are read",
                             f.extra_size, PREP_LAZ_EXTRA_MAX);
    f.chunk_points = prep_le32(record + 12);
    if (f.chunk_points == (uint32_t)VARIABLE) f.chunk_points = 0;
    if (!check_items(record, items, count, at, &f, err)) return false;
    *out = f;
    return true;
}

void prep_laz_table_fini(prep_laz_table *table)
{
    free(table->places);
    *table = (prep_laz_table){0};
}

static bool add_place(prep_laz_table *t, prep_laz_place place, mospt_err *err)
{
    if (t->count == t->capacity) {
        uint32_t capacity = t->capacity < 64 ? 64 : 2 * t->capacity;
        prep_laz_place *grown = realloc(t->places, capacity * sizeof *grown);
        if (grown == NULL) return mospt_err_nomem(err, capacity * sizeof *grown);
        t->places = grown;
        t->capacity = capacity;
    }
    t->places[t->count++] = place;
    return true;
}

typedef struct {
    prep_input *input;
    const prep_laz_format *format;
    const char *file;
    uint64_t declared;
    uint64_t begin, file_size;
    prep_laz_table *table;
    mospt_err *damage;
} finder;

static bool read_at(const finder *f, uint64_t offset, void *out, size_t size, bool *is_there,
                    mospt_err *err)
{
    size_t got;
    if (!prep_input_read_at(f->input, offset, out, size, &got, err)) return false;
    *is_there = got == size;
    return true;
}

/* Says where the table begins; 0 if nothing sensible is said. */
static bool find_table(const finder *f, uint64_t *out, mospt_err *err)
{
    uint8_t p[POINTER_SIZE];
    bool is_there;
    *out = 0;
    if (!read_at(f, f->begin - POINTER_SIZE, p, sizeof p, &is_there, err)) return false;
    if (!is_there) return true;
    uint64_t at = prep_le64(p);
    if (at == UINT64_MAX &&
        f->file_size >= f->begin + POINTER_SIZE) { /* a writer that could not go back */
        if (!read_at(f, f->file_size - POINTER_SIZE, p, sizeof p, &is_there, err)) return false;
        at = is_there ? prep_le64(p) : 0;
    }
    if (at >= f->begin && at <= f->file_size && f->file_size - at >= TABLE_HEAD_SIZE) *out = at;
    return true;
}

/* Reads one entry after the other as long as they make sense.
 * returns  false if there is no memory; all of them were read if table->count comes out as `count`
 */
static bool read_entries(const finder *f, prep_laz_stream *stream, prep_laz_arena *arena,
                         uint32_t count, uint64_t end, mospt_err *err)
{
    prep_laz_integer integer;
    prep_laz_model *context[2] = {NULL, NULL};
    uint64_t offset = f->begin;
    uint32_t size = 0, points = 0;
    prep_laz_integer_init(&integer, 32);
    for (uint32_t i = 0; i < count; i++) {
        if (!prep_laz_ready(stream, &stream->range)) break;
        if (f->format->chunk_points == 0)
            points = prep_laz_integer_read(&stream->range, arena, &integer, &context[0], points);
        else points = f->format->chunk_points;
        size = prep_laz_integer_read(&stream->range, arena, &integer, &context[1], size);
        if (prep_laz_stream_is_beyond(stream) || points == 0) break;
        if (size < f->format->record_length || size > end - offset) break;
        if (!add_place(f->table, (prep_laz_place){offset, size, points}, err)) return false;
        offset += size;
        f->table->points += points;
    }
    return true;
}

static bool decode_table(const finder *f, uint64_t at, uint32_t count, mospt_err *err)
{
    bool ok = false;
    size_t margin = prep_laz_stream_margin(TABLE_NEED);
    prep_laz_arena arena = {.size = prep_laz_integer_size(32, 2)};
    uint8_t *window = malloc(TABLE_WINDOW_SIZE + margin);
    arena.bytes = malloc(arena.size);
    if (window == NULL || arena.bytes == NULL) {
        mospt_err_nomem(err, TABLE_WINDOW_SIZE + arena.size);
        goto done;
    }
    prep_laz_stream stream;
    prep_laz_source source = {.input = f->input,
                              .offset = at + TABLE_HEAD_SIZE,
                              .size = f->file_size - at - TABLE_HEAD_SIZE};
    mospt_err failed = {0};
    ok = !prep_laz_stream_begin(&stream, source, window, TABLE_WINDOW_SIZE, margin, &failed) ||
         read_entries(f, &stream, &arena, count, at, err);
    if (failed.code != MOSPT_OK) {
        ok = false;
        if (err != NULL) *err = failed;
    }
done:
    free(window);
    free(arena.bytes);
    return ok;
}

/* Reads the table.
 * is_good  out: all of it was there and fits the file */
static bool read_table(const finder *f, bool *is_good, mospt_err *err)
{
    uint8_t head[TABLE_HEAD_SIZE];
    uint64_t at;
    bool is_there;
    *is_good = false;
    if (!find_table(f, &at, err)) return false;
    if (at == 0) return true;
    f->table->end = at;
    if (!read_at(f, at, head, sizeof head, &is_there, err)) return false;
    uint32_t count = prep_le32(head + 4);
    uint64_t most = (at - f->begin) / f->format->record_length;
    if (!is_there || prep_le32(head) != 0 || count == 0 || count > most ||
        count > PREP_LAZ_CHUNKS_MAX)
        return true;
    if (!decode_table(f, at, count, err)) return false;
    if (f->table->count < count) return true;
    const prep_laz_place *last = &f->table->places[count - 1];
    *is_good = last->offset + last->size == at;
    return true;
}

/* Chunks of a fixed number of points: the last one has what remains. */
static void fit_to_header(const finder *f)
{
    prep_laz_table *t = f->table;
    uint64_t each = f->format->chunk_points, all = t->count * each;
    if (each != 0 && f->declared > 0 && f->declared <= all) {
        uint64_t chunks = (f->declared + each - 1) / each;
        if (chunks < t->count)
            mospt_err_set(f->damage, MOSPT_EFORMAT,
                          mospt_at_byte(f->file, t->places[chunks].offset),
                          "the header claims %" PRIu64 " points, but the chunk table has %" PRIu32
                          " chunks of %" PRIu64,
                          f->declared, t->count, each);
        t->count = (uint32_t)chunks;
        t->places[chunks - 1].points = f->declared - (chunks - 1) * each;
        t->points = f->declared;
    } else if (f->declared != t->points) {
        mospt_err_set(f->damage, MOSPT_EFORMAT, mospt_at_file(f->file),
                      "the header claims %" PRIu64 " points, the chunks hold %" PRIu64, f->declared,
                      t->points);
    }
}

/* Goes from head to head. What is behind the last chunk is none, but may look like one: the header
 * says when to stop. */
static bool walk_layers(const finder *f, mospt_err *err)
{
    prep_laz_table *t = f->table;
    prep_laz_source source = {.input = f->input, .offset = f->begin, .size = t->end - f->begin};
    while (t->points < f->declared && t->count < PREP_LAZ_CHUNKS_MAX) {
        uint32_t points;
        uint64_t size;
        mospt_err failed = {0};
        if (!prep_laz_layers_measure(f->format, source, &points, &size, &failed)) {
            if (failed.code == MOSPT_OK) break;
            if (err != NULL) *err = failed;
            return false;
        }
        if (points == 0 || points > f->declared - t->points) break;
        if (size > source.size) size = source.size;
        if (!add_place(t, (prep_laz_place){source.offset, size, points}, err)) return false;
        t->points += points;
        prep_laz_source_skip(&source, size);
    }
    return true;
}

static bool find_without_table(const finder *f, mospt_err *err)
{
    prep_laz_table *t = f->table;
    uint64_t each = f->format->chunk_points;
    const char *loss =
        "the chunk table is missing or damaged; chunks are looked for one after the other";
    t->count = 0;
    t->points = 0;
    if (t->end == 0) t->end = f->file_size;
    if (f->format->compressor == PREP_LAZ_LAYER_CHUNKS) {
        if (!walk_layers(f, err)) return false;
    } else if (each != 0 && t->end - f->begin >= f->format->record_length) {
        prep_laz_place first = {f->begin, t->end - f->begin,
                                f->declared < each ? f->declared : each};
        if (!add_place(t, first, err)) return false;
        t->points = f->declared;
        t->is_open = true;
    } else if (each == 0) {
        loss = "the chunk table is missing or damaged, and without it chunks of varying size "
               "cannot be told apart";
    }
    mospt_where at = mospt_at_byte(f->file, f->begin - POINTER_SIZE);
    if (t->count == 0) return mospt_err_set(err, MOSPT_EFORMAT, at, "%s", loss);
    mospt_err_set(f->damage, MOSPT_EFORMAT, at, "%s", loss);
    return true;
}

static bool find_chunks(const finder *f, mospt_err *err)
{
    bool is_good;
    prep_laz_table *t = f->table;
    if (!read_table(f, &is_good, err)) return false;
    if (!is_good && f->format->chunk_points == 0 && f->format->compressor == PREP_LAZ_ROW_CHUNKS &&
        t->count > 0) {
        /* the entries that make sense are all there is to go by */
        mospt_err_set(f->damage, MOSPT_EFORMAT, mospt_at_byte(f->file, t->end),
                      "the chunk table is damaged");
        return true;
    }
    if (!is_good) return find_without_table(f, err);
    fit_to_header(f);
    return true;
}

bool prep_laz_table_read(prep_input *input, const prep_las_header *h, const prep_laz_format *format,
                         prep_laz_table *out, mospt_err *damage, mospt_err *err)
{
    prep_laz_table table = {0};
    bool is_chunked = format->compressor != PREP_LAZ_ROWS;
    finder f = {.input = input,
                .format = format,
                .file = prep_input_path(input),
                .declared = h->declared,
                .begin = h->data_offset + (is_chunked ? POINTER_SIZE : 0),
                .file_size = prep_input_size(input),
                .table = &table,
                .damage = damage};
    *damage = (mospt_err){0};
    if (f.begin > f.file_size || f.file_size - f.begin < format->record_length)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(f.file, f.file_size),
                             "the file ends before the first of %" PRIu64 " points", h->declared);
    bool ok;
    if (is_chunked) {
        ok = find_chunks(&f, err);
    } else {
        table.end = f.file_size;
        table.points = f.declared;
        ok = add_place(&table, (prep_laz_place){f.begin, f.file_size - f.begin, f.declared}, err);
    }
    if (ok) *out = table;
    else prep_laz_table_fini(&table);
    return ok;
}

bool prep_laz_table_go_on(prep_laz_table *t, const prep_laz_format *format, uint64_t offset,
                          mospt_err *err)
{
    uint64_t known = 0;
    prep_laz_place *last = &t->places[t->count - 1];
    if (!t->is_open || offset > t->end || t->end - offset < format->record_length) return false;
    if (t->count == PREP_LAZ_CHUNKS_MAX) return false;
    last->size = offset - last->offset;
    known = (uint64_t)t->count * format->chunk_points;
    if (known >= t->points) return false;
    uint64_t rest = t->points - known;
    prep_laz_place next = {offset, t->end - offset,
                           rest < format->chunk_points ? rest : format->chunk_points};
    return add_place(t, next, err);
}
