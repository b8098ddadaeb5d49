#include "mospt/linear.h"

enum { FEW = 64 }; /* points in one cell, for a plain sort */

/* The points that stand for the cells of the present depth. */
typedef struct {
    uint32_t *place; /* of the point in the keys */
    uint32_t *colour;
    uint8_t *boundary; /* coarsest depth at which it is in another cell than the one before it */
} standing;

size_t mospt_linear_work_size(uint32_t count)
{
    return (size_t)count * (2 * sizeof(uint32_t) + 2);
}

static const uint8_t *record_of(const mospt_linear_input *in, uint64_t key)
{
    return mospt_records_at(in->records, mospt_linear_index(key, in->index_bits));
}

/* The first byte from `at` on in which not all records are alike; the stride if there is none. */
static size_t first_difference(const mospt_linear_input *in, const uint64_t *keys, uint32_t count,
                               size_t at)
{
    const uint8_t *first = record_of(in, keys[0]);
    size_t end = in->records->stride;
    for (uint32_t i = 1; i < count && end > at; i++) {
        const uint8_t *record = record_of(in, keys[i]);
        size_t alike = at;
        while (alike < end && record[alike] == first[alike])
            alike++;
        end = alike;
    }
    return end;
}

/* Eight bytes of a record from `at` on, or its last eight, as a number that compares like them. */
static uint64_t word_at(const mospt_linear_input *in, uint64_t key, size_t at)
{
    uint64_t word;
    size_t last = in->records->stride - sizeof word;
    memcpy(&word, record_of(in, key) + (at < last ? at : last), sizeof word);
    return __builtin_bswap64(word);
}

/* All records are alike before `at`, so a word that begins earlier decides as well. Words are taken
 * first, since records stand anywhere, and the waits for them overlap. */
static void sort_few(const mospt_linear_input *in, uint64_t *keys, uint32_t count, size_t at)
{
    uint64_t words[FEW];
    size_t stride = in->records->stride;
    for (uint32_t i = 0; i < count; i++)
        words[i] = word_at(in, keys[i], at);
    for (uint32_t i = 1; i < count; i++) {
        uint64_t key = keys[i], word = words[i];
        uint32_t to = i;
        for (; to > 0 && words[to - 1] >= word; to--) {
            if (words[to - 1] == word &&
                memcmp(record_of(in, keys[to - 1]) + at, record_of(in, key) + at, stride - at) <= 0)
                break;
            words[to] = words[to - 1];
            keys[to] = keys[to - 1];
        }
        words[to] = word;
        keys[to] = key;
    }
}

/* Sorts by the bytes of the records from `at` on: byte by byte, in place, since there may be as
 * many in one cell as a node can hold. */
static void sort_cell(const mospt_linear_input *in, uint64_t *keys, uint32_t count, size_t at)
{
    uint32_t begin[UINT8_MAX + 2] = {0}, next[UINT8_MAX + 1];
    if (at == in->records->stride || count < 2) return;
    if (count <= FEW) {
        sort_few(in, keys, count, at);
        return;
    }
    at = first_difference(in, keys, count, at);
    if (at == in->records->stride) return;
    for (uint32_t i = 0; i < count; i++)
        begin[record_of(in, keys[i])[at] + 1]++;
    for (uint32_t v = 0; v <= UINT8_MAX; v++) {
        begin[v + 1] += begin[v];
        next[v] = begin[v];
    }
    for (uint32_t v = 0; v <= UINT8_MAX; v++)
        while (next[v] < begin[v + 1]) {
            uint32_t here = next[v];
            uint64_t key = keys[here];
            uint32_t there = next[record_of(in, key)[at]]++;
            keys[here] = keys[there];
            keys[there] = key;
        }
    for (uint32_t v = 0; v <= UINT8_MAX; v++)
        sort_cell(in, keys + begin[v], begin[v + 1] - begin[v], at + 1);
}

/* The order in which points arrived must not show in the result: only their bytes order the points
 * of one cell. */
static void sort_shared_cells(const mospt_linear_input *in, uint64_t *keys, uint32_t count)
{
    for (uint32_t a = 0, b; a < count; a = b) {
        uint64_t cell = keys[a] >> in->cell_shift;
        for (b = a + 1; b < count && keys[b] >> in->cell_shift == cell;)
            b++;
        if (b - a > 1) sort_cell(in, keys + a, b - a, 0);
    }
}

/* Depth at which two cells of the finest depth part: 0 for other octants of the node, `depth` + 1
 * for the same cell. */
