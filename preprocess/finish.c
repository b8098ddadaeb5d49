#include "preprocess/finish.h"

#include "preprocess/feed.h"
#include "preprocess/large_node.h"
#include "preprocess/pages.h"

#include <pthread.h>
#include <stdlib.h>

/* A part on its way. First its points are divided among nodes, then these are made one by one. */
typedef struct {
    const prep_finish_part *part;
    uint64_t count;
    const prep_solving *solving; /* borrowed: it is a piece of that; NULL: it is all of the part */
    uint32_t piece;
    uint32_t kept;  /* its node of what an interrupted build has left; MOSPT_NO_NODE: none */
    bool is_solved; /* under the lock, like the counts below */
    bool on_heap;   /* its memory is not of the arena, for which it is too large */
    void *memory;   /* owned: for solving, and records that do not stand in memory */
    const uint8_t **blocks; /* owned */
    mospt_records records;
    prep_subtree made;
    uint32_t first_index;             /* of its nodes in the writer */
    uint32_t nodes_taken, nodes_done; /* of made.nodes */
} item;

typedef struct {
    const prep_pass_env *env;
    uint32_t item_count, threads;
    size_t buffer_kept; /* bytes: a larger buffer is given back after its node */

    pthread_mutex_t lock;
    pthread_cond_t change;
    /* Under the lock: */
    item *items; /* [item_count]; what is not said to be under the lock is of the thread that solves
                    it, and is only read after */
    uint32_t next_to_solve, next_to_place, next_to_emit;
    uint32_t in_flight; /* taken, and not all nodes written */
    bool failed;
    mospt_err err; /* of the first failure */
} line;

/* Points of a rejection file that all threads solve together. */
enum { SHARED_MIN = 1 << 20 };

/* One thread's memory for the payload of a node; that of a large one is given back at once. */
enum { BUFFER_KEPT_MAX = 8 << 20 };
typedef struct {
    void *memory; /* [size], owned, of prep_pages_take() */
    size_t size;
} buffer;

size_t prep_finish_size(size_t record_size, uint64_t count)
{
    return (size_t)count * record_size + prep_solve_work_size((uint32_t)count);
}

size_t prep_finish_emit_size(size_t record_size, uint64_t count)
{
    return (size_t)count * (2 * record_size + sizeof(uint32_t)) +
           mospt_linear_work_size((uint32_t)count);
}

static uint64_t count_of(const prep_finish_part *part)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < part->spool_count; i++)
        sum += part->spools[i]->count;
    return sum;
}

static bool report_progress(const prep_pass_env *env, mospt_err *err)
{
    if (env->report(env->report_context)) return true;
    return mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
}

/* The node to begin with of a part that need not be made again; MOSPT_NO_NODE if it must be. */
static uint32_t find_kept(const prep_pass_env *env, const prep_finish_part *part)
{
    uint32_t node = prep_resume_find(env->resume, part->corner, part->level);
    bool is_kept =
        node != MOSPT_NO_NODE && (part->is_node || prep_resume_is_whole(env->resume, node));
    return is_kept ? node : MOSPT_NO_NODE;
}

/* Points that were passed over in reading must be those that are there. */
static bool check_kept(const prep_pass_env *env, const item *i, mospt_err *err)
{
    bool is_right = i->kept == MOSPT_NO_NODE ||
                    prep_resume_points(env->resume, i->kept, !i->part->is_node) == i->count;
    for (uint32_t s = 0; i->kept == MOSPT_NO_NODE && s < i->part->spool_count; s++)
        is_right =
            is_right && (i->part->spools[s]->count == 0 || i->part->spools[s]->block_count > 0);
    return is_right || mospt_err_set(err, MOSPT_EFORMAT, mospt_nowhere(),
                                     "the scans are not those that the interrupted build has read; "
                                     "remove the unfinished dataset to start anew");
}

/* Bytes for the blocks of a rejection file, of which those on the disk are read, or for the records
 * of a node, which come from many. */
static size_t records_size(const prep_pass_env *env, const item *i)
{
    if (i->part->is_node) return (size_t)i->count * mospt_record_size(env->shape->schema);
    return prep_spool_size_on_disk(env->store, i->part->spools[0]);
}

