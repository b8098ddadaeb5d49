#include "preprocess/sort.h"

#include <string.h>

/* Radix sort, least digit first. 11 bits: few digits, and counters that fit the first cache. */
enum { DIGIT_BITS = 11, DIGITS_MAX = 6, VALUES = 1 << DIGIT_BITS, FEW = 64 };
/* Records that are fetched before their turn, where keys have been sorted before and they stand
 * anywhere. */
enum { AHEAD = 16 };

static void sort_few(uint64_t *keys, uint32_t count, uint32_t low_bit)
{
    for (uint32_t i = 1; i < count; i++) {
        uint64_t key = keys[i];
        uint32_t at = i;
        for (; at > 0 && keys[at - 1] >> low_bit > key >> low_bit; at--)
            keys[at] = keys[at - 1];
        keys[at] = key;
    }
}

static uint32_t digit_of(uint64_t key, uint32_t shift)
{
    return (uint32_t)(key >> shift) & (VALUES - 1);
}

/* Counts into places; false if all keys are alike in this digit. */
static bool make_places(uint32_t *counts, uint32_t alike, uint32_t count)
{
    if (counts[alike] == count) return false;
    for (uint32_t v = 0, sum = 0; v < VALUES; v++) {
        uint32_t n = counts[v];
        counts[v] = sum;
        sum += n;
    }
    return true;
}

void prep_sort_keys(uint64_t *keys, uint64_t *spare, uint32_t count, uint32_t low_bit)
{
    uint32_t place[DIGITS_MAX][VALUES];
    uint64_t *from = keys, *to = spare, any = 0;
    uint32_t digits = 0;
    if (count < FEW) {
        sort_few(keys, count, low_bit);
        return;
    }
    for (uint32_t i = 1; i < count; i++)
        any |= keys[i] ^ keys[0];
    while (low_bit + digits * DIGIT_BITS < 64 && any >> (low_bit + digits * DIGIT_BITS) != 0)
        digits++;
    memset(place, 0, digits * sizeof place[0]);
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t d = 0; d < digits; d++)
            place[d][digit_of(keys[i], low_bit + d * DIGIT_BITS)]++;
    for (uint32_t d = 0; d < digits; d++) {
        uint32_t shift = low_bit + d * DIGIT_BITS;
        if (!make_places(place[d], digit_of(from[0], shift), count)) continue;
        for (uint32_t i = 0; i < count; i++)
            to[place[d][digit_of(from[i], shift)]++] = from[i];
        uint64_t *swap = from;
        from = to, to = swap;
    }
    if (from != keys) memcpy(keys, from, count * sizeof *keys);
}

void prep_sort_begin(prep_sorter *s, uint64_t *keys, uint32_t count)
{
    s->index_bits = 0;
    while (count > 0 && (count - 1) >> s->index_bits > 0)
        s->index_bits++;
    s->code_levels = (64 - s->index_bits) / 3;
    if (s->code_levels > MOSPT_CODE_LEVELS) s->code_levels = MOSPT_CODE_LEVELS;
    for (uint32_t i = 0; i < count; i++)
        keys[i] = i;
}

void prep_sort_below(const prep_sorter *s, uint32_t level, uint64_t *keys, uint64_t *spare,
                     uint32_t count)
{
    uint32_t bits = mospt_cell_bits(s->grid, level);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t index = mospt_linear_index(keys[i], s->index_bits);
        if (i + AHEAD < count)
            __builtin_prefetch(
                mospt_records_at(s->records, mospt_linear_index(keys[i + AHEAD], s->index_bits)));
        mospt_vertex v = mospt_vertex_of(mospt_records_at(s->records, index));
        keys[i] = mospt_cell_code(v.x, v.y, v.z, bits, s->code_levels) << s->index_bits | index;
    }
    prep_sort_keys(keys, spare, count, s->index_bits);
}
