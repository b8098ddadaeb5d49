/* Of all points at one position the first is kept, whatever memory and threads. */
#include "tests/core_tools.h"

#include "mospt/hash.h"
#include "preprocess/dedupe.h"
#include "preprocess/feed.h"
#include "preprocess/finish.h"

#include <stdlib.h>
#include <string.h>

/* Position and place of arrival. */
typedef struct {
    uint32_t g[3], index;
} placed;

static bool same_position(const placed *p, const placed *q)
{
    return memcmp(p->g, q->g, sizeof p->g) == 0;
}

/* Morton order, the slow way: the highest bit in which two positions differ decides, z before y
 * before x. */
static int compare_placed(const void *a, const void *b)
{
    const placed *p = a, *q = b;
    for (int bit = 31; bit >= 0; bit--)
        for (int axis = 2; axis >= 0; axis--) {
            uint32_t x = p->g[axis] >> bit & 1, y = q->g[axis] >> bit & 1;
            if (x != y) return x < y ? -1 : 1;
        }
    return p->index < q->index ? -1 : p->index > q->index;
}

typedef struct {
    uint8_t *records; /* [count], owned: what is to be kept, in its order */
    uint32_t count;
    prep_dedupe_scan scans[2];
} wanted;

static uint32_t scan_of(const uint8_t *record)
{
    uint16_t scan;
    memcpy(&scan, record + sizeof(mospt_vertex), sizeof scan);
    return scan;
}

static wanted work_out(const core_site *site)
{
    wanted w = {.records = malloc(site->count * site->stride)};
    placed *points = calloc(site->count, sizeof *points);
    assert_true(w.records != NULL && points != NULL);
    for (uint32_t i = 0; i < site->count; i++) {
        memcpy(points[i].g, site->records + i * site->stride, sizeof points[i].g);
        points[i].index = i;
    }
    qsort(points, site->count, sizeof *points, compare_placed);
    for (uint32_t i = 0; i < site->count; i++) {
        const uint8_t *record = site->records + points[i].index * site->stride;
        prep_dedupe_scan *scan = &w.scans[scan_of(record)];
        if (i > 0 && same_position(&points[i], &points[i - 1])) {
            scan->dropped++;
            continue;
        }
        scan->sums.hash += mospt_hash(record, site->stride);
        memcpy(w.records + w.count++ * site->stride, record, site->stride);
    }
    free(points);
    return w;
}

typedef struct {
    uint32_t threads, levels;
    size_t block_size, store_memory, solve_memory;
} way;

static bool go_on(void *context)
{
    (void)context;
    return true;
}

static void check_way(const core_site *site, const way *y, const wanted *w)
{
    prep_workers *workers = NULL;
    prep_store *store = NULL;
    prep_arena *arena = NULL;
    prep_pass *pass = NULL;
    prep_spool all = {0}, kept = {0};
    prep_dedupe_scan scans[2];
    mospt_err err = {0};
    prep_shape shape = core_shape(site, 5, 100);
    CORE_NEED(prep_workers_create(y->threads, &workers, &err));
    CORE_NEED(
        prep_store_create(core_folder, site->stride, y->block_size, y->store_memory, &store, &err));
    CORE_NEED(prep_arena_create(y->solve_memory, &arena, &err));
    prep_pass_env env = {.shape = &shape,
                         .workers = workers,
                         .store = store,
                         .arena = arena,
                         .divides = true,
                         .levels = y->levels,
                         .slice_points = PREP_PASS_SLICE_MAX,
                         .batch_slices = 1,
                         .solve_points = y->solve_memory / prep_finish_size(site->stride, 1),
                         .report = go_on};
    for (uint32_t i = 0; i < site->count; i++)
        CORE_NEED(
            prep_spool_append(store, &all, site->records + i * site->stride, site->stride, &err));
    CORE_NEED(prep_spool_seal(store, &all, &err));
    CORE_NEED(prep_pass_begin(&env, site->grid.root, 0, &pass, &err));
    CORE_NEED(prep_feed_spool(&env, pass, &all, &err));
    CORE_NEED(prep_dedupe(&env, pass, scans, 2, &kept, &err));

    assert_int_equal(kept.count, w->count);
    uint8_t *got = malloc(w->count * site->stride);
    assert_non_null(got);
    CORE_NEED(prep_spool_take(store, &kept, got, &err));
    assert_memory_equal(got, w->records, w->count * site->stride);
    for (int s = 0; s < 2; s++) {
        assert_int_equal(scans[s].dropped, w->scans[s].dropped);
        assert_true(scans[s].sums.hash == w->scans[s].sums.hash);
    }
    free(got);
    prep_arena_destroy(arena);
    prep_store_destroy(store);
    prep_workers_destroy(workers);
}

static void the_first_at_each_position_is_kept(void **state)
{
    static const way ways[] = {
        {.threads = 1,
         .levels = 3,
         .block_size = 1 << 14,
         .store_memory = 1 << 30,
         .solve_memory = 1 << 24},
        {.threads = 2, .levels = 2, .block_size = 400, .store_memory = 5000, .solve_memory = 30000},
        {.threads = 7, .levels = 2, .block_size = 100, .store_memory = 0, .solve_memory = 9000},
    };
    static const uint32_t bits[] = {0, 1, 3, 10, 22, 32};
    (void)state;
    for (int kind = 0; kind < CORE_KINDS; kind++)
        for (size_t k = 0; k < sizeof bits / sizeof bits[0]; k++) {
            core_site site;
            core_site_make((core_kind)kind, bits[k], 1500, (uint64_t)kind + 10 * k, &site);
            wanted w = work_out(&site);
            for (size_t y = 0; y < sizeof ways / sizeof ways[0]; y++)
                check_way(&site, &ways[y], &w);
            free(w.records);
            core_site_fini(&site);
        }
}

static void copies_far_apart_in_time_are_found(void **state)
{
    /* Twice the same points, and neighbours that differ in the finest step only. */
    (void)state;
    core_site site;
    core_site_make(CORE_CLUSTERED, 32, 4000, 4, &site);
    for (uint32_t i = 2000; i < 4000; i++) {
        memcpy(site.records + i * site.stride, site.records + (i - 2000) * site.stride,
               sizeof(mospt_vertex));
        site.records[i * site.stride] ^= i % 2;
    }
    wanted w = work_out(&site);
    assert_int_equal(w.scans[0].dropped + w.scans[1].dropped + w.count, 4000);
    assert_true(w.count >= 3000 && w.count < 3100);
    const way y = {.threads = 2, .levels = 3, .block_size = 400, .solve_memory = 50000};
    check_way(&site, &y, &w);
    free(w.records);
    core_site_fini(&site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_first_at_each_position_is_kept),
        cmocka_unit_test(copies_far_apart_in_time_are_found),
    };
    return cmocka_run_group_tests(tests, core_folder_set_up, core_folder_tear_down);
}
