/* The outer octree: every field of every node is held against every other. */
#include "tests/core_tools.h"

#include "mospt/hash.h"
#include "mospt/hierarchy.h"

#include <stdlib.h>
#include <string.h>

enum { DEPTH = 3 };

static char *folder, *path;
static core_site site;
static mospt_hierarchy good;

static int set_up(void **state)
{
    mospt_err err = {0};
    (void)state;
    folder = core_folder_make();
    path = core_path(folder, "h.bin");
    core_site_make(CORE_CLUSTERED, 12, 3000, 8, &site);
    prep_shape shape = core_shape(&site, DEPTH, 20);
    core_subtree made = core_solve(&shape, &site);
    good = (mospt_hierarchy){.nodes = malloc(made.node_count * sizeof(mospt_node)),
                             .count = made.node_count,
                             .inner_depth = DEPTH,
                             .refinement = MOSPT_REFINE_ADD};
    assert_non_null(good.nodes);
    memcpy(good.nodes, made.nodes, made.node_count * sizeof(mospt_node));
    CORE_NEED(mospt_hierarchy_link(&good, &site.grid, &err));
    assert_true(good.count > 20 && good.nodes[good.count - 1].level > 2);
    assert_int_equal(good.point_count, site.count);
    core_subtree_fini(&made);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    mospt_hierarchy_fini(&good);
    core_site_fini(&site);
    core_folder_remove(folder);
    free(path);
    return 0;
}

static void what_is_written_is_read(void **state)
{
    mospt_hierarchy back;
    mospt_err err = {0};
    uint64_t size, hash;
    (void)state;
    CORE_NEED(mospt_hierarchy_write(&good, path, &size, &hash, &err));
    CORE_NEED(mospt_hierarchy_read(path, &site.grid, size, hash, &back, &err));
    assert_int_equal(back.count, good.count);
    assert_int_equal(back.inner_depth, good.inner_depth);
    assert_int_equal(back.point_count, good.point_count);
    assert_int_equal(back.refinement, good.refinement);
    assert_memory_equal(back.nodes, good.nodes, good.count * sizeof(mospt_node));
    mospt_hierarchy_fini(&back);
}

static void every_truncation_is_a_format_error(void **state)
{
    mospt_hierarchy back;
    mospt_err err = {0};
    uint64_t size, hash;
    size_t n;
    (void)state;
    CORE_NEED(mospt_hierarchy_write(&good, path, &size, &hash, &err));
    uint8_t *bytes = core_file_read(path, &n);
    for (size_t cut = 0; cut < n; cut += cut < 300 ? 1 : 97) {
        core_file_write(path, bytes, cut);
        CORE_FAILS(mospt_hierarchy_read(path, &site.grid, size, hash, &back, &err), MOSPT_EFORMAT);
        /* also if metadata.json agrees with what is left */
        CORE_FAILS(mospt_hierarchy_read(path, &site.grid, cut, mospt_hash(bytes, cut), &back, &err),
                   MOSPT_EFORMAT);
    }
    free(bytes);
}

static void every_header_byte_is_checked(void **state)
{
    mospt_hierarchy back;
    mospt_err err = {0};
    uint64_t size, hash;
    size_t n;
    (void)state;
    CORE_NEED(mospt_hierarchy_write(&good, path, &size, &hash, &err));
    uint8_t *bytes = core_file_read(path, &n);
    for (size_t i = 0; i < 64; i++)
        for (int bit = 0; bit < 8; bit++) {
            bytes[i] ^= (uint8_t)(1 << bit);
            core_file_write(path, bytes, n);
            CORE_FAILS(mospt_hierarchy_read(path, &site.grid, size, hash, &back, &err),
                       MOSPT_EFORMAT);
            /* and by a liar with the right checksum */
            CORE_FAILS(
                mospt_hierarchy_read(path, &site.grid, size, mospt_hash(bytes, n), &back, &err),
                MOSPT_EFORMAT);
            bytes[i] ^= (uint8_t)(1 << bit);
        }
    free(bytes);
}

static void any_change_of_a_record_gives_an_error_or_a_valid_hierarchy(void **state)
{
    mospt_err err = {0};
    uint64_t size, hash, random = 3;
    size_t n;
    (void)state;
    CORE_NEED(mospt_hierarchy_write(&good, path, &size, &hash, &err));
    uint8_t *bytes = core_file_read(path, &n);
    for (int k = 0; k < 3000; k++) {
        size_t at = 64 + core_below(&random, (uint32_t)n - 64), times = 1 + core_below(&random, 3);
        uint8_t before[4];
        for (size_t t = 0; t < times; t++)
            before[t] = bytes[(at + t) % n], bytes[(at + t) % n] = (uint8_t)core_random(&random);
        core_file_write(path, bytes, n);
        mospt_hierarchy back;
        if (mospt_hierarchy_read(path, &site.grid, size, mospt_hash(bytes, n), &back, &err)) {
            assert_true(mospt_hierarchy_is_valid(&back, &site.grid, &err));
            mospt_hierarchy_fini(&back);
        } else {
            assert_int_equal(err.code, MOSPT_EFORMAT);
            assert_string_equal(err.file, path);
        }
        for (size_t t = times; t-- > 0;)
            bytes[(at + t) % n] = before[t];
    }
    free(bytes);
}

