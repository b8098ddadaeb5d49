/* The order of one MOSPT against an octree of pointers, and the promises of a prefix. */
#include "tests/core_tools.h"
#include "tests/ref_mospt.h"

#include "mospt/deal.h"

#include "preprocess/sort.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    uint32_t *order;
    uint32_t level_end[MOSPT_LEVELS_MAX];
} built;

enum { INDEX_BITS = 16, CODE_LEVELS = 16 }; /* of a key */

/* code_levels   of the codes: `depth` of them or more */
static built build(const core_site *site, uint32_t depth, uint32_t code_levels)
{
    uint32_t n = site->count;
    built b = {.order = malloc((n + 1) * sizeof *b.order)};
    uint64_t *keys = malloc(2 * (n + 1) * sizeof *keys);
    void *work = malloc(mospt_linear_work_size(n) + 1);
    const uint8_t *blocks[] = {site->records};
    const mospt_records records = {
        .blocks = blocks, .stride = site->stride, .shift = MOSPT_RECORDS_ONE_BLOCK};
    const mospt_linear_input input = {.records = &records,
                                      .depth = depth,
                                      .index_bits = INDEX_BITS,
                                      .cell_shift = INDEX_BITS + 3 * (code_levels - depth)};
    assert_true(b.order != NULL && keys != NULL && work != NULL);
    for (uint32_t i = 0; i < n; i++) {
        mospt_vertex v = mospt_vertex_of(site->records + i * site->stride);
        keys[i] = mospt_cell_code(v.x, v.y, v.z, site->grid.bits, code_levels) << INDEX_BITS | i;
    }
    prep_sort_keys(keys, keys + n, n, INDEX_BITS);
    mospt_linear_build(&input, keys, n, work, b.order, b.level_end);
    free(keys), free(work);
    return b;
}

static void assert_like_twin(const core_site *site, uint32_t depth)
{
    ref_mospt *m = ref_mospt_create(depth, site->grid.bits, site->stride);
    const uint8_t **order = malloc((site->count + 1) * sizeof *order);
    uint32_t level_end[MOSPT_LEVELS_MAX];
    assert_non_null(order);
    for (uint32_t i = 0; i < site->count; i++)
        assert_true(ref_mospt_insert(m, site->records + i * site->stride, false));
    ref_mospt_finish(m, order, level_end);
    const uint32_t code_levels[] = {depth, depth + 3, CODE_LEVELS};
    for (int k = 0; k < 3; k++) {
        built b = build(site, depth, code_levels[k]);
        assert_memory_equal(b.level_end, level_end, (depth + 2) * sizeof level_end[0]);
        for (uint32_t i = 0; i < site->count; i++)
            assert_memory_equal(site->records + b.order[i] * site->stride, order[i], site->stride);
        free(b.order);
    }
    ref_mospt_destroy(m);
    free(order);
}

static void every_kind_of_points_is_ordered_like_the_octree_of_pointers(void **state)
{
    (void)state;
    for (int kind = 0; kind < CORE_KINDS; kind++)
        for (uint32_t depth = MOSPT_DEPTH_MIN; depth <= MOSPT_DEPTH_MAX; depth++) {
            core_site site;
            core_site_make((core_kind)kind, 12, 900, (uint64_t)kind * 100 + depth, &site);
            assert_like_twin(&site, depth);
            core_site_fini(&site);
        }
}

static void few_points_are_ordered_like_the_octree_of_pointers(void **state)
{
    (void)state;
    for (uint32_t count = 1; count < 20; count++)
        for (uint32_t depth = MOSPT_DEPTH_MIN; depth <= MOSPT_DEPTH_MAX; depth++) {
            core_site site;
            core_site_make((core_kind)(count % CORE_KINDS), 4, count, count, &site);
            assert_like_twin(&site, depth);
            core_site_fini(&site);
        }
}

static void
grids_coarser_or_finer_than_the_cells_are_ordered_like_the_octree_of_pointers(void **state)
{
    static const uint32_t bits[] = {0, 1, 2, 7, 8, 9, 10, 31, 32};
    (void)state;
    for (size_t k = 0; k < sizeof bits / sizeof bits[0]; k++)
        for (uint32_t depth = MOSPT_DEPTH_MIN; depth <= MOSPT_DEPTH_MAX; depth += 2) {
            core_site site;
            core_site_make(k % 2 ? CORE_UNIFORM : CORE_CLUSTERED, bits[k], 500, 77 + k, &site);
            assert_like_twin(&site, depth);
            core_site_fini(&site);
        }
}

static void order_of_arrival_does_not_show(void **state)
{
    uint64_t random = 5;
    (void)state;
    for (int kind = 0; kind < CORE_KINDS; kind++) {
        core_site site, shuffled;
        core_site_make((core_kind)kind, 6, 700, 9, &site);
        core_site_make((core_kind)kind, 6, 700, 9, &shuffled);
        for (uint32_t i = shuffled.count; i > 1; i--) {
            uint8_t swap[64], *a = shuffled.records + (i - 1) * site.stride,
                              *b = shuffled.records + core_below(&random, i) * site.stride;
            memcpy(swap, a, site.stride), memcpy(a, b, site.stride), memcpy(b, swap, site.stride);
        }
        built x = build(&site, 3, 3), y = build(&shuffled, 3, 3);
        assert_memory_equal(x.level_end, y.level_end, 5 * sizeof(uint32_t));
        for (uint32_t i = 0; i < site.count; i++)
            assert_memory_equal(site.records + x.order[i] * site.stride,
                                shuffled.records + y.order[i] * site.stride, site.stride);
        free(x.order), free(y.order);
        core_site_fini(&site), core_site_fini(&shuffled);
    }
}