static bool take_memory(const prep_pass_env *env, item *i)
{
    if (i->kept != MOSPT_NO_NODE || i->solving != NULL) return true;
    size_t size = prep_solve_work_size((uint32_t)i->count) + records_size(env, i);
    i->memory = i->on_heap ? malloc(size) : prep_arena_take(env->arena, size);
    return i->memory != NULL;
}

/* The same for a part that comes alone: it may be larger than the arena, and better too much memory
 * than none. */
static bool take_memory_anyhow(const prep_pass_env *env, item *i, mospt_err *err)
{
    if (take_memory(env, i)) return true;
    i->on_heap = true;
    return take_memory(env, i) || mospt_err_nomem(err, (size_t)i->count);
}

/* Gives back all that a part holds. */
static void fini_item(const prep_pass_env *env, item *i)
{
    if (i->on_heap) free(i->memory);
    else prep_arena_give(env->arena, i->memory);
    for (uint32_t s = 0; i->blocks != NULL && s < i->part->spool_count; s++)
        prep_spool_drop(env->store, i->part->spools[s]);
    prep_subtree_fini(&i->made);
    free(i->blocks);
    i->memory = NULL, i->blocks = NULL;
}

/* Makes the records of a part addressable: `to` is for those that do not stand in memory. */
static bool collect_records(const prep_pass_env *env, item *i, uint8_t *to, mospt_err *err)
{
    const prep_finish_part *part = i->part;
    uint32_t block_count = part->is_node ? 1 : part->spools[0]->block_count;
    size_t stride = mospt_record_size(env->shape->schema);
    i->blocks = malloc(block_count * sizeof *i->blocks);
    if (i->blocks == NULL) return mospt_err_nomem(err, block_count * sizeof *i->blocks);
    i->records = (mospt_records){.blocks = i->blocks, .stride = stride};
    if (!part->is_node) {
        i->records.shift = prep_store_block_shift(env->store);
        return prep_spool_view(env->store, part->spools[0], to, i->blocks, err);
    }
    i->records.shift = MOSPT_RECORDS_ONE_BLOCK;
    i->blocks[0] = to;
    for (uint32_t s = 0; s < part->spool_count; s++) {
        size_t size = (size_t)part->spools[s]->count * stride;
        if (!prep_spool_take(env->store, part->spools[s], to, err)) return false;
        to += size;
    }
    return true;
}

static bool solve_item(const prep_pass_env *env, item *i, mospt_err *err)
{
    const prep_finish_part *part = i->part;
    uint32_t count = (uint32_t)i->count;
    if (i->solving != NULL) return prep_solving_piece(i->solving, i->piece, &i->made, err);
    if (!check_kept(env, i, err)) return false;
    if (i->kept != MOSPT_NO_NODE)
        return prep_resume_list(env->resume, i->kept, !part->is_node, &i->made, err);
    if (!collect_records(env, i, (uint8_t *)i->memory + prep_solve_work_size(count), err))
        return false;
    if (part->is_node)
        return prep_solve_node(env->shape, part->corner, part->level, part->child_mask, &i->records,
                               count, i->memory, &i->made, err);
    return prep_solve(env->shape, part->corner, part->level, &i->records, count, i->memory,
                      &i->made, err);
}

/* Under the lock: gives places to the nodes of all that is solved and follows what has its place.
 */
static bool place_solved(line *l, mospt_err *err)
{
    for (; l->next_to_place < l->item_count && l->items[l->next_to_place].is_solved;
         l->next_to_place++) {
        item *i = &l->items[l->next_to_place];
        for (uint32_t n = 0; n < i->made.node_count; n++) {
            uint32_t index;
            mospt_node *node = &i->made.nodes[n].node;
            uint64_t offset = node->payload_offset;
            if (!mospt_writer_place(l->env->writer, node, &index, err)) return false;
            if (i->kept != MOSPT_NO_NODE && node->payload_offset != offset)
                return mospt_err_set(err, MOSPT_EFORMAT, mospt_nowhere(),
                                     "what an interrupted build has left does not fit; remove the "
                                     "unfinished dataset to start anew");
            if (n == 0) i->first_index = index;
        }
    }
    return true;
}

