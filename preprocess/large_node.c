#include "preprocess/large_node.h"

#include "mospt/deal.h"

#include <stdlib.h>

enum {
    OCTANTS = 8,
    BELOW_CUT = 5,         /* levels, at most: a cell at the cut has 8^5 finest cells */
    CUT_MAX = 3,           /* levels above it: there are no more cells than a pass has octants */
    CELL_SIZE = 4 << 20,   /* bytes of a cell with a point in each of its finest cells, */
    SPOOLS_SIZE = 8 << 20, /* where the blocks of all cells take no more than that */
    ALIGNMENT = 64,
};

/* A cell at the cut. */
typedef struct {
    prep_spool spool;
    uint32_t corner[3];
    uint32_t level_end[MOSPT_LEVELS_MAX]; /* of its own MOSPT */
    uint32_t colour;                      /* of the point that stands for it */
    uint8_t depth;                        /* of the node's inner octree at which that stands */
} cell;

typedef struct {
    const prep_pass_env *env;
    const prep_finish_part *part;
    prep_shape shape; /* of the cells */
    uint32_t cut;     /* levels of the inner octree above it */
    uint32_t cell_count;
    cell *cells; /* [cell_count], owned, in Morton order */
    mospt_node node;
    uint32_t dealt[MOSPT_LEVELS_MAX]; /* points of each level of the node that are written */
    uint64_t points_hash;
} large;

static void cell_corner(const large *l, uint32_t code, uint32_t out[3])
{
    memcpy(out, l->part->corner, 3 * sizeof *out);
    for (uint32_t j = 0; j < l->cut; j++)
        mospt_cell_child(l->env->shape->grid, out, l->part->level + j,
                         code >> 3 * (l->cut - 1 - j) & (OCTANTS - 1), out);
}

/* Sends the points of a spool to their cells. */
static bool divide_spool(large *l, prep_spool *spool, uint8_t *block, mospt_err *err)
{
    prep_store *store = l->env->store;
    size_t stride = mospt_record_size(l->env->shape->schema);
    uint32_t bits = mospt_cell_bits(l->env->shape->grid, l->part->level), n;
    for (uint32_t b = 0; b < spool->block_count; b++) {
        if (!prep_spool_take_block(store, spool, b, block, &n, err)) return false;
        for (uint32_t i = 0; i < n; i++) {
            mospt_vertex v = mospt_vertex_of(block + i * stride);
            uint32_t code = (uint32_t)mospt_cell_code(v.x, v.y, v.z, bits, l->cut);
            if (!prep_spool_append(store, &l->cells[code].spool, block + i * stride, stride, err))
                return false;
        }
    }
    prep_spool_drop(store, spool);
    return true;
}

static bool divide(large *l, mospt_err *err)
{
    uint8_t *block = malloc(prep_store_block_size(l->env->store));
    bool ok = block != NULL || mospt_err_nomem(err, prep_store_block_size(l->env->store));
    for (uint32_t s = 0; ok && s < l->part->spool_count; s++) {
        l->node.count += (uint32_t)l->part->spools[s]->count;
        ok = divide_spool(l, l->part->spools[s], block, err);
    }
    for (uint32_t c = 0; ok && c < l->cell_count; c++)
        ok = prep_spool_seal(l->env->store, &l->cells[c].spool, err);
    free(block);
    return ok;
}

/* What is done with the payload of a cell. */
typedef bool (*use_payload)(large *l, cell *c, const uint8_t *payload, uint64_t points_hash,
                            mospt_err *err);

