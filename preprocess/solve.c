#include "preprocess/solve.h"

#include "preprocess/sort.h"

#include <stdlib.h>

enum { OCTANTS = 8 };

typedef struct {
    const prep_shape *shape;
    const uint8_t *records;
    size_t stride;
    mospt_linear_key *keys; /* [count] sorted; rejected points move to the front of a node's part */
    mospt_linear_key *spare; /* [count] for sorting, and for the points of the node being made */
    void *work;
    uint32_t *order; /* [count] */
    prep_subtree made;
} solver;

void prep_subtree_fini(prep_subtree *subtree)
{
    free(subtree->nodes), free(subtree->payload);
    *subtree = (prep_subtree){0};
}

size_t prep_solve_point_size(const prep_shape *shape)
{
    return 2 * sizeof(mospt_linear_key) + mospt_linear_work_size(1) + sizeof(uint32_t) +
           mospt_record_size(shape->schema);
}

static bool solver_init(solver *s, const prep_shape *shape, const uint8_t *records, uint32_t count,
                        mospt_err *err)
{
    *s = (solver){.shape = shape, .records = records, .stride = mospt_record_size(shape->schema)};
    s->keys = malloc(count * sizeof *s->keys);
    s->spare = malloc(count * sizeof *s->spare);
    s->work = malloc(mospt_linear_work_size(count));
    s->order = malloc(count * sizeof *s->order);
    s->made.payload = malloc(count * s->stride);
    if (s->keys == NULL || s->spare == NULL || s->work == NULL || s->order == NULL ||
        s->made.payload == NULL)
        return mospt_err_nomem(err, count * prep_solve_point_size(shape));
    for (uint32_t i = 0; i < count; i++)
        s->keys[i].index = i;
    return true;
}

static void solver_fini(solver *s)
{
    free(s->keys), free(s->spare), free(s->work), free(s->order);
    prep_subtree_fini(&s->made);
}

static mospt_node *add_node(prep_subtree *made, mospt_err *err)
{
    if (made->node_count == made->node_capacity) {
        uint32_t capacity = made->node_capacity > 0 ? 2 * made->node_capacity : 16;
        mospt_node *nodes = realloc(made->nodes, capacity * sizeof *nodes);
        if (nodes == NULL) {
            mospt_err_nomem(err, capacity * sizeof *nodes);
            return NULL;
        }
        made->nodes = nodes;
        made->node_capacity = capacity;
    }
    return &made->nodes[made->node_count++];
}

/* Codes of 21 levels below the node at `level`, in rising order. */
static void sort_below(solver *s, uint32_t level, mospt_linear_key *keys, uint32_t count)
{
    uint32_t bits = mospt_cell_bits(s->shape->grid, level);
    for (uint32_t i = 0; i < count; i++) {
        mospt_vertex v = mospt_vertex_of(s->records + keys[i].index * s->stride);
        keys[i].code = mospt_cell_code(v.x, v.y, v.z, bits, MOSPT_CODE_LEVELS);
    }
    prep_sort_keys(keys, s->spare + (keys - s->keys), count);
}

static bool emit(solver *s, const uint32_t corner[3], uint32_t level, uint8_t child_mask,
                 uint32_t code_shift, mospt_linear_key *keys, uint32_t count, mospt_err *err)
{
    mospt_linear_input input = {.records = s->records,
                                .stride = s->stride,
                                .depth = s->shape->inner_depth,
                                .code_shift = code_shift};
    if (level > UINT16_MAX)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "more than %d levels: too many points at one position", UINT16_MAX);
    mospt_node *node = add_node(&s->made, err);
    if (node == NULL) return false;
    *node = (mospt_node){.corner = {corner[0], corner[1], corner[2]},
                         .level = (uint16_t)level,
                         .child_mask = child_mask,
                         .payload_offset = s->made.point_count * s->stride};
    mospt_linear_build(&input, keys, count, s->work, s->order, node->level_end);
    uint8_t *payload = s->made.payload + node->payload_offset;
    mospt_payload_pack(s->shape->schema, s->records, s->order, count, payload, node);
    s->made.point_count += count;
    s->made.points_hash += mospt_payload_points_hash(s->shape->schema, payload,
                                                     payload + count * sizeof(mospt_vertex), count);
    return true;
}

/* All points at one position: the first PREP_PILE_MAX of them, then a child with the next, and so
 * on. */
static bool solve_pile(solver *s, const uint32_t corner[3], uint32_t level, mospt_linear_key *keys,
                       uint32_t count, mospt_err *err)
{
    while (count > 0) {
        uint32_t n = count;
        if (n > PREP_PILE_MAX && n - PREP_PILE_MAX >= s->shape->add_threshold) n = PREP_PILE_MAX;
        if (!emit(s, corner, level, n < count ? 1 : 0, 0, keys, n, err)) return false;
        keys += n, count -= n, level++;
    }
    return true;
}

