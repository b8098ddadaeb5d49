#include "preprocess/workers.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

struct prep_workers {
    uint32_t helper_count;
    pthread_t *helpers; /* [helper_count] */

    pthread_mutex_t lock;
    pthread_cond_t start, finish;
    /* Under the lock: */
    uint64_t round; /* raised for every run */
    uint32_t busy;  /* helpers that have not finished this round */
    bool stop;
    /* Set under the lock before a round, read by all in it: */
    uint32_t job_count;
    prep_job job;
    void *context;
    atomic_uint next;
};

static void take_jobs(prep_workers *w)
{
    for (;;) {
        uint32_t i = atomic_fetch_add(&w->next, 1);
        if (i >= w->job_count) return;
        w->job(w->context, i);
    }
}

static void *help(void *argument)
{
    prep_workers *w = argument;
    uint64_t seen = 0;
    pthread_mutex_lock(&w->lock);
    for (;;) {
        while (w->round == seen && !w->stop)
            pthread_cond_wait(&w->start, &w->lock);
        if (w->stop) break;
        seen = w->round;
        pthread_mutex_unlock(&w->lock);
        take_jobs(w);
        pthread_mutex_lock(&w->lock);
        if (--w->busy == 0) pthread_cond_signal(&w->finish);
    }
    pthread_mutex_unlock(&w->lock);
    return NULL;
}

bool prep_workers_create(uint32_t thread_count, prep_workers **out, mospt_err *err)
{
    prep_workers *w = calloc(1, sizeof *w);
    if (w != NULL) w->helpers = calloc(thread_count, sizeof *w->helpers);
    if (w == NULL || w->helpers == NULL) {
        free(w);
        return mospt_err_nomem(err, sizeof *w);
    }
    pthread_mutex_init(&w->lock, NULL);
    pthread_cond_init(&w->start, NULL);
    pthread_cond_init(&w->finish, NULL);
    /* Fewer threads than asked for are no reason to fail. */
    while (w->helper_count + 1 < thread_count &&
           pthread_create(&w->helpers[w->helper_count], NULL, help, w) == 0)
        w->helper_count++;
    *out = w;
    return true;
}

void prep_workers_destroy(prep_workers *w)
{
    if (w == NULL) return;
    pthread_mutex_lock(&w->lock);
    w->stop = true;
    pthread_cond_broadcast(&w->start);
    pthread_mutex_unlock(&w->lock);
    for (uint32_t i = 0; i < w->helper_count; i++)
        pthread_join(w->helpers[i], NULL);
    pthread_mutex_destroy(&w->lock);
    pthread_cond_destroy(&w->start);
    pthread_cond_destroy(&w->finish);
    free(w->helpers);
    free(w);
}

uint32_t prep_workers_count(const prep_workers *workers)
{
    return workers->helper_count + 1;
}

void prep_workers_run(prep_workers *w, uint32_t job_count, prep_job job, void *context)
{
    if (job_count == 0) return;
    pthread_mutex_lock(&w->lock);
    w->job_count = job_count;
    w->job = job;
    w->context = context;
    atomic_store(&w->next, 0);
    w->busy = w->helper_count;
    w->round++;
    pthread_cond_broadcast(&w->start);
    pthread_mutex_unlock(&w->lock);
    take_jobs(w);
    pthread_mutex_lock(&w->lock);
    while (w->busy > 0)
        pthread_cond_wait(&w->finish, &w->lock);
    pthread_mutex_unlock(&w->lock);
}
