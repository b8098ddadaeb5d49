/* The subtree of points in memory against the literal builder of section 5.2. */
#include "tests/core_tools.h"
#include "tests/ref_tree.h"

#include "mospt/hash.h"

#include <stdlib.h>
#include <string.h>

/* Puts a record together again from the planes of a payload. */
static void unpack(const uint8_t *payload, uint32_t count, uint32_t i, uint8_t *record)
{
    const uint8_t *planes = payload + count * sizeof(mospt_vertex);
    memcpy(record, payload + i * sizeof(mospt_vertex), sizeof(mospt_vertex));
    memcpy(record + 16, planes + i * 2, 2);
    memcpy(record + 18, planes + count * 2 + i * 4, 4);
}

static void assert_like_twin(const core_site *site, uint32_t depth, uint32_t threshold)
{
    prep_shape shape = core_shape(site, depth, threshold);
    core_subtree made = core_solve(&shape, site);
    ref_tree tree;
    uint64_t at = 0;
    ref_tree_build(&shape, site, &tree);
    assert_int_equal(made.node_count, tree.count);
    assert_int_equal(made.point_count, site->count);
    assert_true(made.points_hash == mospt_hash_records(site->records, site->stride, site->count));
    for (uint32_t n = 0; n < tree.count; n++) {
        const mospt_node *node = &made.nodes[n];
        const ref_node *want = &tree.nodes[n];
        assert_memory_equal(node->corner, want->corner, sizeof want->corner);
        assert_int_equal(node->level, want->level);
        assert_int_equal(node->child_mask, want->child_mask);
        assert_int_equal(node->count, want->count);
        assert_memory_equal(node->level_end, want->level_end,
                            (depth + 2) * sizeof want->level_end[0]);
        assert_int_equal(node->payload_size, node->count * site->stride);
        const uint8_t *payload = made.payload + at;
        for (uint32_t i = 0; i < node->count; i++) {
            uint8_t record[64];
            unpack(payload, node->count, i, record);
            if (memcmp(record, want->points[i], site->stride) != 0)
                fail_msg("node %u, point %u", n, i);
        }
        assert_true(node->vertices_hash == mospt_hash(payload, node->count * sizeof(mospt_vertex)));
        assert_true(
            node->attributes_hash ==
            mospt_hash(payload + node->count * sizeof(mospt_vertex), node->count * (size_t)6));
        at += node->payload_size;
    }
    ref_tree_fini(&tree);
    core_subtree_fini(&made);
}

static void check(core_kind kind, uint32_t bits, uint32_t count, uint32_t depth, uint32_t threshold)
{
    core_site site;
    core_site_make(kind, bits, count, count + bits, &site);
    assert_like_twin(&site, depth, threshold);
    core_site_fini(&site);
}

static void every_kind_of_points_is_solved_as_section_5_2_says(void **state)
{
    (void)state;
    for (int kind = 0; kind < CORE_KINDS; kind++)
        for (uint32_t depth = MOSPT_DEPTH_MIN; depth <= MOSPT_DEPTH_MAX; depth++)
            check((core_kind)kind, 14, 2500, depth, depth < 4 ? 20 : 3);
}

static void grids_of_all_widths_are_solved_as_section_5_2_says(void **state)
{
    static const uint32_t bits[] = {0, 1, 2, 5, 20, 21, 22, 30, 31, 32};
    (void)state;
    for (size_t k = 0; k < sizeof bits / sizeof bits[0]; k++)
        for (uint32_t depth = 1; depth <= MOSPT_DEPTH_MAX; depth += 4) {
            check(CORE_UNIFORM, bits[k], 800, depth, 5);
            check(CORE_CLUSTERED, bits[k], 800, depth, 5);
            check(CORE_COPIES, bits[k], 800, depth, 5);
        }
}

static void threshold_decides_between_adding_and_rejecting(void **state)
{
    (void)state;
    static const uint32_t thresholds[] = {1, 2, 10, 100, 699, 700, 701, 100000};
    for (size_t k = 0; k < sizeof thresholds / sizeof thresholds[0]; k++) {
        check(CORE_CLUSTERED, 10, 1500, 2, thresholds[k]);
        /* At one position 700 of 701 points are rejected. */
        check(CORE_ONE_POSITION, 6, 701, 2, thresholds[k]);
    }
}

