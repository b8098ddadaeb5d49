/* Rejection files: what goes in comes out, in its order, from memory and from the scratch disk. */
#include "tests/core_tools.h"

#include "preprocess/spool.h"
#include "preprocess/workers.h"

#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>

enum { RECORD = 20, BLOCK = 16 }; /* 16 records: the least that a block holds */

static char *folder;

static int set_up(void **state)
{
    (void)state;
    signal(SIGXFSZ, SIG_IGN);
    folder = core_folder_make();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    core_folder_remove(folder);
    return 0;
}

static prep_store *make_store(size_t blocks_in_memory)
{
    prep_store *store = NULL;
    mospt_err err = {0};
    CORE_NEED(
        prep_store_create(folder, RECORD, 1, blocks_in_memory * BLOCK * RECORD, &store, &err));
    assert_int_equal(1 << prep_store_block_shift(store), BLOCK);
    assert_int_equal(prep_store_block_size(store), BLOCK * RECORD);
    return store;
}

static void make_record(uint32_t spool, uint32_t i, uint8_t record[RECORD])
{
    uint64_t random = (uint64_t)spool << 32 | i;
    for (int k = 0; k < RECORD; k++)
        record[k] = (uint8_t)core_random(&random);
}

static bool fill(prep_store *store, prep_spool *spool, uint32_t name, uint32_t count,
                 mospt_err *err)
{
    uint8_t record[RECORD];
    for (uint32_t i = 0; i < count; i++) {
        make_record(name, i, record);
        if (!prep_spool_append(store, spool, record, RECORD, err)) return false;
    }
    return true;
}

static void assert_holds(const uint8_t *records, uint32_t name, uint32_t count)
{
    uint8_t record[RECORD];
    for (uint32_t i = 0; i < count; i++) {
        make_record(name, i, record);
        assert_memory_equal(records + i * RECORD, record, RECORD);
    }
}

static void take_and_compare(prep_store *store, prep_spool *spool, uint32_t name, uint32_t count)
{
    uint8_t *out = malloc(count * RECORD + 1);
    mospt_err err = {0};
    assert_non_null(out);
    out[count * RECORD] = 0xa5;
    assert_int_equal(spool->count, count);
    CORE_NEED(prep_spool_take(store, spool, out, &err));
    assert_holds(out, name, count);
    assert_int_equal(out[count * RECORD], 0xa5);
    assert_int_equal(spool->count, 0);
    assert_int_equal(spool->block_count, 0);
    free(out);
}

static void records_come_back_in_their_order(void **state)
{
    static const uint32_t counts[] = {0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK, 1000};
    static const size_t memory[] = {0, 1, 5, 1000};
    (void)state;
    for (size_t m = 0; m < 4; m++)
        for (size_t k = 0; k < sizeof counts / sizeof counts[0]; k++)
            for (int sealed = 0; sealed < 2; sealed++) {
                prep_store *store = make_store(memory[m]);
                prep_spool spool = {0};
                mospt_err err = {0};
                CORE_NEED(fill(store, &spool, 7, counts[k], &err));
                if (sealed) CORE_NEED(prep_spool_seal(store, &spool, &err));
                take_and_compare(store, &spool, 7, counts[k]);
                /* and again: an empty spool is a new one */
                CORE_NEED(fill(store, &spool, 8, counts[k], &err));
                take_and_compare(store, &spool, 8, counts[k]);
                prep_store_destroy(store);
            }
    assert_int_equal(core_entries(folder), 0);
}

static void spools_filled_in_turn_do_not_mix(void **state)
{
    enum { SPOOLS = 37 };
    (void)state;
    prep_store *store = make_store(20);
    prep_spool spools[SPOOLS] = {{0}};
    uint32_t counts[SPOOLS] = {0};
    uint64_t random = 3;
    mospt_err err = {0};
    uint8_t record[RECORD];
    for (uint32_t i = 0; i < 20000; i++) {
        uint32_t s = core_below(&random, SPOOLS);
        make_record(s, counts[s]++, record);
        CORE_NEED(prep_spool_append(store, &spools[s], record, RECORD, &err));
    }
    for (uint32_t s = 0; s < SPOOLS; s++)
        CORE_NEED(prep_spool_seal(store, &spools[s], &err));
    for (uint32_t s = SPOOLS; s-- > 0;)
        take_and_compare(store, &spools[s], s, counts[s]);
    prep_store_destroy(store);
}

