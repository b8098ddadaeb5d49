/* preprocess/finish.h - what is done with what a pass has set aside: from spools to nodes on the
 * disk.
 *
 * What fits in memory is finished by all workers at once. Places in the dataset are given in the
 * order of the parts, so that each payload file is in Morton order and the dataset the same
 * whatever the number of threads; the payloads are then written in any order. */
#pragma once
#include "preprocess/pass.h"

typedef struct {
    prep_spool **spools; /* [spool_count], borrowed, sealed; empty afterwards */
    uint32_t spool_count;
    uint32_t corner[3], level;
    bool is_node; /* the points are those of one node; else one spool, a rejection file: of the node
                     and all below */
    uint8_t child_mask; /* of that node */
} prep_finish_part;

typedef struct {
    prep_finish_part *parts; /* [part_count] */
    uint32_t part_count;
    prep_spool **spools; /* of all parts */
    uint32_t spool_count;
} prep_finish_list;

/* Memory comes in huge pages, so that a thread takes this for payloads however small they are:
 * there are no more threads than env->emit_memory has room for. */
enum { PREP_FINISH_BUFFER_MIN = 2 << 20 };

/* Bytes of memory that finishing so many points in one go takes. */
size_t prep_finish_size(size_t record_size, uint64_t count);

/* Bytes of memory that making the payloads of so many points takes meanwhile. */
size_t prep_finish_emit_size(size_t record_size, uint64_t count);

/* Finishes all parts, in their order. */
bool prep_finish(const prep_pass_env *env, const prep_finish_list *list, mospt_err *err);

/* Finishes a node that is one step wide: all points of the spool are at one position. */
bool prep_finish_pile(const prep_pass_env *env, prep_spool *spool, const uint32_t corner[3],
                      uint32_t level, mospt_err *err);