static uint8_t parting_depth(uint64_t a, uint64_t b, uint32_t depth)
{
    uint64_t differ = a ^ b;
    if (differ == 0) return (uint8_t)(depth + 1);
    return (uint8_t)(depth - (63 - (uint32_t)__builtin_clzll(differ)) / 3);
}

static void stand_all(const mospt_linear_input *in, const uint64_t *keys, uint32_t count,
                      standing *s)
{
    for (uint32_t i = 0; i < count; i++) {
        s->place[i] = i;
        s->colour[i] = in->colours[mospt_linear_index(keys[i], in->index_bits)];
        s->boundary[i] = i == 0 ? 0
                                : parting_depth(keys[i] >> in->cell_shift,
                                                keys[i - 1] >> in->cell_shift, in->depth);
    }
}

static int32_t channel(uint32_t colour, int c)
{
    uint8_t bytes[4];
    memcpy(bytes, &colour, sizeof bytes);
    return bytes[c];
}

/* Section 4.6: of the points standing for the children of a cell, the one whose colour is nearest
 * to their average; the first of several. Distances are compared as |n c - sum|^2, in integers, so
 * that every machine decides alike. */
static uint32_t choose_of_many(const uint32_t *colours, uint32_t n)
{
    int64_t sum[3] = {0}, best_distance = INT64_MAX;
    uint32_t best = 0;
    for (uint32_t i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            sum[c] += channel(colours[i], c);
    for (uint32_t i = 0; i < n; i++) {
        int64_t distance = 0;
        for (int c = 0; c < 3; c++) {
            int64_t d = (int64_t)n * channel(colours[i], c) - sum[c];
            distance += d * d;
        }
        if (distance < best_distance) best_distance = distance, best = i;
    }
    return best;
}

/* For eight points 32 bits do. */
uint32_t mospt_linear_choose(const uint32_t *colours, uint32_t n)
{
    int32_t sum[3] = {0}, best_distance = INT32_MAX, count = (int32_t)n;
    uint32_t best = 0;
    for (uint32_t i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            sum[c] += channel(colours[i], c);
    for (uint32_t i = 0; i < n; i++) {
        int32_t dr = count * channel(colours[i], 0) - sum[0],
                dg = count * channel(colours[i], 1) - sum[1],
                db = count * channel(colours[i], 2) - sum[2];
        int32_t distance = dr * dr + dg * dg + db * db;
        if (distance < best_distance) best_distance = distance, best = i;
    }
    return best;
}

/* Leaves one of the points in each cell of `depth` standing, and gives them that level. Returns how
 * many. */
static uint32_t rise(standing *s, uint32_t count, uint32_t depth, uint8_t *level)
{
    uint32_t out = 0;
    for (uint32_t a = 0, b; a < count; a = b) {
        for (b = a + 1; b < count && s->boundary[b] > depth;)
            b++;
        uint32_t chosen = a;
        if (b - a > 1 && b - a <= MOSPT_CHILDREN_MAX)
            chosen += mospt_linear_choose(s->colour + a, b - a);
        else if (b - a > 1) chosen += choose_of_many(s->colour + a, b - a);
        level[s->place[chosen]] = (uint8_t)depth;
        s->place[out] = s->place[chosen];
        s->colour[out] = s->colour[chosen];
        s->boundary[out++] = s->boundary[a];
    }
    return out;
}

void mospt_linear_build(const mospt_linear_input *in, uint64_t *keys, uint32_t count, void *work,
                        uint32_t *order, uint32_t *level_end)
{
    standing s = {.place = work};
    s.colour = s.place + count;
    s.boundary = (uint8_t *)(s.colour + count);
    uint8_t *level = s.boundary + count;
    uint32_t at[MOSPT_LEVELS_MAX] = {0}, standing_count = count;

    sort_shared_cells(in, keys, count);
    stand_all(in, keys, count, &s);
    memset(level, (int)in->depth + 1, count);
    for (uint32_t depth = in->depth + 1; depth-- > 0;)
        standing_count = rise(&s, standing_count, depth, level);

    for (uint32_t i = 0; i < count; i++)
        at[level[i]]++;
    for (uint32_t l = 0, end = 0; l < in->depth + 2; l++) {
        uint32_t here = at[l];
        at[l] = end;
        level_end[l] = end += here;
    }
    for (uint32_t i = 0; i < count; i++)
        order[at[level[i]]++] = mospt_linear_index(keys[i], in->index_bits);
}
