#include "preprocess/las.h"

#include "preprocess/bytes.h"
#include "preprocess/laz.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum {
    BLOCK_SIZE = 256 * 1024, /* stays in the second-level cache while each attribute is picked from
                                it in turn */
    SAMPLE_PLACES = 64,
    SAMPLE_STRIDE = 50000, /* points of a chunk as most LAZ files have them: the first records of a
                              chunk are cheap to have */
    SAMPLE_SKIPPED_MAX = 400000, /* records, a tenth of a second */
    LOOK_SIZE = 1024 * 1024,
};

typedef struct {
    prep_las_header header;
    prep_las_layout layout;
    prep_laz *laz;  /* owned; NULL: the records are not compressed */
    uint64_t next;  /* point to read next */
    uint8_t *block; /* [block_records * record_length], owned, allocated by the first read */
    uint32_t block_records;
} las_state;

static bool alloc_block(las_state *las, mospt_err *err)
{
    uint32_t length = las->header.record_length;
    las->block_records = length < BLOCK_SIZE ? BLOCK_SIZE / length : 1;
    if (las->block == NULL) las->block = malloc((size_t)las->block_records * length);
    return las->block != NULL || mospt_err_nomem(err, (size_t)las->block_records * length);
}

/* What was found wrong with the chunks so far becomes the damage of the scan. */
static void note_laz_damage(prep_scan *scan, const prep_laz *laz)
{
    const mospt_err *damage = prep_laz_damage(laz);
    if (damage == NULL) return;
    mospt_where where = mospt_at_file(scan->path);
    if (damage->place_kind == MOSPT_AT_BYTE) where = mospt_at_byte(scan->path, damage->place);
    prep_scan_set_damage(scan, where, "%s", damage->message);
}

static uint64_t record_offset(const las_state *las, uint64_t point)
{
    return las->header.data_offset + point * las->header.record_length;
}

/* Where the sample is taken: places spread evenly over the file, since the first points of a scan
 * are often all alike. */
typedef struct {
    uint64_t parts; /* that the file is divided into */
    uint32_t looks; /* at that many of them, from their first record on */
    bool by_chunks; /* parts are those of the LAZ file */
} sample_places;

static sample_places make_places(uint64_t parts, bool by_chunks)
{
    return (sample_places){parts, parts < SAMPLE_PLACES ? (uint32_t)parts : (uint32_t)SAMPLE_PLACES,
                           by_chunks};
}

static uint64_t first_record(const las_state *las, const sample_places *places, uint32_t look)
{
    uint64_t part = places->parts * look / places->looks;
    return places->by_chunks ? prep_laz_chunk_first(las->laz, (uint32_t)part)
                             : part * SAMPLE_STRIDE;
}

/* The same for LAS and for LAZ, so that both show the same; but for chunks that begin elsewhere,
 * and that it would take too long to decode as far as these places. */
static sample_places choose_places(const las_state *las)
{
    sample_places places =
        make_places((las->header.present + SAMPLE_STRIDE - 1) / SAMPLE_STRIDE, false);
    uint64_t skipped = 0;
    for (uint32_t i = 0; las->laz != NULL && i < places.looks; i++) {
        uint64_t lead = prep_laz_lead(las->laz, first_record(las, &places, i));
        skipped = lead <= SAMPLE_SKIPPED_MAX ? skipped + lead : UINT64_MAX;
        if (skipped > SAMPLE_SKIPPED_MAX) return make_places(prep_laz_chunk_count(las->laz), true);
    }
    return places;
}

static bool look(prep_scan *scan, las_state *las, uint64_t first, uint8_t *records, size_t count,
                 size_t *got, mospt_err *err)
{
    size_t length = las->header.record_length;
    if (las->laz != NULL) return prep_laz_look(las->laz, first, records, count, got, err);
    bool ok = prep_input_read_at(scan->input, record_offset(las, first), records, count * length,
                                 got, err);
    *got /= length;
    return ok;
}

static bool take_sample(prep_scan *scan, las_state *las, prep_las_sample *sample, mospt_err *err)
{
    const prep_las_header *h = &las->header;
    sample_places places = choose_places(las);
    if (!prep_las_sample_init(sample, h, places.looks, err)) return false;
    size_t want = places.looks > 0 ? PREP_TONE_SAMPLES / places.looks : 0;
    if (want > LOOK_SIZE / h->record_length) want = LOOK_SIZE / h->record_length;
    uint8_t *records = malloc(want * h->record_length + 1);
    if (records == NULL) return mospt_err_nomem(err, want * h->record_length);
    bool ok = true;
    for (uint32_t i = 0; i < places.looks && ok; i++) {
        uint64_t first = first_record(las, &places, i), left = h->present - first;
        size_t got;
        ok = look(scan, las, first, records, left < want ? (size_t)left : want, &got, err);
        if (ok) prep_las_sample_add(sample, h, records, got);
    }
    free(records);
    return ok;
}

