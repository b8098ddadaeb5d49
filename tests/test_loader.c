#include "render/loader.h"
#include "tests/render_tools.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

static render_site site;

static int make_site(void **unused)
{
    (void)unused;
    render_site_make(CORE_CLUSTERED, 20000, NULL, &site);
    return 0;
}

static int remove_site(void **unused)
{
    (void)unused;
    render_site_fini(&site);
    return 0;
}

static uint32_t node_count(void)
{
    return site.dataset->hierarchy.count;
}

static void assert_true_vertices(const rend_loaded *loaded)
{
    size_t size = mospt_dataset_vertices_size(site.dataset, loaded->node);
    mospt_vertex *expected = malloc(size + 1);
    mospt_err err = {0};
    CORE_NEED(mospt_dataset_read_vertices(site.dataset, loaded->node, expected, &err));
    assert_memory_equal(loaded->vertices, expected, size);
    free(expected);
}

static void count_wakes(void *user)
{
    atomic_fetch_add((atomic_uint *)user, 1);
}

static void all_that_is_asked_for_arrives_once(void **unused)
{
    (void)unused;
    for (uint32_t threads = 1; threads <= 4; threads++) {
        rend_loader *l;
        mospt_err err = {0};
        atomic_uint wakes = 0;
        uint32_t *wanted = calloc(node_count(), sizeof *wanted),
                 *seen = calloc(node_count(), sizeof *seen), taken = 0;
        for (uint32_t n = 0; n < node_count(); n++)
            wanted[n] = node_count() - 1 - n;
        CORE_NEED(rend_loader_create(site.dataset, threads, 10000, count_wakes, &wakes, &l, &err));
        CORE_NEED(rend_loader_request(l, wanted, node_count(), &err));
        while (rend_loader_wait(l)) {
            rend_loaded loaded[3];
            uint32_t count = rend_loader_take(l, loaded, 3);
            for (uint32_t i = 0; i < count; i++, taken++) {
                assert_non_null(loaded[i].vertices);
                assert_true_vertices(&loaded[i]);
                if (threads == 1)
                    assert_int_equal(loaded[i].node, wanted[taken]); /* most urgent first */
                seen[loaded[i].node]++;
                free(loaded[i].vertices);
            }
        }
        for (uint32_t n = 0; n < node_count(); n++)
            assert_int_equal(seen[n], 1);
        assert_int_equal(rend_loader_pending(l), 0);
        assert_true(rend_loader_bytes(l) ==
                    site.dataset->hierarchy.point_count * sizeof(mospt_vertex));
        rend_loader_destroy(l); /* the last wake may come after its result was taken */
        assert_int_equal(wakes, node_count());
        free(wanted);
        free(seen);
    }
}

static void a_new_list_withdraws_the_old_one(void **unused)
{
    (void)unused;
    rend_loader *l;
    mospt_err err = {0};
    uint32_t all[64], last = node_count() - 1, taken = 0;
    for (uint32_t n = 0; n < 64; n++)
        all[n] = n % (node_count() - 1);
    /* One byte may wait: the loader stops after the first node until that is taken. */
    CORE_NEED(rend_loader_create(site.dataset, 1, 1, NULL, NULL, &l, &err));
    CORE_NEED(rend_loader_request(l, all, 64, &err));
    assert_true(rend_loader_wait(l));
    CORE_NEED(rend_loader_request(l, &last, 1, &err));
    while (rend_loader_wait(l)) {
        rend_loaded loaded;
        if (rend_loader_take(l, &loaded, 1) == 0) continue;
        assert_true(loaded.node == all[0] || loaded.node == last);
        free(loaded.vertices);
        taken++;
    }
    assert_int_equal(taken, 2);
    rend_loader_destroy(l);
}

static void frames_may_ask_as_often_as_they_like(void **unused)
{
    (void)unused;
    rend_loader *l;
    mospt_err err = {0};
    uint64_t state = 1;
    bool *here = calloc(node_count(), 1);
    uint32_t left = node_count(), wanted[4096];
    assert_true(node_count() < 4096);
    CORE_NEED(rend_loader_create(site.dataset, 3, 20000, NULL, NULL, &l, &err));
    for (int frame = 0; left > 0; frame++) {
        uint32_t count = 0;
        rend_loaded loaded[8];
        for (uint32_t n = 0; n < node_count(); n++)
            if (!here[n] && (core_below(&state, 2) > 0 || left < 10)) wanted[count++] = n;
        CORE_NEED(rend_loader_request(l, wanted, count, &err));
        for (uint32_t i = 0, got = rend_loader_take(l, loaded, 8); i < got; i++) {
            /* A request and its result can cross; a node that came in between is read again, and
             * that is all. */
            left -= !here[loaded[i].node];
            here[loaded[i].node] = true;
            free(loaded[i].vertices);
        }
    }
    rend_loader_destroy(l); /* with whatever is under way */
    free(here);
}