static void blocks_are_taken_one_by_one(void **state)
{
    (void)state;
    for (size_t memory = 0; memory < 8; memory += 3) {
        prep_store *store = make_store(memory);
        prep_spool spool = {0};
        mospt_err err = {0};
        uint8_t out[BLOCK * RECORD * 7];
        uint32_t count = 6 * BLOCK + 5, at = 0, n;
        CORE_NEED(fill(store, &spool, 1, count, &err));
        CORE_NEED(prep_spool_seal(store, &spool, &err));
        uint32_t blocks = spool.block_count;
        assert_int_equal(blocks, 7);
        for (uint32_t b = 0; b < blocks; b++) {
            CORE_NEED(prep_spool_take_block(store, &spool, b, out + at * RECORD, &n, &err));
            assert_int_equal(n, b < 6 ? BLOCK : 5);
            at += n;
        }
        assert_int_equal(at, count);
        assert_holds(out, 1, count);
        prep_spool_drop(store, &spool);
        take_and_compare(store, &spool, 1, 0);
        prep_store_destroy(store);
    }
}

static void a_view_shows_the_blocks_where_they_are(void **state)
{
    (void)state;
    for (size_t memory = 0; memory < 8; memory += 3) {
        prep_store *store = make_store(memory);
        prep_spool spool = {0};
        mospt_err err = {0};
        uint8_t buffer[BLOCK * RECORD * 7];
        const uint8_t *blocks[7];
        const mospt_records records = {blocks, RECORD, prep_store_block_shift(store)};
        uint32_t count = 6 * BLOCK + 5;
        CORE_NEED(fill(store, &spool, 1, count, &err));
        CORE_NEED(prep_spool_seal(store, &spool, &err));
        size_t on_disk = memory < 7 ? 7 - memory : 0;
        assert_int_equal(prep_spool_size_on_disk(store, &spool), on_disk * BLOCK * RECORD);
        CORE_NEED(prep_spool_view(store, &spool, buffer, blocks, &err));
        for (uint32_t i = 0; i < count; i++) {
            uint8_t record[RECORD];
            make_record(1, i, record);
            assert_memory_equal(mospt_records_at(&records, i), record, RECORD);
        }
        take_and_compare(store, &spool, 1, count); /* it is all still there */
        prep_store_destroy(store);
    }
}

static void scratch_space_is_used_again(void **state)
{
    (void)state;
    prep_store *store = make_store(0);
    mospt_err err = {0};
    prep_spool keep = {0};
    CORE_NEED(fill(store, &keep, 99, 5 * BLOCK, &err));
    CORE_NEED(prep_spool_seal(store, &keep, &err));
    for (uint32_t round = 0; round < 20; round++) {
        prep_spool spool = {0};
        CORE_NEED(fill(store, &spool, round, 10 * BLOCK, &err));
        CORE_NEED(prep_spool_seal(store, &spool, &err));
        take_and_compare(store, &spool, round, 10 * BLOCK);
    }
    assert_int_equal(prep_store_scratch_peak(store), 15 * BLOCK * RECORD);
    take_and_compare(store, &keep, 99, 5 * BLOCK);
    prep_store_destroy(store);
}

static void memory_is_used_before_the_disk_and_given_back(void **state)
{
    (void)state;
    prep_store *store = make_store(10);
    mospt_err err = {0};
    for (uint32_t round = 0; round < 20; round++) {
        prep_spool spool = {0}, dropped = {0};
        CORE_NEED(fill(store, &spool, round, 5 * BLOCK, &err));
        CORE_NEED(prep_spool_seal(store, &spool, &err));
        CORE_NEED(fill(store, &dropped, round, 5 * BLOCK, &err));
        if (round % 2) CORE_NEED(prep_spool_seal(store, &dropped, &err));
        take_and_compare(store, &spool, round, 5 * BLOCK);
        prep_spool_drop(store, &dropped);
        assert_int_equal(dropped.count, 0);
    }
    assert_int_equal(prep_store_scratch_peak(store), 0);
    assert_int_equal(core_entries(folder), 0);
    prep_store_destroy(store);
}

