#include "preprocess/solve.h"

#include "preprocess/sort.h"

#include <stdlib.h>

enum { OCTANTS = 8 };

typedef struct {
    const prep_shape *shape;
    prep_sorter sorter;
    uint64_t *keys;      /* [count] sorted; rejected points move to the front of a node's part */
    uint32_t kept_count; /* of made.keys; the rest of them is room for sorting what is left */
    prep_subtree made;
} solver;

void prep_subtree_fini(prep_subtree *subtree)
{
    free(subtree->nodes);
    *subtree = (prep_subtree){0};
}

size_t prep_solve_work_size(uint32_t count)
{
    return count * 2 * sizeof(uint64_t);
}

static void solver_init(solver *s, const prep_shape *shape, const mospt_records *records,
                        uint32_t count, void *work)
{
    *s = (solver){.shape = shape, .keys = work, .made.count = count};
    s->made.keys = s->keys + count;
    s->sorter = (prep_sorter){.grid = shape->grid, .records = records};
    prep_sort_begin(&s->sorter, s->keys, count);
    s->made.index_bits = s->sorter.index_bits;
}

static uint32_t index_of(const solver *s, uint64_t key)
{
    return mospt_linear_index(key, s->made.index_bits);
}

static bool reserve(prep_subtree *made, mospt_err *err)
{
    if (made->node_count < made->node_capacity) return true;
    uint32_t capacity = made->node_capacity > 0 ? 2 * made->node_capacity : 16;
    prep_solved *nodes = realloc(made->nodes, capacity * sizeof *nodes);
    if (nodes == NULL) return mospt_err_nomem(err, capacity * sizeof *nodes);
    made->nodes = nodes;
    made->node_capacity = capacity;
    return true;
}

/* Where the keys that the next node keeps go. */
static uint64_t *room(const solver *s)
{
    return s->made.keys + s->kept_count;
}

/* There is room for that: none of the keys is kept yet. */
static void sort_below(solver *s, uint32_t level, uint64_t *keys, uint32_t count)
{
    prep_sort_below(&s->sorter, level, keys, room(s), count);
}

/* Makes a node of the next `count` keys in the room. */
static bool keep(solver *s, const uint32_t corner[3], uint32_t level, uint8_t child_mask,
                 uint32_t cell_shift, uint32_t count, mospt_err *err)
{
    if (level > UINT16_MAX)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "more than %d levels: too many points at one position", UINT16_MAX);
    if (!reserve(&s->made, err)) return false;
    s->made.nodes[s->made.node_count++] = (prep_solved){
        .first = s->kept_count,
        .cell_shift = cell_shift,
        .node = {.corner = {corner[0], corner[1], corner[2]},
                 .level = (uint16_t)level,
                 .child_mask = child_mask,
                 .count = count,
                 .payload_size = (uint64_t)count * mospt_record_size(s->shape->schema)}};
    s->kept_count += count;
    return true;
}

/* All points at one position: the first PREP_PILE_MAX of them, then a child with the next, and so
 * on.
 * keys     as they arrived */
static bool solve_pile(solver *s, const uint32_t corner[3], uint32_t level, uint64_t *keys,
                       uint32_t count, mospt_err *err)
{
    memcpy(room(s), keys, count * sizeof *keys);
    while (count > 0) {
        uint32_t n = count;
        if (n > PREP_PILE_MAX && n - PREP_PILE_MAX >= s->shape->add_threshold) n = PREP_PILE_MAX;
        if (!keep(s, corner, level, n < count ? 1 : 0, s->made.index_bits, n, err)) return false;
        count -= n, level++;
    }
    return true;
}

/* Where the keys of the octant end that the first one is in. */
static uint32_t octant_end(const uint64_t *keys, uint32_t count, uint32_t octant_shift)
{
    uint32_t low = 1, high = count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (keys[middle] >> octant_shift == keys[0] >> octant_shift) low = middle + 1;
        else high = middle;
    }
    return low;
}

/* Points that find their finest cell taken. */
static uint32_t count_rejected(const uint64_t *keys, uint32_t count, uint32_t cell_shift)
{
    uint32_t sum = 0;
    for (uint32_t i = 1; i < count; i++)
        sum += keys[i] >> cell_shift == keys[i - 1] >> cell_shift;
    return sum;
}

/* Sends the first point that arrived in each cell to `kept`, and the others, in their order, to
 * `rejected`, which may overlap `keys` from below. Returns how many are kept. */
static uint32_t reject(const solver *s, const uint64_t *keys, uint32_t count, uint32_t cell_shift,
                       uint64_t *kept, uint64_t *rejected)
{
    uint32_t cells = 0;
    for (uint32_t a = 0, b; a < count; a = b) {
        uint64_t cell = keys[a] >> cell_shift, first_key = keys[a];
        uint32_t first = a;
        for (b = a + 1; b < count && keys[b] >> cell_shift == cell; b++) {
            bool earlier = index_of(s, keys[b]) < index_of(s, first_key);
            first = earlier ? b : first;
            first_key = earlier ? keys[b] : first_key;
        }
        kept[cells++] = first_key;
        for (uint32_t i = a; i < first; i++)
            *rejected++ = keys[i];
        for (uint32_t i = first + 1; i < b; i++)
            *rejected++ = keys[i];
    }
    return cells;
}

