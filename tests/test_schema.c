/* Attributes, their types, and what becomes of two scans that disagree. */
#include "tests/core_tools.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double low_of[MOSPT_TYPE_COUNT] = {0,         INT8_MIN, 0,       INT16_MIN, 0,
                                                INT32_MIN, 0,        -0x1p63, -16777216, -0x1p53};
static const double high_of[MOSPT_TYPE_COUNT] = {UINT8_MAX,  INT8_MAX,  UINT16_MAX, INT16_MAX,
                                                 UINT32_MAX, INT32_MAX, 0x1p53,     0x1p53,
                                                 16777216,   0x1p53};

static void names_of_types_come_back(void **state)
{
    (void)state;
    for (int t = 0; t < MOSPT_TYPE_COUNT; t++) {
        mospt_type back;
        assert_true(mospt_type_from_name(mospt_type_name((mospt_type)t), &back));
        assert_int_equal(back, t);
    }
    mospt_type unused;
    assert_false(mospt_type_from_name("u128", &unused));
    assert_false(mospt_type_from_name("", &unused));
}

static void the_common_type_holds_the_values_of_both(void **state)
{
    (void)state;
    for (int a = 0; a < MOSPT_TYPE_COUNT; a++)
        for (int b = 0; b < MOSPT_TYPE_COUNT; b++) {
            mospt_type c = mospt_type_common((mospt_type)a, (mospt_type)b);
            assert_int_equal(c, mospt_type_common((mospt_type)b, (mospt_type)a));
            assert_int_equal(mospt_type_common((mospt_type)a, c), c);
            const double values[] = {low_of[a], high_of[a], low_of[b], high_of[b], 0, 1};
            for (int v = 0; v < 6; v++) {
                uint8_t bytes[8];
                mospt_type_write(c, values[v], bytes);
                if (mospt_type_read(c, bytes) != values[v])
                    fail_msg("%s and %s meet in %s, which does not hold %.17g",
                             mospt_type_name((mospt_type)a), mospt_type_name((mospt_type)b),
                             mospt_type_name(c), values[v]);
            }
        }
    assert_int_equal(mospt_type_common(MOSPT_U8, MOSPT_I8), MOSPT_I16);
    assert_int_equal(mospt_type_common(MOSPT_U16, MOSPT_F32), MOSPT_F32);
    assert_int_equal(mospt_type_common(MOSPT_I32, MOSPT_F32), MOSPT_F64);
    assert_int_equal(mospt_type_common(MOSPT_U64, MOSPT_I64), MOSPT_F64);
    assert_int_equal(mospt_type_common(MOSPT_U16, MOSPT_I32), MOSPT_I32);
}

static void values_are_rounded_and_clamped(void **state)
{
    static const struct {
        mospt_type type;
        double in, out;
    } cases[] = {
        {MOSPT_U8, -1, 0},
        {MOSPT_U8, 254.6, 255},
        {MOSPT_U8, 1e9, 255},
        {MOSPT_U8, NAN, 0},
        {MOSPT_U8, 2.4, 2},
        {MOSPT_I8, -129, -128},
        {MOSPT_I8, -1.6, -2},
        {MOSPT_I8, 127.4, 127},
        {MOSPT_I8, INFINITY, 127},
        {MOSPT_I8, NAN, 0},
        {MOSPT_U16, 65535.7, 65535},
        {MOSPT_I16, -40000, -32768},
        {MOSPT_U32, 5e9, UINT32_MAX},
        {MOSPT_U32, -INFINITY, 0},
        {MOSPT_I32, -3e9, INT32_MIN},
        {MOSPT_I32, 3e9, INT32_MAX},
        {MOSPT_U64, 1e30, 0x1p64},
        {MOSPT_U64, -5, 0},
        {MOSPT_U64, NAN, 0},
        {MOSPT_I64, 1e30, 0x1p63},
        {MOSPT_I64, -1e30, -0x1p63},
        {MOSPT_I64, NAN, 0},
        {MOSPT_F32, 0.5, 0.5},
        {MOSPT_F64, -1.5e300, -1.5e300},
    };
    (void)state;
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        uint8_t bytes[9];
        memset(bytes, 0xa5, sizeof bytes);
        mospt_type_write(cases[k].type, cases[k].in, bytes);
        assert_true(mospt_type_read(cases[k].type, bytes) == cases[k].out);
        for (size_t i = mospt_type_size(cases[k].type); i < sizeof bytes; i++)
            assert_int_equal(bytes[i], 0xa5);
    }
}

