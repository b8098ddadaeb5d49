/* The division of memory: never more than was given, and always enough of each part to work. */
#include "tests/core_tools.h"

#include "preprocess/finish.h"
#include "preprocess/plan.h"

#include <stdio.h>
#include <string.h>

static const uint64_t MIB = UINT64_C(1) << 20;

/* A node has at most a point in each finest cell and less than the threshold more in each octant,
 * or is a pile; no more points are made into payloads than are being finished. */
static uint64_t emit_points(const prep_plan *p, size_t record_size, uint32_t depth,
                            uint32_t threads)
{
    uint64_t cells = UINT64_C(1) << 3 * depth,
             pile = prep_pile_points(record_size) + prep_add_threshold(record_size),
             node = cells + 8 * prep_add_threshold(record_size), all;
    all = threads * (node > pile ? node : pile);
    return all < p->solve_points ? all : p->solve_points;
}

static void check_plan(const prep_plan *p, uint64_t memory, size_t record_size, uint32_t depth,
                       uint32_t threads)
{
    uint64_t buckets = UINT64_C(1) << 3 * p->levels;
    assert_in_range(p->levels, 1, PREP_PASS_LEVELS_MAX);
    assert_true(p->levels <= depth);
    assert_true(3 * (p->levels + depth - 1) <= 32); /* codes of a pass are 32 bits */
    assert_true(p->batch_slices > 0 && p->block_size > 0 && p->solve_memory > 0);
    assert_true(p->solve_points * prep_finish_size(record_size, 1) <= p->solve_memory);
    uint64_t store = buckets * (p->levels + 1) * p->block_size + p->store_memory;
    uint64_t in_pass = prep_pass_cells_size(p->levels, depth) +
                       (uint64_t)p->batch_slices * p->slice_points * 2 * record_size;
    uint64_t in_finish =
        p->solve_memory +
        prep_finish_emit_size(record_size, emit_points(p, record_size, depth, threads));
    assert_true(store + in_pass <= memory);
    assert_true(store + in_finish <= memory);
}

static void parts_never_sum_to_more_than_was_given(void **state)
{
    uint32_t made = 0;
    (void)state;
    for (uint64_t memory = 32 * MIB; memory <= 512 * 1024 * MIB; memory = memory * 5 / 4)
        for (uint32_t depth = MOSPT_DEPTH_MIN; depth <= MOSPT_DEPTH_MAX; depth++)
            for (size_t record = 16; record <= 16 + MOSPT_ROW_SIZE_MAX;
                 record = record * 3 / 2 + 1) {
                prep_plan plan;
                mospt_err err = {0};
                uint32_t threads = 1 + made % 40;
                if (!prep_plan_make(memory, record, depth, threads, &plan, &err)) {
                    assert_int_equal(err.code, MOSPT_EINVAL);
                    assert_true(memory < 2048 * MIB);
                    continue;
                }
                check_plan(&plan, memory, record, depth, threads);
                made++;
            }
    assert_true(made > 1000);
}

static void the_least_memory_is_enough_for_usual_points(void **state)
{
    (void)state;
    for (uint32_t depth = MOSPT_DEPTH_MIN; depth <= 7; depth++)
        for (size_t record = 18; record <= 1024; record += 1 + record / 4) {
            prep_plan plan;
            mospt_err err = {0};
            CORE_NEED(prep_plan_make(PREP_MEMORY_MIN_MIB * MIB, record, depth, 2, &plan, &err));
            check_plan(&plan, PREP_MEMORY_MIN_MIB * MIB, record, depth, 2);
            CORE_FAILS(prep_plan_make(PREP_MEMORY_MIN_MIB * MIB - 1, record, depth, 2, &plan, &err),
                       MOSPT_EINVAL);
        }
}

static void too_little_memory_is_refused_with_an_amount_that_would_do(void **state)
{
    (void)state;
    for (uint32_t depth = MOSPT_DEPTH_MIN; depth <= MOSPT_DEPTH_MAX; depth++)
        for (size_t record = 18; record <= 16 + MOSPT_ROW_SIZE_MAX; record = record * 2) {
            prep_plan plan;
            mospt_err err = {0};
            uint64_t memory = MIB;
            unsigned asked = 0;
            /* Whoever does as told gets there within a few steps. */
            while (!prep_plan_make(memory, record, depth, 2, &plan, &err)) {
                unsigned long long least;
                const char *at = strstr(err.message, "at least ");
                assert_non_null(at);
                assert_int_equal(sscanf(at, "at least %llu MiB", &least), 1);
                assert_true(least * MIB > memory);
                memory = least * MIB;
                assert_true(++asked < 20);
            }
            check_plan(&plan, memory, record, depth, 2);
        }
}

static void a_block_of_a_spool_fits_a_slice(void **state)
{
    /* finish_large() fills slices with whole blocks. */
    (void)state;
    for (uint64_t memory = 64 * MIB; memory <= 64 * 1024 * MIB; memory *= 2)
        for (uint32_t depth = 1; depth <= MOSPT_DEPTH_MAX; depth++)
            for (size_t record = 16; record < 16 + MOSPT_ROW_SIZE_MAX; record += record / 16) {
                prep_plan plan;
                if (prep_plan_make(memory, record, depth, 2, &plan, NULL))
                    assert_true(plan.block_size / record <= plan.slice_points);
            }
}

static void what_is_solved_has_most_of_the_memory_for_finishing(void **state)
{
    /* Payloads take more than twice their size, but are made one node a thread at a time. */
    prep_plan plan;
    (void)state;
    assert_true(prep_plan_make(1024 * MIB, 34, 6, 2, &plan, NULL));
    assert_true(plan.solve_memory > 300 * MIB && plan.store_memory > 300 * MIB);
    assert_true(prep_plan_make(6144 * MIB, 34, 6, 2, &plan, NULL));
    assert_true(plan.store_memory > 4096 * MIB);
}

static void the_machine_has_memory(void **state)
{
    (void)state;
    assert_true(prep_plan_machine_memory() > 16 * MIB);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parts_never_sum_to_more_than_was_given),
        cmocka_unit_test(the_least_memory_is_enough_for_usual_points),
        cmocka_unit_test(too_little_memory_is_refused_with_an_amount_that_would_do),
        cmocka_unit_test(a_block_of_a_spool_fits_a_slice),
        cmocka_unit_test(what_is_solved_has_most_of_the_memory_for_finishing),
        cmocka_unit_test(the_machine_has_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
