#include "preprocess/generations.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <time.h>

/* The coarse levels are done soon after the first pass; then each commit comes a little later after
 * the last one, down to one a second, so that of a short build, too, most is kept when it is
 * killed. Never do they take more than one part in REST of a processor. */
#define FIRST_SECONDS 0.06
#define GROWTH 1.25
#define SECONDS_MAX 1.0
enum { REST = 50 };

/* A disk takes as long for a flush as it has been given bytes since the last one, and nothing else
 * meanwhile. So it is given what is there, and flushed, all the time: no commit waits long, and
 * least of all the last one, when there is nothing else left to be done. Those who make nodes only
 * fill the page cache, since whoever gives a disk more while it is flushed waits. */
#define PAUSE_SECONDS 0.001

struct prep_generations {
    mospt_writer *writer;
    const mospt_metadata *metadata;
    uint64_t build;
    pthread_t thread;

    pthread_mutex_t lock;
    pthread_cond_t change;
    bool stops; /* under the lock */

    bool failed; /* of the thread, until it has ended */
    mospt_err err;
};

static double read_clock(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Returns false where the waiting is to end for good. */
static bool wait_until(prep_generations *g, double when)
{
    struct timespec t = {.tv_sec = (time_t)when};
    t.tv_nsec = (long)((when - (double)t.tv_sec) * 1e9);
    pthread_mutex_lock(&g->lock);
    for (int rc = 0; !g->stops && rc != ETIMEDOUT;)
        rc = pthread_cond_timedwait(&g->change, &g->lock, &t);
    bool goes_on = !g->stops;
    pthread_mutex_unlock(&g->lock);
    return goes_on;
}

static double now(void)
{
    return read_clock(CLOCK_MONOTONIC);
}

/* Returns false where that is to end for good, by a failure or because the build has ended. */
static bool flush_until(prep_generations *g, double when)
{
    while (!g->failed) {
        double next = now() + PAUSE_SECONDS;
        if (!wait_until(g, next < when ? next : when)) return false;
        if (now() >= when) return true;
        g->failed = !mospt_writer_flush(g->writer, &g->err);
    }
    return false;
}

static void *run(void *context)
{
    prep_generations *g = context;
    double interval = FIRST_SECONDS;
    while (!g->failed && flush_until(g, now() + interval)) {
        double start = read_clock(CLOCK_THREAD_CPUTIME_ID);
        g->failed = !mospt_writer_commit_part(g->writer, g->metadata, g->build, &g->err);
        double least = REST * (read_clock(CLOCK_THREAD_CPUTIME_ID) - start);
        interval = GROWTH * interval < SECONDS_MAX ? GROWTH * interval : SECONDS_MAX;
        if (interval < least) interval = least;
    }
    return NULL;
}

static void destroy(prep_generations *g)
{
    pthread_cond_destroy(&g->change);
    pthread_mutex_destroy(&g->lock);
    free(g);
}

bool prep_generations_start(mospt_writer *writer, const mospt_metadata *metadata, uint64_t build,
                            prep_generations **out, mospt_err *err)
{
    prep_generations *g = calloc(1, sizeof *g);
    pthread_condattr_t monotonic;
    if (g == NULL) return mospt_err_nomem(err, sizeof *g);
    *g = (prep_generations){.writer = writer, .metadata = metadata, .build = build};
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_mutex_init(&g->lock, NULL);
    pthread_cond_init(&g->change, &monotonic);
    pthread_condattr_destroy(&monotonic);
    if (pthread_create(&g->thread, NULL, run, g) != 0) {
        destroy(g);
        return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(), "no thread can be started");
    }
    *out = g;
    return true;
}

bool prep_generations_stop(prep_generations *g, mospt_err *err)
{
    if (g == NULL) return true;
    pthread_mutex_lock(&g->lock);
    g->stops = true;
    pthread_cond_signal(&g->change);
    pthread_mutex_unlock(&g->lock);
    pthread_join(g->thread, NULL);
    bool ok = !g->failed;
    if (!ok && err != NULL) *err = g->err;
    destroy(g);
    return ok;
}
