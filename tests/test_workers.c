/* Every job runs once, whatever the number of threads. */
#include "tests/core_tools.h"

#include "preprocess/workers.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

enum { JOBS_MAX = 5000 };

typedef struct {
    uint32_t ran[JOBS_MAX]; /* each touched by its own job only */
    atomic_uint total;
    pthread_mutex_t lock;
    pthread_cond_t met;
    uint32_t waiting, wanted;
} work;

static void count_job(void *context, uint32_t i)
{
    work *w = context;
    w->ran[i]++;
    atomic_fetch_add(&w->total, 1);
}

static void every_job_runs_once(void **state)
{
    static const uint32_t threads[] = {1, 2, 7}, jobs[] = {0, 1, 2, 6, 7, 8, JOBS_MAX};
    static work w;
    (void)state;
    for (int t = 0; t < 3; t++) {
        prep_workers *workers = NULL;
        mospt_err err = {0};
        CORE_NEED(prep_workers_create(threads[t], &workers, &err));
        assert_int_equal(prep_workers_count(workers), threads[t]);
        for (int j = 0; j < 7; j++) {
            w = (work){0};
            prep_workers_run(workers, jobs[j], count_job, &w);
            assert_int_equal(atomic_load(&w.total), jobs[j]);
            for (uint32_t i = 0; i < JOBS_MAX; i++)
                assert_int_equal(w.ran[i], i < jobs[j]);
        }
        prep_workers_destroy(workers);
    }
}

static void runs_follow_each_other_without_mixing(void **state)
{
    static work w;
    prep_workers *workers = NULL;
    mospt_err err = {0};
    (void)state;
    CORE_NEED(prep_workers_create(4, &workers, &err));
    w = (work){0};
    for (uint32_t run = 1; run <= 3000; run++) {
        prep_workers_run(workers, 5, count_job, &w);
        for (uint32_t i = 0; i < 5; i++)
            assert_int_equal(w.ran[i], run); /* what jobs wrote is seen after the run */
    }
    prep_workers_destroy(workers);
}

static void meet(void *context, uint32_t i)
{
    work *w = context;
    (void)i;
    pthread_mutex_lock(&w->lock);
    w->waiting++;
    pthread_cond_broadcast(&w->met);
    while (w->waiting < w->wanted)
        pthread_cond_wait(&w->met, &w->lock);
    pthread_mutex_unlock(&w->lock);
}

static void as_many_jobs_run_at_the_same_time_as_there_are_threads(void **state)
{
    work *w = calloc(1, sizeof *w);
    prep_workers *workers = NULL;
    mospt_err err = {0};
    (void)state;
    assert_non_null(w);
    w->wanted = 3;
    pthread_mutex_init(&w->lock, NULL);
    pthread_cond_init(&w->met, NULL);
    CORE_NEED(prep_workers_create(3, &workers, &err));
    alarm(60); /* a job that waits for ever is a failure */
    prep_workers_run(workers, 3, meet, w);
    alarm(0);
    assert_int_equal(w->waiting, 3);
    prep_workers_destroy(workers);
    pthread_mutex_destroy(&w->lock);
    pthread_cond_destroy(&w->met);
    free(w);
}

static void workers_that_never_ran_are_destroyed(void **state)
{
    (void)state;
    for (uint32_t n = 1; n < 50; n++) {
        prep_workers *workers = NULL;
        mospt_err err = {0};
        CORE_NEED(prep_workers_create(n % 8 + 1, &workers, &err));
        prep_workers_destroy(workers);
    }
    prep_workers_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_job_runs_once),
        cmocka_unit_test(runs_follow_each_other_without_mixing),
        cmocka_unit_test(as_many_jobs_run_at_the_same_time_as_there_are_threads),
        cmocka_unit_test(workers_that_never_ran_are_destroyed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