static void reserved_bytes_of_records_must_be_zero(void **state)
{
    mospt_hierarchy back;
    mospt_err err = {0};
    uint64_t size, hash;
    size_t n;
    static const size_t reserved[] = {28, 29, 30, 31};
    (void)state;
    CORE_NEED(mospt_hierarchy_write(&good, path, &size, &hash, &err));
    uint8_t *bytes = core_file_read(path, &n);
    size_t record = (n - 64) / good.count;
    for (uint32_t i = 0; i < good.count; i += 7)
        for (size_t k = 0; k < sizeof reserved / sizeof reserved[0]; k++) {
            uint8_t *byte = bytes + 64 + i * record + reserved[k];
            assert_int_equal(*byte, 0);
            *byte = 1;
            core_file_write(path, bytes, n);
            CORE_FAILS(
                mospt_hierarchy_read(path, &site.grid, size, mospt_hash(bytes, n), &back, &err),
                MOSPT_EFORMAT);
            *byte = 0;
        }
    free(bytes);
}

/* Calls a change on a copy of the nodes, and expects that it is found. */
#define CHANGE(statement)                                                                          \
    do {                                                                                           \
        mospt_hierarchy bad = good;                                                                \
        bad.nodes = malloc(good.count * sizeof(mospt_node));                                       \
        assert_non_null(bad.nodes);                                                                \
        memcpy(bad.nodes, good.nodes, good.count * sizeof(mospt_node));                            \
        mospt_node *node = &bad.nodes[i];                                                          \
        statement;                                                                                 \
        mospt_err err = {0};                                                                       \
        if (mospt_hierarchy_is_valid(&bad, &site.grid, &err))                                      \
            fail_msg("node %u of %u: %s", i, good.count, #statement);                              \
        assert_int_equal(err.code, MOSPT_EFORMAT);                                                 \
        (void)node;                                                                                \
        free(bad.nodes);                                                                           \
    } while (0)

static void every_field_of_every_node_is_checked(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < good.count; i++) {
        for (int a = 0; a < 3; a++) {
            CHANGE(node->corner[a]++);
            CHANGE(node->corner[a]--);
            CHANGE(node->corner[a] ^= 0x80000000);
        }
        CHANGE(node->level++);
        CHANGE(node->level--);
        for (int o = 0; o < 8; o++) {
            CHANGE(node->child_mask ^= (uint8_t)(1 << o));
            CHANGE((node->child_mask ^= (uint8_t)(1 << o),
                    node->child_count = (uint8_t)__builtin_popcount(node->child_mask)));
        }
        uint8_t mask = good.nodes[i].child_mask;
        if (mask != 0 && mask != 0xff)
            CHANGE(node->child_mask = (uint8_t)(node->child_mask << 1 | node->child_mask >> 7));
        CHANGE(node->child_count++);
        CHANGE(node->child_count--);
        CHANGE(node->first_child++);
        CHANGE(node->first_child--);
        CHANGE(node->first_child ^= MOSPT_NO_NODE);
        CHANGE(node->count++);
        CHANGE(node->count--);
        CHANGE(node->count = 0);
        CHANGE(node->codec = 1);
        CHANGE(node->level_end[0] = 0);
        CHANGE(node->level_end[0] = 2);
        CHANGE(node->level_end[DEPTH + 1]++);
        CHANGE(node->level_end[DEPTH + 1]--);
        CHANGE((node->level_end[DEPTH + 1]++, node->count++)); /* then the total is wrong */
        for (int l = 1; l <= DEPTH; l++) {
            CHANGE(node->level_end[l] = node->level_end[l - 1] - 1);
            CHANGE(node->level_end[l] = node->level_end[l + 1] + 1);
            CHANGE(node->level_end[l] = node->level_end[l - 1] * 8 + 1);
        }
    }
}

static void every_total_is_checked(void **state)
{
    uint32_t i = 0;
    (void)state;
    CHANGE(bad.point_count++);
    CHANGE(bad.point_count--);
    CHANGE(bad.count--);
    CHANGE(bad.count = 0);
    CHANGE(bad.count = 1);
    mospt_grid other = site.grid;
    other.root[1] += 1u << other.bits;
    mospt_err err = {0};
    CORE_FAILS(mospt_hierarchy_is_valid(&good, &other, &err), MOSPT_EFORMAT);
}

