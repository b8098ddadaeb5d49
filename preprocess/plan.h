/* preprocess/plan.h - how the memory that the builder was given is divided. */
#pragma once
#include "mospt/err.h"

enum { PREP_MEMORY_MIN_MIB = 64 };

typedef struct {
    uint32_t levels;       /* of the outer octree that one pass fills */
    uint32_t slice_points; /* records of a slice */
    uint32_t batch_slices; /* of a batch */
    size_t block_size;     /* of spools, bytes, at most */
    size_t store_memory;   /* bytes of full blocks that stay in memory */
    size_t spools_size;    /* bytes of the blocks that a pass is filling, on top of that */
    size_t solve_memory;   /* bytes for rejection files being finished */
    size_t emit_memory;    /* bytes for the payloads that are being made of them */
    uint64_t solve_points; /* of a rejection file that is finished in one go, at most */
    size_t chunk_size;     /* in which payloads are written past the page cache */
} prep_plan;

/* Memory of this machine, bytes. */
uint64_t prep_plan_machine_memory(void);

/* Divides `memory` bytes, the peak of the whole process.
 * record_size  bytes of a point with its attributes
 * errors       MOSPT_EINVAL: too little, with the least that would do */
bool prep_plan_make(uint64_t memory, size_t record_size, uint32_t inner_depth, uint32_t threads,
                    prep_plan *out, mospt_err *err);
