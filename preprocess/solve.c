#include "preprocess/solve.h"

#include "preprocess/sort.h"

#include <stdlib.h>

enum { OCTANTS = 8 };

/* Keys go back and forth between two arrays: what a node keeps stays where it was put, and what it
 * rejects, octant by octant behind it, goes on in the other array. So all that belongs to a subtree
 * has the same place in both, whoever solves it. */
typedef struct {
    const prep_shape *shape;
    prep_sorter sorter;
    uint64_t *keys[2]; /* [count] */
} solver;

/* The points of a subtree that is to be solved. */
typedef struct {
    uint32_t corner[3], level;
    uint32_t base;         /* level at which the codes of the keys begin */
    uint32_t first, count; /* of the keys */
    uint32_t side;         /* which array they are in, sorted */
} part;

/* What becomes of a part. */
typedef struct {
    uint32_t cell_shift, octant_shift; /* in its keys */
    uint32_t kept;                     /* points that its node keeps */
    uint32_t rejected[OCTANTS];        /* 0: the octant is added */
} division;

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
    *s = (solver){.shape = shape, .keys = {work, (uint64_t *)work + count}};
    s->sorter = (prep_sorter){.grid = shape->grid, .records = records};
    prep_sort_begin(&s->sorter, s->keys[0], count);
}

static uint64_t *keys_of(const solver *s, const part *p)
{
    return s->keys[p->side] + p->first;
}

/* Where what becomes of them goes. */
static uint64_t *room_of(const solver *s, const part *p)
{
    return s->keys[1 - p->side] + p->first;
}

static uint32_t index_of(const solver *s, uint64_t key)
{
    return mospt_linear_index(key, s->sorter.index_bits);
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

/* Makes a node of a part, or of the first `count` of its points.
 * keys     of these */
static bool keep(const solver *s, const part *p, uint8_t child_mask, uint32_t cell_shift,
                 uint64_t *keys, uint32_t count, prep_subtree *made, mospt_err *err)
{
    if (p->level > UINT16_MAX)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "more than %d levels: too many points at one position", UINT16_MAX);
    if (!reserve(made, err)) return false;
    made->nodes[made->node_count++] = (prep_solved){
        .keys = keys,
        .first = p->first,
        .cell_shift = cell_shift,
        .node = {.corner = {p->corner[0], p->corner[1], p->corner[2]},
                 .level = (uint16_t)p->level,
                 .child_mask = child_mask,
                 .count = count,
                 .payload_size = (uint64_t)count * mospt_record_size(s->shape->schema)}};
    return true;
}

/* All points at one position: the first PREP_PILE_MAX of them that arrived, then a child with the
 * next, and so on. */
static bool solve_pile(const solver *s, part p, prep_subtree *made, mospt_err *err)
{
    uint64_t *keys = keys_of(s, &p);
    for (uint32_t i = 0; i < p.count; i++)
        keys[i] = (uint64_t)index_of(s, keys[i]);
    prep_sort_keys(keys, room_of(s, &p), p.count, 0);
    while (p.count > 0) {
        uint32_t n = p.count;
        if (n > PREP_PILE_MAX && n - PREP_PILE_MAX >= s->shape->add_threshold) n = PREP_PILE_MAX;
        if (!keep(s, &p, n < p.count ? 1 : 0, s->sorter.index_bits, keys_of(s, &p), n, made, err))
            return false;
        p.first += n, p.count -= n, p.level++;
    }
    return true;
}