static void full_blocks_make_room_for_what_is_needed_sooner(void **state)
{
    prep_store *store = make_store(6);
    prep_spool later = {0}, sooner = {0};
    mospt_err err = {0};
    (void)state;
    CORE_NEED(fill(store, &later, 1, 5 * BLOCK + 3, &err) && prep_spool_seal(store, &later, &err));
    assert_int_equal(prep_store_scratch_peak(store), 0);
    /* As many as asked for, less those that there is room for; then all that are full. */
    CORE_NEED(prep_spool_make_room(store, &later, 2 * BLOCK * RECORD, &err));
    assert_int_equal(prep_spool_size_on_disk(store, &later), 2 * BLOCK * RECORD);
    CORE_NEED(fill(store, &sooner, 2, 2 * BLOCK, &err) && prep_spool_seal(store, &sooner, &err));
    assert_int_equal(prep_spool_size_on_disk(store, &sooner), 0);
    CORE_NEED(prep_spool_make_room(store, &later, 100 * BLOCK * RECORD, &err));
    assert_int_equal(prep_spool_size_on_disk(store, &later), 5 * BLOCK * RECORD);
    take_and_compare(store, &sooner, 2, 2 * BLOCK);
    take_and_compare(store, &later, 1, 5 * BLOCK + 3);
    prep_store_destroy(store);
}

/* Of `alike` halves of each record, all have the same. */
static void make_alike(uint32_t i, uint32_t alike, uint8_t record[RECORD])
{
    uint8_t same[RECORD];
    size_t size = alike * RECORD / 2;
    make_record(7, i, record);
    make_record(7, 0, same);
    memcpy(record, same, size);
}

static void compressed_blocks_come_back_and_take_less_room(void **state)
{
    enum { SIZE = 1 << 16, COUNT = 10 * SIZE / RECORD + 3 };
    (void)state;
    for (uint32_t alike = 0; alike <= 2; alike++) {
        prep_store *store = NULL;
        prep_spool spool = {0};
        mospt_err err = {0};
        uint8_t *out = malloc(COUNT * RECORD), record[RECORD];
        assert_non_null(out);
        CORE_NEED(prep_store_create(folder, RECORD, SIZE, 0, &store, &err));
        prep_store_compress(store);
        for (uint32_t i = 0; i < COUNT; i++) {
            make_alike(i, alike, record);
            CORE_NEED(prep_spool_append(store, &spool, record, RECORD, &err));
        }
        CORE_NEED(prep_spool_seal(store, &spool, &err));
        uint64_t raw = spool.block_count * (uint64_t)prep_store_block_size(store),
                 peak = prep_store_scratch_peak(store);
        if (alike == 0) assert_true(peak > raw - SIZE && peak <= raw);
        else assert_true(peak <= raw * (2 - alike) / 2 + spool.block_count * 4096);
        CORE_NEED(prep_spool_take(store, &spool, out, &err));
        for (uint32_t i = 0; i < COUNT; i++) {
            make_alike(i, alike, record);
            assert_memory_equal(out + i * RECORD, record, RECORD);
        }
        free(out);
        prep_store_destroy(store);
    }
}

static void the_scratch_file_has_no_name(void **state)
{
    (void)state;
    prep_store *store = make_store(0);
    prep_spool spool = {0};
    mospt_err err = {0};
    CORE_NEED(fill(store, &spool, 1, 10 * BLOCK, &err));
    assert_true(prep_store_scratch_peak(store) > 0);
    assert_int_equal(core_entries(folder), 0);
    prep_spool_drop(store, &spool);
    prep_store_destroy(store);
}