static void a_single_point_is_one_node(void **state)
{
    (void)state;
    for (uint32_t bits = 0; bits <= 32; bits++)
        check(CORE_UNIFORM, bits, 1, 7, PREP_ADD_THRESHOLD);
}

static void deep_trees_need_more_levels_than_one_code_holds(void **state)
{
    /* Points two by two at neighbouring steps: only the finest level tells them apart. */
    (void)state;
    core_site site;
    core_site_make(CORE_CLUSTERED, 32, 1200, 3, &site);
    for (uint32_t i = 0; i < site.count; i++) {
        mospt_vertex v = mospt_vertex_of(site.records + i * site.stride);
        v.x = 5 + i % 3, v.y = 9 + i % 2, v.z = 0x80000000 + (i & 1);
        memcpy(site.records + i * site.stride, &v, sizeof v);
    }
    assert_like_twin(&site, 1, 2);
    assert_like_twin(&site, 5, 2);
    core_site_fini(&site);
}

static void piles_are_cut_into_nodes_of_at_most_pile_max(void **state)
{
    static const uint32_t more[] = {100, 101}; /* one point is in the node above */
    (void)state;
    for (size_t k = 0; k < sizeof more / sizeof more[0]; k++)
        check(CORE_ONE_POSITION, 1, PREP_PILE_MAX + more[k], 3, 100);
    check(CORE_IDENTICAL, 0, PREP_PILE_MAX + 5000, 7, PREP_ADD_THRESHOLD);
}

static void nodes_of_piles_have_fewer_points_where_records_are_wide(void **state)
{
    (void)state;
    assert_int_equal(prep_pile_points(16), PREP_PILE_MAX);
    assert_int_equal(prep_pile_points(24), PREP_PILE_MAX);
    assert_int_equal(prep_pile_points(250), PREP_PILE_SIZE / 250);
    assert_int_equal(prep_pile_points(16 + MOSPT_ROW_SIZE_MAX), 383);
}

static void children_have_fewer_points_where_records_are_wide(void **state)
{
    (void)state;
    assert_int_equal(prep_add_threshold(16), PREP_ADD_THRESHOLD);
    assert_int_equal(prep_add_threshold(1024), PREP_ADD_THRESHOLD);
    assert_int_equal(prep_add_threshold(4096), 1024);
    assert_int_equal(prep_add_threshold(16 + MOSPT_ROW_SIZE_MAX), 255);
}

static void many_copies_of_few_points_are_solved(void **state)
{
    (void)state;
    check(CORE_COPIES, 32, 80000, 7, PREP_ADD_THRESHOLD);
}

/* Nodes and the points of each by the indices of their records. */
static void assert_same_division(const prep_subtree *a, const prep_subtree *b)
{
    assert_int_equal(a->node_count, b->node_count);
    assert_int_equal(a->index_bits, b->index_bits);
    for (uint32_t n = 0; n < a->node_count; n++) {
        const prep_solved *x = &a->nodes[n], *y = &b->nodes[n];
        assert_memory_equal(x->node.corner, y->node.corner, sizeof x->node.corner);
        assert_int_equal(x->node.level, y->node.level);
        assert_int_equal(x->node.child_mask, y->node.child_mask);
        assert_int_equal(x->node.count, y->node.count);
        assert_int_equal(x->first, y->first);
        assert_int_equal(x->cell_shift, y->cell_shift);
        assert_memory_equal(x->keys, y->keys, x->node.count * sizeof *x->keys);
    }
}

/* Last piece first: any order is right. */
static prep_subtree solve_pieces(const prep_solving *solving)
{
    uint32_t pieces = prep_solving_pieces(solving), count = 0;
    prep_subtree all = {0}, *made = calloc(pieces, sizeof *made);
    mospt_err err = {0};
    assert_non_null(made);
    for (uint32_t i = pieces; i-- > 0;) {
        CORE_NEED(prep_solving_piece(solving, i, &made[i], &err));
        count += made[i].node_count;
    }
    all.nodes = malloc(count * sizeof *all.nodes);
    assert_non_null(all.nodes);
    for (uint32_t i = 0; i < pieces; i++) {
        all.index_bits = made[i].index_bits;
        for (uint32_t n = 0; n < made[i].node_count; n++)
            all.nodes[all.node_count++] = made[i].nodes[n];
        prep_subtree_fini(&made[i]);
    }
    free(made);
    return all;
}