/* What the points of a sample have in common, the others may have, too. */
static bool look_at_sample(prep_scan *scan, const las_state *las, const prep_las_sample *sample,
                           mospt_err *err)
{
    enum { POINTS = 256 };
    prep_batch batch;
    if (!prep_batch_init(&batch, &scan->info.attributes, POINTS, err)) return false;
    for (size_t i = 0, n; i < sample->kept_count; i += n) {
        n = sample->kept_count - i < POINTS ? sample->kept_count - i : POINTS;
        batch.count = 0;
        prep_places places = prep_batch_places(&batch);
        prep_las_unpack(&las->layout, sample->kept + i * las->header.record_length, (uint32_t)n,
                        &places);
        batch.count = (uint32_t)n;
        prep_scan_look(&scan->info, &batch);
    }
    prep_batch_fini(&batch);
    return true;
}

static bool open_chunks(prep_scan *scan, las_state *las, mospt_err *err)
{
    if (!prep_laz_open(scan->input, &las->header, 0, &las->laz, err)) return false;
    prep_laz_leave_out_waves(las->laz);
    las->header.present = prep_laz_point_count(las->laz);
    note_laz_damage(scan, las->laz);
    return true;
}

/* Records behind the last one that the header claims, where nothing else has a place. */
static uint64_t count_unclaimed(const prep_scan *scan, const prep_las_header *h)
{
    uint64_t end = h->data_offset + h->present * h->record_length,
             size = prep_input_size(scan->input);
    if (h->is_compressed || h->has_tail || size <= end) return 0;
    bool is_whole = h->declared == 0 || (size - end) % h->record_length == 0;
    return is_whole ? (size - end) / h->record_length : 0;
}

static bool check_openable(prep_scan *scan, const prep_las_header *h, mospt_err *err)
{
    uint64_t unclaimed = count_unclaimed(scan, h);
    if (h->declared == 0 && unclaimed > 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, 107),
                             "the header claims no points, and there is room for %" PRIu64
                             ": the recording was not closed",
                             unclaimed);
    if (h->declared == 0)
        return mospt_err_set(err, MOSPT_EEMPTY, mospt_at_file(scan->path),
                             "the LAS file holds no points");
    if (h->present == 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, h->data_offset),
                             "the file ends before the first of %" PRIu64 " points", h->declared);
    return true;
}

static bool las_open(prep_scan *scan, uint32_t index, const prep_scan_options *options,
                     mospt_err *err)
{
    (void)index, (void)options;
    las_state *las = calloc(1, sizeof *las);
    if (las == NULL) return mospt_err_nomem(err, sizeof *las);
    scan->state = las;
    if (!prep_las_header_read(scan->input, &las->header, err)) return false;
    if (!check_openable(scan, &las->header, err)) return false;
    if (las->header.is_compressed && !open_chunks(scan, las, err)) return false;
    prep_las_describe(scan, &las->header);
    if (las->laz == NULL && las->header.present < las->header.declared)
        prep_scan_set_damage(
            scan, mospt_at_byte(scan->path, record_offset(las, las->header.present)),
            "the file ends here: the header claims %" PRIu64 " points, %" PRIu64 " are there",
            las->header.declared, las->header.present);
    uint64_t unclaimed = count_unclaimed(scan, &las->header);
    if (unclaimed > 0)
        prep_scan_set_damage(
            scan, mospt_at_byte(scan->path, record_offset(las, las->header.present)),
            "the header claims %" PRIu64 " points; what follows has room for %" PRIu64
            " more, which are left out",
            las->header.declared, unclaimed);

    prep_las_sample sample = {0};
    bool ok = take_sample(scan, las, &sample, err);
    if (ok) prep_las_layout_make(scan, &las->header, &sample, &las->layout);
    ok = ok && look_at_sample(scan, las, &sample, err);
    prep_las_sample_fini(&sample);
    return ok;
}

/* A coder that starts from a damaged first record shifts all that follow, and nothing in the stream
 * tells; the bounds in the header do. */
