#include "preprocess/solve.h"

#include "mospt/wide.h"
#include "preprocess/sort.h"

#include <stdlib.h>

enum {
    OCTANTS = 8,
    PIECES_MAX = OCTANTS * OCTANTS,
    SHARED_MIN = 1 << 19, /* points that all threads divide together */
    RUN_BITS = 8,
    RUN = 1 << RUN_BITS, /* points that are divided at a time */
};

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

/* What becomes of a part, piece by piece: an octant, or a cell below it. */
typedef struct {
    const solver *s;
    const part *p;
    uint32_t cell_shift, piece_shift; /* in its keys */
    uint32_t pieces, pieces_per_octant;
    uint32_t begin[PIECES_MAX + 1]; /* in the keys of the part */
    uint32_t taken[PIECES_MAX];     /* points that find their finest cell taken */
    uint32_t kept_at[PIECES_MAX], rest_at[PIECES_MAX]; /* where its points go in the room */
    uint32_t kept;                                     /* points that the node keeps */
    uint32_t rejected[OCTANTS];                        /* 0: the octant is added */
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
    prep_sort_begin(&s->sorter, count);
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
    made->nodes[made->node_count++] =
        (prep_solved){.keys = keys,
                      .first = p->first,
                      .cell_shift = cell_shift,
                      .node = {.corner = {p->corner[0], p->corner[1], p->corner[2]},
                               .level = (uint16_t)p->level,
                               .child_mask = child_mask,
                               .count = count,
                               .payload_size = mospt_payload_size(s->shape->schema, count)}};
    return true;
}

/* Points whose records fit `size` bytes, but no more than `most`. */
static uint32_t points_in(size_t size, size_t record_size, uint32_t most)
{
    size_t fit = size / record_size;
    return fit < most ? (uint32_t)fit : most;
}

uint32_t prep_add_threshold(size_t record_size)
{
    return points_in(PREP_ADD_SIZE, record_size, PREP_ADD_THRESHOLD);
}

uint32_t prep_pile_points(size_t record_size)
{
    return points_in(PREP_PILE_SIZE, record_size, PREP_PILE_MAX);
}

/* All points at one position: as many of them as a node may have, in the order in which they
 * arrived, then a child with the next, and so on. */
static bool solve_pile(const solver *s, part p, prep_subtree *made, mospt_err *err)
{
    uint64_t *keys = keys_of(s, &p);
    uint32_t most = prep_pile_points(mospt_record_size(s->shape->schema));
    for (uint32_t i = 0; i < p.count; i++)
        keys[i] = (uint64_t)index_of(s, keys[i]);
    prep_sort_keys(keys, room_of(s, &p), p.count, 0);
    while (p.count > 0) {
        uint32_t n = p.count;
        if (n > most && n - most >= s->shape->add_threshold) n = most;
        if (!keep(s, &p, n < p.count ? 1 : 0, s->sorter.index_bits, keys_of(s, &p), n, made, err))
            return false;
        p.first += n, p.count -= n, p.level++;
    }
    return true;
}

/* How many of the keys come before the piece. */
static uint32_t count_before(const division *d, uint32_t piece)
{
    const uint64_t *keys = keys_of(d->s, d->p);
    uint32_t low = 0, high = d->p->count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if ((keys[middle] >> d->piece_shift & (d->pieces - 1)) < piece) low = middle + 1;
        else high = middle;
    }
    return low;
}

/* Points that find their finest cell taken. */
MOSPT_WIDE static uint32_t count_rejected(const uint64_t *keys, uint32_t count, uint32_t cell_shift)
{
    uint64_t sum = 0;
    for (uint32_t i = 1; i < count; i++)
        sum += keys[i] >> cell_shift == keys[i - 1] >> cell_shift;
    return (uint32_t)sum;
}

/* Where keys go. */
typedef struct {
    uint64_t *kept, *rejected;
} exits;

