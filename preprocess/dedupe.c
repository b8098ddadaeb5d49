#include "preprocess/dedupe.h"

#include "mospt/hash.h"
#include "preprocess/feed.h"
#include "preprocess/sort.h"

#include <stdlib.h>

typedef struct {
    const prep_pass_env *env;
    size_t stride;
    const mospt_attribute *scan; /* which scan a point is of */
    prep_dedupe_scan *scans;
    prep_spool *kept;
} dedupe;

static prep_dedupe_scan *scan_of(const dedupe *d, const uint8_t *record)
{
    const uint8_t *value = d->scan->storage == MOSPT_CONSTANT
                               ? d->scan->constant
                               : record + sizeof(mospt_vertex) + d->scan->stored_offset;
    return &d->scans[(uint32_t)mospt_type_read(d->scan->type, value)];
}

static bool keep(dedupe *d, const uint8_t *record, mospt_err *err)
{
    prep_pack_sums *sums = &scan_of(d, record)->sums;
    mospt_vertex v = mospt_vertex_of(record);
    const uint32_t g[3] = {v.x, v.y, v.z};
    for (int a = 0; a < 3; a++) {
        if (g[a] < sums->low[a]) sums->low[a] = g[a];
        if (g[a] > sums->high[a]) sums->high[a] = g[a];
    }
    sums->hash += mospt_hash_records(record, d->stride, 1);
    return prep_spool_append(d->env->store, d->kept, record, d->stride, err);
}

/* Keeps the first point at each position.
 * keys     sorted by the cells below `level` */
static bool keep_first(dedupe *d, const prep_sorter *sorter, uint32_t level, uint64_t *keys,
                       uint64_t *spare, uint32_t count, mospt_err *err)
{
    uint32_t shift = sorter->index_bits, next = level + sorter->code_levels;
    for (uint32_t a = 0, b; a < count; a = b) {
        for (b = a + 1; b < count && keys[b] >> shift == keys[a] >> shift;)
            b++;
        if (b - a > 1 && mospt_cell_bits(sorter->grid, next) > 0) {
            /* Their keys do not tell them apart, but there are finer levels. */
            prep_sort_below(sorter, next, keys + a, spare, b - a);
            if (!keep_first(d, sorter, next, keys + a, spare, b - a, err)) return false;
            continue;
        }
        for (uint32_t i = a; i < b; i++) {
            const uint8_t *record =
                mospt_records_at(sorter->records, mospt_linear_index(keys[i], shift));
            if (i > a) scan_of(d, record)->dropped++;
            else if (!keep(d, record, err)) return false;
        }
    }
    return true;
}

static size_t sort_size(uint32_t count)
{
    return count * 2 * sizeof(uint64_t);
}

static bool sort_and_keep(dedupe *d, prep_spool *spool, uint32_t level, mospt_err *err)
{
    uint32_t count = (uint32_t)spool->count;
    size_t size = sort_size(count) + prep_spool_size_on_disk(d->env->store, spool);
    uint8_t *memory = prep_arena_take(d->env->arena, size);
    const uint8_t **blocks = malloc(spool->block_count * sizeof *blocks);
    bool ok = (memory != NULL && blocks != NULL) || mospt_err_nomem(err, size);
    if (ok) {
        uint64_t *keys = (uint64_t *)memory;
        mospt_records records = {
            .blocks = blocks, .stride = d->stride, .shift = prep_store_block_shift(d->env->store)};
        prep_sorter sorter = {.grid = d->env->shape->grid, .records = &records};
        ok = prep_spool_view(d->env->store, spool, memory + sort_size(count), blocks, err);
        if (ok) {
            prep_sort_begin(&sorter, count);
            prep_sort_all(&sorter, level, keys, keys + count, count);
            ok = keep_first(d, &sorter, level, keys, keys + count, count, err);
        }
    }
    prep_arena_give(d->env->arena, memory);
    free(blocks);
    prep_spool_drop(d->env->store, spool);
    return ok;
}

/* All points of the spool are at one position. */
static bool keep_one(dedupe *d, prep_spool *spool, mospt_err *err)
{
    uint8_t *records = malloc(prep_store_block_size(d->env->store));
    bool ok = records != NULL || mospt_err_nomem(err, prep_store_block_size(d->env->store));
    for (uint32_t b = 0, n; ok && b < spool->block_count; b++) {
        ok = prep_spool_take_block(d->env->store, spool, b, records, &n, err);
        for (uint32_t i = 0; ok && i < n; i++) {
            if (b == 0 && i == 0) ok = keep(d, records, err);
            else scan_of(d, records + i * d->stride)->dropped++;
        }
    }
    free(records);
    prep_spool_drop(d->env->store, spool);
    return ok;
}

static bool take_octant(void *context, prep_spool *spool, const uint32_t corner[3], uint32_t level,
                        mospt_err *err)
{
    dedupe *d = context;
    prep_pass *pass = NULL;
    if (!d->env->report(d->env->report_context))
        return mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
    if (mospt_cell_bits(d->env->shape->grid, level) == 0) return keep_one(d, spool, err);
    if (spool->count <= d->env->solve_points) return sort_and_keep(d, spool, level, err);
    if (!prep_pass_begin(d->env, corner, level, &pass, err)) return false;
    if (prep_feed_spool(d->env, pass, spool, err))
        return prep_pass_divide(pass, take_octant, d, err);
    prep_pass_abandon(pass);
    return false;
}

bool prep_dedupe(const prep_pass_env *env, prep_pass *divided, prep_dedupe_scan *scans,
                 uint32_t scan_count, prep_spool *kept, mospt_err *err)
{
    const mospt_schema *schema = env->shape->schema;
    dedupe d = {.env = env,
                .stride = mospt_record_size(schema),
                .scan = &schema->at[mospt_schema_find(schema, "scan")],
                .scans = scans,
                .kept = kept};
    for (uint32_t i = 0; i < scan_count; i++)
        scans[i] = (prep_dedupe_scan){.sums = prep_pack_sums_empty};
    return prep_pass_divide(divided, take_octant, &d, err) &&
           prep_spool_seal(env->store, kept, err);
}
