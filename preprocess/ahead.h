/* preprocess/ahead.h - blocks of one file, worked on by several threads a few ahead of whoever
 * reads them.
 *
 * Blocks are read one after the other by whichever thread is free (so that a stream that must be
 * unpacked in order needs no thread of its own), worked on at the same time, and handed out in the
 * order in which they were read. Without threads everything happens in prep_ahead_next(), with the
 * same results. */
#pragma once
#include "mospt/err.h"

enum { PREP_AHEAD_THREADS_MAX = 8 };

typedef struct {
    void *context;     /* borrowed; what all blocks need */
    size_t block_size; /* bytes of the caller's own struct, zeroed before its first use and then
                          used again */
    /* Reads the next block; one thread at a time. Not called again once it failed or said that this
     * was the last one. */
    bool (*fill)(void *context, void *block, bool *is_last, mospt_err *err);
    /* Works on a block that was filled; several threads at a time, each with its own block. */
    bool (*work)(const void *context, void *block, mospt_err *err);
    void (*fini)(void *block); /* frees what the struct owns */
} prep_ahead_task;

typedef struct prep_ahead prep_ahead; /* opaque; one thread at a time */

/* Threads that are worth having: one per processor that this process may use, at most
 * PREP_AHEAD_THREADS_MAX; 0 if there is only one. */
uint32_t prep_ahead_thread_count(void);

/* thread_count  0: none
 * threads       while they run, only fill() may touch what it reads from */
bool prep_ahead_create(const prep_ahead_task *task, uint32_t thread_count, prep_ahead **out,
                       mospt_err *err);
void prep_ahead_destroy(prep_ahead *ahead);

/* The next block.
 * block    out, the reader's until the next call; NULL behind the last one
 * errors   those of fill() and work(), when the reader comes to the block where they occurred */
bool prep_ahead_next(prep_ahead *ahead, void **block, mospt_err *err);