static uint32_t octant_of(uint64_t code, uint32_t shift)
{
    return (uint32_t)(code >> shift) & (OCTANTS - 1);
}

/* Splits the keys of a node: those that it keeps go to `kept`, the others stay in front of `keys`;
 * both in their order. Which octants reject is decided here. rejected  out, [OCTANTS] */
static uint32_t split(const solver *s, mospt_linear_key *keys, uint32_t count, uint32_t cell_shift,
                      uint32_t octant_shift, mospt_linear_key *kept, uint32_t rejected[OCTANTS])
{
    uint32_t kept_count = 0, left = 0;
    for (int o = 0; o < OCTANTS; o++)
        rejected[o] = 0;
    for (uint32_t i = 1; i < count; i++)
        if (keys[i].code >> cell_shift == keys[i - 1].code >> cell_shift)
            rejected[octant_of(keys[i].code, octant_shift)]++;
    for (int o = 0; o < OCTANTS; o++)
        if (rejected[o] < s->shape->add_threshold) rejected[o] = 0;

    for (uint32_t a = 0, b; a < count; a = b) {
        uint64_t cell = keys[a].code >> cell_shift;
        uint32_t first = a;
        for (b = a + 1; b < count && keys[b].code >> cell_shift == cell; b++)
            if (keys[b].index < keys[first].index) first = b;
        bool rejects = rejected[octant_of(keys[a].code, octant_shift)] > 0;
        mospt_linear_key accepted = keys[first];
        for (uint32_t i = a; rejects && i < b; i++)
            if (i != first) keys[left++] = keys[i];
        if (rejects) {
            kept[kept_count++] = accepted;
        } else {
            memcpy(kept + kept_count, keys + a, (b - a) * sizeof *keys);
            kept_count += b - a;
        }
    }
    return kept_count;
}

/* base     level at which the codes of `keys` begin */
static bool solve_node(solver *s, const uint32_t corner[3], uint32_t level, uint32_t base,
                       mospt_linear_key *keys, uint32_t count, mospt_err *err)
{
    uint32_t depth = s->shape->inner_depth, rejected[OCTANTS];
    mospt_linear_key *spare = s->spare + (keys - s->keys);

    if (mospt_cell_bits(s->shape->grid, level) == 0) {
        /* In the order of arrival, which is that of the indices. */
        for (uint32_t i = 0; i < count; i++)
            keys[i].code = keys[i].index;
        prep_sort_keys(keys, spare, count);
        for (uint32_t i = 0; i < count; i++)
            keys[i].code = 0;
        return solve_pile(s, corner, level, keys, count, err);
    }
    if (level - base + depth > MOSPT_CODE_LEVELS) {
        base = level;
        sort_below(s, level, keys, count);
    }
    uint32_t cell_shift = 3 * (MOSPT_CODE_LEVELS - (level - base) - depth);
    uint32_t octant_shift = 3 * (MOSPT_CODE_LEVELS - (level - base) - 1);
    uint32_t kept = split(s, keys, count, cell_shift, octant_shift, spare, rejected);
    uint8_t child_mask = 0;
    for (int o = 0; o < OCTANTS; o++)
        if (rejected[o] > 0) child_mask |= (uint8_t)(1u << o);
    if (!emit(s, corner, level, child_mask, cell_shift, spare, kept, err)) return false;
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
                const uint8_t *records, uint32_t count, prep_subtree *out, mospt_err *err)
{
    solver s;
    bool ok = solver_init(&s, shape, records, count, err);
    if (ok) {
        sort_below(&s, level, s.keys, count);
        ok = solve_node(&s, corner, level, level, s.keys, count, err);
    }
    if (ok) *out = s.made, s.made = (prep_subtree){0};
    solver_fini(&s);
    return ok;
}

bool prep_solve_node(const prep_shape *shape, const uint32_t corner[3], uint32_t level,
                     uint8_t child_mask, const uint8_t *records, uint32_t count, prep_subtree *out,
                     mospt_err *err)
{
    solver s;
    bool ok = solver_init(&s, shape, records, count, err);
    if (ok) {
        sort_below(&s, level, s.keys, count);
        ok = emit(&s, corner, level, child_mask, 3 * (MOSPT_CODE_LEVELS - shape->inner_depth),
                  s.keys, count, err);
    }
    if (ok) *out = s.made, s.made = (prep_subtree){0};
    solver_fini(&s);
    return ok;
}