static void nodes_in_any_order_are_linked_alike(void **state)
{
    uint64_t random = 6;
    mospt_err err = {0};
    (void)state;
    for (int round = 0; round < 20; round++) {
        mospt_hierarchy shuffled = good;
        shuffled.nodes = malloc(good.count * sizeof(mospt_node));
        assert_non_null(shuffled.nodes);
        memcpy(shuffled.nodes, good.nodes, good.count * sizeof(mospt_node));
        for (uint32_t i = good.count; i > 1; i--) {
            uint32_t j = core_below(&random, i);
            mospt_node swap = shuffled.nodes[j];
            shuffled.nodes[j] = shuffled.nodes[i - 1], shuffled.nodes[i - 1] = swap;
        }
        for (uint32_t i = 0; i < good.count; i++) {
            mospt_node *n = &shuffled.nodes[i];
            n->child_count = 77, n->first_child = 88, n->parent = 99;
        }
        shuffled.point_count = 5;
        CORE_NEED(mospt_hierarchy_link(&shuffled, &site.grid, &err));
        assert_int_equal(shuffled.point_count, good.point_count);
        assert_memory_equal(shuffled.nodes, good.nodes, good.count * sizeof(mospt_node));
        free(shuffled.nodes);
    }
}

static void nodes_stand_in_morton_order_by_level(void **state)
{
    (void)state;
    for (uint32_t i = 1; i < good.count; i++) {
        const mospt_node *a = &good.nodes[i - 1], *b = &good.nodes[i];
        assert_true(a->level <= b->level);
        if (a->level != b->level) continue;
        uint64_t x =
            mospt_cell_code(a->corner[0], a->corner[1], a->corner[2], site.grid.bits, a->level);
        uint64_t y =
            mospt_cell_code(b->corner[0], b->corner[1], b->corner[2], site.grid.bits, b->level);
        assert_true(x < y);
    }
}

static void children_and_parents_find_each_other(void **state)
{
    uint32_t seen = 1;
    (void)state;
    assert_int_equal(good.nodes[0].parent, MOSPT_NO_NODE);
    for (uint32_t i = 0; i < good.count; i++)
        for (uint32_t o = 0; o < 8; o++) {
            uint32_t child = mospt_hierarchy_child(&good, i, o), corner[3];
            if (!(good.nodes[i].child_mask >> o & 1)) {
                assert_int_equal(child, MOSPT_NO_NODE);
                continue;
            }
            assert_true(child < good.count);
            assert_int_equal(good.nodes[child].parent, i);
            mospt_cell_child(&site.grid, good.nodes[i].corner, good.nodes[i].level, o, corner);
            assert_memory_equal(corner, good.nodes[child].corner, sizeof corner);
            seen++;
        }
    assert_int_equal(seen, good.count);
}

static void a_hierarchy_without_a_node_waits_for_it(void **state)
{
    /* Any node but one with children, which then belong to nobody. */
    mospt_err err = {0};
    (void)state;
    for (uint32_t gone = 0; gone < good.count; gone++) {
        mospt_hierarchy bad = good;
        bad.nodes = malloc(good.count * sizeof(mospt_node));
        assert_non_null(bad.nodes);
        memcpy(bad.nodes, good.nodes, gone * sizeof(mospt_node));
        memcpy(bad.nodes + gone, good.nodes + gone + 1,
               (good.count - gone - 1) * sizeof(mospt_node));
        bad.count--;
        if (good.nodes[gone].child_count > 0) {
            CORE_FAILS(mospt_hierarchy_link(&bad, &site.grid, &err), MOSPT_EFORMAT);
        } else {
            const mospt_node *parent = &bad.nodes[good.nodes[gone].parent];
            CORE_NEED(mospt_hierarchy_link(&bad, &site.grid, &err));
            assert_false(mospt_hierarchy_is_finished(&bad));
            assert_int_equal(parent->pending_mask,
                             good.nodes[good.nodes[gone].parent].child_mask & ~parent->child_mask);
            assert_int_equal(__builtin_popcount(parent->pending_mask), 1);
        }
        free(bad.nodes);
    }
}

static void codes_agree_with_the_bits_of_the_coordinates(void **state)
{
    uint64_t random = 9;
    (void)state;
    for (int k = 0; k < 20000; k++) {
        uint32_t bits = core_below(&random, 33), depth = core_below(&random, MOSPT_CODE_LEVELS + 1),
                 g[3];
        for (int a = 0; a < 3; a++)
            g[a] = (uint32_t)core_random(&random);
        uint64_t code = 0;
        for (uint32_t level = 0; level < depth; level++) {
            code <<= 3;
            for (uint32_t a = 0; a < 3 && level < bits; a++)
                code |= (uint64_t)(g[a] >> (bits - 1 - level) & 1) << a;
        }
        assert_true(mospt_cell_code(g[0], g[1], g[2], bits, depth) == code);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_written_is_read),
        cmocka_unit_test(every_truncation_is_a_format_error),
        cmocka_unit_test(every_header_byte_is_checked),
        cmocka_unit_test(any_change_of_a_record_gives_an_error_or_a_valid_hierarchy),
        cmocka_unit_test(reserved_bytes_of_records_must_be_zero),
        cmocka_unit_test(every_field_of_every_node_is_checked),
        cmocka_unit_test(every_total_is_checked),
        cmocka_unit_test(nodes_in_any_order_are_linked_alike),
        cmocka_unit_test(nodes_stand_in_morton_order_by_level),
        cmocka_unit_test(children_and_parents_find_each_other),
        cmocka_unit_test(a_hierarchy_without_a_node_waits_for_it),
        cmocka_unit_test(codes_agree_with_the_bits_of_the_coordinates),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
