/* What all points have in common need not be stored: found exactly where it is so. */
#include "tests/core_tools.h"

#include "preprocess/implied.h"

#include <stdlib.h>
#include <string.h>

enum { COUNT = 500 };

static mospt_schema make_schema(void)
{
    mospt_schema s = {0};
    mospt_err err = {0};
    CORE_NEED(mospt_schema_add(&s, "a", MOSPT_U8, 1, &err));
    CORE_NEED(mospt_schema_add(&s, "rgb", MOSPT_U16, 3, &err));
    CORE_NEED(mospt_schema_add(&s, "b", MOSPT_U16, 1, &err));
    CORE_NEED(mospt_schema_add(&s, "wide", MOSPT_F32, 3, &err)); /* too wide for a constant */
    CORE_NEED(mospt_schema_add(&s, "c", MOSPT_F64, 1, &err));
    CORE_NEED(mospt_schema_add(&s, "d", MOSPT_U8, 1, &err));
    return s;
}

static uint8_t *row(const mospt_schema *s, uint8_t *record, uint32_t k)
{
    return record + sizeof(mospt_vertex) + s->at[k].offset;
}

/* The same attributes in all records, with the colour as 16 bits in "rgb". */
static uint8_t *make_records(const mospt_schema *s, uint64_t seed)
{
    size_t stride = mospt_record_size(s);
    uint8_t *records = calloc(COUNT, stride);
    assert_non_null(records);
    for (uint32_t i = 0; i < COUNT; i++) {
        uint8_t *r = records + i * stride, *rgb = row(s, r, 1);
        for (size_t b = 0; b < sizeof(mospt_vertex); b++)
            r[b] = (uint8_t)core_random(&seed);
        for (size_t b = 0; b < s->row_size; b++)
            row(s, r, 0)[b] = (uint8_t)(3 * b + 1);
        for (size_t c = 0; c < 3; c++)
            rgb[2 * c] = rgb[2 * c + 1] = r[offsetof(mospt_vertex, r) + c];
    }
    return records;
}

/* How the attributes are kept, if the records are looked at in parts: each of `step`, and these put
 * together. */
static mospt_schema keep(const mospt_schema *s, const uint8_t *records, uint32_t step)
{
    mospt_schema kept = *s;
    prep_implied all = {0}, part = {0};
    for (uint32_t i = 0; i < COUNT; i += step) {
        uint32_t n = COUNT - i < step ? COUNT - i : step;
        prep_implied_look(&part, s, records + i * mospt_record_size(s), n);
        if (i / step % 3 != 2) continue; /* the next part goes on with this one */
        prep_implied_add(&all, s, &part);
        part = (prep_implied){0};
    }
    prep_implied_add(&all, s, &part);
    prep_implied_apply(&all, &kept);
    return kept;
}

static void what_is_the_same_in_all_points_is_a_constant(void **state)
{
    static const uint32_t steps[] = {1, 7, 256, COUNT};
    mospt_schema s = make_schema();
    uint8_t *records = make_records(&s, 1);
    (void)state;
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        mospt_schema kept = keep(&s, records, steps[i]);
        static const mospt_storage wanted[] = {MOSPT_CONSTANT, MOSPT_OF_COLOUR, MOSPT_CONSTANT,
                                               MOSPT_IN_PLANE, MOSPT_CONSTANT,  MOSPT_CONSTANT};
        for (uint32_t k = 0; k < s.count; k++) {
            assert_int_equal(kept.at[k].storage, wanted[k]);
            if (wanted[k] == MOSPT_CONSTANT)
                assert_memory_equal(kept.at[k].constant, row(&s, records, k),
                                    mospt_attribute_size(&s.at[k]));
        }
        assert_int_equal(kept.stored_size, 12);
    }
    free(records);
}

static void one_bit_of_one_point_makes_the_difference(void **state)
{
    static const uint32_t steps[] = {1, 16, 256, COUNT}, places[] = {0, 1, 255, 256, COUNT - 1};
    mospt_schema s = make_schema();
    uint8_t *records = make_records(&s, 2);
    (void)state;
    for (size_t at = 0; at < s.row_size; at++)
        for (size_t p = 0; p < sizeof places / sizeof places[0]; p++)
            for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
                uint8_t *byte =
                    records + places[p] * mospt_record_size(&s) + sizeof(mospt_vertex) + at;
                *byte ^= (uint8_t)(1u << at % 8);
                mospt_schema kept = keep(&s, records, steps[i]);
                *byte ^= (uint8_t)(1u << at % 8);
                for (uint32_t k = 0; k < s.count; k++) {
                    size_t size = mospt_attribute_size(&s.at[k]);
                    bool is_changed = at >= s.at[k].offset && at < s.at[k].offset + size;
                    assert_int_equal(kept.at[k].storage == MOSPT_IN_PLANE, is_changed || k == 3);
                }
            }
    free(records);
}

static void a_single_point_has_all_in_common_with_itself(void **state)
{
    mospt_schema s = make_schema(), kept = s;
    uint8_t *records = make_records(&s, 3);
    prep_implied one = {0};
    (void)state;
    prep_implied_look(&one, &s, records, 0);
    prep_implied_apply(&one, &kept);
    assert_int_equal(kept.stored_size, s.row_size); /* of nothing, nothing is said */
    prep_implied_look(&one, &s, records, 1);
    prep_implied_apply(&one, &kept);
    assert_int_equal(kept.at[1].storage, MOSPT_CONSTANT);
    assert_int_equal(kept.stored_size, 12);
    free(records);
}

static void rows_of_a_byte_are_looked_at(void **state)
{
    mospt_schema s = {0}, kept;
    mospt_err err = {0};
    (void)state;
    CORE_NEED(mospt_schema_add(&s, "a", MOSPT_U8, 1, &err));
    size_t stride = mospt_record_size(&s);
    uint8_t *records = calloc(COUNT, stride);
    assert_non_null(records);
    for (uint32_t i = 0; i < COUNT; i++)
        records[i * stride] = (uint8_t)i; /* the vertex does not matter */
    kept = keep(&s, records, COUNT);
    assert_int_equal(kept.at[0].storage, MOSPT_CONSTANT);
    records[COUNT * stride - 1] = 1;
    kept = keep(&s, records, COUNT);
    assert_int_equal(kept.at[0].storage, MOSPT_IN_PLANE);
    free(records);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_the_same_in_all_points_is_a_constant),
        cmocka_unit_test(one_bit_of_one_point_makes_the_difference),
        cmocka_unit_test(a_single_point_has_all_in_common_with_itself),
        cmocka_unit_test(rows_of_a_byte_are_looked_at),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