/* Where the keys end that are alike above `shift` to the first one. */
static uint32_t run_end(const uint64_t *keys, uint32_t count, uint32_t shift)
{
    uint32_t low = 1, high = count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (keys[middle] >> shift == keys[0] >> shift) low = middle + 1;
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
 * `rejected`. Returns how many are kept. */
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

static uint32_t octant_of(const division *d, uint64_t key)
{
    return (uint32_t)(key >> d->octant_shift) & (OCTANTS - 1);
}

static division begin_division(const solver *s, const part *p)
{
    uint32_t left = s->sorter.code_levels - (p->level - p->base);
    return (division){.cell_shift = s->sorter.index_bits + 3 * (left - s->shape->inner_depth),
                      .octant_shift = s->sorter.index_bits + 3 * (left - 1)};
}

/* Which octants reject, and how much. */
static void decide(const solver *s, const part *p, division *d)
{
    const uint64_t *keys = keys_of(s, p);
    d->kept = p->count;
    for (uint32_t a = 0, n; a < p->count; a += n) {
        n = run_end(keys + a, p->count - a, d->octant_shift);
        uint32_t more =
            n < s->shape->add_threshold ? 0 : count_rejected(keys + a, n, d->cell_shift);
        if (more < s->shape->add_threshold) continue;
        d->rejected[octant_of(d, keys[a])] = more;
        d->kept -= more;
    }
}

/* Moves the keys to where they go. */
static void divide(const solver *s, const part *p, const division *d)
{
    const uint64_t *keys = keys_of(s, p);
    uint64_t *kept = room_of(s, p), *rejected = kept + d->kept;
    for (uint32_t a = 0, n; a < p->count; a += n) {
        uint32_t more = d->rejected[octant_of(d, keys[a])];
        n = run_end(keys + a, p->count - a, d->octant_shift);
        if (more > 0) reject(s, keys + a, n, d->cell_shift, kept, rejected);
        else memcpy(kept, keys + a, n * sizeof *keys);
        kept += n - more, rejected += more;
    }
}

/* Makes the node of a part that is divided, and lists the parts below it.
 * below    out, [OCTANTS]
 * returns  how many there are; UINT32_MAX: failed */
static uint32_t settle(const solver *s, const part *p, const division *d, part *below,
                       prep_subtree *made, mospt_err *err)
{
    uint8_t child_mask = 0;
    uint32_t count = 0, first = p->first + d->kept;
    for (uint32_t o = 0; o < OCTANTS; o++) {
        if (d->rejected[o] == 0) continue;
        child_mask |= (uint8_t)(1u << o);
        below[count] = *p;
        mospt_cell_child(s->shape->grid, p->corner, p->level, o, below[count].corner);
        below[count].level++;
        below[count].first = first;
        below[count].count = d->rejected[o];
        below[count++].side = 1 - p->side;
        first += d->rejected[o];
    }
    if (!keep(s, p, child_mask, d->cell_shift, room_of(s, p), d->kept, made, err))
        return UINT32_MAX;
    return count;
}

static bool is_pile(const solver *s, const part *p)
{
    return mospt_cell_bits(s->shape->grid, p->level) == 0;
}

/* True if the codes of a part do not go down to its finest cells. */
static bool ends_above(const solver *s, const part *p)
{
    return p->level - p->base + s->shape->inner_depth > s->sorter.code_levels;
}

static bool solve_part(const solver *s, part p, prep_subtree *made, mospt_err *err)
{
    part below[OCTANTS];
    if (is_pile(s, &p)) return solve_pile(s, p, made, err);
    if (ends_above(s, &p)) {
        p.base = p.level;
        prep_sort_below(&s->sorter, p.level, keys_of(s, &p), room_of(s, &p), p.count);
    }
    division d = begin_division(s, &p);
    decide(s, &p, &d);
    divide(s, &p, &d);
    uint32_t n = settle(s, &p, &d, below, made, err);
    bool ok = n != UINT32_MAX;
    for (uint32_t i = 0; ok && i < n; i++)
        ok = solve_part(s, below[i], made, err);
    return ok;
}

static part whole(const uint32_t corner[3], uint32_t level, uint32_t count)
{
    return (part){
        .corner = {corner[0], corner[1], corner[2]}, .level = level, .base = level, .count = count};
}

bool prep_solve(const prep_shape *shape, const uint32_t corner[3], uint32_t level,
                const mospt_records *records, uint32_t count, void *work, prep_subtree *out,
                mospt_err *err)
{
    solver s;
    prep_subtree made = {0};
    solver_init(&s, shape, records, count, work);
    made.index_bits = s.sorter.index_bits;
    prep_sort_below(&s.sorter, level, s.keys[0], s.keys[1], count);
    bool ok = solve_part(&s, whole(corner, level, count), &made, err);
    if (ok) *out = made;
    else prep_subtree_fini(&made);
    return ok;
}

bool prep_solve_node(const prep_shape *shape, const uint32_t corner[3], uint32_t level,
                     uint8_t child_mask, const mospt_records *records, uint32_t count, void *work,
                     prep_subtree *out, mospt_err *err)
{
    solver s;
    prep_subtree made = {0};
    solver_init(&s, shape, records, count, work);
    made.index_bits = s.sorter.index_bits;
    prep_sort_below(&s.sorter, level, s.keys[0], s.keys[1], count);
    part p = whole(corner, level, count);
    division d = begin_division(&s, &p);
    if (!keep(&s, &p, child_mask, d.cell_shift, s.keys[0], count, &made, err)) return false;
    *out = made;
    return true;
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
    mospt_linear_build(&input, solved->keys, count, order + count, order, node->level_end);
    mospt_payload_pack(shape->schema, records, order, count, payload, node);
    return mospt_payload_points_hash(shape->schema, payload, payload + count * sizeof(mospt_vertex),
                                     count);
}
