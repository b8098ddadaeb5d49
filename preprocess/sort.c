#include "preprocess/sort.h"

#include <stdlib.h>
#include <string.h>

/* Many keys are split by their highest digit until a part fits the second cache together with its
 * spare; a part is sorted by its lowest digit first, and few keys by comparing. */
enum {
    FEW = 32,
    SPLIT_BITS = 8,
    SPLIT_VALUES = 1 << SPLIT_BITS,
    CACHED_MAX = 1 << 15,
    DIGIT_BITS = 11,
    DIGITS_MAX = 6,
    SMALL = 2048, /* keys for which smaller digits, whose counters are cleared sooner, do */
    SMALL_DIGIT_BITS = 8,
    SMALL_DIGITS_MAX = 8,
    COUNTERS = DIGITS_MAX << DIGIT_BITS,
    SLICE = 1 << 16, /* keys that are one job */
};
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

/* Bits in which some of the keys differ from `first`. */
static uint64_t differences(const uint64_t *keys, uint32_t count, uint64_t first)
{
    uint64_t any = 0;
    for (uint32_t i = 0; i < count; i++)
        any |= keys[i] ^ first;
    return any;
}

static uint32_t highest_bit(uint64_t v)
{
    return 63 - (uint32_t)__builtin_clzll(v);
}

/* Where a digit of SPLIT_BITS begins whose highest bit is that of `any`. */
static uint32_t split_shift(uint64_t any, uint32_t low_bit)
{
    uint32_t high = highest_bit(any) + 1;
    return high >= low_bit + SPLIT_BITS ? high - SPLIT_BITS : low_bit;
}

static uint32_t split_digit(uint64_t key, uint32_t shift)
{
    return (uint32_t)(key >> shift) & (SPLIT_VALUES - 1);
}

/* Counts into places; false if all keys are alike in this digit. */
static bool make_places(uint32_t *counts, uint32_t values, uint32_t alike, uint32_t count)
{
    if (counts[alike] == count) return false;
    for (uint32_t v = 0, sum = 0; v < values; v++) {
        uint32_t n = counts[v];
        counts[v] = sum;
        sum += n;
    }
    return true;
}

/* Counts all digits at once: place[] has those of each after those of the one before. */
static inline void count_digits(const uint64_t *keys, uint32_t count, uint32_t low_bit,
                                uint32_t digit_bits, uint32_t digits, uint32_t *place)
{
    uint32_t values = 1u << digit_bits;
    for (uint32_t i = 0; i < count; i++) {
        uint64_t key = keys[i] >> low_bit;
        for (uint32_t d = 0; d < digits; d++, key >>= digit_bits)
            place[d * values + (uint32_t)(key & (values - 1))]++;
    }
}

/* With constants for the usual numbers of digits, so that there is no inner loop. */
static void count_any_digits(const uint64_t *keys, uint32_t count, uint32_t low_bit,
                             uint32_t digit_bits, uint32_t digits, uint32_t *place)
{
    memset(place, 0, (digits << digit_bits) * sizeof *place);
    switch (digits) {
    case 1:
        count_digits(keys, count, low_bit, digit_bits, 1, place);
        break;
    case 2:
        count_digits(keys, count, low_bit, digit_bits, 2, place);
        break;
    case 3:
        count_digits(keys, count, low_bit, digit_bits, 3, place);
        break;
    case 4:
        count_digits(keys, count, low_bit, digit_bits, 4, place);
        break;
    default:
        count_digits(keys, count, low_bit, digit_bits, digits, place);
    }
}

/* Least digit first. Returns true if the result is in `other`. */
static bool sort_by_digits(uint64_t *keys, uint64_t *other, uint32_t count, uint32_t low_bit,
                           uint32_t end_bit)
{
    uint32_t place[COUNTERS], digit_bits = count < SMALL ? SMALL_DIGIT_BITS : DIGIT_BITS,
                              values = 1u << digit_bits, mask = values - 1;
    uint32_t digits = (end_bit - low_bit + digit_bits - 1) / digit_bits;
    uint64_t *from = keys, *to = other;
    count_any_digits(keys, count, low_bit, digit_bits, digits, place);
    for (uint32_t d = 0; d < digits; d++) {
        uint32_t shift = low_bit + d * digit_bits, *at = place + d * values;
        if (!make_places(at, values, (uint32_t)(from[0] >> shift & mask), count)) continue;
        for (uint32_t i = 0; i < count; i++)
            to[at[from[i] >> shift & mask]++] = from[i];
        uint64_t *swap = from;
        from = to, to = swap;
    }
    return from == other;
}

