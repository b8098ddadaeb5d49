#include "preprocess/pass.h"

#include "preprocess/finish.h"

#include <stdlib.h>

enum { OCTANTS = 8, SLICE = 8192 };

/* An octant at the end of the pass: what was accepted in it level by level, and what goes below. */
typedef struct {
    uint8_t *cells; /* owned bit sets of its finest cells, one per level; NULL: untouched */
    prep_spool accepted[PREP_PASS_LEVELS_MAX];
    prep_spool rejected;
    mospt_err err;
} bucket;

struct prep_pass {
    const prep_pass_env *env;
    uint32_t corner[3], level;
    uint32_t levels; /* that this pass fills; 0: one position, a pile */
    uint32_t
        code_levels;   /* of the codes: from the node down to the finest cells of the last level */
    size_t cells_size; /* bytes of bit sets in a bucket */
    size_t cells_offset[PREP_PASS_LEVELS_MAX]; /* of each level in them, bytes */
    uint32_t bucket_count;
    bucket *buckets; /* [bucket_count], owned */
    prep_spool pile;

    /* The batch being inserted: */
    const uint8_t *records;
    uint32_t record_count;
    uint32_t *codes;    /* [batch_count], owned */
    uint32_t *order;    /* [batch_count], owned: the records of each bucket, in their order */
    uint32_t *slice_at; /* [slices][bucket_count], owned: counts, then places */
    uint32_t *begin;    /* [bucket_count + 1], owned: part of each bucket in order */
    uint32_t *touched;  /* [bucket_count], owned: buckets with records */
};

/* Bytes of the bit set for one level of one bucket: as many cells as the bucket has at that depth.
 */
static size_t level_cells_size(uint32_t levels, uint32_t level, uint32_t inner_depth)
{
    uint32_t cell_bits = 3 * (inner_depth - (levels - level));
    return cell_bits > 3 ? (size_t)1 << (cell_bits - 3) : 1;
}

size_t prep_pass_cells_size(uint32_t levels, uint32_t inner_depth)
{
    size_t sum = 0;
    for (uint32_t j = 0; j < levels; j++)
        sum += level_cells_size(levels, j, inner_depth) << 3 * levels;
    return sum;
}

static size_t stride_of(const prep_pass *p)
{
    return mospt_record_size(p->env->shape->schema);
}

bool prep_pass_begin(const prep_pass_env *env, const uint32_t corner[3], uint32_t level,
                     prep_pass **out, mospt_err *err)
{
    uint32_t cell_bits = mospt_cell_bits(env->shape->grid, level), depth = env->shape->inner_depth;
    prep_pass *p = calloc(1, sizeof *p);
    if (p == NULL) return mospt_err_nomem(err, sizeof *p);
    p->env = env;
    p->level = level;
    for (int a = 0; a < 3; a++)
        p->corner[a] = corner[a];
    /* No level below the resolution of the grid, and no octant smaller than a finest cell of the
     * first node. */
    p->levels = env->levels;
    if (p->levels > cell_bits) p->levels = cell_bits;
    if (p->levels > depth) p->levels = depth;
    while (p->levels > 1 && 3 * (p->levels + depth - 1) > 32)
        p->levels--; /* codes of a pass are 32 bits */
    p->code_levels = p->levels + depth - 1;
    p->bucket_count = 1u << 3 * p->levels;
    for (uint32_t j = 0; j < p->levels; j++) {
        p->cells_offset[j] = p->cells_size;
        p->cells_size += level_cells_size(p->levels, j, depth);
    }
    uint32_t slices = (env->batch_count + SLICE - 1) / SLICE;
    p->buckets = calloc(p->bucket_count, sizeof *p->buckets);
    p->codes = malloc(env->batch_count * sizeof *p->codes);
    p->order = malloc(env->batch_count * sizeof *p->order);
    p->slice_at = malloc((size_t)slices * p->bucket_count * sizeof *p->slice_at);
    p->begin = malloc((p->bucket_count + 1) * sizeof *p->begin);
    p->touched = malloc(p->bucket_count * sizeof *p->touched);
    if (p->buckets == NULL || p->codes == NULL || p->order == NULL || p->slice_at == NULL ||
        p->begin == NULL || p->touched == NULL) {
        prep_pass_abandon(p);
        return mospt_err_nomem(err, env->batch_count * 8 + p->bucket_count * sizeof *p->buckets);
    }
    *out = p;
    return true;
}

