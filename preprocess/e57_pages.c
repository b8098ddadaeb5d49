#include "preprocess/e57_pages.h"

#include "preprocess/bytes.h"

#include <stdlib.h>

/* Slicing by eight: Kounavis and Berry, A Systematic Approach to Building High Performance
 * Software-Based CRC Generators, ISCC 2005. Row k of the table moves a byte past k more of them. */
static void make_table(uint32_t table[8][256])
{
    enum { CASTAGNOLI = 0x82f63b78 }; /* the polynomial, reflected */
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t crc = i;
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? crc >> 1 ^ (uint32_t)CASTAGNOLI : crc >> 1;
        table[0][i] = crc;
    }
    for (uint32_t k = 1; k < 8; k++) {
        for (uint32_t i = 0; i < 256; i++)
            table[k][i] = table[k - 1][i] >> 8 ^ table[0][table[k - 1][i] & 255];
    }
}

static uint32_t page_crc(const uint32_t table[8][256], const uint8_t *page)
{
    uint32_t crc = UINT32_MAX;
    size_t i = 0;
    for (; i + 8 <= PREP_E57_PAGE_DATA; i += 8) {
        uint64_t v = prep_le64(page + i) ^ crc;
        crc = table[7][v & 255] ^ table[6][v >> 8 & 255] ^ table[5][v >> 16 & 255] ^
              table[4][v >> 24 & 255] ^ table[3][v >> 32 & 255] ^ table[2][v >> 40 & 255] ^
              table[1][v >> 48 & 255] ^ table[0][v >> 56];
    }
    for (; i < PREP_E57_PAGE_DATA; i++)
        crc = crc >> 8 ^ table[0][(crc ^ page[i]) & 255];
    return ~crc;
}

#if defined(__x86_64__) && defined(__GNUC__)
/* The same with the instruction that SSE 4.2 has for this polynomial, about ten times as fast. */
__attribute__((target("sse4.2"))) static uint32_t page_crc_sse42(const uint8_t *page)
{
    uint64_t crc = UINT32_MAX;
    size_t i = 0;
    for (; i + 8 <= PREP_E57_PAGE_DATA; i += 8)
        crc = __builtin_ia32_crc32di(crc, prep_le64(page + i));
    return ~__builtin_ia32_crc32si((uint32_t)crc, prep_le32(page + i));
}

static bool has_sse42(void)
{
    return __builtin_cpu_supports("sse4.2");
}
#else
static uint32_t page_crc_sse42(const uint8_t *page)
{
    (void)page;
    return 0;
}

static bool has_sse42(void)
{
    return false;
}
#endif

static bool page_is_good(const prep_e57_pages *pages, const uint8_t *page)
{
    uint32_t crc = pages->uses_sse42 ? page_crc_sse42(page) : page_crc(pages->table, page);
    return prep_swap32(prep_le32(page + PREP_E57_PAGE_DATA)) == crc;
}

void prep_e57_pages_init(prep_e57_pages *pages, prep_input *input)
{
    *pages = (prep_e57_pages){.input = input, .ahead = PREP_E57_RUN_PAGES};
    pages->page_count = prep_input_size(input) / PREP_E57_PAGE_SIZE;
    pages->uses_sse42 = has_sse42();
    make_table(pages->table);
}

void prep_e57_pages_release(prep_e57_pages *pages)
{
    for (int i = 0; i < PREP_E57_RUNS; i++) {
        free(pages->run[i].bytes);
        pages->run[i] = (prep_e57_run){0};
    }
}

/* Runs begin at multiples of their length, so that no two of them overlap. */
static bool load(prep_e57_pages *pages, prep_e57_run *run, uint64_t page, mospt_err *err)
{
    uint64_t first = page - page % pages->ahead, left = pages->page_count - first;
    uint32_t count = left < pages->ahead ? (uint32_t)left : pages->ahead;
    size_t got, size = (size_t)count * PREP_E57_PAGE_SIZE;
    if (run->bytes == NULL) run->bytes = malloc(PREP_E57_RUN_PAGES * PREP_E57_PAGE_SIZE);
    if (run->bytes == NULL) return mospt_err_nomem(err, PREP_E57_RUN_PAGES * PREP_E57_PAGE_SIZE);
    run->count = 0;
    if (!prep_input_read_at(pages->input, first * PREP_E57_PAGE_SIZE, run->bytes, size, &got, err))
        return false;
    run->first = first;
    run->bad = 0;
    for (uint32_t i = 0; i < got / PREP_E57_PAGE_SIZE; i++) {
        const uint8_t *from = run->bytes + (size_t)i * PREP_E57_PAGE_SIZE;
        if (!page_is_good(pages, from)) run->bad |= UINT64_C(1) << i;
        memmove(run->bytes + (size_t)i * PREP_E57_PAGE_DATA, from, PREP_E57_PAGE_DATA);
    }
    run->count = (uint32_t)(got / PREP_E57_PAGE_SIZE);
    return true;
}

/* The run that holds a page; where none does, the one that was not needed for longest is loaded
 * anew. */
static bool find_run(prep_e57_pages *pages, uint64_t page, prep_e57_run **out, mospt_err *err)
{
    prep_e57_run *oldest = &pages->run[0];
    for (int i = 0; i < PREP_E57_RUNS; i++) {
        prep_e57_run *run = &pages->run[i];
        if (page - run->first < run->count) {
            run->used = ++pages->clock;
            *out = run;
            return true;
        }
        if (run->used < oldest->used) oldest = run;
    }
    oldest->used = ++pages->clock;
    *out = oldest;
    return load(pages, oldest, page, err);
}

/* Bytes from `at` in a run to the end of the good pages there. */
static size_t good_bytes(const prep_e57_run *run, size_t at)
{
    size_t page = at / PREP_E57_PAGE_DATA;
    if (page >= run->count) return 0;
    uint64_t bad = run->bad >> page;
    size_t end = bad == 0 ? run->count : page + (size_t)__builtin_ctzll(bad);
    return end > page ? end * PREP_E57_PAGE_DATA - at : 0;
}

bool prep_e57_pages_read(prep_e57_pages *pages, uint64_t logical, void *out, size_t size,
                         size_t *got, mospt_err *err)
{
    size_t done = 0;
    *got = 0;
    while (done < size) {
        uint64_t page = (logical + done) / PREP_E57_PAGE_DATA;
        prep_e57_run *run;
        if (page >= pages->page_count) break;
        if (!find_run(pages, page, &run, err)) return false;
        size_t at = (size_t)(logical + done - run->first * PREP_E57_PAGE_DATA);
        size_t n = good_bytes(run, at);
        if (n == 0) break;
        if (n > size - done) n = size - done;
        memcpy((uint8_t *)out + done, run->bytes + at, n);
        done += n;
    }
    *got = done;
    return true;
}

const char *prep_e57_pages_fault(const prep_e57_pages *pages, uint64_t logical, uint64_t *place)
{
    uint64_t page = logical / PREP_E57_PAGE_DATA;
    if (page < pages->page_count) {
        *place = page * PREP_E57_PAGE_SIZE;
        return "the checksum of the page that begins here is wrong";
    }
    *place = prep_input_size(pages->input);
    return "the file ends here";
}

bool prep_e57_pages_locate(const prep_e57_pages *pages, uint64_t physical, uint64_t *logical)
{
    uint64_t page = physical / PREP_E57_PAGE_SIZE, at = physical % PREP_E57_PAGE_SIZE;
    if (page >= pages->page_count || at >= PREP_E57_PAGE_DATA) return false;
    *logical = page * PREP_E57_PAGE_DATA + at;
    return true;
}