/* Sorts keys, into `other` or in place; the other of the two holds nothing then. */
static void sort_part(uint64_t *keys, uint64_t *other, uint32_t count, uint32_t low_bit,
                      bool into_other)
{
    uint64_t any = count < FEW ? 0 : differences(keys, count, keys[0]);
    bool in_other = false;
    if (count < FEW) {
        sort_few(keys, count, low_bit);
    } else if (any >> low_bit != 0 && count <= CACHED_MAX) {
        in_other = sort_by_digits(keys, other, count, low_bit, highest_bit(any) + 1);
    } else if (any >> low_bit != 0) {
        uint32_t place[SPLIT_VALUES] = {0}, begin = 0, shift = split_shift(any, low_bit);
        for (uint32_t i = 0; i < count; i++)
            place[split_digit(keys[i], shift)]++;
        make_places(place, SPLIT_VALUES, 0, UINT32_MAX);
        for (uint32_t i = 0; i < count; i++)
            other[place[split_digit(keys[i], shift)]++] = keys[i];
        for (uint32_t v = 0; v < SPLIT_VALUES; begin = place[v++])
            sort_part(other + begin, keys + begin, place[v] - begin, low_bit, !into_other);
        return;
    }
    if (in_other == into_other) return;
    if (into_other) memcpy(other, keys, count * sizeof *keys);
    else memcpy(keys, other, count * sizeof *keys);
}

void prep_sort_keys(uint64_t *keys, uint64_t *spare, uint32_t count, uint32_t low_bit)
{
    sort_part(keys, spare, count, low_bit, false);
}

void prep_sort_begin(prep_sorter *s, uint32_t count)
{
    s->index_bits = 0;
    while (count > 0 && (count - 1) >> s->index_bits > 0)
        s->index_bits++;
    s->code_levels = (64 - s->index_bits) / 3;
    if (s->code_levels > MOSPT_CODE_LEVELS) s->code_levels = MOSPT_CODE_LEVELS;
}

/* The keys of `count` records from the one with index `first`, without their cells. */
static void find_indices(uint64_t *keys, uint32_t first, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        keys[i] = first + i;
}

/* Gives keys the cells of the levels below `level`. */
static void find_cells(const prep_sorter *s, uint32_t level, uint64_t *keys, uint32_t count)
{
    uint32_t bits = mospt_cell_bits(s->grid, level), index_bits = s->index_bits;
    mospt_cell_points points;
    uint64_t codes[MOSPT_CELL_POINTS_MAX];
    for (uint32_t begin = 0, n; begin < count; begin += n, keys += n) {
        n = count - begin < MOSPT_CELL_POINTS_MAX ? count - begin : MOSPT_CELL_POINTS_MAX;
        for (uint32_t i = 0; i < n; i++) {
            if (begin + i + AHEAD < count)
                __builtin_prefetch(
                    mospt_records_at(s->records, mospt_linear_index(keys[i + AHEAD], index_bits)));
            mospt_vertex v = mospt_vertex_of(
                mospt_records_at(s->records, mospt_linear_index(keys[i], index_bits)));
            points.x[i] = v.x, points.y[i] = v.y, points.z[i] = v.z;
        }
        mospt_cell_codes(&points, n, bits, s->code_levels, codes);
        for (uint32_t i = 0; i < n; i++)
            keys[i] = codes[i] << index_bits | mospt_linear_index(keys[i], index_bits);
    }
}

void prep_sort_below(const prep_sorter *s, uint32_t level, uint64_t *keys, uint64_t *spare,
                     uint32_t count)
{
    find_cells(s, level, keys, count);
    sort_part(keys, spare, count, s->index_bits, false);
}