static void drop_buffer(buffer *b)
{
    prep_pages_give(b->memory, b->size);
    *b = (buffer){0};
}

static bool emit_node(const line *l, item *i, uint32_t n, buffer *b, uint64_t *hash, mospt_err *err)
{
    const prep_pass_env *env = l->env;
    if (i->kept != MOSPT_NO_NODE) {
        *hash = prep_resume_points_hash(env->resume, i->made.nodes[n].first);
        return true;
    }
    size_t size = prep_solve_emit_size(env->shape, i->made.nodes[n].node.count);
    if (size > b->size) {
        drop_buffer(b);
        /* What is not touched takes no room. */
        if (size < l->buffer_kept) size = l->buffer_kept;
        b->memory = prep_pages_take(size);
        if (b->memory == NULL) return mospt_err_nomem(err, size);
        b->size = size;
    }
    *hash = prep_solve_emit(env->shape, &i->records, &i->made, n, b->memory);
    bool ok = mospt_writer_write(env->writer, &i->made.nodes[n].node, b->memory, err);
    if (b->size > l->buffer_kept) drop_buffer(b);
    return ok;
}

/* Under the lock: the account of a node that is written. */
static bool settle_node(line *l, item *i, uint32_t n, uint64_t hash, mospt_err *err)
{
    mospt_writer_complete(l->env->writer, i->first_index + n, &i->made.nodes[n].node, hash);
    if (++i->nodes_done == i->made.node_count) {
        l->in_flight--;
        fini_item(l->env, i);
    }
    return report_progress(l->env, err);
}

/* Under the lock: the part whose nodes come next, if there is one. */
static item *next_to_emit(line *l)
{
    while (l->next_to_emit < l->next_to_place) {
        item *i = &l->items[l->next_to_emit];
        if (i->nodes_taken < i->made.node_count) return i;
        l->next_to_emit++;
    }
    return NULL;
}

/* Under the lock: the next part to be solved, if there is memory for it. They are taken in order,
 * so the first one in flight can always be placed and written, and makes room for those after it.
 */
static item *next_to_solve(line *l)
{
    if (l->next_to_solve == l->item_count) return NULL;
    item *i = &l->items[l->next_to_solve];
    bool alone = l->in_flight == 0,
         taken = alone ? take_memory_anyhow(l->env, i, &l->err) : take_memory(l->env, i);
    l->failed = l->failed || (alone && !taken);
    if (!taken) return NULL;
    l->in_flight++;
    l->next_to_solve++;
    return i;
}

/* Under the lock; does one step without it. Returns false when nothing is left to be done. */
static bool step(line *l, buffer *b, mospt_err *err, bool *ok)
{
    /* Parts are solved ahead, so that while one thread is busy with a large one there are nodes to
     * be made for the others. */
    bool ahead = l->in_flight > l->threads;
    item *i = ahead ? next_to_emit(l) : NULL, *solving = i == NULL ? next_to_solve(l) : NULL;
    if (i == NULL && solving == NULL) i = next_to_emit(l);
    if (i != NULL) {
        uint32_t n = i->nodes_taken++;
        uint64_t hash = 0;
        pthread_mutex_unlock(&l->lock);
        *ok = emit_node(l, i, n, b, &hash, err);
        pthread_mutex_lock(&l->lock);
        *ok = *ok && settle_node(l, i, n, hash, err);
    } else if (solving != NULL) {
        pthread_mutex_unlock(&l->lock);
        *ok = solve_item(l->env, solving, err);
        pthread_mutex_lock(&l->lock);
        solving->is_solved = *ok;
        *ok = *ok && place_solved(l, err);
    } else if (l->next_to_emit < l->item_count && !l->failed) {
        pthread_cond_wait(&l->change, &l->lock);
        return true;
    } else {
        return false;
    }
    pthread_cond_broadcast(&l->change);
    return true;
}

/* Job: one thread's share. */
static void work_on_line(void *context, uint32_t thread)
{
    line *l = context;
    buffer b = {0};
    (void)thread;
    pthread_mutex_lock(&l->lock);
    for (bool more = true; more && !l->failed;) {
        mospt_err err = {0};
        bool ok = true;
        more = step(l, &b, &err, &ok);
        if (ok || l->failed) continue;
        l->failed = true;
        l->err = err;
    }
    pthread_cond_broadcast(&l->change);
    pthread_mutex_unlock(&l->lock);
    drop_buffer(&b);
}

