#include "tests/ref_mospt.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    const uint8_t *record;
    uint32_t level;
} item;

typedef struct cell {
    struct cell *child[8];
    bool is_inner;
    item *items; /* of a leaf, owned */
    uint32_t count;
} cell;

struct ref_mospt {
    uint32_t depth, bits, count;
    size_t stride;
    cell root;
};

ref_mospt *ref_mospt_create(uint32_t depth, uint32_t bits, size_t stride)
{
    ref_mospt *m = calloc(1, sizeof *m);
    if (m == NULL) abort();
    m->depth = depth, m->bits = bits, m->stride = stride;
    return m;
}

static void free_cell(cell *c)
{
    for (int o = 0; o < 8; o++) {
        if (c->child[o] == NULL) continue;
        free_cell(c->child[o]);
        free(c->child[o]);
    }
    free(c->items);
}

void ref_mospt_destroy(ref_mospt *m)
{
    free_cell(&m->root);
    free(m);
}

/* Octant of a point among the children of a cell at `depth` of this octree. */
static uint32_t octant_at(const ref_mospt *m, const uint8_t *record, uint32_t depth)
{
    uint32_t g[3], octant = 0;
    if (depth >= m->bits) return 0;
    memcpy(g, record, sizeof g);
    for (uint32_t a = 0; a < 3; a++)
        octant |= (g[a] >> (m->bits - 1 - depth) & 1) << a;
    return octant;
}

static bool insert(ref_mospt *m, cell *c, uint32_t depth, const uint8_t *record, bool reject)
{
    if (!c->is_inner && c->count > 0 && depth == m->depth && reject) return false;
    if (!c->is_inner && (c->count == 0 || depth == m->depth)) {
        if ((c->count & (c->count - 1)) == 0) /* grows at powers of two */
            c->items =
                realloc(c->items, (c->count > 0 ? 2 * (size_t)c->count : 1) * sizeof *c->items);
        if (c->items == NULL) abort();
        c->items[c->count++] = (item){.record = record};
        return true;
    }
    if (!c->is_inner) {
        const uint8_t *old = c->items[0].record;
        c->is_inner = true;
        c->count = 0;
        free(c->items);
        c->items = NULL;
        insert(m, c, depth, old, reject);
    }
    cell **child = &c->child[octant_at(m, record, depth)];
    if (*child == NULL && (*child = calloc(1, sizeof **child)) == NULL) abort();
    return insert(m, *child, depth + 1, record, reject);
}

bool ref_mospt_insert(ref_mospt *m, const uint8_t *record, bool reject)
{
    bool taken = insert(m, &m->root, 0, record, reject);
    m->count += taken;
    return taken;
}

uint32_t ref_mospt_count(const ref_mospt *m)
{
    return m->count;
}

/* The one whose colour has the least distance to the average of all; of equal ones the first. */
static item *nearest_to_average(item **items, uint32_t n)
{
    int64_t sum[3] = {0}, least = 0;
    item *nearest = NULL;
    for (uint32_t i = 0; i < n; i++)
        for (int k = 0; k < 3; k++)
            sum[k] += items[i]->record[12 + k];
    for (uint32_t i = 0; i < n; i++) {
        int64_t distance = 0;
        for (int k = 0; k < 3; k++) {
            int64_t d = (int64_t)n * items[i]->record[12 + k] - sum[k];
            distance += d * d;
        }
        if (nearest == NULL || distance < least) nearest = items[i], least = distance;
    }
    return nearest;
}

static size_t compare_stride; /* qsort() has no argument for it */

static int compare_items(const void *a, const void *b)
{
    const item *x = a, *y = b;
    return memcmp(x->record, y->record, compare_stride);
}

/* Returns the point that stands for a cell, after it has moved up to the cell's depth. */
static item *represent(ref_mospt *m, cell *c, uint32_t depth)
{
    item *standing[8], **all = standing, *chosen;
    uint32_t n = 0;
    if (c->is_inner) {
        for (int o = 0; o < 8; o++)
            if (c->child[o] != NULL) standing[n++] = represent(m, c->child[o], depth + 1);
        chosen = nearest_to_average(standing, n);
    } else {
        compare_stride = m->stride;
        qsort(c->items, c->count, sizeof *c->items, compare_items);
        all = malloc(c->count * sizeof *all);
        if (all == NULL) abort();
        for (uint32_t i = 0; i < c->count; i++) {
            c->items[i].level = m->depth + 1;
            all[i] = &c->items[i];
        }
        chosen = nearest_to_average(all, c->count);
        free(all);
    }
    chosen->level = depth;
    return chosen;
}

/* Points of one level, octant by octant: Morton order. */
static uint32_t collect(const cell *c, uint32_t level, const uint8_t **out)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < c->count; i++)
        if (c->items[i].level == level) out[n++] = c->items[i].record;
    for (int o = 0; o < 8; o++)
        if (c->child[o] != NULL) n += collect(c->child[o], level, out + n);
    return n;
}

static uint32_t bits_reversed(uint32_t turn)
{
    return (turn & 1) << 3 | (turn & 2) << 1 | (turn & 4) >> 1 | (turn & 8) >> 3;
}

/* Takes every 16th, sixteen times. */
static void deal(const uint8_t **order, uint32_t n)
{
    const uint8_t **morton = malloc((n + 1) * sizeof *morton);
    uint32_t to = 0;
    if (morton == NULL) abort();
    memcpy(morton, order, n * sizeof *morton);
    for (uint32_t turn = 0; turn < 16; turn++)
        for (uint32_t k = bits_reversed(turn); k < n; k += 16)
            order[to++] = morton[k];
    free(morton);
}

void ref_mospt_finish(ref_mospt *m, const uint8_t **order, uint32_t *level_end)
{
    uint32_t n = 0;
    if (m->count > 0) represent(m, &m->root, 0);
    for (uint32_t level = 0; level <= m->depth + 1; level++) {
        uint32_t added = collect(&m->root, level, order + n);
        deal(order + n, added);
        level_end[level] = n += added;
    }
}