static void rows_are_packed(void **state)
{
    mospt_schema s = {0};
    mospt_err err = {0};
    (void)state;
    CORE_NEED(mospt_schema_add(&s, "a", MOSPT_U8, 1, &err));
    CORE_NEED(mospt_schema_add(&s, "b", MOSPT_F64, 3, &err));
    CORE_NEED(mospt_schema_add(&s, "c", MOSPT_U16, 2, &err));
    assert_int_equal(s.row_size, 1 + 24 + 4);
    assert_int_equal(s.at[1].offset, 1);
    assert_int_equal(s.at[2].offset, 25);
    assert_int_equal(mospt_schema_find(&s, "c"), 2);
    assert_int_equal(mospt_schema_find(&s, "d"), -1);
    /* The same name again widens the type and moves what comes after. */
    CORE_NEED(mospt_schema_add(&s, "a", MOSPT_I8, 1, &err));
    assert_int_equal(s.count, 3);
    assert_int_equal(s.at[0].type, MOSPT_I16);
    assert_int_equal(s.at[2].offset, 26);
    assert_int_equal(s.row_size, 30);
}

static void one_name_has_one_number_of_components(void **state)
{
    mospt_schema s = {0};
    mospt_err err = {0};
    (void)state;
    CORE_NEED(mospt_schema_add(&s, "n", MOSPT_F32, 3, &err));
    mospt_schema before = s;
    CORE_FAILS(mospt_schema_add(&s, "n", MOSPT_F32, 2, &err), MOSPT_EINVAL);
    CORE_FAILS(mospt_schema_add(&s, "m", MOSPT_F32, 0, &err), MOSPT_EINVAL);
    CORE_FAILS(mospt_schema_add(&s, "m", MOSPT_F32, 256, &err), MOSPT_EINVAL);
    assert_memory_equal(&s, &before, sizeof s);
}

static void attributes_and_bytes_are_limited(void **state)
{
    mospt_schema s = {0};
    mospt_err err = {0};
    char name[16];
    (void)state;
    for (int i = 0; i < MOSPT_ATTRIBUTES_MAX; i++) {
        snprintf(name, sizeof name, "a%d", i);
        CORE_NEED(mospt_schema_add(&s, name, MOSPT_U8, 255, &err));
    }
    CORE_FAILS(mospt_schema_add(&s, "more", MOSPT_U8, 1, &err), MOSPT_EINVAL);
    s = (mospt_schema){0};
    for (int i = 0; i < 8; i++) {
        snprintf(name, sizeof name, "a%d", i);
        CORE_NEED(mospt_schema_add(&s, name, MOSPT_F64, 255, &err));
    }
    CORE_NEED(mospt_schema_add(&s, "b", MOSPT_U8, 64, &err));
    assert_int_equal(s.row_size, MOSPT_ROW_SIZE_MAX);
    CORE_FAILS(mospt_schema_add(&s, "c", MOSPT_U8, 1, &err), MOSPT_EINVAL);
}

static void widening_does_not_pass_the_limit_of_bytes(void **state)
{
    mospt_schema s = {0};
    mospt_err err = {0};
    char name[16];
    (void)state;
    for (int i = 0; i < MOSPT_ATTRIBUTES_MAX; i++) {
        snprintf(name, sizeof name, "a%d", i);
        CORE_NEED(mospt_schema_add(&s, name, MOSPT_U8, 255, &err));
    }
    mospt_schema before = s;
    CORE_FAILS(mospt_schema_add(&s, "a7", MOSPT_F64, 255, &err), MOSPT_EINVAL);
    assert_memory_equal(&s, &before, sizeof s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_of_types_come_back),
        cmocka_unit_test(the_common_type_holds_the_values_of_both),
        cmocka_unit_test(values_are_rounded_and_clamped),
        cmocka_unit_test(rows_are_packed),
        cmocka_unit_test(one_name_has_one_number_of_components),
        cmocka_unit_test(attributes_and_bytes_are_limited),
        cmocka_unit_test(widening_does_not_pass_the_limit_of_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
