#include "mospt/linear.h"

#include <stdlib.h>

size_t mospt_linear_work_size(uint32_t count)
{
    return (size_t)count * (sizeof(uint32_t) + 1);
}

static uint64_t cell_of(const mospt_linear_input *in, const mospt_linear_key *key)
{
    return key->code >> in->code_shift;
}

static const uint8_t *record_of(const mospt_linear_input *in, const mospt_linear_key *key)
{
    return in->records + (size_t)key->index * in->stride;
}

static int compare_records(const void *a, const void *b, void *user)
{
    const mospt_linear_input *in = user;
    return memcmp(record_of(in, a), record_of(in, b), in->stride);
}

/* The order in which points arrived must not show in the result: only their bytes order the points
 * of one cell. */
static void sort_shared_cells(const mospt_linear_input *in, mospt_linear_key *keys, uint32_t count)
{
    for (uint32_t a = 0, b; a < count; a = b) {
        uint64_t cell = cell_of(in, &keys[a]);
        for (b = a + 1; b < count && cell_of(in, &keys[b]) == cell;)
            b++;
        if (b - a > 1)
            qsort_r(keys + a, b - a, sizeof *keys, compare_records, (void *)(uintptr_t)in);
    }
}

/* Section 4.6: of the points standing for the children of a cell, the one whose colour is nearest
 * to their average; the first of several. Distances are compared as |n c - sum|^2, in integers, so
 * that every machine decides alike. */
static uint32_t choose(const mospt_linear_input *in, const mospt_linear_key *keys,
                       const uint32_t *from, uint32_t n)
{
    int64_t sum[3] = {0};
    if (n == 1) return from[0];
    for (uint32_t i = 0; i < n; i++) {
        mospt_vertex v = mospt_vertex_of(record_of(in, &keys[from[i]]));
        sum[0] += v.r, sum[1] += v.g, sum[2] += v.b;
    }
    uint32_t best = from[0];
    int64_t best_distance = INT64_MAX;
    for (uint32_t i = 0; i < n; i++) {
        mospt_vertex v = mospt_vertex_of(record_of(in, &keys[from[i]]));
        int64_t dr = (int64_t)n * v.r - sum[0], dg = (int64_t)n * v.g - sum[1],
                db = (int64_t)n * v.b - sum[2];
        int64_t distance = dr * dr + dg * dg + db * db;
        if (distance < best_distance) best_distance = distance, best = from[i];
    }
    return best;
}

void mospt_linear_build(const mospt_linear_input *in, mospt_linear_key *keys, uint32_t count,
                        void *work, uint32_t *order, uint32_t *level_end)
{
    uint32_t *standing =
        work; /* positions in keys of the points that stand for the cells of the present depth */
    uint8_t *level = (uint8_t *)(standing + count);
    uint32_t standing_count = count;
    uint32_t at[MOSPT_LEVELS_MAX] = {0};

    sort_shared_cells(in, keys, count);
    for (uint32_t i = 0; i < count; i++)
        standing[i] = i, level[i] = (uint8_t)(in->depth + 1);
    for (uint32_t depth = in->depth + 1; depth-- > 0;) {
        uint32_t shift = in->code_shift + 3 * (in->depth - depth), out = 0;
        for (uint32_t a = 0, b; a < standing_count; a = b) {
            uint64_t cell = keys[standing[a]].code >> shift;
            for (b = a + 1; b < standing_count && keys[standing[b]].code >> shift == cell;)
                b++;
            uint32_t chosen = choose(in, keys, standing + a, b - a);
            level[chosen] = (uint8_t)depth;
            standing[out++] = chosen;
        }
        standing_count = out;
    }
    for (uint32_t i = 0; i < count; i++)
        at[level[i]]++;
    for (uint32_t l = 0, end = 0; l < in->depth + 2; l++) {
        uint32_t here = at[l];
        at[l] = end;
        level_end[l] = end += here;
    }
    for (uint32_t i = 0; i < count; i++)
        order[at[level[i]]++] = keys[i].index;
}