static size_t aligned(size_t size)
{
    return (size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
}

/* Makes the MOSPT of one cell.
 * memory   for solving, the blocks that are on the disk, and the payload */
static bool make_cell(large *l, cell *c, uint8_t *memory, use_payload use, mospt_err *err)
{
    const prep_pass_env *env = l->env;
    uint32_t count = (uint32_t)c->spool.count;
    const uint8_t **blocks = malloc(c->spool.block_count * sizeof *blocks);
    uint8_t *records = memory + aligned(prep_solve_work_size(count)),
            *payload = records + aligned(prep_spool_size_on_disk(env->store, &c->spool));
    mospt_records view = {.blocks = blocks,
                          .stride = mospt_record_size(l->shape.schema),
                          .shift = prep_store_block_shift(env->store)};
    prep_subtree made = {0};
    if (blocks == NULL) return mospt_err_nomem(err, c->spool.block_count * sizeof *blocks);
    bool ok = prep_spool_view(env->store, &c->spool, records, blocks, err) &&
              prep_solve_node(&l->shape, c->corner, l->part->level + l->cut, 0, &view, count,
                              memory, &made, err);
    if (ok) {
        uint64_t hash = prep_solve_emit(&l->shape, &view, &made, 0, payload);
        memcpy(c->level_end, made.nodes[0].node.level_end, sizeof c->level_end);
        ok = use(l, c, payload, hash, err);
    }
    prep_subtree_fini(&made);
    free(blocks);
    return ok;
}

static size_t make_cell_size(const large *l, const cell *c)
{
    uint32_t count = (uint32_t)c->spool.count;
    return aligned(prep_solve_work_size(count)) +
           aligned(prep_spool_size_on_disk(l->env->store, &c->spool)) +
           prep_solve_emit_size(&l->shape, count);
}

static bool make_all(large *l, use_payload use, mospt_err *err)
{
    size_t size = 0;
    for (uint32_t c = 0; c < l->cell_count; c++)
        if (make_cell_size(l, &l->cells[c]) > size) size = make_cell_size(l, &l->cells[c]);
    uint8_t *memory = prep_arena_take(l->env->arena, size);
    bool of_arena = memory != NULL, ok = true;
    /* Attributes by the kilobyte: better too much memory than none. */
    if (!of_arena && (memory = malloc(size)) == NULL) return mospt_err_nomem(err, size);
    for (uint32_t c = 0; ok && c < l->cell_count; c++)
        if (l->cells[c].spool.count > 0) ok = make_cell(l, &l->cells[c], memory, use, err);
    if (of_arena) prep_arena_give(l->env->arena, memory);
    else free(memory);
    return ok;
}

static bool note_cell(large *l, cell *c, const uint8_t *payload, uint64_t points_hash,
                      mospt_err *err)
{
    mospt_vertex first;
    (void)err;
    memcpy(&first, payload, sizeof first);
    c->colour = mospt_linear_colour(&first);
    c->depth = (uint8_t)l->cut;
    l->points_hash += points_hash;
    return true;
}

/* Of the cells that share one at `depth`, the point of one stands for it. Returns how many cells
 * are left standing.
 * standing  [count] numbers of cells */
static uint32_t rise(large *l, uint32_t *standing, uint32_t count, uint32_t depth)
{
    uint32_t shift = 3 * (l->cut - depth), out = 0;
    for (uint32_t a = 0, b; a < count; a = b) {
        uint32_t colours[OCTANTS];
        for (b = a; b < count && standing[b] >> shift == standing[a] >> shift; b++)
            colours[b - a] = l->cells[standing[b]].colour;
        uint32_t chosen = standing[a + mospt_linear_choose(colours, b - a)];
        l->cells[chosen].depth = (uint8_t)depth;
        standing[out++] = chosen;
    }
    return out;
}

static bool sum_up(large *l, mospt_err *err)
{
    uint32_t count = 0, *standing = malloc(l->cell_count * sizeof *standing);
    if (standing == NULL) return mospt_err_nomem(err, l->cell_count * sizeof *standing);
    for (uint32_t c = 0; c < l->cell_count; c++)
        if (l->cells[c].spool.count > 0) standing[count++] = c;
    for (uint32_t depth = l->cut; depth-- > 0;) {
        count = rise(l, standing, count, depth);
        l->node.level_end[depth] = count;
    }
    free(standing);
    /* From the cut on, the levels of the node are those of the cells together. */
    for (uint32_t c = 0; c < l->cell_count; c++)
        for (uint32_t i = 0; l->cells[c].spool.count > 0 && i < l->shape.inner_depth + 2; i++)
            l->node.level_end[l->cut + i] += l->cells[c].level_end[i];
    return true;
}

/* Writes points [begin, end) of a cell to place `to` of the node, plane by plane. */
static bool write_run(large *l, const cell *c, const uint8_t *payload, uint32_t begin, uint32_t end,
                      uint32_t to, mospt_err *err)
{
    const mospt_schema *schema = l->env->shape->schema;
    size_t of_cell = c->spool.count, of_node = l->node.count;
    for (uint32_t k = 0; k <= schema->count; k++) {
        const mospt_attribute *a = k > 0 ? &schema->at[k - 1] : NULL;
        size_t size = a != NULL ? mospt_attribute_size(a) : sizeof(mospt_vertex),
               before = a != NULL ? sizeof(mospt_vertex) + a->stored_offset : 0;
        if (a != NULL && a->storage != MOSPT_IN_PLANE) continue;
        if (!mospt_writer_write_part(l->env->writer, &l->node, before * of_node + to * size,
                                     payload + before * of_cell + begin * size,
                                     (end - begin) * size, err))
            return false;
    }
    return true;
}

/* Place in the node of point k, in Morton order, of what a level adds. */
static uint32_t place_in_level(const large *l, uint32_t level, uint32_t k)
{
    uint32_t begin = level > 0 ? l->node.level_end[level - 1] : 0;
    mospt_deal deal = mospt_deal_of(l->node.level_end[level] - begin);
    return begin + mospt_deal_place(&deal, k);
}

/* Writes what level i of a cell adds. The Morton order of the node's level is that of the cells,
 * one after the other, so that a hand of the cell goes to one hand of the node, in one piece. */
static bool write_level(large *l, const cell *c, const uint8_t *payload, uint32_t i, mospt_err *err)
{
    uint32_t begin = c->level_end[i - 1], count = c->level_end[i] - begin, level = l->cut + i;
    mospt_deal deal = mospt_deal_of(count);
    for (uint32_t h = 0; h < MOSPT_HANDS && h < count; h++) {
        uint32_t from = begin + deal.begin[h], size = (count - h - 1) / MOSPT_HANDS + 1,
                 to = place_in_level(l, level, l->dealt[level] + h);
        if (!write_run(l, c, payload, from, from + size, to, err)) return false;
    }
    l->dealt[level] += count;
    return true;
}

/* The point that stands for the cell goes to the level where it does; what the other levels of the
 * cell add, to those of the node. */
static bool write_cell(large *l, cell *c, const uint8_t *payload, uint64_t points_hash,
                       mospt_err *err)
{
    uint32_t to = place_in_level(l, c->depth, l->dealt[c->depth]++);
    (void)points_hash;
    if (!write_run(l, c, payload, 0, 1, to, err)) return false;
    for (uint32_t i = 1; i < l->shape.inner_depth + 2; i++)
        if (!write_level(l, c, payload, i, err)) return false;
    return true;
}

static bool make_node(large *l, mospt_err *err)
{
    uint32_t index;
    l->node = (mospt_node){
        .level = (uint16_t)l->part->level,
        .child_mask = l->part->child_mask,
        .corner = {l->part->corner[0], l->part->corner[1], l->part->corner[2]},
    };
    if (!divide(l, err) || !make_all(l, note_cell, err) || !sum_up(l, err)) return false;
    l->node.payload_size = mospt_payload_size(l->env->shape->schema, l->node.count);
    if (!mospt_writer_place(l->env->writer, &l->node, &index, err) ||
        !make_all(l, write_cell, err) || !mospt_writer_hash(l->env->writer, &l->node, err))
        return false;
    mospt_writer_complete(l->env->writer, index, &l->node, l->points_hash);
    return l->env->report(l->env->report_context) ||
           mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
}

/* As few cells as may be, of which one is little beside the memory that there is. */
static uint32_t choose_cut(const prep_pass_env *env)
{
    uint32_t depth = env->shape->inner_depth, cut = depth > BELOW_CUT ? depth - BELOW_CUT : 1;
    size_t record_size = mospt_record_size(env->shape->schema),
           block_size = prep_store_block_size(env->store);
    if (cut > CUT_MAX) cut = CUT_MAX;
    while (cut < CUT_MAX && cut + MOSPT_DEPTH_MIN < depth &&
           record_size << 3 * (depth - cut) > CELL_SIZE &&
           block_size << 3 * (cut + 1) <= SPOOLS_SIZE)
        cut++;
    return cut;
}

bool prep_large_node(const prep_pass_env *env, const prep_finish_part *part, mospt_err *err)
{
    large l = {.env = env, .part = part, .shape = *env->shape, .cut = choose_cut(env)};
    l.shape.inner_depth = env->shape->inner_depth - l.cut;
    l.cell_count = 1u << 3 * l.cut;
    l.cells = calloc(l.cell_count, sizeof *l.cells);
    if (l.cells == NULL) return mospt_err_nomem(err, l.cell_count * sizeof *l.cells);
    for (uint32_t c = 0; c < l.cell_count; c++)
        cell_corner(&l, c, l.cells[c].corner);
    bool ok = make_node(&l, err);
    for (uint32_t c = 0; c < l.cell_count; c++)
        prep_spool_drop(env->store, &l.cells[c].spool);
    free(l.cells);
    return ok;
}
