/* Pieces of an arena: never two at one place, never beyond its end, and the lowest gap first. */
#include "tests/core_tools.h"

#include "preprocess/arena.h"

#include <string.h>

enum { SIZE = 1 << 16, PIECES = 200 };

static void pieces_do_not_overlap(void **state)
{
    (void)state;
    prep_arena *arena = NULL;
    mospt_err err = {0};
    uint64_t random = 1;
    struct {
        uint8_t *at;
        size_t size;
        uint8_t mark;
    } piece[PIECES] = {{0}};
    uint32_t refused = 0;
    CORE_NEED(prep_arena_create(SIZE, &arena, &err));
    for (int round = 0; round < 20000; round++) {
        uint32_t k = core_below(&random, PIECES);
        if (piece[k].at != NULL) {
            for (size_t i = 0; i < piece[k].size; i++)
                assert_int_equal(piece[k].at[i], piece[k].mark);
            prep_arena_give(arena, piece[k].at);
            piece[k].at = NULL;
            continue;
        }
        piece[k].size = core_below(&random, 1500);
        piece[k].mark = (uint8_t)round;
        piece[k].at = prep_arena_take(arena, piece[k].size);
        if (piece[k].at == NULL) refused++;
        else memset(piece[k].at, piece[k].mark, piece[k].size);
    }
    assert_true(refused > 0);
    prep_arena_destroy(arena);
}

static void the_lowest_gap_that_is_wide_enough_is_taken(void **state)
{
    (void)state;
    prep_arena *arena = NULL;
    mospt_err err = {0};
    CORE_NEED(prep_arena_create(SIZE, &arena, &err));
    uint8_t *a = prep_arena_take(arena, 1000), *b = prep_arena_take(arena, 200),
            *c = prep_arena_take(arena, 3000), *d = prep_arena_take(arena, 10);
    assert_true(a < b && b < c && c < d);
    prep_arena_give(arena, b);
    prep_arena_give(arena, c);
    assert_ptr_equal(prep_arena_take(arena, 3100), b);
    prep_arena_give(arena, a);
    assert_ptr_equal(prep_arena_take(arena, 100), a);
    prep_arena_give(arena, NULL);
    assert_null(prep_arena_take(arena, SIZE));
    prep_arena_destroy(arena);
}

static void all_of_it_can_be_taken_and_no_more(void **state)
{
    (void)state;
    prep_arena *arena = NULL;
    mospt_err err = {0};
    CORE_NEED(prep_arena_create(SIZE, &arena, &err));
    for (int round = 0; round < 3; round++) {
        uint8_t *all = prep_arena_take(arena, SIZE);
        assert_non_null(all);
        memset(all, round, SIZE);
        assert_null(prep_arena_take(arena, 1));
        prep_arena_give(arena, all);
    }
    prep_arena_destroy(arena);
    CORE_NEED(prep_arena_create(0, &arena, &err));
    assert_null(prep_arena_take(arena, 0));
    prep_arena_destroy(arena);
    prep_arena_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pieces_do_not_overlap),
        cmocka_unit_test(the_lowest_gap_that_is_wide_enough_is_taken),
        cmocka_unit_test(all_of_it_can_be_taken_and_no_more),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