static void each_prefix_holds_one_point_of_each_occupied_cell(void **state)
{
    enum { DEPTH = 4 };
    static uint8_t seen[1 << 3 * DEPTH], occupied[1 << 3 * DEPTH];
    (void)state;
    core_site site;
    core_site_make(CORE_CLUSTERED, 9, 3000, 4, &site);
    built b = build(&site, DEPTH, DEPTH);
    assert_int_equal(b.level_end[0], 1);
    assert_int_equal(b.level_end[DEPTH + 1], site.count);
    for (uint32_t level = 0; level <= DEPTH; level++) {
        memset(seen, 0, sizeof seen), memset(occupied, 0, sizeof occupied);
        for (uint32_t i = 0; i < site.count; i++) {
            mospt_vertex v = mospt_vertex_of(site.records + b.order[i] * site.stride);
            uint64_t cell = mospt_cell_code(v.x, v.y, v.z, site.grid.bits, level);
            occupied[cell] = 1;
            if (i < b.level_end[level]) assert_int_equal(seen[cell]++, 0);
        }
        assert_memory_equal(seen, occupied, sizeof seen);
    }
    free(b.order);
    core_site_fini(&site);
}

/* Of a level's points in a row along its Morton order, any prefix of the level holds its share, but
 * for one in each window of 16. */
static void each_part_of_a_level_is_spread_over_all_of_it(void **state)
{
    enum { COUNT = 1003, WINDOW = 16 };
    uint32_t place[COUNT];
    bool taken[COUNT] = {false};
    (void)state;
    mospt_deal deal = mospt_deal_of(COUNT);
    for (uint32_t k = 0; k < COUNT; k++) {
        place[k] = mospt_deal_place(&deal, k);
        assert_true(place[k] < COUNT && !taken[place[k]]);
        taken[place[k]] = true;
    }
    for (uint32_t prefix = 0; prefix <= COUNT; prefix++)
        for (uint32_t from = 0; from + WINDOW <= COUNT; from += WINDOW) {
            uint32_t in_prefix = 0;
            for (uint32_t k = from; k < from + WINDOW; k++)
                in_prefix += place[k] < prefix;
            assert_true(in_prefix * COUNT <= (prefix + COUNT / WINDOW + 1) * WINDOW);
            assert_true((in_prefix + 1) * COUNT >= prefix * WINDOW);
        }
}

static void representative_is_the_child_nearest_to_the_average_colour(void **state)
{
    /* Eight points in the eight octants; averages by hand: red 0 10 ... 70, mean 35: 30 and 40 tie,
     * the first one wins. */
    mospt_vertex v[8];
    core_site site = {
        .grid = {.step = 1, .bits = 1}, .stride = sizeof v[0], .count = 8, .records = (uint8_t *)v};
    (void)state;
    for (uint32_t i = 0; i < 8; i++)
        v[i] = (mospt_vertex){.x = i & 1, .y = i >> 1 & 1, .z = i >> 2, .r = (uint8_t)(10 * i)};
    built b = build(&site, 1, 1);
    assert_int_equal(b.level_end[0], 1);
    assert_int_equal(b.level_end[1], 8);
    assert_int_equal(b.order[0], 3);
    free(b.order);
    v[6].r = 36, v[0].r = 24; /* the mean stays 35 - 10/8 = 33.75; 36 is nearer than 30 */
    b = build(&site, 1, 1);
    assert_int_equal(b.order[0], 6);
    free(b.order);
}

static void prefix_is_the_first_level_fine_enough(void **state)
{
    const uint32_t end[] = {1, 5, 20, 60, 61};
    (void)state;
    assert_int_equal(mospt_linear_prefix(end, 3, 1, 1), 1);
    assert_int_equal(mospt_linear_prefix(end, 3, 0, 1), 1);
    assert_int_equal(mospt_linear_prefix(end, 3, 1.01f, 1), 5);
    assert_int_equal(mospt_linear_prefix(end, 3, 2, 1), 5);
    assert_int_equal(mospt_linear_prefix(end, 3, 8, 1), 60);
    assert_int_equal(mospt_linear_prefix(end, 3, 8.1f, 1), 61);
    assert_int_equal(mospt_linear_prefix(end, 3, 1e30f, 1), 61);
    assert_int_equal(mospt_linear_prefix(end, 3, 8, 2), 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_kind_of_points_is_ordered_like_the_octree_of_pointers),
        cmocka_unit_test(few_points_are_ordered_like_the_octree_of_pointers),
        cmocka_unit_test(
            grids_coarser_or_finer_than_the_cells_are_ordered_like_the_octree_of_pointers),
        cmocka_unit_test(order_of_arrival_does_not_show),
        cmocka_unit_test(each_prefix_holds_one_point_of_each_occupied_cell),
        cmocka_unit_test(each_part_of_a_level_is_spread_over_all_of_it),
        cmocka_unit_test(representative_is_the_child_nearest_to_the_average_colour),
        cmocka_unit_test(prefix_is_the_first_level_fine_enough),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