static void check_first_point(prep_scan *scan, const las_state *las, const uint8_t *record)
{
    const prep_las_header *h = &las->header;
    for (int a = 0; h->has_bounds && a < 3; a++) {
        double at = (int32_t)prep_le32(record + 4 * a) * h->scale[a] + h->offset[a];
        if (h->low[a] == h->high[a]) continue; /* as good as not filled in */
        if (at >= h->low[a] - h->scale[a] && at <= h->high[a] + h->scale[a]) continue;
        prep_scan_set_damage(scan, mospt_at_byte(scan->path, h->data_offset),
                             "the first point, at %.10g along %c, is outside the header's bounds: "
                             "one of them is damaged, and all points after it may be shifted",
                             at, "xyz"[a]);
        return;
    }
}

/* A batch that takes packed records gets them, if every point that they can hold is wanted as it
 * is. */
static bool choose_packing(const prep_scan *scan, const las_state *las, prep_batch *batch,
                           mospt_err *err)
{
    const prep_las_header *h = &las->header;
    double low[3], high[3];
    for (int a = 0; a < 3; a++) {
        double first = INT32_MIN * h->scale[a] + h->offset[a],
               last = INT32_MAX * h->scale[a] + h->offset[a];
        low[a] = first < last ? first : last;
        high[a] = first < last ? last : first;
    }
    if (!batch->takes_packed || !prep_scan_keeps_all(scan, low, high)) return true;
    if (!prep_batch_take_packed(batch, prep_las_unpack, h->record_length, &las->layout,
                                sizeof las->layout, err))
        return false;
    batch->packed.has_lattice = true;
    memcpy(batch->packed.scale, h->scale, sizeof h->scale);
    memcpy(batch->packed.offset, h->offset, sizeof h->offset);
    return true;
}

/* Where the next record of a batch goes as it is; NULL: it is unpacked. */
static uint8_t *next_packed(const prep_batch *batch)
{
    if (batch->packed.unpack == NULL) return NULL;
    return batch->packed.records + batch->count * batch->packed.stride;
}

/* Appends records, which may stand in their place already. */
static void append(const las_state *las, const uint8_t *records, size_t count, prep_batch *batch)
{
    uint8_t *packed = next_packed(batch);
    prep_places places = prep_batch_places(batch);
    if (packed == NULL) prep_las_unpack(&las->layout, records, (uint32_t)count, &places);
    else if (packed != records) memcpy(packed, records, count * batch->packed.stride);
    batch->count += (uint32_t)count;
}

static bool read_chunks(prep_scan *scan, las_state *las, prep_batch *batch, mospt_err *err)
{
    while (batch->count < batch->capacity) {
        const uint8_t *records;
        size_t count;
        if (!prep_laz_read(las->laz, batch->capacity - batch->count, &records, &count, err))
            return false;
        if (count == 0) break;
        append(las, records, count, batch);
        if (las->next == 0) check_first_point(scan, las, records);
        las->next += count;
    }
    note_laz_damage(scan, las->laz);
    return true;
}

static bool read_records(prep_scan *scan, las_state *las, prep_batch *batch, mospt_err *err)
{
    uint64_t length = las->header.record_length;
    bool is_packed = batch->packed.unpack != NULL;
    if (!is_packed && !alloc_block(las, err)) return false;
    while (batch->count < batch->capacity && las->next < las->header.present) {
        uint8_t *records = is_packed ? next_packed(batch) : las->block;
        uint64_t n = las->header.present - las->next;
        if (n > batch->capacity - batch->count) n = batch->capacity - batch->count;
        if (!is_packed && n > las->block_records) n = las->block_records;
        size_t got;
        uint64_t offset = record_offset(las, las->next);
        if (!prep_input_read_at(scan->input, offset, records, n * length, &got, err)) return false;
        append(las, records, got / length, batch);
        las->next += got / length;
        if (got == n * length) continue;
        prep_scan_set_damage(scan, mospt_at_byte(scan->path, offset + got),
                             "the file became shorter while it was read");
        las->next = las->header.present;
    }
    return true;
}

static bool las_read(prep_scan *scan, prep_batch *batch, mospt_err *err)
{
    las_state *las = scan->state;
    if (!choose_packing(scan, las, batch, err)) return false;
    return las->laz != NULL ? read_chunks(scan, las, batch, err)
                            : read_records(scan, las, batch, err);
}

static bool las_rewind(prep_scan *scan, mospt_err *err)
{
    (void)err;
    las_state *las = scan->state;
    las->next = 0;
    if (las->laz != NULL) prep_laz_rewind(las->laz);
    return true;
}

static void las_close(prep_scan *scan)
{
    las_state *las = scan->state;
    if (las == NULL) return;
    prep_laz_close(las->laz);
    free(las->block);
    free(las);
}

const prep_scan_format prep_las_format = {las_open, las_read, las_rewind, las_close};
