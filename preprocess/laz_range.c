#include "preprocess/laz_range.h"

#include <assert.h>
#include <string.h>

enum {
    PLACES_LOG2 = 15, /* resolution of a distribution */
    BIT_PLACES_LOG2 = 13,
    BIT_CYCLE_MAX = 64,
};

static uint32_t start_log2(uint32_t symbols)
{
    uint32_t log2 = 0;
    while (1u << log2 < symbols && log2 < 9)
        log2++;
    return log2;
}

size_t prep_laz_model_size(uint32_t symbols)
{
    size_t words = symbols + 1 + symbols + ((size_t)1 << start_log2(symbols));
    size_t size = sizeof(prep_laz_model) + words * sizeof(uint16_t);
    return (size + 15) & ~(size_t)15;
}

size_t prep_laz_integer_size(uint32_t bits, uint32_t contexts)
{
    size_t size = contexts * prep_laz_model_size(bits + 1);
    for (uint32_t k = 1; k <= bits && k < 32; k++)
        size += prep_laz_model_size(1u << (k < 8 ? k : 8));
    return size;
}

/* Places follow from the counts, all rounded down; a count of at least 1 of at most 2^15 leaves no
 * symbol without one. */
static void distribute(prep_laz_model *m)
{
    uint32_t scale = (1u << 31) / m->total, sum = 0, entry = 0;
    for (uint32_t s = 0; s < m->symbols; s++) {
        m->low[s] = (uint16_t)(scale * sum >> (31 - PLACES_LOG2));
        sum += m->count[s];
    }
    m->low[m->symbols] = 1u << PLACES_LOG2;
    for (uint32_t s = 0; s < m->symbols; s++) {
        uint32_t end = (m->low[s + 1] + (1u << m->shift) - 1) >> m->shift;
        while (entry < end)
            m->start[entry++] = (uint16_t)s;
    }
}

prep_laz_model *prep_laz_model_make(prep_laz_arena *arena, uint32_t symbols)
{
    size_t size = prep_laz_model_size(symbols);
    assert(symbols >= 2 && symbols <= PREP_LAZ_SYMBOLS_MAX && size <= arena->size - arena->used);
    prep_laz_model *m = (prep_laz_model *)(void *)(arena->bytes + arena->used);
    arena->used += size;
    m->symbols = (uint16_t)symbols;
    m->shift = (uint16_t)(PLACES_LOG2 - start_log2(symbols));
    m->count = m->low + symbols + 1;
    m->start = m->count + symbols;
    for (uint32_t s = 0; s < symbols; s++)
        m->count[s] = 1;
    m->total = symbols;
    m->cycle = m->left = (uint16_t)((symbols + 6) >> 1);
    distribute(m);
    return m;
}

void prep_laz_model_adapt(prep_laz_model *m)
{
    m->total += m->cycle;
    if (m->total > 1u << PLACES_LOG2) {
        m->total = 0;
        for (uint32_t s = 0; s < m->symbols; s++) {
            m->count[s] = (uint16_t)((m->count[s] + 1) >> 1);
            m->total += m->count[s];
        }
    }
    distribute(m);
    uint32_t cycle = 5u * m->cycle >> 2, most = (m->symbols + 6u) << 3;
    m->cycle = m->left = (uint16_t)(cycle < most ? cycle : most);
}

void prep_laz_bit_init(prep_laz_bit *b)
{
    *b = (prep_laz_bit){
        .zeros = 1, .total = 2, .zero_part = 1u << (BIT_PLACES_LOG2 - 1), .cycle = 4, .left = 4};
}

void prep_laz_bit_adapt(prep_laz_bit *b)
{
    uint32_t total = (uint32_t)b->total + b->cycle, zeros = b->zeros;
    if (total > 1u << BIT_PLACES_LOG2) {
        total = (total + 1) >> 1;
        zeros = (zeros + 1) >> 1;
        if (zeros == total) total++;
    }
    b->total = (uint16_t)total;
    b->zeros = (uint16_t)zeros;
    b->zero_part = (uint16_t)((1u << 31) / total * zeros >> (31 - BIT_PLACES_LOG2));
    uint32_t cycle = 5u * b->cycle >> 2;
    b->cycle = b->left = (uint16_t)(cycle < BIT_CYCLE_MAX ? cycle : BIT_CYCLE_MAX);
}

void prep_laz_integer_init(prep_laz_integer *integer, uint32_t bits)
{
    memset(integer, 0, sizeof *integer);
    integer->bits = bits;
    prep_laz_bit_init(&integer->one);
}

void prep_laz_range_begin(prep_laz_range *range, const uint8_t *bytes)
{
    range->length = UINT32_MAX;
    range->value =
        (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
    range->next = bytes + 4;
}
