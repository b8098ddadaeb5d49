/* render/cpu/threads.h - threads that are made once and divide the work of a frame. */
#pragma once
#include "mospt/err.h"

typedef struct rcpu_threads rcpu_threads;

/* One job of several; worker counts from 0 to rcpu_threads_count() - 1, and no two jobs of one
 * worker run at the same time. */
typedef void rcpu_job(void *user, uint32_t worker, uint32_t job);

/* count    of threads, the caller's own included; 0: one per processor that this process may use
 * errors   MOSPT_ENOMEM, MOSPT_EIO */
bool rcpu_threads_create(uint32_t count, rcpu_threads **out, mospt_err *err);
void rcpu_threads_destroy(rcpu_threads *threads);
uint32_t rcpu_threads_count(const rcpu_threads *threads);

/* Runs jobs 0 to job_count - 1, in this order but several at once, and returns when all are done.
 * workers  at most so many take part; 0: all
 * threads  the one that created them */
void rcpu_threads_run(rcpu_threads *threads, uint32_t workers, uint32_t job_count, rcpu_job *job,
                      void *user);
