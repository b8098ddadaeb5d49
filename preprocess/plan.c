#include "preprocess/plan.h"

#include "mospt/sink.h"
#include "preprocess/finish.h"

#include <unistd.h>

/* The program, its libraries and stacks (6 MiB where a file has one point), the buffers of the
 * readers, and what the allocator keeps. */
static const uint64_t FIXED_SIZE = UINT64_C(24) << 20;
/* Blocks are large enough for a disk, and small enough that thousands of spools with a few points
 * each waste little. */
enum { BLOCK_MIN = 4 << 10, BLOCK_MAX = 64 << 10, SLICES_MAX = 16 };
/* Rejection files of more points are cut by another pass, which all threads share. */
enum { SOLVE_POINTS_MAX = 1 << 24 };

uint64_t prep_plan_machine_memory(void)
{
    return (uint64_t)sysconf(_SC_PHYS_PAGES) * (uint64_t)sysconf(_SC_PAGESIZE);
}

/* Spools that are being filled at the same time in a pass: accepted points of each level, and the
 * rejected. */
static uint64_t open_spools(uint32_t levels)
{
    return (UINT64_C(1) << 3 * levels) * (levels + 1);
}

/* Bytes of a slice in the two batches of a pass and the four of the readers. */
static uint64_t slice_size(size_t record_size, uint32_t points)
{
    return points * (2 * (record_size + 6) + 4 * (record_size + 32));
}

/* Points of all nodes whose payloads are made at a time: a node has one in each of its finest
 * cells, and less than the threshold more in each octant; or it is a pile. */
static uint64_t emitted_points(uint32_t inner_depth, size_t record_size, uint32_t threads)
{
    uint64_t node = UINT64_C(1) << 3 * inner_depth, pile = prep_pile_points(record_size);
    if (node < pile) node = pile;
    return threads * (node + 8 * prep_add_threshold(record_size));
}

/* What a pass holds while it is fed, and the chunks of the writer.
 * returns  bytes of a slice in all batches */
static uint64_t plan_pass(uint64_t memory, size_t record_size, uint32_t inner_depth,
                          prep_plan *plan)
{
    uint64_t block_min = PREP_BLOCK_RECORDS_MIN * record_size;
    if (block_min < BLOCK_MIN) block_min = BLOCK_MIN;
    plan->levels = inner_depth < PREP_PASS_LEVELS_MAX ? inner_depth : PREP_PASS_LEVELS_MAX;
    /* Codes of a pass are 32 bits. */
    while (plan->levels > 1 && 3 * (plan->levels + inner_depth - 1) > 32)
        plan->levels--;
    while (plan->levels > 1 && (prep_pass_cells_size(plan->levels, inner_depth) > memory / 8 ||
                                open_spools(plan->levels) * block_min > memory / 8))
        plan->levels--;
    uint64_t spools = open_spools(plan->levels), block = memory / 8 / spools;
    if (block > BLOCK_MAX) block = BLOCK_MAX;
    if (block < block_min) block = block_min;
    plan->block_size = (size_t)block;
    plan->spools_size = (size_t)(spools * block);

    /* So few points a slice where they are wide that there are several. */
    plan->slice_points = PREP_PASS_SLICE_MAX;
    while (plan->slice_points > PREP_PASS_SLICE_MIN &&
           slice_size(record_size, plan->slice_points) > memory / 32)
        plan->slice_points /= 2;
    uint64_t slice = slice_size(record_size, plan->slice_points), slices = memory / 16 / slice;
    plan->batch_slices = (uint32_t)(slices < 1 ? 1 : slices > SLICES_MAX ? SLICES_MAX : slices);

    plan->chunk_size = MOSPT_SINK_CHUNK_MIN;
    while (plan->chunk_size < MOSPT_SINK_CHUNK_MAX && plan->chunk_size < memory / 1024)
        plan->chunk_size *= 2;
    return slice;
}

/* What rejection files that are being finished have, and what the store.
 * left        bytes for both
 * given_back  bytes that a pass had, which are there for the former on top */
static void plan_finish(uint64_t left, uint64_t given_back, size_t record_size, uint64_t emitted,
                        prep_plan *plan)
{
    /* While some of their points are being solved, as many may be on their way to the disk, or so
     * many as are in one node for each thread. */
    uint64_t share = left / 8, finish = 4 * share + given_back;
    size_t solve_size = prep_finish_size(record_size, 1),
           emit_size = prep_finish_emit_size(record_size, 1);
    plan->solve_points = finish / (solve_size + emit_size);
    if (plan->solve_points > emitted)
        plan->solve_points = (finish - emitted * emit_size) / solve_size;
    if (plan->solve_points > SOLVE_POINTS_MAX) plan->solve_points = SOLVE_POINTS_MAX;
    if (emitted > plan->solve_points) emitted = plan->solve_points;
    plan->solve_memory = (size_t)(plan->solve_points * solve_size);
    /* The rest keeps points from going to the disk. */
    plan->emit_memory = (size_t)(emitted * emit_size);
    finish = plan->solve_memory + plan->emit_memory;
    plan->store_memory = (size_t)(7 * share - (finish > given_back ? finish - given_back : 0));
}

bool prep_plan_make(uint64_t memory, size_t record_size, uint32_t inner_depth, uint32_t threads,
                    prep_plan *out, mospt_err *err)
{
    prep_plan plan = {0};
    uint64_t slice = plan_pass(memory, record_size, inner_depth, &plan);
    uint64_t given_back =
                 prep_pass_cells_size(plan.levels, inner_depth) + plan.batch_slices * slice,
             taken =
                 FIXED_SIZE + given_back + plan.spools_size + MOSPT_SINK_CHUNKS * plan.chunk_size,
             least = ((taken + (taken >> 3)) >> 20) + 1;
    if (memory < (uint64_t)PREP_MEMORY_MIN_MIB << 20 || memory < taken + (taken >> 3))
        return mospt_err_set(
            err, MOSPT_EINVAL, mospt_nowhere(),
            "a memory limit of %llu MiB is too little: at inner depth %u it takes at least %llu "
            "MiB",
            (unsigned long long)(memory >> 20), inner_depth,
            (unsigned long long)(least > PREP_MEMORY_MIN_MIB ? least : PREP_MEMORY_MIN_MIB));
    plan_finish(memory - taken, given_back, record_size,
                emitted_points(inner_depth, record_size, threads), &plan);
    *out = plan;
    return true;
}
