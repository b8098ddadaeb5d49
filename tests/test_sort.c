/* The radix sort against a slow, obvious sort. */
#include "tests/core_tools.h"

#include "preprocess/sort.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    uint64_t key;
    uint32_t place, low_bit;
} placed;

static int by_key_then_place(const void *a, const void *b)
{
    const placed *x = a, *y = b;
    uint64_t p = x->key >> x->low_bit, q = y->key >> y->low_bit;
    if (p != q) return p < q ? -1 : 1;
    return x->place < y->place ? -1 : x->place > y->place;
}

/* mask  which bits of the keys differ */
static void check(uint32_t count, uint64_t mask, uint32_t low_bit, uint64_t seed)
{
    uint64_t random = seed, *keys = calloc(count + 1, sizeof *keys),
             *spare = malloc((count + 1) * sizeof *spare);
    placed *want = calloc(count + 1, sizeof *want);
    assert_true(keys != NULL && want != NULL && spare != NULL);
    for (uint32_t i = 0; i < count; i++) {
        keys[i] = core_random(&random) & mask;
        want[i] = (placed){keys[i], i, low_bit};
    }
    keys[count] = 12345; /* nobody's */
    qsort(want, count, sizeof *want, by_key_then_place);
    prep_sort_keys(keys, spare, count, low_bit);
    for (uint32_t i = 0; i < count; i++)
        assert_true(keys[i] == want[i].key);
    assert_true(keys[count] == 12345);
    free(keys), free(want), free(spare);
}

static void few_and_many_keys_are_sorted(void **state)
{
    static const uint32_t counts[] = {0, 1, 2, 3, 63, 64, 65, 2047, 2048, 2049, 100000};
    (void)state;
    for (size_t k = 0; k < sizeof counts / sizeof counts[0]; k++)
        for (uint32_t low_bit = 0; low_bit < 64; low_bit += 9)
            check(counts[k], UINT64_MAX, low_bit, k);
}

static void every_bit_from_the_lowest_up_counts(void **state)
{
    (void)state;
    for (uint32_t bit = 0; bit < 64; bit++)
        check(300, UINT64_C(1) << bit, bit / 2, bit), check(300, UINT64_C(1) << bit, bit, bit);
    for (uint32_t bit = 1; bit < 64; bit += 7)
        check(5000, UINT64_MAX << bit, bit - 1, bit), check(40, UINT64_MAX << bit, bit - 1, 1);
}

static void keys_alike_keep_their_order(void **state)
{
    (void)state;
    check(10000, 0, 0, 1);
    check(10000, UINT64_C(0x40000000000fffff), 20, 2); /* what differs below does not count */
    check(10000, UINT64_MAX, 63, 2);
    check(30, 0xff, 4, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(few_and_many_keys_are_sorted),
        cmocka_unit_test(every_bit_from_the_lowest_up_counts),
        cmocka_unit_test(keys_alike_keep_their_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