/* Takes over the items. */
static bool run_line(const prep_pass_env *env, item *items, uint32_t item_count, mospt_err *err)
{
    uint32_t threads = prep_workers_count(env->workers);
    if (threads > env->emit_memory / PREP_FINISH_BUFFER_MIN)
        threads = (uint32_t)(env->emit_memory / PREP_FINISH_BUFFER_MIN);
    if (threads == 0) threads = 1;
    size_t share = env->emit_memory / threads;
    line l = {.env = env,
              .items = items,
              .item_count = item_count,
              .threads = threads,
              .buffer_kept = share < BUFFER_KEPT_MAX ? share : BUFFER_KEPT_MAX};
    pthread_mutex_init(&l.lock, NULL);
    pthread_cond_init(&l.change, NULL);
    prep_workers_run(env->workers, threads, work_on_line, &l);
    pthread_cond_destroy(&l.change);
    pthread_mutex_destroy(&l.lock);
    for (uint32_t i = 0; i < item_count; i++)
        fini_item(env, &items[i]);
    free(items);
    if (l.failed && err != NULL) *err = l.err;
    return !l.failed;
}

static bool finish_in_memory(const prep_pass_env *env, const prep_finish_part *parts,
                             uint32_t part_count, mospt_err *err)
{
    if (part_count == 0) return true;
    item *items = calloc(part_count, sizeof *items);
    if (items == NULL) return mospt_err_nomem(err, part_count * sizeof *items);
    for (uint32_t i = 0; i < part_count; i++)
        items[i] = (item){
            .part = &parts[i], .count = count_of(&parts[i]), .kept = find_kept(env, &parts[i])};
    return run_line(env, items, part_count, err);
}

static bool finish_pieces(const prep_pass_env *env, const item *whole, const prep_solving *solving,
                          mospt_err *err)
{
    uint32_t count = prep_solving_pieces(solving);
    item *items = calloc(count, sizeof *items);
    if (items == NULL) return mospt_err_nomem(err, count * sizeof *items);
    for (uint32_t i = 0; i < count; i++)
        items[i] = (item){.part = whole->part,
                          .kept = MOSPT_NO_NODE,
                          .solving = solving,
                          .piece = i,
                          .records = whole->records};
    return run_line(env, items, count, err);
}

/* All threads begin with it together. It comes alone, and piece by piece. */
static bool finish_shared(const prep_pass_env *env, const prep_finish_part *part, mospt_err *err)
{
    item i = {.part = part, .count = count_of(part), .kept = MOSPT_NO_NODE};
    uint32_t count = (uint32_t)i.count;
    prep_solving *solving = NULL;
    if (!take_memory_anyhow(env, &i, err)) return false;
    bool ok = check_kept(env, &i, err) &&
              collect_records(env, &i, (uint8_t *)i.memory + prep_solve_work_size(count), err) &&
              prep_solving_begin(env->shape, env->workers, part->corner, part->level, &i.records,
                                 count, i.memory, &solving, err) &&
              finish_pieces(env, &i, solving, err);
    prep_solving_end(solving);
    fini_item(env, &i);
    return ok;
}

/* What comes of a large part is needed before what waits behind it: as much of that goes to the
 * disk as the large part has there, so that its points are not written a second time. */
static bool make_room(const prep_pass_env *env, const prep_finish_list *list, uint32_t large,
                      mospt_err *err)
{
    const prep_finish_part *part = &list->parts[large];
    size_t size = 0;
    for (uint32_t s = 0; s < part->spool_count; s++)
        size += prep_spool_size_on_disk(env->store, part->spools[s]);
    for (uint32_t i = list->part_count; i-- > large + 1;)
        for (uint32_t s = 0; s < list->parts[i].spool_count; s++)
            if (!prep_spool_make_room(env->store, list->parts[i].spools[s], size, err))
                return false;
    return true;
}

