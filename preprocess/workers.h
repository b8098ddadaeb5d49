/* preprocess/workers.h - the builder's threads: the one place where they are made. */
#pragma once
#include "mospt/err.h"

typedef struct prep_workers prep_workers;

/* A job touches only what its index names; results cross when prep_workers_run() returns. */
typedef void (*prep_job)(void *context, uint32_t index);

/* thread_count  1 or more, the caller's thread included */
bool prep_workers_create(uint32_t thread_count, prep_workers **out, mospt_err *err);
void prep_workers_destroy(prep_workers *workers);
uint32_t prep_workers_count(const prep_workers *workers);

/* Calls job(context, 0) ... job(context, job_count - 1), in this order but at the same time, and
 * waits for all. threads  the creator's only */
void prep_workers_run(prep_workers *workers, uint32_t job_count, prep_job job, void *context);