static void a_damaged_node_comes_with_its_error(void **unused)
{
    (void)unused;
    render_site bad;
    rend_loader *l;
    rend_loaded loaded;
    mospt_err err = {0};
    const uint32_t wanted[] = {1};
    render_site_make(CORE_UNIFORM, 5000, NULL, &bad);
    render_site_damage(&bad, 1);
    CORE_NEED(rend_loader_create(bad.dataset, 1, 1 << 20, NULL, NULL, &l, &err));
    CORE_NEED(rend_loader_request(l, wanted, 1, &err));
    assert_true(rend_loader_wait(l));
    assert_int_equal(rend_loader_take(l, &loaded, 1), 1);
    assert_null(loaded.vertices);
    assert_int_equal(loaded.err.code, MOSPT_EFORMAT);
    assert_true(strlen(loaded.err.file) > 0);
    rend_loader_destroy(l);
    render_site_fini(&bad);
}

static void assert_painted(const rend_loaded *loaded, const rend_paint *paint)
{
    size_t size = mospt_dataset_vertices_size(site.dataset, loaded->node),
           planes_size = site.dataset->hierarchy.nodes[loaded->node].count *
                         site.dataset->metadata.schema.row_size;
    mospt_vertex *expected = malloc(size + 1);
    uint8_t *planes = malloc(planes_size + 1);
    mospt_err err = {0};
    CORE_NEED(mospt_dataset_read_vertices(site.dataset, loaded->node, expected, &err));
    CORE_NEED(mospt_dataset_read_attributes(site.dataset, loaded->node, expected, planes, &err));
    rend_paint_apply(paint, loaded->node, planes, expected);
    assert_memory_equal(loaded->vertices, expected, size);
    free(planes);
    free(expected);
}

/* Takes some of what comes, then changes the paint while the rest is on its way. */
static void nothing_arrives_in_the_paint_of_before(void **unused)
{
    (void)unused;
    rend_loader *l;
    mospt_err err = {0};
    uint64_t state = 3;
    uint32_t *wanted = calloc(node_count(), sizeof *wanted);
    for (uint32_t n = 0; n < node_count(); n++)
        wanted[n] = n;
    CORE_NEED(rend_loader_create(site.dataset, 3, 1 << 20, NULL, NULL, &l, &err));
    for (int round = 0; round < 60; round++) {
        rend_paint paint = {.source = REND_PAINT_VALUE,
                            .dataset = site.dataset,
                            .attribute = 1,
                            .high = 1000 * (round + 1)};
        if (round % 3 == 0) paint.source = REND_PAINT_HEIGHT, paint.attribute = -1;
        rend_ramp_fill(REND_MAP_TURBO, &paint.ramp);
        rend_loader_set_paint(l, &paint);
        CORE_NEED(rend_loader_request(l, wanted, node_count(), &err));
        uint32_t enough = round == 59 ? node_count() : core_below(&state, node_count()), taken = 0;
        while (taken < enough && rend_loader_wait(l)) {
            rend_loaded loaded;
            assert_int_equal(rend_loader_take(l, &loaded, 1), 1);
            assert_painted(&loaded, &paint);
            free(loaded.vertices);
            taken++;
        }
        assert_int_equal(taken, enough);
    }
    assert_int_equal(rend_loader_pending(l), 0);
    rend_loader_destroy(l);
    free(wanted);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_that_is_asked_for_arrives_once),
        cmocka_unit_test(a_new_list_withdraws_the_old_one),
        cmocka_unit_test(frames_may_ask_as_often_as_they_like),
        cmocka_unit_test(a_damaged_node_comes_with_its_error),
        cmocka_unit_test(nothing_arrives_in_the_paint_of_before),
    };
    return cmocka_run_group_tests(tests, make_site, remove_site);
}
