#include "preprocess/pass.h"

#include "preprocess/finish.h"
#include "preprocess/pages.h"

#include <stdlib.h>

enum { OCTANTS = 8, TOUCH_SIZE = 2 << 20 };

/* An octant at the end of the pass: what was accepted in it level by level, and what goes below. */
typedef struct {
    uint8_t kept;   /* bit for each level, and one more for what goes below: these points are in the
                       dataset already, and are only counted */
    uint8_t *cells; /* bit sets of its finest cells, one per level; NULL: untouched */
    prep_spool accepted[PREP_PASS_LEVELS_MAX];
    prep_spool rejected;
    mospt_err err;
} bucket;

/* Records on their way into the buckets, slice by slice. */
typedef struct {
    uint32_t slice_count;
    void *memory; /* owned, of prep_pages_take(), for all that follows */
    size_t size;
    uint32_t *codes;   /* [batch_slices][slice_points] */
    uint32_t *touched; /* [bucket_count]: buckets with records */
    uint32_t touched_count;
    uint16_t *order;  /* [batch_slices][slice_points]: those of each bucket, in turn */
    uint16_t *begin;  /* [batch_slices][bucket_count + 1]: part of each bucket in that */
    uint8_t *records; /* [batch_slices][slice_points][stride] */
} batch;

struct prep_pass {
    const prep_pass_env *env;
    size_t stride; /* of a record, bytes */
    uint32_t corner[3], level;
    uint32_t levels; /* that this pass fills; 0: one position, a pile */
    uint32_t
        code_levels;   /* of the codes: from the node down to the finest cells of the last level */
    size_t cells_size; /* bytes of bit sets in a bucket */
    size_t cells_offset[PREP_PASS_LEVELS_MAX]; /* of each level in them, bytes */
    uint32_t bucket_count;
    bucket *buckets; /* [bucket_count], owned */
    uint8_t *cells;  /* [bucket_count][cells_size], owned, of prep_pages_take() */
    prep_spool pile;
    batch batches[2];
    batch *prepared; /* the next to go into the buckets; NULL: none */

