#include "preprocess/sort.h"

#include <string.h>

/* Radix sort, least digit first. 11 bits: six digits for a code of 63 bits, and counters that fit
 * the first cache. */
enum { DIGIT_BITS = 11, DIGITS = 6, VALUES = 1 << DIGIT_BITS };

static uint32_t digit_of(uint64_t code, int digit)
{
    return (uint32_t)(code >> (digit * DIGIT_BITS)) & (VALUES - 1);
}

static void sort_few(mospt_linear_key *keys, uint32_t count)
{
    for (uint32_t i = 1; i < count; i++) {
        mospt_linear_key key = keys[i];
        uint32_t at = i;
        for (; at > 0 && keys[at - 1].code > key.code; at--)
            keys[at] = keys[at - 1];
        keys[at] = key;
    }
}

void prep_sort_keys(mospt_linear_key *keys, mospt_linear_key *spare, uint32_t count)
{
    uint32_t place[DIGITS][VALUES];
    mospt_linear_key *from = keys, *to = spare;
    if (count < 64) {
        sort_few(keys, count);
        return;
    }
    memset(place, 0, sizeof place);
    for (uint32_t i = 0; i < count; i++)
        for (int d = 0; d < DIGITS; d++)
            place[d][digit_of(keys[i].code, d)]++;
    for (int d = 0; d < DIGITS; d++) {
        if (place[d][digit_of(from[0].code, d)] == count) continue; /* all alike in this digit */
        for (uint32_t v = 0, sum = 0; v < VALUES; v++) {
            uint32_t n = place[d][v];
            place[d][v] = sum;
            sum += n;
        }
        for (uint32_t i = 0; i < count; i++)
            to[place[d][digit_of(from[i].code, d)]++] = from[i];
        mospt_linear_key *swap = from;
        from = to, to = swap;
    }
    if (from != keys) memcpy(keys, from, count * sizeof *keys);
}
