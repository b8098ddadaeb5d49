#include "mospt/linear.h"

#include "mospt/deal.h"

enum {
    FEW = 64,   /* points in one cell, for a plain sort */
    AHEAD = 64, /* keys by which the memory that they point to is asked for early */
    STANDING_MAX = 1 + (MOSPT_CHILDREN_MAX - 1) * MOSPT_DEPTH_MAX,
};

/* Work in progress. A point stands for the cells around it: of all depths but those that it shares
 * with the one before it. Those in cells that have not ended stand in a stack. */
typedef struct {
    const mospt_linear_input *in;
    uint8_t *level;                /* [count] of the points that no longer stand */
    uint32_t at[MOSPT_LEVELS_MAX]; /* how many of them are in each level */
    uint32_t place[STANDING_MAX];  /* in the keys */
    uint32_t colour[STANDING_MAX];
    uint32_t boundary[STANDING_MAX]; /* coarsest depth at which it is in another cell than the one
                                        before it; they rise */
    uint32_t top;                    /* index of the last one */
} linear;

size_t mospt_linear_work_size(uint32_t count)
{
    return count;
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

/* Coarsest depth at which two finest cells part: 1 for other octants of the node. */
static uint32_t parting_depth(uint64_t a, uint64_t b, uint32_t depth)
{
    return depth - (63 - (uint32_t)__builtin_clzll(a ^ b)) / 3;
}

static uint32_t colour_of(const mospt_linear_input *in, uint64_t key)
{
    uint32_t colour;
    memcpy(&colour, record_of(in, key) + offsetof(mospt_vertex, r), sizeof colour);
    return colour;
}

static int32_t channel(uint32_t colour, int c)
{
    uint8_t bytes[4];
    memcpy(bytes, &colour, sizeof bytes);
    return bytes[c];
}

/* Section 4.6: of the points standing for the children of a cell, the one whose colour is nearest
 * to their average; the first of several. Distances are compared as |n c - sum|^2, in integers, so
 * that every machine decides alike. Two are always at the same distance. */
uint32_t mospt_linear_choose(const uint32_t *colours, uint32_t n)
{
    int32_t sum[3] = {0}, best_distance = INT32_MAX, count = (int32_t)n;
    uint32_t best = 0;
    if (n <= 2) return 0;
    for (uint32_t i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            sum[c] += channel(colours[i], c);
    for (uint32_t i = 0; i < n; i++) {
        int32_t dr = count * channel(colours[i], 0) - sum[0],
                dg = count * channel(colours[i], 1) - sum[1],
                db = count * channel(colours[i], 2) - sum[2];
        int32_t distance = dr * dr + dg * dg + db * db;
        best = distance < best_distance ? i : best;
        best_distance = distance < best_distance ? distance : best_distance;
    }
    return best;
}

/* The same for any number of points in a finest cell, where 32 bits would not do. */
static uint32_t choose_key(const mospt_linear_input *in, const uint64_t *keys, uint32_t n)
{
    int64_t sum[3] = {0}, best_distance = INT64_MAX;
    uint32_t best = 0;
    if (n <= 2) return 0;
    for (uint32_t i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            sum[c] += channel(colour_of(in, keys[i]), c);
    for (uint32_t i = 0; i < n; i++) {
        int64_t distance = 0;
        for (int c = 0; c < 3; c++) {
            int64_t d = (int64_t)n * channel(colour_of(in, keys[i]), c) - sum[c];
            distance += d * d;
        }
        if (distance < best_distance) best_distance = distance, best = i;
    }
    return best;
}

static void settle(linear *l, uint32_t place, uint32_t level)
{
    l->level[place] = (uint8_t)level;
    l->at[level]++;
}

/* Ends all cells of depth `boundary` and below: of the children of each, finest first, one goes on
 * to stand for it, and the others are settled in the level that they stood in. */
static void end_cells(linear *l, uint32_t boundary)
{
    while (l->boundary[l->top] > boundary) {
        uint32_t level = l->boundary[l->top], first = l->top;
        do
            first--;
        while (l->boundary[first] == level);
        uint32_t n = l->top - first + 1, chosen = mospt_linear_choose(l->colour + first, n);
        for (uint32_t i = 0; i < n; i++)
            if (i != chosen) settle(l, l->place[first + i], level);
        l->place[first] = l->place[first + chosen];
        l->colour[first] = l->colour[first + chosen];
        l->top = first;
    }
}

/* The points of one finest cell: one of them stands for it. Returns which. The order in which they
 * arrived must not show in the result, so only their bytes order them. */
static uint32_t enter_cell(linear *l, uint64_t *keys, uint32_t begin, uint32_t end)
{
    if (end - begin == 1) return begin;
    sort_cell(l->in, keys + begin, end - begin, 0);
    uint32_t chosen = begin + choose_key(l->in, keys + begin, end - begin);
    for (uint32_t i = begin; i < end; i++)
        if (i != chosen) settle(l, i, l->in->depth + 1);
    return chosen;
}

/* Gives every point its level, in one walk along the Morton order. */
static void assign_levels(linear *l, uint64_t *keys, uint32_t count)
{
    const mospt_linear_input *in = l->in;
    uint64_t last = 0; /* cell */
    uint32_t asked = 0;
    for (uint32_t a = 0, b; a < count; a = b) {
        uint64_t cell = keys[a] >> in->cell_shift;
        for (b = a + 1; b < count && keys[b] >> in->cell_shift == cell;)
            b++;
        uint32_t ask = count - b < AHEAD ? count : b + AHEAD;
        for (; asked < ask; asked++)
            __builtin_prefetch(record_of(in, keys[asked]));
        uint32_t place = enter_cell(l, keys, a, b), boundary = 0;
        if (a > 0) {
            boundary = parting_depth(cell, last, in->depth);
            end_cells(l, boundary);
            l->top++;
        }
        l->place[l->top] = place;
        l->colour[l->top] = colour_of(in, keys[place]);
        l->boundary[l->top] = boundary;
        last = cell;
    }
    end_cells(l, 0);
    settle(l, l->place[0], 0);
}

void mospt_linear_build(const mospt_linear_input *in, uint64_t *keys, uint32_t count, void *work,
                        uint32_t *order, uint32_t *level_end)
{
    linear l = {.in = in, .level = work};
    uint32_t next[MOSPT_LEVELS_MAX][MOSPT_HANDS], dealt[MOSPT_LEVELS_MAX] = {0};
    if (count > 0) assign_levels(&l, keys, count);
    for (uint32_t level = 0, end = 0; level < in->depth + 2; level++) {
        mospt_deal deal = mospt_deal_of(l.at[level]);
        for (uint32_t h = 0; h < MOSPT_HANDS; h++)
            next[level][h] = end + deal.begin[h];
        level_end[level] = end += l.at[level];
    }
    for (uint32_t i = 0; i < count; i++) {
        uint32_t level = l.level[i], hand = dealt[level]++ % MOSPT_HANDS;
        order[next[level][hand]++] = mospt_linear_index(keys[i], in->index_bits);
    }
}
