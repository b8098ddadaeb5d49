#include "preprocess/ahead.h"

#include <pthread.h>
#include <sched.h>
#include <stdlib.h>

/* The block belongs to a thread while the slot is not ready, and to the reader while it is. */
typedef struct {
    void *block;               /* [task.block_size], owned */
    bool is_ready, has_failed; /* under the lock */
    mospt_err err;
} slot;

struct prep_ahead {
    prep_ahead_task task;
    uint32_t thread_count, slot_count;
    pthread_t *threads; /* [thread_count] */
    slot *slots;        /* [slot_count] */
    bool holds_block;   /* the reader looks at the block in its slot */

    pthread_mutex_t lock;
    pthread_cond_t work, ready; /* for the threads, for the reader */
    /* Under the lock: */
    uint64_t filled, read; /* blocks that were read from the file; that the reader has done with */
    bool is_filling, is_finished, stop;
};

uint32_t prep_ahead_thread_count(void)
{
    cpu_set_t set;
    int count = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
    if (count <= 1) return 0;
    return count < PREP_AHEAD_THREADS_MAX ? (uint32_t)count : PREP_AHEAD_THREADS_MAX;
}

static slot *slot_of(prep_ahead *a, uint64_t number)
{
    return &a->slots[number % a->slot_count];
}

/* Takes the next block from the file and works on it. Called, and returns, with the lock held. */
static void make_block(prep_ahead *a)
{
    slot *s = slot_of(a, a->filled);
    bool is_last = false;
    a->is_filling = true;
    pthread_mutex_unlock(&a->lock);
    bool ok = a->task.fill(a->task.context, s->block, &is_last, &s->err);

    pthread_mutex_lock(&a->lock);
    a->filled++;
    a->is_filling = false;
    a->is_finished = is_last || !ok;
    pthread_cond_broadcast(&a->work);
    pthread_mutex_unlock(&a->lock);
    ok = ok && a->task.work(a->task.context, s->block, &s->err);

    pthread_mutex_lock(&a->lock);
    s->has_failed = !ok;
    s->is_ready = true;
    pthread_cond_signal(&a->ready);
}

static void *run(void *argument)
{
    prep_ahead *a = argument;
    pthread_mutex_lock(&a->lock);
    while (!a->stop && !a->is_finished) {
        if (a->is_filling || a->filled - a->read >= a->slot_count)
            pthread_cond_wait(&a->work, &a->lock);
        else make_block(a);
    }
    pthread_mutex_unlock(&a->lock);
    return NULL;
}

bool prep_ahead_create(const prep_ahead_task *task, uint32_t thread_count, prep_ahead **out,
                       mospt_err *err)
{
    prep_ahead *a = calloc(1, sizeof *a);
    if (a == NULL) return mospt_err_nomem(err, sizeof *a);
    a->task = *task;
    a->slot_count = thread_count > 0
                        ? thread_count + 2
                        : 1; /* one with the reader, one for the next thread that is free */
    a->threads = calloc(thread_count + 1, sizeof *a->threads);
    a->slots = calloc(a->slot_count, sizeof *a->slots);
    pthread_mutex_init(&a->lock, NULL);
    pthread_cond_init(&a->work, NULL);
    pthread_cond_init(&a->ready, NULL);
    bool ok = a->threads != NULL && a->slots != NULL;
    for (uint32_t i = 0; ok && i < a->slot_count; i++) {
        a->slots[i].block = calloc(1, task->block_size);
        ok = a->slots[i].block != NULL;
    }
    if (!ok) {
        prep_ahead_destroy(a);
        return mospt_err_nomem(err, a->slot_count * task->block_size);
    }
    /* Fewer threads than asked for are no reason to fail. */
    while (a->thread_count < thread_count &&
           pthread_create(&a->threads[a->thread_count], NULL, run, a) == 0)
        a->thread_count++;
    *out = a;
    return true;
}

static void free_slots(prep_ahead *a)
{
    for (uint32_t i = 0; a->slots != NULL && i < a->slot_count; i++) {
        if (a->slots[i].block != NULL) a->task.fini(a->slots[i].block);
        free(a->slots[i].block);
    }
    free(a->slots);
}

void prep_ahead_destroy(prep_ahead *a)
{
    if (a == NULL) return;
    pthread_mutex_lock(&a->lock);
    a->stop = true;
    pthread_cond_broadcast(&a->work);
    pthread_mutex_unlock(&a->lock);
    for (uint32_t i = 0; i < a->thread_count; i++)
        pthread_join(a->threads[i], NULL);
    pthread_mutex_destroy(&a->lock);
    pthread_cond_destroy(&a->work);
    pthread_cond_destroy(&a->ready);
    free_slots(a);
    free(a->threads);
    free(a);
}

/* Gives the block that was looked at back. Under the lock. */
static void release_block(prep_ahead *a)
{
    if (!a->holds_block) return;
    slot_of(a, a->read)->is_ready = false;
    a->read++;
    a->holds_block = false;
    pthread_cond_broadcast(&a->work);
}

bool prep_ahead_next(prep_ahead *a, void **block, mospt_err *err)
{
    bool ok = true;
    *block = NULL;
    pthread_mutex_lock(&a->lock);
    release_block(a);
    if (!a->is_finished || a->read < a->filled) {
        slot *s = slot_of(a, a->read);
        if (a->thread_count == 0) make_block(a);
        while (!s->is_ready)
            pthread_cond_wait(&a->ready, &a->lock);
        a->holds_block = true;
        ok = !s->has_failed;
        if (ok) *block = s->block;
        else if (err != NULL) *err = s->err;
    }
    pthread_mutex_unlock(&a->lock);
    return ok;
}