/* The points of one cell: the first that arrived is kept, and the others are rejected, in their
 * order. */
static void reject_cell(const uint64_t *keys, uint32_t count, uint64_t index_mask, exits *to)
{
    uint32_t first = 0;
    for (uint32_t i = 1; i < count; i++)
        if ((keys[i] & index_mask) < (keys[first] & index_mask)) first = i;
    *to->kept++ = keys[first];
    memcpy(to->rejected, keys, first * sizeof *keys);
    memcpy(to->rejected + first, keys + first + 1, (count - 1 - first) * sizeof *keys);
    to->rejected += count - 1;
}

/* What is told of each key without looking at others than the one before it. */
typedef struct {
    uint64_t begins[RUN]; /* all bits: it is the first of its cell; else none */
    uint64_t rival[RUN];  /* its index, above where it is */
} signs;

MOSPT_WIDE static void read_signs(const uint64_t *restrict keys, uint32_t count,
                                  uint32_t cell_shift, uint64_t index_mask, signs *restrict out)
{
    for (uint32_t i = 0; i < count; i++)
        out->rival[i] = (keys[i] & index_mask) << RUN_BITS | i;
    out->begins[0] = 0;
    for (uint32_t i = 1; i < count; i++)
        out->begins[i] = keys[i] >> cell_shift != keys[i - 1] >> cell_shift ? UINT64_MAX : 0;
}

/* The same for whole cells with `count` points, at most RUN. Cells have a few points each: how
 * many, and which of them came first, no processor can foretell, so none of that is a branch. */
static void reject_run(const uint64_t *keys, uint32_t count, uint32_t cell_shift,
                       uint64_t index_mask, exits *to)
{
    signs of;
    uint64_t first[RUN], rejected[RUN + 1], earliest = UINT64_MAX;
    bool is_kept[RUN] = {false};
    uint32_t cell = 0, n = 0;
    read_signs(keys, count, cell_shift, index_mask, &of);
    for (uint32_t i = 0; i < count; i++) {
        earliest |= of.begins[i];
        earliest = of.rival[i] < earliest ? of.rival[i] : earliest;
        cell -= (uint32_t)of.begins[i];
        first[cell] = earliest;
    }
    for (uint32_t c = 0; c <= cell; c++) {
        uint32_t i = (uint32_t)first[c] & (RUN - 1);
        is_kept[i] = true;
        to->kept[c] = keys[i];
    }
    for (uint32_t i = 0; i < count; i++) {
        rejected[n] = keys[i];
        n += !is_kept[i];
    }
    memcpy(to->rejected, rejected, n * sizeof *rejected);
    to->kept += cell + 1;
    to->rejected += n;
}

/* How many of the first keys are whole cells, at most RUN; 0: the first cell has more points. */
static uint32_t run_of_cells(const uint64_t *keys, uint32_t count, uint32_t cell_shift)
{
    if (count <= RUN) return count;
    uint32_t end = RUN;
    while (end > 0 && (keys[end] ^ keys[end - 1]) >> cell_shift == 0)
        end--;
    return end;
}

/* Sends the first point that arrived in each cell to `kept`, and the others, in their order, to
 * `rejected`. */
static void reject(const solver *s, const uint64_t *keys, uint32_t count, uint32_t cell_shift,
                   exits to)
{
    uint64_t index_mask = (UINT64_C(1) << s->sorter.index_bits) - 1;
    for (uint32_t i = 0, n; i < count; i += n) {
        n = run_of_cells(keys + i, count - i, cell_shift);
        if (n > 0) {
            reject_run(keys + i, n, cell_shift, index_mask, &to);
            continue;
        }
        for (n = RUN; i + n < count && (keys[i + n] ^ keys[i]) >> cell_shift == 0;)
            n++;
        reject_cell(keys + i, n, index_mask, &to);
    }
}

