#include "mospt/linear.h"

#include "mospt/deal.h"
#include "mospt/wide.h"

enum {
    FEW = 64, /* points in one cell, for a plain sort */
    SIBLINGS = MOSPT_CHILDREN_MAX,
    RUN = 256, /* points that stand for cells, whose parents are found at a time */
};

/* Work in progress, depth by depth from the finest: of each occupied cell, the point that stands
 * for it, in Morton order. */
typedef struct {
    const mospt_linear_input *in;
    uint32_t *cell;
    uint32_t *place;  /* in the keys */
    uint32_t *colour; /* room for SIBLINGS - 1 more, which may be read */
    uint32_t standing;
    uint8_t *level;                /* [count] of the points, by place; as far as is known yet */
    uint32_t at[MOSPT_LEVELS_MAX]; /* how many of them are in each level */
} linear;

size_t mospt_linear_work_size(uint32_t count)
{
    return (3 * (size_t)count + SIBLINGS - 1) * sizeof(uint32_t) + count;
}

static void linear_init(linear *l, const mospt_linear_input *in, uint32_t count, void *work)
{
    *l = (linear){.in = in, .cell = work};
    l->place = l->cell + count;
    l->colour = l->place + count;
    l->level = (uint8_t *)(l->colour + count + SIBLINGS - 1);
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

/* Two, as most cells have that have several: which comes first no processor can foretell. */
static void sort_two(const mospt_linear_input *in, uint64_t *keys, size_t at)
{
    uint64_t a = keys[0], b = keys[1], first = word_at(in, a, at), second = word_at(in, b, at);
    bool turned = second < first;
    if (first == second)
        turned = memcmp(record_of(in, a) + at, record_of(in, b) + at, in->records->stride - at) > 0;
    keys[0] = turned ? b : a;
    keys[1] = turned ? a : b;
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

static void sort_cell(const mospt_linear_input *in, uint64_t *keys, uint32_t count, size_t at);

/* Byte by byte, in place, since there may be as many in one cell as a node can hold. */
static void sort_many(const mospt_linear_input *in, uint64_t *keys, uint32_t count, size_t at)
{
    uint32_t begin[UINT8_MAX + 2] = {0}, next[UINT8_MAX + 1];
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

/* Sorts by the bytes of the records from `at` on. */
static void sort_cell(const mospt_linear_input *in, uint64_t *keys, uint32_t count, size_t at)
{
    if (at == in->records->stride || count < 2) return;
    if (count == 2) sort_two(in, keys, at);
    else if (count <= FEW) sort_few(in, keys, count, at);
    else sort_many(in, keys, count, at);
}

static uint32_t colour_of(const mospt_linear_input *in, uint64_t key)
{
    mospt_vertex v = mospt_vertex_of(record_of(in, key));
    return mospt_linear_colour(&v);
}

static int32_t channel(uint32_t colour, int c)
{
    return (int32_t)(colour >> 8 * c & 0xff);
}

/* Section 4.6: of the points standing for the children of a cell, the one whose colour is nearest
 * to their average; the first of several. Distances are compared as |n c - sum|^2, in integers, so
 * that every machine decides alike. How many children there are no processor can foretell, so all
 * of them, and what is behind them, are looked at.
 * colours  [SIBLINGS], of which the first n count */
static inline uint32_t choose(const uint32_t *colours, uint32_t n)
{
    int32_t count = (int32_t)n, sum[3] = {0}, distance[SIBLINGS] = {0}, best = INT32_MAX;
    for (int c = 0; c < 3; c++)
        for (uint32_t i = 0; i < SIBLINGS; i++)
            sum[c] += i < n ? channel(colours[i], c) : 0;
    for (int c = 0; c < 3; c++)
        for (uint32_t i = 0; i < SIBLINGS; i++) {
            int32_t d = count * channel(colours[i], c) - sum[c];
            distance[i] += d * d;
        }
    for (int32_t i = 0; i < SIBLINGS; i++) {
        int32_t rank = i < count ? distance[i] * SIBLINGS + i : INT32_MAX;
        best = rank < best ? rank : best;
    }
    return (uint32_t)best % SIBLINGS;
}

uint32_t mospt_linear_choose(const uint32_t *colours, uint32_t n)
{
    uint32_t all[SIBLINGS] = {0};
    memcpy(all, colours, n * sizeof *all);
    return choose(all, n);
}

/* The same for any number of keys in a finest cell, where 32 bits would not do. */
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

/* The points of one finest cell: one of them stands for it. Returns which. The order in which they
 * arrived must not show in the result, so only their bytes order them. */
static uint32_t enter_cell(linear *l, uint64_t *keys, uint32_t begin, uint32_t end)
{
    if (end - begin == 1) return begin;
    sort_cell(l->in, keys + begin, end - begin, 0);
    return begin + choose_key(l->in, keys + begin, end - begin);
}

static void enter_cells(linear *l, uint64_t *keys, uint32_t count)
{
    const mospt_linear_input *in = l->in;
    uint32_t mask = (UINT32_C(1) << 3 * in->depth) - 1, n = 0;
    for (uint32_t a = 0, b; a < count; a = b, n++) {
        uint64_t cell = keys[a] >> in->cell_shift;
        for (b = a + 1; b < count && keys[b] >> in->cell_shift == cell;)
            b++;
        l->cell[n] = (uint32_t)cell & mask;
        l->place[n] = enter_cell(l, keys, a, b);
        l->colour[n] = colour_of(in, keys[l->place[n]]);
    }
    l->standing = n;
    l->at[in->depth + 1] = count - n;
}

/* The first of each parent's children, and the end of the last one's. Returns how many parents. */
static uint32_t find_parents(const uint32_t *cell, uint32_t count, uint32_t *first)
{
    uint32_t parents = 1;
    first[0] = 0;
    for (uint32_t i = 1; i < count; i++) {
        first[parents] = i;
        parents += (cell[i] ^ cell[i - 1]) >> 3 > 0;
    }
    first[parents] = count;
    return parents;
}

/* Ends a run of cells of depth `level`, from the one at `from` on: of the points that stand for the
 * children of a cell, one goes on to stand for it, at `*to` and after. Returns how many are done.
 */
MOSPT_WIDE static uint32_t end_run(linear *l, uint32_t level, uint32_t from, uint32_t *to)
{
    uint32_t count = l->standing - from < RUN ? l->standing - from : RUN, first[RUN + 1];
    uint32_t parents = find_parents(l->cell + from, count, first), up = *to;
    /* The last one may have more children. */
    if (from + count < l->standing) count = first[--parents];
    for (uint32_t i = from; i < from + count; i++)
        l->level[l->place[i]] = (uint8_t)level;
    for (uint32_t p = 0; p < parents; p++, up++) {
        uint32_t child = from + first[p];
        uint32_t chosen = child + choose(l->colour + child, first[p + 1] - first[p]);
        l->cell[up] = l->cell[child] >> 3;
        l->place[up] = l->place[chosen];
        l->colour[up] = l->colour[chosen];
    }
    *to = up;
    return count;
}

static void end_depth(linear *l, uint32_t level)
{
    uint32_t to = 0;
    for (uint32_t from = 0; from < l->standing;)
        from += end_run(l, level, from, &to);
    l->at[level] = l->standing - to;
    l->standing = to;
}

/* Gives every point its level: that of the last depth at which it stood for a cell, or one more
 * than there are. */
static void assign_levels(linear *l, uint64_t *keys, uint32_t count)
{
    memset(l->level, (int)l->in->depth + 1, count);
    enter_cells(l, keys, count);
    for (uint32_t level = l->in->depth; level > 0; level--)
        end_depth(l, level);
    l->level[l->place[0]] = 0;
    l->at[0] = 1;
}

void mospt_linear_build(const mospt_linear_input *in, uint64_t *keys, uint32_t count, void *work,
                        uint32_t *order, uint32_t *level_end)
{
    linear l;
    uint32_t next[MOSPT_LEVELS_MAX][MOSPT_HANDS], dealt[MOSPT_LEVELS_MAX] = {0};
    linear_init(&l, in, count, work);
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
