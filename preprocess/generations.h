/* preprocess/generations.h - commits what a build has finished so far, about once a second.
 *
 * A thread of its own waits for the disk, so that the others need not. Commits that take long come
 * further apart. */
#pragma once
#include "mospt/writer.h"

typedef struct prep_generations prep_generations;

/* writer, metadata  borrowed until prep_generations_stop(), see mospt_writer_commit_part(); nobody
 *                   changes the metadata
 * errors            MOSPT_ENOMEM, MOSPT_EIO: no thread could be started */
bool prep_generations_start(mospt_writer *writer, const mospt_metadata *metadata, uint64_t build,
                            prep_generations **out, mospt_err *err);

/* Waits for a commit that is under way. NULL is fine.
 * errors   of the first commit that failed: after it there were no more */
bool prep_generations_stop(prep_generations *generations, mospt_err *err);