/* levels   below the part at which its pieces are cells */
static void begin_division(const solver *s, const part *p, uint32_t levels, division *d)
{
    uint32_t left = s->sorter.code_levels - (p->level - p->base), index_bits = s->sorter.index_bits;
    *d = (division){.s = s,
                    .p = p,
                    .cell_shift = index_bits + 3 * (left - s->shape->inner_depth),
                    .piece_shift = index_bits + 3 * (left - levels),
                    .pieces = 1u << 3 * levels,
                    .pieces_per_octant = 1u << 3 * (levels - 1)};
    for (uint32_t i = 0; i <= d->pieces; i++)
        d->begin[i] = i < d->pieces ? count_before(d, i) : p->count;
}

static uint32_t octant_size(const division *d, uint32_t octant)
{
    return d->begin[(octant + 1) * d->pieces_per_octant] - d->begin[octant * d->pieces_per_octant];
}

/* Job. */
static void count_piece(void *context, uint32_t piece)
{
    division *d = context;
    if (octant_size(d, piece / d->pieces_per_octant) < d->s->shape->add_threshold) return;
    d->taken[piece] = count_rejected(keys_of(d->s, d->p) + d->begin[piece],
                                     d->begin[piece + 1] - d->begin[piece], d->cell_shift);
}

/* Which octants reject; what each piece keeps then, and where all of it goes. */
static void place_pieces(division *d)
{
    uint32_t kept = 0, rest = 0;
    for (uint32_t i = 0; i < d->pieces; i++)
        d->rejected[i / d->pieces_per_octant] += d->taken[i];
    for (uint32_t o = 0; o < OCTANTS; o++)
        if (d->rejected[o] < d->s->shape->add_threshold) d->rejected[o] = 0;
    for (uint32_t i = 0; i < d->pieces; i++) {
        uint32_t rejected = d->rejected[i / d->pieces_per_octant] > 0 ? d->taken[i] : 0;
        d->kept_at[i] = kept;
        d->rest_at[i] = rest;
        kept += d->begin[i + 1] - d->begin[i] - rejected;
        rest += rejected;
    }
    d->kept = kept;
}

/* Job. */
static void move_piece(void *context, uint32_t piece)
{
    division *d = context;
    const uint64_t *keys = keys_of(d->s, d->p) + d->begin[piece];
    uint64_t *room = room_of(d->s, d->p), *kept = room + d->kept_at[piece],
             *rest = room + d->kept + d->rest_at[piece];
    uint32_t count = d->begin[piece + 1] - d->begin[piece];
    if (d->rejected[piece / d->pieces_per_octant] > 0)
        reject(d->s, keys, count, d->cell_shift, (exits){kept, rest});
    else memcpy(kept, keys, count * sizeof *keys);
}

/* Makes the node of a part that is divided, and lists the parts below it.
 * below    out, [OCTANTS] */
static bool settle(const division *d, part *below, uint32_t *count, prep_subtree *made,
                   mospt_err *err)
{
    const part *p = d->p;
    uint8_t child_mask = 0;
    uint32_t first = p->first + d->kept;
    *count = 0;
    for (uint32_t o = 0; o < OCTANTS; o++) {
        if (d->rejected[o] == 0) continue;
        part *child = &below[(*count)++];
        child_mask |= (uint8_t)(1u << o);
        *child = (part){.level = p->level + 1,
                        .base = p->base,
                        .first = first,
                        .count = d->rejected[o],
                        .side = 1 - p->side};
        mospt_cell_child(d->s->shape->grid, p->corner, p->level, o, child->corner);
        first += d->rejected[o];
    }
    return keep(d->s, p, child_mask, d->cell_shift, room_of(d->s, p), d->kept, made, err);
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
    division d;
    begin_division(s, &p, 1, &d);
    for (uint32_t i = 0; i < d.pieces; i++)
        count_piece(&d, i);
    place_pieces(&d);
    for (uint32_t i = 0; i < d.pieces; i++)
        move_piece(&d, i);
    uint32_t count;
    bool ok = settle(&d, below, &count, made, err);
    for (uint32_t i = 0; ok && i < count; i++)
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
    prep_sort_all(&s.sorter, level, s.keys[0], s.keys[1], count);
    bool ok = solve_part(&s, whole(corner, level, count), &made, err);
    if (ok) *out = made;
    else prep_subtree_fini(&made);
    return ok;
}