static void a_full_disk_is_an_error_and_leaves_the_spool_usable(void **state)
{
    (void)state;
    for (rlim_t room = 0; room < 5; room++) {
        prep_store *store = make_store(0);
        prep_spool spool = {0};
        mospt_err err = {0};
        struct rlimit old, small;
        getrlimit(RLIMIT_FSIZE, &old);
        small = old;
        small.rlim_cur = room * BLOCK * RECORD + room; /* the last block fits in part */
        setrlimit(RLIMIT_FSIZE, &small);
        bool ok = fill(store, &spool, 1, 10 * BLOCK, &err);
        setrlimit(RLIMIT_FSIZE, &old);
        assert_false(ok);
        assert_int_equal(err.code, MOSPT_EIO);
        assert_true(err.sys_errno != 0);
        assert_string_equal(err.file, folder);
        prep_spool_drop(store, &spool);
        CORE_NEED(fill(store, &spool, 2, 10 * BLOCK, &err));
        take_and_compare(store, &spool, 2, 10 * BLOCK);
        prep_store_destroy(store);
    }
}

static void a_folder_that_cannot_be_written_to_is_an_error(void **state)
{
    (void)state;
    mospt_err err = {0};
    prep_store *store = NULL;
    prep_spool spool = {0};
    char *nowhere = core_path(folder, "nowhere");
    CORE_NEED(prep_store_create(nowhere, RECORD, 1, 0, &store, &err));
    CORE_FAILS(fill(store, &spool, 1, 2 * BLOCK, &err), MOSPT_EIO);
    assert_string_equal(err.file, nowhere);
    prep_spool_drop(store, &spool);
    prep_store_destroy(store);
    free(nowhere);
}

typedef struct {
    prep_store *store;
    prep_spool spools[16];
    mospt_err err[16];
} crowd;

static void fill_one(void *context, uint32_t i)
{
    crowd *c = context;
    if (fill(c->store, &c->spools[i], i, 2000, &c->err[i]))
        prep_spool_seal(c->store, &c->spools[i], &c->err[i]);
}

static void take_one(void *context, uint32_t i)
{
    crowd *c = context;
    uint8_t *out = malloc(2000 * RECORD), record[RECORD];
    bool ok = out != NULL && prep_spool_take(c->store, &c->spools[i], out, &c->err[i]);
    for (uint32_t k = 0; ok && k < 2000; k++) {
        make_record(i, k, record);
        if (memcmp(out + k * RECORD, record, RECORD) != 0) c->err[i].code = MOSPT_EFORMAT;
    }
    free(out);
}

static void many_threads_share_a_store(void **state)
{
    (void)state;
    crowd c = {.store = make_store(100)};
    prep_workers *workers = NULL;
    mospt_err err = {0};
    CORE_NEED(prep_workers_create(4, &workers, &err));
    for (int round = 0; round < 5; round++) {
        prep_workers_run(workers, 16, fill_one, &c);
        prep_workers_run(workers, 16, take_one, &c);
        for (int i = 0; i < 16; i++)
            assert_int_equal(c.err[i].code, MOSPT_OK);
    }
    prep_workers_destroy(workers);
    prep_store_destroy(c.store);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(records_come_back_in_their_order),
        cmocka_unit_test(spools_filled_in_turn_do_not_mix),
        cmocka_unit_test(blocks_are_taken_one_by_one),
        cmocka_unit_test(a_view_shows_the_blocks_where_they_are),
        cmocka_unit_test(scratch_space_is_used_again),
        cmocka_unit_test(memory_is_used_before_the_disk_and_given_back),
        cmocka_unit_test(full_blocks_make_room_for_what_is_needed_sooner),
        cmocka_unit_test(compressed_blocks_come_back_and_take_less_room),
        cmocka_unit_test(the_scratch_file_has_no_name),
        cmocka_unit_test(a_full_disk_is_an_error_and_leaves_the_spool_usable),
        cmocka_unit_test(a_folder_that_cannot_be_written_to_is_an_error),
        cmocka_unit_test(many_threads_share_a_store),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
