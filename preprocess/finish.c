#include "preprocess/finish.h"

#include <pthread.h>
#include <stdlib.h>

typedef struct {
    const prep_pass_env *env;
    const prep_finish_part *parts;
    uint32_t part_count;

    pthread_mutex_t lock;
    pthread_cond_t change;
    /* Under the lock: */
    uint32_t next_to_take, next_to_write;
    uint32_t in_flight;
    size_t memory_left;
    bool failed;
    mospt_err err; /* of the first failure */
} line;

/* Memory that finishing so many points in one go takes. */
static size_t memory_for(const prep_pass_env *env, uint64_t count)
{
    return (size_t)count *
           (mospt_record_size(env->shape->schema) + prep_solve_point_size(env->shape));
}

static bool report_progress(const prep_pass_env *env, mospt_err *err)
{
    if (env->report(env->report_context, env->written)) return true;
    return mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
}

bool prep_finish_write(const prep_pass_env *env, const prep_subtree *made, mospt_err *err)
{
    for (uint32_t i = 0; i < made->node_count; i++) {
        const mospt_node *node = &made->nodes[i];
        if (!mospt_writer_append(env->writer, node, made->payload + node->payload_offset, err))
            return false;
    }
    env->written->points += made->point_count;
    env->written->points_hash += made->points_hash;
    return report_progress(env, err);
}

/* Takes the next part as soon as there is memory for it; parts are taken in order, so the first one
 * in flight can always be written, and makes room for those after it. Returns false when there is
 * none. */
static bool take_part(line *l, uint32_t *part, size_t *memory)
{
    pthread_mutex_lock(&l->lock);
    for (;;) {
        if (l->failed || l->next_to_take == l->part_count) break;
        *memory = memory_for(l->env, l->parts[l->next_to_take].spool->count);
        if (*memory <= l->memory_left || l->in_flight == 0) break;
        pthread_cond_wait(&l->change, &l->lock);
    }
    bool taken = !l->failed && l->next_to_take < l->part_count;
    if (taken) {
        *part = l->next_to_take++;
        if (*memory > l->memory_left) *memory = l->memory_left;
        l->memory_left -= *memory;
        l->in_flight++;
        pthread_cond_broadcast(&l->change);
    }
    pthread_mutex_unlock(&l->lock);
    return taken;
}

static void fail(line *l, const mospt_err *err)
{
    pthread_mutex_lock(&l->lock);
    if (!l->failed) l->err = *err;
    l->failed = true;
    pthread_cond_broadcast(&l->change);
    pthread_mutex_unlock(&l->lock);
}

static bool solve_part(const prep_pass_env *env, const prep_finish_part *part, prep_subtree *made,
                       mospt_err *err)
{
    uint32_t count = (uint32_t)part->spool->count;
    size_t size = count * mospt_record_size(env->shape->schema);
    uint8_t *records = malloc(size);
    if (records == NULL) return mospt_err_nomem(err, size);
    bool ok = prep_spool_take(env->store, part->spool, records, err) &&
              prep_solve(env->shape, part->corner, part->level, records, count, made, err);
    free(records);
    return ok;
}

/* Waits until all parts before this one are written. */
static bool await_turn(line *l, uint32_t part)
{
    pthread_mutex_lock(&l->lock);
    while (!l->failed && l->next_to_write != part)
        pthread_cond_wait(&l->change, &l->lock);
    bool go = !l->failed;
    pthread_mutex_unlock(&l->lock);
    return go;
}

/* Job: one thread's share. */
static void work_on_line(void *context, uint32_t thread)
{
    line *l = context;
    uint32_t part;
    size_t memory = 0;
    (void)thread;
    while (take_part(l, &part, &memory)) {
        mospt_err err = {0};
        prep_subtree made = {0};
        bool ok = solve_part(l->env, &l->parts[part], &made, &err);
        if (ok && !await_turn(l, part)) {
            prep_subtree_fini(&made);
            return;
        }
        ok = ok && prep_finish_write(l->env, &made, &err);
        prep_subtree_fini(&made);
        if (!ok) {
            fail(l, &err);
            return;
        }
        pthread_mutex_lock(&l->lock);
        l->next_to_write++;
        l->in_flight--;
        l->memory_left += memory;
        pthread_cond_broadcast(&l->change);
        pthread_mutex_unlock(&l->lock);
    }
}