    /* The round being run: */
    uint8_t *untouched; /* memory that will be filled in the next one */
    size_t untouched_size;
    batch *preparing; /* NULL: none */
    prep_pass_prepare prepare;
    void *context;
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

static bool batch_init(const prep_pass *p, batch *b, mospt_err *err)
{
    size_t records = (size_t)p->env->batch_slices * p->env->slice_points,
           parts = (size_t)p->env->batch_slices * (p->bucket_count + 1);
    b->size = records * (sizeof *b->codes + sizeof *b->order + p->stride) +
              p->bucket_count * sizeof *b->touched + parts * sizeof *b->begin;
    b->memory = prep_pages_take(b->size);
    if (b->memory == NULL) return mospt_err_nomem(err, b->size);
    b->codes = b->memory;
    b->touched = b->codes + records;
    b->order = (uint16_t *)(b->touched + p->bucket_count);
    b->begin = b->order + records;
    b->records = (uint8_t *)(b->begin + parts);
    return true;
}

static void batch_fini(batch *b)
{
    prep_pages_give(b->memory, b->size);
    *b = (batch){0};
}

static size_t cells_total(const prep_pass *p)
{
    return p->bucket_count * p->cells_size;
}

static void drop_cells(prep_pass *p)
{
    prep_pages_give(p->cells, cells_total(p));
    p->cells = NULL;
}

bool prep_pass_begin(const prep_pass_env *env, const uint32_t corner[3], uint32_t level,
                     prep_pass **out, mospt_err *err)
{
    uint32_t cell_bits = mospt_cell_bits(env->shape->grid, level), depth = env->shape->inner_depth;
    prep_pass *p = calloc(1, sizeof *p);
    if (p == NULL) return mospt_err_nomem(err, sizeof *p);
    p->env = env;
    p->stride = mospt_record_size(env->shape->schema);
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
    p->buckets = calloc(p->bucket_count, sizeof *p->buckets);
    bool ok = p->buckets != NULL || mospt_err_nomem(err, p->bucket_count * sizeof *p->buckets);
    if (ok && p->levels > 0 && !env->divides) {
        p->cells = prep_pages_take(cells_total(p));
        ok = p->cells != NULL || mospt_err_nomem(err, cells_total(p));
    }
    for (int b = 0; ok && b < 2; b++)
        ok = batch_init(p, &p->batches[b], err);
    if (ok) *out = p;
    else prep_pass_abandon(p);
    return ok;
}

void prep_pass_abandon(prep_pass *p)
{
    if (p == NULL) return;
    for (uint32_t b = 0; p->buckets != NULL && b < p->bucket_count; b++) {
        for (uint32_t j = 0; j < p->levels; j++)
            prep_spool_drop(p->env->store, &p->buckets[b].accepted[j]);
        prep_spool_drop(p->env->store, &p->buckets[b].rejected);
    }
    prep_spool_drop(p->env->store, &p->pile);
    for (int b = 0; b < 2; b++)
        batch_fini(&p->batches[b]);
    drop_cells(p);
    free(p->buckets);
    free(p);
}

static uint8_t *records_of(const prep_pass *p, const batch *b, uint32_t slice)
{
    return b->records + (size_t)slice * p->env->slice_points * p->stride;
}

/* Parts of the buckets in the order of a slice. */
static uint16_t *begin_of(const prep_pass *p, const batch *b, uint32_t slice)
{
    return b->begin + (size_t)slice * (p->bucket_count + 1);
}

static void find_codes(const uint8_t *records, size_t stride, uint32_t count, uint32_t cell_bits,
                       uint32_t levels, uint32_t *codes)
{
    mospt_cell_points points;
    for (uint32_t begin = 0, n; begin < count; begin += n) {
        n = count - begin < MOSPT_CELL_POINTS_MAX ? count - begin : MOSPT_CELL_POINTS_MAX;
        for (uint32_t i = 0; i < n; i++, records += stride) {
            mospt_vertex v = mospt_vertex_of(records);
            points.x[i] = v.x, points.y[i] = v.y, points.z[i] = v.z;
        }
        mospt_cell_codes_short(&points, n, cell_bits, levels, codes + begin);
    }
}

/* Job: a slice of the batch being prepared, and the order of its records by bucket (a stable
 * counting sort). */
static void prepare_slice(prep_pass *p, uint32_t slice)
{
    batch *b = p->preparing;
    uint8_t *records = records_of(p, b, slice);
    uint32_t *codes = b->codes + (size_t)slice * p->env->slice_points;
    uint16_t *order = b->order + (size_t)slice * p->env->slice_points,
             *begin = begin_of(p, b, slice);
    uint32_t bits = mospt_cell_bits(p->env->shape->grid, p->level), levels = p->code_levels;
    uint32_t bucket_shift = 3 * (levels - p->levels);
    uint32_t count = p->prepare(p->context, slice, records);

    find_codes(records, p->stride, count, bits, levels, codes);
    memset(begin, 0, (p->bucket_count + 1) * sizeof *begin);
    for (uint32_t i = 0; i < count; i++)
        begin[codes[i] >> bucket_shift]++;
    for (uint32_t k = 0, sum = 0; k <= p->bucket_count; k++) {
        uint32_t n = begin[k];
        begin[k] = (uint16_t)sum;
        sum += n;
    }
    for (uint32_t i = 0; i < count; i++)
        order[begin[codes[i] >> bucket_shift]++] = (uint16_t)i;
    /* Each place now stands where the next bucket begins. */
    memmove(begin + 1, begin, p->bucket_count * sizeof *begin);
    begin[0] = 0;
}

static bool take_cell(uint8_t *cells, uint32_t cell)
{
    uint8_t bit = (uint8_t)(1u << (cell & 7));
    if (cells[cell >> 3] & bit) return false;
    cells[cell >> 3] |= bit;
    return true;
}

static uint32_t cell_at(const prep_pass *p, uint32_t code, uint32_t j)
{
    /* The finest cell at level j is the code down to j + depth levels; of those, the bucket is the
     * first. */
    uint32_t bits = 3 * (p->env->shape->inner_depth + j - p->levels);
    return code >> 3 * (p->levels - 1 - j) & (uint32_t)((UINT64_C(1) << bits) - 1);
}

/* The first level of the pass that has the cell of a point free; p->levels: none. Whoever took the
 * cell of the last level had found those of all levels above taken, and they hold it: so one look
 * is enough for most points. */
static uint32_t accepting_level(const prep_pass *p, uint8_t *cells, uint32_t code)
{
    uint32_t last = p->levels - 1, cell = cell_at(p, code, last);
    if (cells[p->cells_offset[last] + (cell >> 3)] >> (cell & 7) & 1) return p->levels;
    for (uint32_t j = 0; j < last; j++)
        if (take_cell(cells + p->cells_offset[j], cell_at(p, code, j))) return j;
    return take_cell(cells + p->cells_offset[last], cell) ? last : p->levels;
}

/* Which points of a bucket are in the dataset already: those accepted by nodes that are there on
 * the way down to it, with what lies in octants that never get a child, and those below if all of
 * that is there. */
static uint8_t find_kept(const prep_pass *p, uint32_t b)
{
    const prep_resume *resume = p->env->resume;
    uint32_t corner[3] = {p->corner[0], p->corner[1], p->corner[2]}, j = 0;
    for (; j < p->levels; j++) {
        uint32_t node = prep_resume_find(resume, corner, p->level + j),
                 octant = b >> 3 * (p->levels - 1 - j) & 7;
        if (node == MOSPT_NO_NODE) return (uint8_t)((1u << j) - 1);
        if (!prep_resume_has_child(resume, node, octant)) return UINT8_MAX;
        mospt_cell_child(p->env->shape->grid, corner, p->level + j, octant, corner);
    }
    uint32_t below = prep_resume_find(resume, corner, p->level + j);
    bool is_whole = below != MOSPT_NO_NODE && prep_resume_is_whole(resume, below);
    return (uint8_t)(is_whole ? UINT8_MAX : (1u << j) - 1);
}

/* Job: sends the records of one bucket to the levels that accept them, or to the rejection file. */
static void fill_bucket(prep_pass *p, const batch *from, uint32_t b)
{
    bucket *to = &p->buckets[b];
    size_t stride = p->stride;
    if (!p->env->divides && to->cells == NULL) {
        to->kept = find_kept(p, b);
        to->cells = p->cells + b * p->cells_size;
    }
    for (uint32_t s = 0; s < from->slice_count; s++) {
        const uint8_t *records = records_of(p, from, s);
        const uint32_t *codes = from->codes + (size_t)s * p->env->slice_points;
        const uint16_t *order = from->order + (size_t)s * p->env->slice_points,
                       *begin = begin_of(p, from, s);
        for (uint32_t i = begin[b]; i < begin[b + 1]; i++) {
            uint32_t j =
                p->env->divides ? p->levels : accepting_level(p, to->cells, codes[order[i]]);
            prep_spool *spool = j < p->levels ? &to->accepted[j] : &to->rejected;
            if (to->kept >> j & 1) spool->count++;
            else if (!prep_spool_append(p->env->store, spool, records + order[i] * stride, stride,
                                        &to->err))
                return;
        }
    }
}

static uint32_t touch_count(const prep_pass *p)
{
    return (uint32_t)((p->untouched_size + TOUCH_SIZE - 1) / TOUCH_SIZE);
}

/* Job: memory is cleared by the system when it is first touched, which takes longer than what is
 * done with it. Most points of a tripod's scan lie in one bucket, whose thread would do all of that
 * alone. */
static void touch(const prep_pass *p, uint32_t piece)
{
    size_t begin = piece * (size_t)TOUCH_SIZE, left = p->untouched_size - begin;
    prep_pages_touch(p->untouched + begin, left < TOUCH_SIZE ? left : TOUCH_SIZE);
}

/* Job: first memory for the next round, then the buckets of the batch that is prepared, then the
 * slices of the next one. */
static void run_job(void *context, uint32_t job)
{
    prep_pass *p = context;
    uint32_t touches = touch_count(p), fills = p->prepared != NULL ? p->prepared->touched_count : 0;
    if (job < touches) touch(p, job);
    else if (job < touches + fills)
        fill_bucket(p, p->prepared, p->prepared->touched[job - touches]);
    else prepare_slice(p, job - touches - fills);
}

static void find_touched(const prep_pass *p, batch *b)
{
    b->touched_count = 0;
    for (uint32_t k = 0; k < p->bucket_count; k++)
        for (uint32_t s = 0; s < b->slice_count; s++) {
            const uint16_t *begin = begin_of(p, b, s);
            if (begin[k] == begin[k + 1]) continue;
            b->touched[b->touched_count++] = k;
            break;
        }
}

static bool fill_pile(prep_pass *p, const batch *b, mospt_err *err)
{
    for (uint32_t s = 0; s < b->slice_count; s++) {
        uint32_t count = begin_of(p, b, s)[p->bucket_count];
        for (uint32_t i = 0; i < count; i++)
            if (!prep_spool_append(p->env->store, &p->pile, records_of(p, b, s) + i * p->stride,
                                   p->stride, err))
                return false;
    }
    return true;
}

/* Runs a round: fills the buckets from the batch that is prepared, and prepares the next one, if
 * there is one. */
static bool run_round(prep_pass *p, batch *next, mospt_err *err)
{
    batch *from = p->prepared;
    uint32_t fills = from != NULL ? from->touched_count : 0;
    uint32_t slices = next != NULL ? next->slice_count : 0;
    size_t batch_size = (size_t)slices * p->env->slice_points * p->stride;
    p->preparing = next;
    p->untouched = prep_store_untouched(p->env->store, 2 * batch_size,
                                        prep_workers_count(p->env->workers) * (size_t)TOUCH_SIZE,
                                        &p->untouched_size);
    prep_workers_run(p->env->workers, touch_count(p) + fills + slices, run_job, p);
    p->prepared = next;
    for (uint32_t t = 0; t < fills; t++) {
        const bucket *b = &p->buckets[from->touched[t]];
        if (b->err.code == MOSPT_OK) continue;
        if (err != NULL) *err = b->err;
        return false;
    }
    if (next == NULL) return true;
    if (p->levels > 0) find_touched(p, next);
    else if (!fill_pile(p, next, err)) return false;
    return true;
}

bool prep_pass_insert(prep_pass *p, uint32_t slice_count, prep_pass_prepare prepare, void *context,
                      mospt_err *err)
{
    batch *next = &p->batches[p->prepared == &p->batches[0] ? 1 : 0];
    next->slice_count = slice_count;
    p->prepare = prepare;
    p->context = context;
    return run_round(p, next, err);
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

/* The node at level `j` of the pass whose buckets are [begin, begin + width): what was accepted
 * there, and all that lies in octants without a child. */
static void list_spools(prep_pass *p, uint32_t j, uint32_t begin, uint32_t width,
                        prep_finish_part *part)
{
    for (uint32_t b = begin; b < begin + width; b++) {
        uint32_t octant = (b - begin) / (width / OCTANTS);
        part->spools[part->spool_count++] = &p->buckets[b].accepted[j];
        if (part->child_mask >> octant & 1) continue;
        for (uint32_t below = j + 1; below < p->levels; below++)
            part->spools[part->spool_count++] = &p->buckets[b].accepted[below];
        part->spools[part->spool_count++] = &p->buckets[b].rejected;
    }
}

/* Lists the nodes of the pass from level `j` down, over the buckets [begin, begin + width). */
static void list_nodes(prep_pass *p, uint32_t j, const uint32_t corner[3], uint32_t begin,
                       uint32_t width, prep_finish_list *list)
{
    uint32_t step = width / OCTANTS;
    if (j >= p->levels || j >= PREP_PASS_LEVELS_MAX) return; /* of the next pass */
    prep_finish_part *part = &list->parts[list->part_count++];
    *part = (prep_finish_part){.spools = list->spools + list->spool_count,
                               .level = p->level + j,
                               .is_node = true,
                               .corner = {corner[0], corner[1], corner[2]}};
    for (uint32_t o = 0; o < OCTANTS; o++)
        if (points_below(p, j + 1, begin + o * step, begin + (o + 1) * step) >=
            p->env->shape->add_threshold)
            part->child_mask |= (uint8_t)(1u << o);
    list_spools(p, j, begin, width, part);
    list->spool_count += part->spool_count;
    for (uint32_t o = 0; o < OCTANTS; o++) {
        uint32_t child[3];
        if (!(part->child_mask >> o & 1)) continue;
        mospt_cell_child(p->env->shape->grid, corner, p->level + j, o, child);
        list_nodes(p, j + 1, child, begin + o * step, step, list);
    }
}

static bool seal_buckets(prep_pass *p, mospt_err *err)
{
    drop_cells(p);
    for (uint32_t b = 0; b < p->bucket_count; b++) {
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

/* Lists the rejection files that are left. */
static void list_buckets(prep_pass *p, prep_finish_list *list)
{
    for (uint32_t b = 0; b < p->bucket_count; b++) {
        /* An octant without a child has given them to a node above. */
        if (p->buckets[b].rejected.count < p->env->shape->add_threshold) continue;
        prep_finish_part *part = &list->parts[list->part_count++];
        *part = (prep_finish_part){.spools = list->spools + list->spool_count,
                                   .spool_count = 1,
                                   .level = p->level + p->levels};
        list->spools[list->spool_count++] = &p->buckets[b].rejected;
        bucket_corner(p, b, part->corner);
    }
}

static bool finish(prep_pass *p, mospt_err *err)
{
    /* At most one node over each bucket and level; every spool is in one part. */
    size_t parts_max = p->bucket_count * (1 + (size_t)p->levels),
           spools_max = p->bucket_count * (1 + (size_t)p->levels);
    prep_finish_list list = {.parts = malloc(parts_max * sizeof *list.parts),
                             .spools = malloc(spools_max * sizeof *list.spools)};
    bool ok = list.parts != NULL && list.spools != NULL;
    if (ok) {
        list_nodes(p, 0, p->corner, 0, p->bucket_count, &list);
        list_buckets(p, &list);
        ok = prep_finish(p->env, &list, err);
    } else {
        mospt_err_nomem(err, parts_max * sizeof *list.parts);
    }
    free(list.parts), free(list.spools);
    return ok;
}

bool prep_pass_end(prep_pass *p, mospt_err *err)
{
    bool ok = run_round(p, NULL, err) && seal_buckets(p, err);
    for (int b = 0; b < 2; b++)
        batch_fini(&p->batches[b]);
    if (ok && p->levels == 0) ok = prep_finish_pile(p->env, &p->pile, p->corner, p->level, err);
    else if (ok && points_below(p, 0, 0, p->bucket_count) > 0) ok = finish(p, err);
    prep_pass_abandon(p);
    return ok;
}

bool prep_pass_divide(prep_pass *p, prep_pass_part part, void *context, mospt_err *err)
{
    bool ok = run_round(p, NULL, err) && seal_buckets(p, err);
    for (int b = 0; b < 2; b++)
        batch_fini(&p->batches[b]);
    if (ok && p->levels == 0) ok = part(context, &p->pile, p->corner, p->level, err);
    for (uint32_t b = 0; ok && p->levels > 0 && b < p->bucket_count; b++) {
        uint32_t corner[3];
        bucket_corner(p, b, corner);
        if (p->buckets[b].rejected.count > 0)
            ok = part(context, &p->buckets[b].rejected, corner, p->level + p->levels, err);
    }
    prep_pass_abandon(p);
    return ok;
}
