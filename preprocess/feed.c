#include "preprocess/feed.h"

#include <pthread.h>

typedef struct {
    prep_store *store;
    prep_spool *spool;
    size_t stride; /* of a record, bytes */
    uint32_t blocks_per_slice;
    uint32_t first_block; /* of the batch */

    pthread_mutex_t lock;
    mospt_err err; /* under the lock: of the last failure */
} feed;

/* Job: whole blocks into a slice. */
static uint32_t read_slice(void *context, uint32_t slice, uint8_t *records)
{
    feed *f = context;
    uint32_t begin = f->first_block + slice * f->blocks_per_slice, filled = 0, n = 0;
    for (uint32_t b = begin; b < begin + f->blocks_per_slice && b < f->spool->block_count; b++) {
        mospt_err err = {0};
        if (!prep_spool_take_block(f->store, f->spool, b, records + filled * f->stride, &n, &err)) {
            pthread_mutex_lock(&f->lock);
            f->err = err;
            pthread_mutex_unlock(&f->lock);
            return 0;
        }
        filled += n;
    }
    return filled;
}

bool prep_feed_spool(const prep_pass_env *env, prep_pass *pass, prep_spool *spool, mospt_err *err)
{
    feed f = {.store = env->store,
              .spool = spool,
              .stride = mospt_record_size(env->shape->schema),
              .blocks_per_slice = env->slice_points >> prep_store_block_shift(env->store)};
    uint32_t slices = (spool->block_count + f.blocks_per_slice - 1) / f.blocks_per_slice;
    bool ok = true;
    pthread_mutex_init(&f.lock, NULL);
    for (uint32_t s = 0, n; ok && s < slices; s += n) {
        n = slices - s < env->batch_slices ? slices - s : env->batch_slices;
        f.first_block = s * f.blocks_per_slice;
        ok = prep_pass_insert(pass, n, read_slice, &f, err);
        if (ok && f.err.code != MOSPT_OK) {
            if (err != NULL) *err = f.err;
            ok = false;
        }
        if (ok && !env->report(env->report_context))
            ok = mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
    }
    pthread_mutex_destroy(&f.lock);
    prep_spool_drop(env->store, spool);
    return ok;
}
