#include "render/cpu/threads.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Rounds of a frame follow each other at once: to sleep in between and be woken takes longer than
 * that, and who is woken may be put on the processor of who wakes, instead of one that is idle. */
enum { THREADS_MAX = 256, SPIN_NS = 200000, SPINS_PER_LOOK = 32 };

typedef struct {
    rcpu_threads *threads;
    pthread_t thread;
    uint32_t number;
} worker;

struct rcpu_threads {
    uint32_t count;   /* with the caller */
    int64_t spin_ns;  /* 0 where there are more threads than processors */
    worker *workers;  /* [count], owned; the caller is number 0 */
    uint32_t made;    /* threads to join */
    atomic_uint next; /* the next job of the round */
    /* The last round that was begun, and that all invited workers have ended: they follow what is
     * under the lock, for those who wait without it. */
    atomic_uint begun_round, ended_round;
    pthread_mutex_t lock;
    pthread_cond_t begun, ended;
    /* Under the lock; what describes a round does not change while `busy` is above 0. */
    uint32_t round;
    uint32_t invited, busy; /* workers that shall take part in the round, and are not done */
    bool stop;
    uint32_t job_count;
    rcpu_job *job;
    void *user;
};

static void relax(void)
{
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    __asm__ volatile("yield");
#endif
}

static int64_t now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

/* Waits for a little while until the round is this one, or is not. */
static bool spin(const rcpu_threads *t, const atomic_uint *round, uint32_t value, bool is)
{
    for (int64_t end = now_ns() + t->spin_ns; now_ns() < end;)
        for (int i = 0; i < SPINS_PER_LOOK; i++, relax())
            if ((atomic_load_explicit(round, memory_order_acquire) == value) == is) return true;
    return false;
}

static void take_jobs(rcpu_threads *t, uint32_t number)
{
    for (uint32_t i;
         (i = atomic_fetch_add_explicit(&t->next, 1, memory_order_relaxed)) < t->job_count;)
        t->job(t->user, number, i);
}

static void *work(void *argument)
{
    worker *w = argument;
    rcpu_threads *t = w->threads;
    for (uint32_t seen = 0;;) {
        spin(t, &t->begun_round, seen, false);
        pthread_mutex_lock(&t->lock);
        while (!t->stop && t->round == seen)
            pthread_cond_wait(&t->begun, &t->lock);
        seen = t->round;
        bool stop = t->stop, is_invited = w->number < t->invited;
        pthread_mutex_unlock(&t->lock);
        if (stop) return NULL;
        if (!is_invited) continue;
        take_jobs(t, w->number);
        pthread_mutex_lock(&t->lock);
        bool is_last = --t->busy == 0;
        if (is_last) pthread_cond_signal(&t->ended);
        pthread_mutex_unlock(&t->lock);
        if (is_last) atomic_store_explicit(&t->ended_round, seen, memory_order_release);
    }
}

static uint32_t count_processors(void)
{
    cpu_set_t set;
    int count = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
    return (uint32_t)count;
}

bool rcpu_threads_create(uint32_t count, rcpu_threads **out, mospt_err *err)
{
    uint32_t processors = count_processors();
    if (count == 0) count = processors;
    if (count > THREADS_MAX) count = THREADS_MAX;
    rcpu_threads *t = calloc(1, sizeof *t);
    worker *workers = calloc(count, sizeof *workers);
    if (t == NULL || workers == NULL) {
        free(t), free(workers);
        return mospt_err_nomem(err, count * sizeof *workers);
    }
    t->count = count, t->workers = workers;
    t->spin_ns = count <= processors ? SPIN_NS : 0;
    pthread_mutex_init(&t->lock, NULL);
    pthread_cond_init(&t->begun, NULL);
    pthread_cond_init(&t->ended, NULL);
    for (uint32_t i = 1; i < count; i++) {
        workers[i] = (worker){.threads = t, .number = i};
        int failure = pthread_create(&workers[i].thread, NULL, work, &workers[i]);
        if (failure != 0) {
            rcpu_threads_destroy(t);
            return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                                 "thread %u of %u cannot be started: %s", i + 1, count,
                                 strerror(failure));
        }
        t->made++;
    }
    *out = t;
    return true;
}

void rcpu_threads_destroy(rcpu_threads *threads)
{
    if (threads == NULL) return;
    pthread_mutex_lock(&threads->lock);
    threads->stop = true;
    pthread_cond_broadcast(&threads->begun);
    pthread_mutex_unlock(&threads->lock);
    for (uint32_t i = 1; i <= threads->made; i++)
        pthread_join(threads->workers[i].thread, NULL);
    pthread_cond_destroy(&threads->begun);
    pthread_cond_destroy(&threads->ended);
    pthread_mutex_destroy(&threads->lock);
    free(threads->workers);
    free(threads);
}

uint32_t rcpu_threads_count(const rcpu_threads *threads)
{
    return threads->count;
}

void rcpu_threads_run(rcpu_threads *threads, uint32_t workers, uint32_t job_count, rcpu_job *job,
                      void *user)
{
    rcpu_threads *t = threads;
    if (workers == 0 || workers > t->count) workers = t->count;
    if (workers > job_count) workers = job_count;
    pthread_mutex_lock(&t->lock);
    t->job_count = job_count, t->job = job, t->user = user;
    atomic_store_explicit(&t->next, 0, memory_order_relaxed);
    if (workers > 1) {
        t->invited = workers, t->busy = workers - 1;
        t->round++;
        pthread_cond_broadcast(&t->begun);
    }
    pthread_mutex_unlock(&t->lock);
    if (workers > 1) atomic_store_explicit(&t->begun_round, t->round, memory_order_release);
    take_jobs(t, 0);
    if (workers <= 1 || spin(t, &t->ended_round, t->round, true)) return;
    pthread_mutex_lock(&t->lock);
    while (t->busy > 0)
        pthread_cond_wait(&t->ended, &t->lock);
    pthread_mutex_unlock(&t->lock);
}