void prep_pass_abandon(prep_pass *p)
{
    if (p == NULL) return;
    for (uint32_t b = 0; p->buckets != NULL && b < p->bucket_count; b++) {
        free(p->buckets[b].cells);
        for (uint32_t j = 0; j < p->levels; j++)
            prep_spool_drop(p->env->store, &p->buckets[b].accepted[j]);
        prep_spool_drop(p->env->store, &p->buckets[b].rejected);
    }
    prep_spool_drop(p->env->store, &p->pile);
    free(p->buckets), free(p->codes), free(p->order), free(p->slice_at), free(p->begin),
        free(p->touched);
    free(p);
}

static uint32_t bucket_of(const prep_pass *p, uint32_t code)
{
    return code >> 3 * (p->code_levels - p->levels);
}

/* Job: codes of a slice of the batch, and how many of them fall into each bucket. */
static void count_slice(void *context, uint32_t slice)
{
    prep_pass *p = context;
    size_t stride = stride_of(p);
    uint32_t bits = mospt_cell_bits(p->env->shape->grid, p->level);
    uint32_t end = (slice + 1) * SLICE < p->record_count ? (slice + 1) * SLICE : p->record_count;
    uint32_t *count = p->slice_at + (size_t)slice * p->bucket_count;
    memset(count, 0, p->bucket_count * sizeof *count);
    for (uint32_t i = slice * SLICE; i < end; i++) {
        mospt_vertex v = mospt_vertex_of(p->records + i * stride);
        p->codes[i] = (uint32_t)mospt_cell_code(v.x, v.y, v.z, bits, p->code_levels);
        count[bucket_of(p, p->codes[i])]++;
    }
}

/* Job: puts a slice of the batch in the order of buckets. */
static void place_slice(void *context, uint32_t slice)
{
    prep_pass *p = context;
    uint32_t end = (slice + 1) * SLICE < p->record_count ? (slice + 1) * SLICE : p->record_count;
    uint32_t *at = p->slice_at + (size_t)slice * p->bucket_count;
    for (uint32_t i = slice * SLICE; i < end; i++)
        p->order[at[bucket_of(p, p->codes[i])]++] = i;
}

static bool take_cell(uint8_t *cells, uint32_t cell)
{
    uint8_t bit = (uint8_t)(1u << (cell & 7));
    if (cells[cell >> 3] & bit) return false;
    cells[cell >> 3] |= bit;
    return true;
}

/* Job: sends the records of one bucket to the levels that accept them, or to the rejection file. */
static void fill_bucket(void *context, uint32_t job)
{
    prep_pass *p = context;
    uint32_t b = p->touched[job], depth = p->env->shape->inner_depth;
    bucket *to = &p->buckets[b];
    size_t stride = stride_of(p);
    if (to->cells == NULL && (to->cells = calloc(1, p->cells_size)) == NULL) {
        mospt_err_nomem(&to->err, p->cells_size);
        return;
    }
    for (uint32_t i = p->begin[b]; i < p->begin[b + 1]; i++) {
        prep_spool *spool = &to->rejected;
        for (uint32_t j = 0; j < p->levels; j++) {
            /* The finest cell at level j is the code down to j + depth levels; of those, the bucket
             * is the first. */
            uint32_t cell = p->codes[p->order[i]] >> 3 * (p->levels - 1 - j);
            cell &= (uint32_t)((UINT64_C(1) << 3 * (depth + j - p->levels)) - 1);
            if (!take_cell(to->cells + p->cells_offset[j], cell)) continue;
            spool = &to->accepted[j];
            break;
        }
        if (!prep_spool_append(p->env->store, spool, p->records + p->order[i] * stride, &to->err))
            return;
    }
}