static void assert_shared_like_alone(core_kind kind, uint32_t bits, uint32_t count, uint32_t depth)
{
    core_site site;
    core_site_make(kind, bits, count, kind, &site);
    prep_shape shape = core_shape(&site, depth, PREP_ADD_THRESHOLD);
    const uint8_t *blocks[] = {site.records};
    const mospt_records records = {
        .blocks = blocks, .stride = site.stride, .shift = MOSPT_RECORDS_ONE_BLOCK};
    void *work = malloc(prep_solve_work_size(count)), *other = malloc(prep_solve_work_size(count));
    prep_subtree alone = {0};
    prep_solving *solving = NULL;
    mospt_err err = {0};
    assert_true(work != NULL && other != NULL);
    CORE_NEED(prep_solve(&shape, site.grid.root, 0, &records, count, work, &alone, &err));
    for (uint32_t threads = 1; threads <= 5; threads += 2) {
        prep_workers *workers = NULL;
        CORE_NEED(prep_workers_create(threads, &workers, &err));
        CORE_NEED(prep_solving_begin(&shape, workers, site.grid.root, 0, &records, count, other,
                                     &solving, &err));
        prep_subtree shared = solve_pieces(solving);
        assert_same_division(&alone, &shared);
        prep_subtree_fini(&shared);
        prep_solving_end(solving);
        prep_workers_destroy(workers);
    }
    prep_subtree_fini(&alone);
    free(work), free(other);
    core_site_fini(&site);
}

static void all_threads_together_solve_like_one(void **state)
{
    (void)state;
    for (int kind = 0; kind < CORE_KINDS; kind++)
        assert_shared_like_alone((core_kind)kind, 26, 700000, 6);
    assert_shared_like_alone(CORE_CLUSTERED, 12, 1000, 7); /* too few to divide */
    assert_shared_like_alone(CORE_CLUSTERED, 18, 600000, 1);
    assert_shared_like_alone(CORE_CLUSTERED, 5, 600000, 9); /* ends in piles */
}

static void one_node_is_made_of_all_the_points_given(void **state)
{
    (void)state;
    core_site site;
    core_site_make(CORE_CLUSTERED, 10, 500, 3, &site);
    prep_shape shape = core_shape(&site, 4, 100000); /* so that all octants add: the same node */
    core_subtree made = core_solve_node(&shape, &site), tree = core_solve(&shape, &site);
    assert_int_equal(made.node_count, 1);
    assert_int_equal(tree.node_count, 1);
    assert_memory_equal(made.nodes[0].level_end, tree.nodes[0].level_end, 6 * sizeof(uint32_t));
    assert_memory_equal(made.payload, tree.payload, site.count * site.stride);
    assert_true(made.points_hash == tree.points_hash);
    core_subtree_fini(&made), core_subtree_fini(&tree);
    core_site_fini(&site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_kind_of_points_is_solved_as_section_5_2_says),
        cmocka_unit_test(grids_of_all_widths_are_solved_as_section_5_2_says),
        cmocka_unit_test(threshold_decides_between_adding_and_rejecting),
        cmocka_unit_test(a_single_point_is_one_node),
        cmocka_unit_test(deep_trees_need_more_levels_than_one_code_holds),
        cmocka_unit_test(piles_are_cut_into_nodes_of_at_most_pile_max),
        cmocka_unit_test(nodes_of_piles_have_fewer_points_where_records_are_wide),
        cmocka_unit_test(children_have_fewer_points_where_records_are_wide),
        cmocka_unit_test(many_copies_of_few_points_are_solved),
        cmocka_unit_test(all_threads_together_solve_like_one),
        cmocka_unit_test(one_node_is_made_of_all_the_points_given),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