/* Splits the keys of a node: those that it keeps go to `kept`, the others stay in front of `keys`.
 * Which octants reject is decided here.
 * rejected  out, [OCTANTS] */
static uint32_t split(const solver *s, uint64_t *keys, uint32_t count, uint32_t cell_shift,
                      uint32_t octant_shift, uint64_t *kept, uint32_t rejected[OCTANTS])
{
    uint32_t kept_count = 0, left = 0;
    memset(rejected, 0, OCTANTS * sizeof *rejected);
    for (uint32_t a = 0, n; a < count; a += n) {
        uint32_t octant = (uint32_t)(keys[a] >> octant_shift) & (OCTANTS - 1);
        n = octant_end(keys + a, count - a, octant_shift);
        uint32_t more = n < s->shape->add_threshold ? 0 : count_rejected(keys + a, n, cell_shift);
        if (more > 0 && more >= s->shape->add_threshold) {
            kept_count += reject(s, keys + a, n, cell_shift, kept + kept_count, keys + left);
            rejected[octant] = more;
            left += more;
        } else {
            memcpy(kept + kept_count, keys + a, n * sizeof *keys);
            kept_count += n;
        }
    }
    return kept_count;
}

/* base     level at which the codes of `keys` begin */
static bool solve_node(solver *s, const uint32_t corner[3], uint32_t level, uint32_t base,
                       uint64_t *keys, uint32_t count, mospt_err *err)
{
    uint32_t depth = s->shape->inner_depth, rejected[OCTANTS];

    if (mospt_cell_bits(s->shape->grid, level) == 0) {
        for (uint32_t i = 0; i < count; i++)
            keys[i] = (uint64_t)index_of(s, keys[i]);
        prep_sort_keys(keys, room(s), count, 0);
        return solve_pile(s, corner, level, keys, count, err);
    }
    if (level - base + depth > s->sorter.code_levels) {
        base = level;
        sort_below(s, level, keys, count);
    }
    uint32_t cell_shift = s->made.index_bits + 3 * (s->sorter.code_levels - (level - base) - depth);
    uint32_t octant_shift = s->made.index_bits + 3 * (s->sorter.code_levels - (level - base) - 1);
    uint32_t kept = split(s, keys, count, cell_shift, octant_shift, room(s), rejected);
    uint8_t child_mask = 0;
    for (int o = 0; o < OCTANTS; o++)
        if (rejected[o] > 0) child_mask |= (uint8_t)(1u << o);
    if (!keep(s, corner, level, child_mask, cell_shift, kept, err)) return false;
    for (uint32_t o = 0; o < OCTANTS; o++) {
        uint32_t child[3];
        if (rejected[o] == 0) continue;
        mospt_cell_child(s->shape->grid, corner, level, o, child);
        if (!solve_node(s, child, level + 1, base, keys, rejected[o], err)) return false;
        keys += rejected[o];
    }
    return true;
}

bool prep_solve(const prep_shape *shape, const uint32_t corner[3], uint32_t level,
                const mospt_records *records, uint32_t count, void *work, prep_subtree *out,
                mospt_err *err)
{
    solver s;
    solver_init(&s, shape, records, count, work);
    sort_below(&s, level, s.keys, count);
    bool ok = solve_node(&s, corner, level, level, s.keys, count, err);
    if (ok) *out = s.made;
    else prep_subtree_fini(&s.made);
    return ok;
}

bool prep_solve_node(const prep_shape *shape, const uint32_t corner[3], uint32_t level,
                     uint8_t child_mask, const mospt_records *records, uint32_t count, void *work,
                     prep_subtree *out, mospt_err *err)
{
    solver s;
    solver_init(&s, shape, records, count, work);
    sort_below(&s, level, s.keys, count);
    memcpy(room(&s), s.keys, count * sizeof *s.keys);
    bool ok = keep(&s, corner, level, child_mask,
                   s.made.index_bits + 3 * (s.sorter.code_levels - shape->inner_depth), count, err);
    if (ok) *out = s.made;
    else prep_subtree_fini(&s.made);
    return ok;
}

/* The payload, which may end anywhere, the order, and what the linearisation needs. */
static size_t payload_room(const prep_shape *shape, uint32_t count)
{
    return (count * mospt_record_size(shape->schema) + sizeof(uint64_t) - 1) / sizeof(uint64_t) *
           sizeof(uint64_t);
}

size_t prep_solve_emit_size(const prep_shape *shape, uint32_t count)
{
    return payload_room(shape, count) + count * sizeof(uint32_t) + mospt_linear_work_size(count);
}

uint64_t prep_solve_emit(const prep_shape *shape, const mospt_records *records,
                         prep_subtree *subtree, uint32_t n, void *memory)
{
    prep_solved *solved = &subtree->nodes[n];
    mospt_node *node = &solved->node;
    uint32_t count = node->count;
    uint8_t *payload = memory;
    uint32_t *order = (uint32_t *)(payload + payload_room(shape, count));
    mospt_linear_input input = {.records = records,
                                .depth = shape->inner_depth,
                                .index_bits = subtree->index_bits,
                                .cell_shift = solved->cell_shift};
    mospt_linear_build(&input, subtree->keys + solved->first, count, order + count, order,
                       node->level_end);
    mospt_payload_pack(shape->schema, records, order, count, payload, node);
    return mospt_payload_points_hash(shape->schema, payload, payload + count * sizeof(mospt_vertex),
                                     count);
}