static bool finish_small(const prep_pass_env *env, const prep_finish_part *parts,
                         uint32_t part_count, mospt_err *err)
{
    line l = {
        .env = env, .parts = parts, .part_count = part_count, .memory_left = env->solve_memory};
    if (part_count == 0) return true;
    pthread_mutex_init(&l.lock, NULL);
    pthread_cond_init(&l.change, NULL);
    prep_workers_run(env->workers, prep_workers_count(env->workers), work_on_line, &l);
    pthread_cond_destroy(&l.change);
    pthread_mutex_destroy(&l.lock);
    if (l.failed && err != NULL) *err = l.err;
    return !l.failed;
}

/* A rejection file that is too large for memory is the input of a pass of its own. */
static bool finish_large(const prep_pass_env *env, const prep_finish_part *part, mospt_err *err)
{
    size_t stride = mospt_record_size(env->shape->schema);
    uint32_t block_count = part->spool->block_count, filled = 0, n;
    uint32_t room = env->batch_count - prep_store_block_capacity(env->store);
    prep_pass *pass = NULL;
    uint8_t *records = malloc(env->batch_count * stride);
    if (records == NULL) return mospt_err_nomem(err, env->batch_count * stride);
    bool ok = prep_pass_begin(env, part->corner, part->level, &pass, err);
    for (uint32_t i = 0; ok && i < block_count; i++) {
        ok = prep_spool_take_block(env->store, part->spool, i, records + filled * stride, &n, err);
        filled += n;
        if (!ok || (filled <= room && i + 1 < block_count)) continue;
        ok = prep_pass_insert(pass, records, filled, err);
        filled = 0;
        ok = ok && report_progress(env, err);
    }
    free(records);
    if (ok) return prep_pass_end(pass, err);
    prep_pass_abandon(pass);
    return false;
}

bool prep_finish(const prep_pass_env *env, const prep_finish_part *parts, uint32_t part_count,
                 mospt_err *err)
{
    uint32_t begin = 0;
    for (uint32_t i = 0; i < part_count; i++) {
        uint64_t count = parts[i].spool->count;
        if (count <= UINT32_MAX && memory_for(env, count) <= env->solve_memory) continue;
        if (!finish_small(env, parts + begin, i - begin, err) || !finish_large(env, &parts[i], err))
            return false;
        begin = i + 1;
    }
    return finish_small(env, parts + begin, part_count - begin, err);
}

bool prep_finish_pile(const prep_pass_env *env, prep_spool *spool, const uint32_t corner[3],
                      uint32_t level, mospt_err *err)
{
    size_t stride = mospt_record_size(env->shape->schema);
    uint32_t block_count = spool->block_count, filled = 0, n;
    uint32_t room =
        PREP_PILE_MAX + env->shape->add_threshold + prep_store_block_capacity(env->store);
    uint64_t left = spool->count;
    bool ok = true;
    uint8_t *records = malloc(room * stride);
    if (records == NULL) return mospt_err_nomem(err, room * stride);
    for (uint32_t i = 0; ok && left > 0;) {
        while (ok && i < block_count && filled < PREP_PILE_MAX + env->shape->add_threshold) {
            ok = prep_spool_take_block(env->store, spool, i++, records + filled * stride, &n, err);
            filled += n;
        }
        /* As prep_solve() does: a rest below the threshold is added to the last node. */
        bool more = left > PREP_PILE_MAX && left - PREP_PILE_MAX >= env->shape->add_threshold;
        uint32_t count = more ? PREP_PILE_MAX : (uint32_t)left;
        prep_subtree made = {0};
        ok = ok &&
             prep_solve_node(env->shape, corner, level, more ? 1 : 0, records, count, &made, err) &&
             prep_finish_write(env, &made, err);
        prep_subtree_fini(&made);
        memmove(records, records + count * stride, (filled - count) * stride);
        filled -= count, left -= count, level++;
    }
    free(records);
    return ok;
}