/* A piece of a subtree: a part that is left for one thread, or a node that is made already. */
typedef struct {
    part p;
    prep_solved node; /* of no points: the part is left */
} piece;

struct prep_solving {
    solver s;
    part *large;   /* [large_count], owned: what all threads divide together */
    piece *pieces; /* [piece_count], owned */
    uint32_t large_count, piece_count;
};

static bool add_piece(prep_solving *o, piece new, mospt_err *err)
{
    piece *pieces = realloc(o->pieces, (o->piece_count + 1) * sizeof *pieces);
    if (pieces == NULL) return mospt_err_nomem(err, (o->piece_count + 1) * sizeof *pieces);
    o->pieces = pieces;
    pieces[o->piece_count++] = new;
    return true;
}

static bool add_part(prep_solving *o, const part *p, mospt_err *err)
{
    bool is_large = p->count >= SHARED_MIN && !is_pile(&o->s, p) && !ends_above(&o->s, p);
    if (!is_large) return add_piece(o, (piece){.p = *p}, err);
    part *large = realloc(o->large, (o->large_count + 1) * sizeof *large);
    if (large == NULL) return mospt_err_nomem(err, (o->large_count + 1) * sizeof *large);
    o->large = large;
    large[o->large_count++] = *p;
    return true;
}

static bool divide_large(prep_solving *o, prep_workers *workers, mospt_err *err)
{
    division d;
    part p = o->large[--o->large_count], below[OCTANTS];
    prep_subtree made = {0};
    uint32_t count;
    begin_division(&o->s, &p, o->s.shape->inner_depth > 1 ? 2 : 1, &d);
    prep_workers_run(workers, d.pieces, count_piece, &d);
    place_pieces(&d);
    prep_workers_run(workers, d.pieces, move_piece, &d);
    bool ok = settle(&d, below, &count, &made, err) &&
              add_piece(o, (piece){.p = p, .node = made.nodes[0]}, err);
    for (uint32_t i = 0; ok && i < count; i++)
        ok = add_part(o, &below[i], err);
    prep_subtree_fini(&made);
    return ok;
}

static int in_order(const void *a, const void *b)
{
    const piece *x = a, *y = b;
    return (x->p.first > y->p.first) - (x->p.first < y->p.first);
}

bool prep_solving_begin(const prep_shape *shape, prep_workers *workers, const uint32_t corner[3],
                        uint32_t level, const mospt_records *records, uint32_t count, void *work,
                        prep_solving **out, mospt_err *err)
{
    prep_solving *o = calloc(1, sizeof *o);
    if (o == NULL) return mospt_err_nomem(err, sizeof *o);
    solver_init(&o->s, shape, records, count, work);
    part p = whole(corner, level, count);
    bool ok = prep_sort_all_shared(&o->s.sorter, workers, level, o->s.keys[0], o->s.keys[1], count,
                                   err) &&
              add_part(o, &p, err);
    while (ok && o->large_count > 0)
        ok = divide_large(o, workers, err);
    if (ok) {
        qsort(o->pieces, o->piece_count, sizeof *o->pieces, in_order);
        *out = o;
    } else {
        prep_solving_end(o);
    }
    return ok;
}

uint32_t prep_solving_pieces(const prep_solving *o)
{
    return o->piece_count;
}