/* Sums the counts of all slices into the places where each slice puts its records. Returns the
 * buckets touched. */
static uint32_t share_out(prep_pass *p, uint32_t slices)
{
    uint32_t place = 0, touched = 0;
    for (uint32_t b = 0; b < p->bucket_count; b++) {
        p->begin[b] = place;
        for (uint32_t s = 0; s < slices; s++) {
            uint32_t *at = &p->slice_at[(size_t)s * p->bucket_count + b], n = *at;
            *at = place;
            place += n;
        }
        if (place > p->begin[b]) p->touched[touched++] = b;
    }
    p->begin[p->bucket_count] = place;
    return touched;
}

bool prep_pass_insert(prep_pass *p, const uint8_t *records, uint32_t count, mospt_err *err)
{
    prep_workers *workers = p->env->workers;
    uint32_t slices = (count + SLICE - 1) / SLICE;
    if (p->levels == 0) {
        for (uint32_t i = 0; i < count; i++)
            if (!prep_spool_append(p->env->store, &p->pile, records + i * stride_of(p), err))
                return false;
        return true;
    }
    p->records = records;
    p->record_count = count;
    prep_workers_run(workers, slices, count_slice, p);
    uint32_t touched = share_out(p, slices);
    prep_workers_run(workers, slices, place_slice, p);
    prep_workers_run(workers, touched, fill_bucket, p);
    for (uint32_t t = 0; t < touched; t++) {
        const bucket *b = &p->buckets[p->touched[t]];
        if (b->err.code == MOSPT_OK) continue;
        if (err != NULL) *err = b->err;
        return false;
    }
    return true;
}

/* Points at or below level `from` of the pass, in the buckets [begin, end). */
static uint64_t points_below(const prep_pass *p, uint32_t from, uint32_t begin, uint32_t end)
{
    uint64_t sum = 0;
    for (uint32_t b = begin; b < end; b++) {
        for (uint32_t j = from; j < p->levels && j < PREP_PASS_LEVELS_MAX; j++)
            sum += p->buckets[b].accepted[j].count;
        sum += p->buckets[b].rejected.count;
    }
    return sum;
}

static bool take_into(prep_pass *p, prep_spool *spool, uint8_t **to, mospt_err *err)
{
    size_t size = (size_t)spool->count * stride_of(p);
    if (!prep_spool_take(p->env->store, spool, *to, err)) return false;
    *to += size;
    return true;
}

/* Collects the points of the node at level `j` of the pass whose buckets are [begin, begin +
 * width): what was accepted there, and all that lies in octants without a child. */
static bool gather(prep_pass *p, uint32_t j, uint32_t begin, uint32_t width, uint8_t child_mask,
                   uint8_t *records, mospt_err *err)
{
    for (uint32_t b = begin; b < begin + width; b++) {
        uint32_t octant = (b - begin) / (width / OCTANTS);
        if (!take_into(p, &p->buckets[b].accepted[j], &records, err)) return false;
        if (child_mask >> octant & 1) continue;
        for (uint32_t below = j + 1; below < p->levels; below++)
            if (!take_into(p, &p->buckets[b].accepted[below], &records, err)) return false;
        if (!take_into(p, &p->buckets[b].rejected, &records, err)) return false;
    }
    return true;
}

