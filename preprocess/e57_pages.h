/* preprocess/e57_pages.h - the bytes of an E57 file without the checksums between them (ASTM E2807,
 * file pages).
 *
 * A file is a row of pages of 1024 bytes, of which the last four hold the CRC-32C of the others,
 * high byte first. Offsets that count all bytes are physical; those that leave the checksums out
 * are logical, and everything longer than a page is contiguous only in them. No byte of a page is
 * delivered before the checksum of the page was found right. */
#pragma once
#include "preprocess/input.h"

enum {
    PREP_E57_PAGE_SIZE = 1024,
    PREP_E57_PAGE_DATA = 1020,
    PREP_E57_RUNS = 4,
    PREP_E57_RUN_PAGES = 64
};

/* Pages that lie side by side in memory; a few of them, because the bytestreams of a scan are read
 * at different paces. */
typedef struct {
    uint64_t first; /* page */
    uint32_t count;
    uint64_t bad;   /* bit i: page first + i has a wrong checksum */
    uint64_t used;  /* when it was last asked for */
    uint8_t *bytes; /* owned, without checksums */
} prep_e57_run;

typedef struct {
    prep_input *input;   /* borrowed */
    uint64_t page_count; /* whole ones */
    uint32_t ahead; /* pages to read at once, 1 to PREP_E57_RUN_PAGES: few while jumping about */
    uint64_t clock;
    prep_e57_run run[PREP_E57_RUNS];
    bool uses_sse42; /* for the checksum, instead of the table */
    uint32_t table[8][256];
} prep_e57_pages;

/* input    borrowed, must outlive the pages; not a gzip file */
void prep_e57_pages_init(prep_e57_pages *pages, prep_input *input);

/* Frees the buffers; reading allocates them again. */
void prep_e57_pages_release(prep_e57_pages *pages);

/* Reads at a logical offset.
 * got      out; fewer than `size` in front of a damaged page and at the end of the file
 * errors   MOSPT_EIO, MOSPT_ENOMEM */
bool prep_e57_pages_read(prep_e57_pages *pages, uint64_t logical, void *out, size_t size,
                         size_t *got, mospt_err *err);

/* Says why no byte could be read at `logical`.
 * place    out, physical offset to name with it */
const char *prep_e57_pages_fault(const prep_e57_pages *pages, uint64_t logical, uint64_t *place);

/* Converts a physical offset; false if it points behind the file or into a checksum. */
bool prep_e57_pages_locate(const prep_e57_pages *pages, uint64_t physical, uint64_t *logical);

static inline uint64_t prep_e57_physical(uint64_t logical)
{
    return logical / PREP_E57_PAGE_DATA * PREP_E57_PAGE_SIZE + logical % PREP_E57_PAGE_DATA;
}
