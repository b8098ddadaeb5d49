#include "preprocess/feed_scans.h"

#include <stdlib.h>

/* A batch of a scan on its way. */
typedef struct {
    const prep_batch *batch;
    uint32_t slice_points;
    prep_packer packer;
    prep_pack_sums *sums; /* [slices], owned */
    uint8_t *records;     /* [slices][slice_points][record], of points that are only looked at;
                             owned; NULL: none are */
} packing;

static uint32_t pack_slice(void *context, uint32_t slice, uint8_t *records)
{
    packing *p = context;
    uint32_t begin = slice * p->slice_points, left = p->batch->count - begin;
    uint32_t count = left < p->slice_points ? left : p->slice_points;
    p->sums[slice] = prep_pack_sums_empty;
    prep_pack(&p->packer, p->batch, begin, begin + count, records, &p->sums[slice]);
    return p->sums[slice].outside ? 0 : count;
}

/* Job: the same for points that go nowhere. */
static void look_at_slice(void *context, uint32_t slice)
{
    packing *p = context;
    size_t size = p->slice_points * mospt_record_size(p->packer.schema);
    pack_slice(p, slice, p->records + slice * size);
}

/* From now on points are only looked at. */
static bool give_up_pass(const prep_pass_env *env, prep_pass **pass, packing *p, mospt_err *err)
{
    size_t size = env->batch_slices * env->slice_points * mospt_record_size(p->packer.schema);
    prep_pass_abandon(*pass);
    *pass = NULL;
    p->records = malloc(size);
    return p->records != NULL || mospt_err_nomem(err, size);
}

/* Packs a batch, and inserts it if there still is a pass. */
static bool feed_batch(const prep_pass_env *env, prep_pass *pass, packing *p, prep_pack_sums *all,
                       prep_pack_sums *of_scan, mospt_err *err)
{
    uint32_t slices = (p->batch->count + p->slice_points - 1) / p->slice_points;
    bool ok = true;
    if (pass != NULL) ok = prep_pass_insert(pass, slices, pack_slice, p, err);
    else prep_workers_run(env->workers, slices, look_at_slice, p);
    for (uint32_t i = 0; i < slices; i++) {
        prep_pack_sums_add(of_scan, &p->sums[i]);
        prep_pack_sums_add(all, &p->sums[i]);
    }
    return ok;
}

bool prep_feed_scans(const prep_pass_env *env, prep_source *source, mospt_schema *schema,
                     prep_feed_report report, void *context, prep_pass **pass,
                     prep_pack_sums *of_scan, prep_feed_outcome *out, mospt_err *err)
{
    prep_stream *stream = NULL;
    uint64_t points = 0;
    prep_pack_sums all = prep_pack_sums_empty;
    packing p = {.slice_points = env->slice_points,
                 .packer = {.grid = env->shape->grid, .schema = schema},
                 .sums = malloc(env->batch_slices * sizeof *p.sums)};
    bool ok = p.sums != NULL || mospt_err_nomem(err, env->batch_slices * sizeof *p.sums);
    ok = ok && prep_stream_open(source, env->batch_slices * env->slice_points, &stream, err);
    while (ok && !all.outside) {
        uint32_t scan = 0;
        ok = prep_stream_next(stream, &p.batch, &scan, err);
        if (!ok || p.batch == NULL) break;
        p.packer.planes = &source->scans[scan].info.attributes;
        p.packer.scan = scan;
        ok = feed_batch(env, *pass, &p, &all, &of_scan[scan], err);
        if (ok && *pass != NULL && !prep_implied_holds(schema, &all.differs))
            ok = give_up_pass(env, pass, &p, err);
        points += p.batch->count;
        if (ok && !report(context, points, *pass == NULL))
            ok = mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
    }
    *out = all.outside ? PREP_FEED_OUTSIDE : *pass == NULL ? PREP_FEED_DIFFERS : PREP_FEED_DONE;
    if (*out == PREP_FEED_DIFFERS) prep_implied_correct(schema, &all.differs);
    prep_stream_close(stream);
    free(p.sums), free(p.records);
    return ok;
}
