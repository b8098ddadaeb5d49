/* What all points have in common need not be stored: found exactly where it is so. */
#include "tests/core_tools.h"

#include "preprocess/implied.h"

#include <stdlib.h>
#include <string.h>

enum { COUNT = 500, ATTRIBUTES = 6, RGB = 1, WIDE = 3 };

/* Points in planes, all with the same attributes but for "rgb", which is their colour. */
typedef struct {
    mospt_schema schema;
    uint8_t rgbi[4 * COUNT];
    uint8_t *planes[ATTRIBUTES]; /* owned */
} points;

static points make_points(uint64_t seed)
{
    points p = {0};
    mospt_err err = {0};
    CORE_NEED(mospt_schema_add(&p.schema, "a", MOSPT_U8, 1, &err));
    CORE_NEED(mospt_schema_add(&p.schema, "rgb", MOSPT_U16, 3, &err));
    CORE_NEED(mospt_schema_add(&p.schema, "b", MOSPT_U16, 1, &err));
    CORE_NEED(mospt_schema_add(&p.schema, "wide", MOSPT_F32, 3, &err)); /* for a constant */
    CORE_NEED(mospt_schema_add(&p.schema, "c", MOSPT_F64, 1, &err));
    CORE_NEED(mospt_schema_add(&p.schema, "d", MOSPT_U8, 1, &err));
    for (size_t i = 0; i < sizeof p.rgbi; i++)
        p.rgbi[i] = (uint8_t)core_random(&seed);
    for (uint32_t k = 0; k < ATTRIBUTES; k++) {
        size_t size = mospt_attribute_size(&p.schema.at[k]);
        p.planes[k] = malloc(COUNT * size);
        assert_non_null(p.planes[k]);
        for (size_t i = 0; i < COUNT * size; i++) {
            p.planes[k][i] = (uint8_t)(3 * (i % size) + k);
            if (k == RGB) p.planes[k][i] = p.rgbi[i / 6 * 4 + i % 6 / 2];
        }
    }
    return p;
}

static void free_points(points *p)
{
    for (uint32_t k = 0; k < ATTRIBUTES; k++)
        free(p->planes[k]);
}

/* Looks at all points, `step` at a time. */
static prep_differing look(const points *p, const mospt_schema *schema, uint32_t step)
{
    prep_differing differs = {0};
    for (uint32_t i = 0; i < COUNT; i += step)
        for (uint32_t k = 0; k < ATTRIBUTES; k++)
            if (schema->at[k].storage != MOSPT_IN_PLANE)
                prep_implied_look(
                    &schema->at[k], k, p->planes[k] + i * mospt_attribute_size(&schema->at[k]),
                    p->rgbi + 4 * (size_t)i, COUNT - i < step ? COUNT - i : step, &differs);
    return differs;
}

/* How the attributes are kept that all points have in common. */
static mospt_schema keep(const points *p, uint32_t step)
{
    mospt_schema kept = p->schema;
    prep_implied_begin(&kept, (const uint8_t *const *)p->planes);
    prep_differing differs = look(p, &kept, step);
    prep_implied_correct(&kept, &differs);
    assert_true(prep_implied_holds(&kept, &differs));
    return kept;
}

static void what_is_the_same_in_all_points_is_a_constant(void **state)
{
    static const uint32_t steps[] = {1, 3, 4, 7, 256, COUNT};
    static const mospt_storage wanted[ATTRIBUTES] = {MOSPT_CONSTANT, MOSPT_OF_COLOUR,
                                                     MOSPT_CONSTANT, MOSPT_IN_PLANE,
                                                     MOSPT_CONSTANT, MOSPT_CONSTANT};
    points p = make_points(1);
    (void)state;
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        mospt_schema kept = keep(&p, steps[i]);
        for (uint32_t k = 0; k < ATTRIBUTES; k++) {
            assert_int_equal(kept.at[k].storage, wanted[k]);
            if (wanted[k] == MOSPT_CONSTANT)
                assert_memory_equal(kept.at[k].constant, p.planes[k],
                                    mospt_attribute_size(&kept.at[k]));
        }
        assert_int_equal(kept.stored_size, 12);
    }
    free_points(&p);
}

static void one_bit_of_one_point_makes_the_difference(void **state)
{
    static const uint32_t steps[] = {1, 16, 255, COUNT},
                          places[] = {0, 1, 2, 3, 254, 255, COUNT - 1};
    points p = make_points(2);
    const mospt_schema whole = keep(&p, COUNT);
    (void)state;
    for (uint32_t k = 0; k < ATTRIBUTES; k++) {
        size_t size = mospt_attribute_size(&p.schema.at[k]);
        for (size_t b = 0; b < size; b++)
            for (size_t at = 0; at < sizeof places / sizeof places[0]; at++)
                for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
                    uint8_t *byte = p.planes[k] + places[at] * size + b;
                    *byte ^= (uint8_t)(1u << b % 8);
                    mospt_schema kept = keep(&p, steps[i]);
                    prep_differing differs = look(&p, &whole, steps[i]);
                    *byte ^= (uint8_t)(1u << b % 8);
                    for (uint32_t j = 0; j < ATTRIBUTES; j++)
                        assert_int_equal(kept.at[j].storage == MOSPT_IN_PLANE, j == k || j == WIDE);
                    assert_int_equal(prep_implied_holds(&whole, &differs), k == WIDE);
                }
    }
    free_points(&p);
}

/* Colours that are all the same are a constant, as long as they are. */
static void a_constant_may_turn_out_to_be_the_colour(void **state)
{
    points p = make_points(3);
    mospt_schema kept = p.schema;
    (void)state;
    prep_implied_begin(&kept, (const uint8_t *const *)p.planes);
    assert_int_equal(kept.at[RGB].storage, MOSPT_CONSTANT);
    prep_differing differs = {0};
    prep_implied_look(&kept.at[RGB], RGB, p.planes[RGB], p.rgbi, 1, &differs);
    assert_true(prep_implied_holds(&kept, &differs));
    prep_implied_look(&kept.at[RGB], RGB, p.planes[RGB], p.rgbi, COUNT, &differs);
    assert_false(prep_implied_holds(&kept, &differs));
    prep_implied_correct(&kept, &differs);
    assert_int_equal(kept.at[RGB].storage, MOSPT_OF_COLOUR);
    p.planes[RGB][6 * COUNT - 1] ^= 1;
    prep_implied_look(&kept.at[RGB], RGB, p.planes[RGB], p.rgbi, COUNT, &differs);
    assert_false(prep_implied_holds(&kept, &differs));
    prep_implied_correct(&kept, &differs);
    assert_int_equal(kept.at[RGB].storage, MOSPT_IN_PLANE);
    free_points(&p);
}

static void nothing_is_found_in_no_points(void **state)
{
    points p = make_points(4);
    mospt_schema kept = keep(&p, COUNT);
    prep_differing differs = {0};
    (void)state;
    for (uint32_t k = 0; k < ATTRIBUTES; k++)
        prep_implied_look(&kept.at[k], k, NULL, NULL, 0, &differs);
    assert_true(differs.in_value == 0 && differs.from_colour == 0);
    free_points(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_the_same_in_all_points_is_a_constant),
        cmocka_unit_test(one_bit_of_one_point_makes_the_difference),
        cmocka_unit_test(a_constant_may_turn_out_to_be_the_colour),
        cmocka_unit_test(nothing_is_found_in_no_points),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
