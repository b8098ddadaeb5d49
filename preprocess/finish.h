/* preprocess/finish.h - what is done with the rejection files of a pass: from spools to nodes on
 * the disk.
 *
 * Files that fit in memory are finished by all workers at once; what they make is written in the
 * order of the parts, so that each payload file is in Morton order and the dataset the same
 * whatever the number of threads. */
#pragma once
#include "preprocess/pass.h"

typedef struct {
    prep_spool *spool; /* borrowed, not empty, sealed; empty afterwards */
    uint32_t corner[3], level;
} prep_finish_part;

/* Finishes all parts, in their order. */
bool prep_finish(const prep_pass_env *env, const prep_finish_part *parts, uint32_t part_count,
                 mospt_err *err);

/* Finishes a node that is one step wide: all points of the spool are at one position. */
bool prep_finish_pile(const prep_pass_env *env, prep_spool *spool, const uint32_t corner[3],
                      uint32_t level, mospt_err *err);

/* Writes nodes and payloads, and reports it. threads: one at a time */
bool prep_finish_write(const prep_pass_env *env, const prep_subtree *made, mospt_err *err);