static bool write_node(prep_pass *p, uint32_t j, const uint32_t corner[3], uint32_t begin,
                       uint32_t width, uint8_t child_mask, uint64_t count, mospt_err *err)
{
    bool ok = false;
    prep_subtree made = {0};
    uint8_t *records = malloc((size_t)count * stride_of(p));
    if (records == NULL) return mospt_err_nomem(err, (size_t)count * stride_of(p));
    if (!gather(p, j, begin, width, child_mask, records, err)) goto done;
    if (!prep_solve_node(p->env->shape, corner, p->level + j, child_mask, records, (uint32_t)count,
                         &made, err))
        goto done;
    ok = prep_finish_write(p->env, &made, err);
done:
    prep_subtree_fini(&made);
    free(records);
    return ok;
}

/* Writes the nodes of the pass from level `j` down, over the buckets [begin, begin + width). */
static bool write_nodes(prep_pass *p, uint32_t j, const uint32_t corner[3], uint32_t begin,
                        uint32_t width, mospt_err *err)
{
    uint32_t part = width / OCTANTS;
    uint64_t below[OCTANTS], count = 0;
    uint8_t child_mask = 0;
    if (j >= p->levels || j >= PREP_PASS_LEVELS_MAX) return true; /* of the next pass */
    for (uint32_t o = 0; o < OCTANTS; o++) {
        below[o] = points_below(p, j + 1, begin + o * part, begin + (o + 1) * part);
        if (below[o] >= p->env->shape->add_threshold) child_mask |= (uint8_t)(1u << o);
        else count += below[o];
    }
    for (uint32_t b = begin; b < begin + width; b++)
        count += p->buckets[b].accepted[j].count;
    if (!write_node(p, j, corner, begin, width, child_mask, count, err)) return false;
    for (uint32_t o = 0; o < OCTANTS; o++) {
        uint32_t child[3];
        if (!(child_mask >> o & 1)) continue;
        mospt_cell_child(p->env->shape->grid, corner, p->level + j, o, child);
        if (!write_nodes(p, j + 1, child, begin + o * part, part, err)) return false;
    }
    return true;
}

static bool seal_buckets(prep_pass *p, mospt_err *err)
{
    for (uint32_t b = 0; b < p->bucket_count; b++) {
        free(p->buckets[b].cells);
        p->buckets[b].cells = NULL;
        for (uint32_t j = 0; j < p->levels; j++)
            if (!prep_spool_seal(p->env->store, &p->buckets[b].accepted[j], err)) return false;
        if (!prep_spool_seal(p->env->store, &p->buckets[b].rejected, err)) return false;
    }
    return prep_spool_seal(p->env->store, &p->pile, err);
}

static void bucket_corner(const prep_pass *p, uint32_t b, uint32_t out[3])
{
    for (int a = 0; a < 3; a++)
        out[a] = p->corner[a];
    for (uint32_t j = 0; j < p->levels; j++)
        mospt_cell_child(p->env->shape->grid, out, p->level + j, b >> 3 * (p->levels - 1 - j) & 7,
                         out);
}

static bool finish_buckets(prep_pass *p, mospt_err *err)
{
    prep_finish_part *parts = malloc(p->bucket_count * sizeof *parts);
    uint32_t part_count = 0;
    if (parts == NULL) return mospt_err_nomem(err, p->bucket_count * sizeof *parts);
    for (uint32_t b = 0; b < p->bucket_count; b++) {
        if (p->buckets[b].rejected.count == 0) continue;
        prep_finish_part *part = &parts[part_count++];
        *part = (prep_finish_part){.spool = &p->buckets[b].rejected, .level = p->level + p->levels};
        bucket_corner(p, b, part->corner);
    }
    bool ok = prep_finish(p->env, parts, part_count, err);
    free(parts);
    return ok;
}

bool prep_pass_end(prep_pass *p, mospt_err *err)
{
    bool ok = seal_buckets(p, err);
    if (ok && p->levels == 0) ok = prep_finish_pile(p->env, &p->pile, p->corner, p->level, err);
    else if (ok && points_below(p, 0, 0, p->bucket_count) > 0)
        ok = write_nodes(p, 0, p->corner, 0, p->bucket_count, err) && finish_buckets(p, err);
    prep_pass_abandon(p);
    return ok;
}