/* A rejection file that is too large for memory is the input of a pass of its own. */
static bool finish_large(const prep_pass_env *env, const prep_finish_part *part, mospt_err *err)
{
    prep_pass *pass = NULL;
    prep_arena_clear(env->arena);
    if (part->is_node) return prep_large_node(env, part, err);
    if (!prep_pass_begin(env, part->corner, part->level, &pass, err)) return false;
    if (prep_feed_spool(env, pass, part->spools[0], err)) return prep_pass_end(pass, err);
    prep_pass_abandon(pass);
    return false;
}

bool prep_finish(const prep_pass_env *env, const prep_finish_list *list, mospt_err *err)
{
    uint32_t begin = 0;
    for (uint32_t i = 0; i < list->part_count; i++) {
        const prep_finish_part *part = &list->parts[i];
        uint64_t count = count_of(part);
        bool is_large = count > env->solve_points &&
                        !(part->is_node && env->shape->inner_depth == MOSPT_DEPTH_MIN),
             is_shared = !part->is_node && count >= SHARED_MIN;
        if ((!is_large && !is_shared) || find_kept(env, part) != MOSPT_NO_NODE) continue;
        if (!finish_in_memory(env, list->parts + begin, i - begin, err)) return false;
        if (is_large && (!make_room(env, list, i, err) || !finish_large(env, part, err)))
            return false;
        if (!is_large && !finish_shared(env, part, err)) return false;
        begin = i + 1;
    }
    return finish_in_memory(env, list->parts + begin, list->part_count - begin, err);
}

/* Makes one node of a pile and writes it.
 * work     for solving and for the payload */
static bool finish_pile_node(const prep_pass_env *env, const uint32_t corner[3], uint32_t level,
                             bool more, const uint8_t *records, uint32_t count, void *work,
                             mospt_err *err)
{
    prep_subtree made = {0};
    uint32_t index;
    mospt_records all = {.blocks = &records,
                         .stride = mospt_record_size(env->shape->schema),
                         .shift = MOSPT_RECORDS_ONE_BLOCK};
    void *payload = (uint8_t *)work + prep_solve_work_size(count);
    if (!prep_solve_node(env->shape, corner, level, more ? 1 : 0, &all, count, work, &made, err))
        return false;
    mospt_node *node = &made.nodes[0].node;
    bool ok = mospt_writer_place(env->writer, node, &index, err);
    if (ok) {
        uint64_t hash = prep_solve_emit(env->shape, &all, &made, 0, payload);
        ok = mospt_writer_write(env->writer, node, payload, err);
        if (ok) mospt_writer_complete(env->writer, index, node, hash);
        ok = ok && report_progress(env, err);
    }
    prep_subtree_fini(&made);
    return ok;
}

bool prep_finish_pile(const prep_pass_env *env, prep_spool *spool, const uint32_t corner[3],
                      uint32_t level, mospt_err *err)
{
    size_t stride = mospt_record_size(env->shape->schema);
    uint32_t block_count = spool->block_count, filled = 0, n;
    uint32_t of_node = prep_pile_points(stride), most = of_node + env->shape->add_threshold,
             room = most + (1u << prep_store_block_shift(env->store));
    uint64_t left = spool->count;
    bool ok = true;
    uint8_t *records = malloc(room * stride);
    /* For any count up to the most: both sizes grow with it. */
    void *work = malloc(prep_solve_work_size(most) + prep_solve_emit_size(env->shape, most));
    if (records == NULL || work == NULL) ok = mospt_err_nomem(err, prep_finish_size(stride, most));
    for (uint32_t i = 0; ok && left > 0;) {
        while (ok && i < block_count && filled < most) {
            ok = prep_spool_take_block(env->store, spool, i++, records + filled * stride, &n, err);
            filled += n;
        }
        /* As prep_solve() does: a rest below the threshold is added to the last node. */
        bool more = left > of_node && left - of_node >= env->shape->add_threshold;
        uint32_t count = more ? of_node : (uint32_t)left;
        ok = ok && finish_pile_node(env, corner, level, more, records, count, work, err);
        memmove(records, records + count * stride, (filled - count) * stride);
        filled -= count, left -= count, level++;
    }
    prep_spool_drop(env->store, spool);
    free(records), free(work);
    return ok;
}
