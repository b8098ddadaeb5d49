#include "preprocess/las.h"

#include <inttypes.h>
#include <stdlib.h>

/* A block stays in the second-level cache while each attribute is picked from it in turn. */
enum { BLOCK_SIZE = 256 * 1024, SAMPLE_BLOCKS = 64, SAMPLE_RECORDS = 1024 };

typedef struct {
    prep_las_header header;
    prep_las_layout layout;
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

static uint64_t record_offset(const las_state *las, uint64_t point)
{
    return las->header.data_offset + point * las->header.record_length;
}

/* Looks at blocks of records spread evenly over the file: the first points of a scan are often all
 * alike. */
static bool take_sample(prep_scan *scan, las_state *las, prep_las_sample *sample, mospt_err *err)
{
    if (!alloc_block(las, err)) return false;
    uint64_t count = las->header.present, length = las->header.record_length;
    uint64_t want = las->block_records < SAMPLE_RECORDS ? las->block_records : SAMPLE_RECORDS;
    uint64_t blocks = count / want < SAMPLE_BLOCKS ? (count + want - 1) / want : SAMPLE_BLOCKS;
    for (uint64_t b = 0; b < blocks; b++) {
        uint64_t first = blocks == SAMPLE_BLOCKS ? count / blocks * b : want * b;
        uint64_t n = count - first < want ? count - first : want;
        size_t got;
        if (!prep_input_read_at(scan->input, record_offset(las, first), las->block, n * length,
                                &got, err))
            return false;
        prep_las_sample_add(sample, &las->header, las->block, got / length);
    }
    free(las->block);
    las->block = NULL;
    return true;
}

static bool check_openable(prep_scan *scan, const prep_las_header *h, mospt_err *err)
{
    if (h->is_compressed)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, 104),
                             "LAZ compression is not read yet; unpack the file to LAS");
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
    prep_las_describe(scan, &las->header);
    if (las->header.present < las->header.declared)
        prep_scan_set_damage(
            scan, mospt_at_byte(scan->path, record_offset(las, las->header.present)),
            "the file ends here: the header claims %" PRIu64 " points, %" PRIu64 " are there",
            las->header.declared, las->header.present);

    prep_las_sample sample;
    uint64_t sampled = SAMPLE_BLOCKS * SAMPLE_RECORDS;
    if (las->header.present < sampled) sampled = las->header.present;
    if (!prep_las_sample_init(&sample, sampled, err)) return false;
    bool ok = take_sample(scan, las, &sample, err);
    if (ok) prep_las_layout_make(scan, &las->header, &sample, &las->layout);
    prep_las_sample_fini(&sample);
    return ok;
}

static bool las_read(prep_scan *scan, prep_batch *batch, mospt_err *err)
{
    las_state *las = scan->state;
    if (!alloc_block(las, err)) return false;
    uint64_t length = las->header.record_length;
    while (batch->count < batch->capacity && las->next < las->header.present) {
        uint64_t n = las->header.present - las->next;
        if (n > las->block_records) n = las->block_records;
        if (n > batch->capacity - batch->count) n = batch->capacity - batch->count;
        size_t got;
        uint64_t offset = record_offset(las, las->next);
        if (!prep_input_read_at(scan->input, offset, las->block, n * length, &got, err))
            return false;
        prep_las_decode(&las->layout, las->block, (uint32_t)(got / length), batch);
        las->next += got / length;
        if (got == n * length) continue;
        prep_scan_set_damage(scan, mospt_at_byte(scan->path, offset + got),
                             "the file became shorter while it was read");
        las->next = las->header.present;
    }
    return true;
}

static bool las_rewind(prep_scan *scan, mospt_err *err)
{
    (void)err;
    ((las_state *)scan->state)->next = 0;
    return true;
}

static void las_close(prep_scan *scan)
{
    las_state *las = scan->state;
    if (las == NULL) return;
    free(las->block);
    free(las);
}

const prep_scan_format prep_las_format = {las_open, las_read, las_rewind, las_close};