void prep_sort_all(const prep_sorter *s, uint32_t level, uint64_t *keys, uint64_t *spare,
                   uint32_t count)
{
    find_indices(keys, 0, count);
    prep_sort_below(s, level, keys, spare, count);
}

/* The first split, done by all workers. */
typedef struct {
    const prep_sorter *sorter;
    uint32_t level, count, shift;
    uint64_t *keys, *spare;
    struct slice {
        uint64_t any, all;            /* bits that some keys have, and that all have */
        uint32_t place[SPLIT_VALUES]; /* where its keys of each digit go */
    } * slices;                       /* [count / SLICE rounded up], owned */
    uint32_t end[SPLIT_VALUES];       /* of the keys of each digit */
} split;

static uint32_t slice_count(const split *s)
{
    return s->count / SLICE + (s->count % SLICE > 0);
}

static uint64_t *slice_keys(const split *s, uint32_t slice, uint32_t *count)
{
    uint32_t begin = slice * SLICE, left = s->count - begin;
    *count = left < SLICE ? left : SLICE;
    return s->keys + begin;
}

static void find_slice(void *context, uint32_t slice)
{
    split *s = context;
    uint32_t count;
    uint64_t *keys = slice_keys(s, slice, &count), any = 0, all = UINT64_MAX;
    find_indices(keys, slice * SLICE, count);
    find_cells(s->sorter, s->level, keys, count);
    for (uint32_t i = 0; i < count; i++)
        any |= keys[i], all &= keys[i];
    s->slices[slice].any = any;
    s->slices[slice].all = all;
}

static void count_slice(void *context, uint32_t slice)
{
    split *s = context;
    uint32_t count, *counts = s->slices[slice].place;
    const uint64_t *keys = slice_keys(s, slice, &count);
    for (uint32_t i = 0; i < count; i++)
        counts[split_digit(keys[i], s->shift)]++;
}

static void move_slice(void *context, uint32_t slice)
{
    split *s = context;
    uint32_t count, *place = s->slices[slice].place;
    const uint64_t *keys = slice_keys(s, slice, &count);
    for (uint32_t i = 0; i < count; i++)
        s->spare[place[split_digit(keys[i], s->shift)]++] = keys[i];
}

static void sort_digit(void *context, uint32_t digit)
{
    split *s = context;
    uint32_t begin = digit > 0 ? s->end[digit - 1] : 0;
    sort_part(s->spare + begin, s->keys + begin, s->end[digit] - begin, s->sorter->index_bits,
              true);
}

/* Counts into places: digit by digit, and of each the slices in their order. */
static void place_slices(split *s)
{
    uint32_t sum = 0;
    for (uint32_t v = 0; v < SPLIT_VALUES; s->end[v++] = sum)
        for (uint32_t i = 0; i < slice_count(s); i++) {
            uint32_t n = s->slices[i].place[v];
            s->slices[i].place[v] = sum;
            sum += n;
        }
}

bool prep_sort_all_shared(const prep_sorter *sorter, prep_workers *workers, uint32_t level,
                          uint64_t *keys, uint64_t *spare, uint32_t count, mospt_err *err)
{
    split s = {.sorter = sorter, .level = level, .count = count, .keys = keys, .spare = spare};
    uint32_t slices = slice_count(&s);
    uint64_t any = 0, all = UINT64_MAX;
    s.slices = calloc(slices, sizeof *s.slices);
    if (s.slices == NULL) return mospt_err_nomem(err, slices * sizeof *s.slices);
    prep_workers_run(workers, slices, find_slice, &s);
    for (uint32_t i = 0; i < slices; i++)
        any |= s.slices[i].any, all &= s.slices[i].all;
    if ((any & ~all) >> sorter->index_bits != 0) {
        s.shift = split_shift(any & ~all, sorter->index_bits);
        prep_workers_run(workers, slices, count_slice, &s);
        place_slices(&s);
        prep_workers_run(workers, slices, move_slice, &s);
        prep_workers_run(workers, SPLIT_VALUES, sort_digit, &s);
    }
    free(s.slices);
    return true;
}