bool prep_solving_piece(const prep_solving *o, uint32_t index, prep_subtree *out, mospt_err *err)
{
    const piece *a = &o->pieces[index];
    prep_subtree made = {.index_bits = o->s.sorter.index_bits};
    bool ok = a->node.node.count > 0 ? reserve(&made, err) : solve_part(&o->s, a->p, &made, err);
    if (ok && a->node.node.count > 0) made.nodes[made.node_count++] = a->node;
    if (ok) *out = made;
    else prep_subtree_fini(&made);
    return ok;
}

void prep_solving_end(prep_solving *o)
{
    if (o == NULL) return;
    free(o->large), free(o->pieces);
    free(o);
}

bool prep_solve_node(const prep_shape *shape, const uint32_t corner[3], uint32_t level,
                     uint8_t child_mask, const mospt_records *records, uint32_t count, void *work,
                     prep_subtree *out, mospt_err *err)
{
    solver s;
    prep_subtree made = {0};
    solver_init(&s, shape, records, count, work);
    made.index_bits = s.sorter.index_bits;
    prep_sort_all(&s.sorter, level, s.keys[0], s.keys[1], count);
    part p = whole(corner, level, count);
    uint32_t cell_shift = made.index_bits + 3 * (s.sorter.code_levels - shape->inner_depth);
    if (!keep(&s, &p, child_mask, cell_shift, s.keys[0], count, &made, err)) return false;
    *out = made;
    return true;
}

/* Records that are fetched before their turn, since they stand anywhere. */
enum { AHEAD = 64 };

static size_t records_room(const prep_shape *shape, uint32_t count)
{
    return (count * mospt_record_size(shape->schema) + sizeof(uint64_t) - 1) / sizeof(uint64_t) *
           sizeof(uint64_t);
}

/* The payload and the records, which may end anywhere, the order, and what the linearisation needs.
 */
size_t prep_solve_emit_size(const prep_shape *shape, uint32_t count)
{
    return 2 * records_room(shape, count) + count * sizeof(uint32_t) +
           mospt_linear_work_size(count);
}

/* Copies the records of a node to one place, in the order of its keys, which then have their
 * indices there. It is the only time that they are fetched from all over the memory: what follows
 * finds them side by side. */
static void gather_records(const mospt_records *records, uint64_t *keys, uint32_t count,
                           uint32_t index_bits, uint8_t *to)
{
    uint64_t index_mask = (UINT64_C(1) << index_bits) - 1;
    for (uint32_t i = 0; i < count; i++, to += records->stride) {
        if (i + AHEAD < count) {
            const uint8_t *later =
                mospt_records_at(records, mospt_linear_index(keys[i + AHEAD], index_bits));
            __builtin_prefetch(later);
            __builtin_prefetch(later + records->stride - 1);
        }
        mospt_record_copy(to, mospt_records_at(records, mospt_linear_index(keys[i], index_bits)),
                          records->stride);
        keys[i] = (keys[i] & ~index_mask) | i;
    }
}

uint64_t prep_solve_emit(const prep_shape *shape, const mospt_records *records,
                         prep_subtree *subtree, uint32_t n, void *memory)
{
    prep_solved *solved = &subtree->nodes[n];
    mospt_node *node = &solved->node;
    uint32_t count = node->count;
    uint8_t *payload = memory;
    const uint8_t *gathered = payload + records_room(shape, count);
    uint32_t *order = (uint32_t *)(payload + 2 * records_room(shape, count));
    mospt_records own = {
        .blocks = &gathered, .stride = records->stride, .shift = MOSPT_RECORDS_ONE_BLOCK};
    mospt_linear_input input = {.records = &own,
                                .depth = shape->inner_depth,
                                .index_bits = subtree->index_bits,
                                .cell_shift = solved->cell_shift};
    gather_records(records, solved->keys, count, subtree->index_bits,
                   payload + records_room(shape, count));
    mospt_linear_build(&input, solved->keys, count, order + count, order, node->level_end);
    return mospt_payload_pack(shape->schema, &own, order, count, payload, node);
}
