/* The radix sort against insertion by a slow, obvious sort. */
#include "tests/core_tools.h"

#include "preprocess/sort.h"

#include <stdlib.h>
#include <string.h>

static int by_code_then_place(const void *a, const void *b)
{
    const mospt_linear_key *x = a, *y = b;
    if (x->code != y->code) return x->code < y->code ? -1 : 1;
    return x->index < y->index ? -1 : x->index > y->index;
}

/* mask  which bits of the codes differ */
static void check(uint32_t count, uint64_t mask, uint64_t seed)
{
    uint64_t random = seed;
    mospt_linear_key *keys = calloc(count + 1, sizeof *keys),
                     *want = calloc(count + 1, sizeof *want),
                     *spare = malloc((count + 1) * sizeof *spare);
    assert_true(keys != NULL && want != NULL && spare != NULL);
    for (uint32_t i = 0; i < count; i++)
        keys[i] = (mospt_linear_key){.code = core_random(&random) & mask, .index = i};
    keys[count] = (mospt_linear_key){.code = 12345, .index = 54321}; /* nobody's */
    memcpy(want, keys, (count + 1) * sizeof *keys);
    qsort(want, count, sizeof *want, by_code_then_place);
    prep_sort_keys(keys, spare, count);
    for (uint32_t i = 0; i <= count; i++) {
        assert_true(keys[i].code == want[i].code);
        assert_int_equal(keys[i].index, want[i].index);
    }
    free(keys), free(want), free(spare);
}

static void few_and_many_keys_are_sorted(void **state)
{
    static const uint32_t counts[] = {0, 1, 2, 3, 63, 64, 65, 2047, 2048, 2049, 100000};
    (void)state;
    for (size_t k = 0; k < sizeof counts / sizeof counts[0]; k++)
        check(counts[k], UINT64_MAX, k);
}

static void every_bit_of_a_code_counts(void **state)
{
    (void)state;
    for (int bit = 0; bit < 64; bit++)
        check(300, UINT64_C(1) << bit, (uint64_t)bit);
    for (int bit = 1; bit < 64; bit += 7)
        check(5000, UINT64_MAX << bit, (uint64_t)bit), check(40, UINT64_MAX << bit, 1);
}

static void equal_keys_keep_their_order(void **state)
{
    (void)state;
    check(10000, 0, 1);
    check(10000, UINT64_C(0x4000000000000001), 2);
    check(30, 1, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(few_and_many_keys_are_sorted),
        cmocka_unit_test(every_bit_of_a_code_counts),
        cmocka_unit_test(equal_keys_keep_their_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
