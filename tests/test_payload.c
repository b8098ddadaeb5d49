/* The bytes of a node: vertices, then plane after plane. */
#include "tests/core_tools.h"

#include "mospt/hash.h"
#include "mospt/payload.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SHIFT = 3 };

/* The value of an attribute is that of the record, or what its schema says that it is. */
static void assert_value(const mospt_attribute *a, const uint8_t *record, const uint8_t *value)
{
    const uint8_t *c = record + offsetof(mospt_vertex, r);
    const uint8_t rgb[] = {c[0], c[0], c[1], c[1], c[2], c[2]};
    const uint8_t *wanted = record + sizeof(mospt_vertex) + a->stored_offset;
    if (a->storage == MOSPT_CONSTANT) wanted = a->constant;
    if (a->storage == MOSPT_OF_COLOUR) wanted = rgb;
    assert_memory_equal(value, wanted, mospt_attribute_size(a));
}

static void check(const mospt_schema *schema, uint32_t record_count, uint32_t count)
{
    size_t stride = mospt_record_size(schema), whole = sizeof(mospt_vertex) + schema->row_size;
    uint64_t random = count;
    uint8_t *records = malloc(record_count * stride + 1), *out = malloc(count * whole + 1),
            *picked = malloc(count * stride + 1);
    uint32_t *order = malloc((count + 1) * sizeof *order);
    const uint8_t **blocks = malloc(((record_count >> SHIFT) + 1) * sizeof *blocks);
    mospt_node node = {.level = 3};
    assert_true(records != NULL && blocks != NULL && out != NULL && order != NULL &&
                picked != NULL);
    for (size_t i = 0; i < record_count * stride; i++)
        records[i] = (uint8_t)core_random(&random);
    for (uint32_t i = 0; i < count; i++) {
        order[i] = core_below(&random, record_count);
        memcpy(picked + i * stride, records + order[i] * stride, stride);
    }
    uint64_t payload_size = mospt_payload_size(schema, count);
    memset(out, 0xa5, count * whole + 1);
    /* Whole blocks of 2^SHIFT, as a spool has them. */
    for (uint32_t b = 0; b <= record_count >> SHIFT; b++)
        blocks[b] = records + ((size_t)b << SHIFT) * stride;
    uint64_t hash = mospt_payload_pack(schema, &(mospt_records){blocks, stride, SHIFT}, order,
                                       count, out, &node);
    assert_true(hash == mospt_hash_records(picked, stride, count));
    for (uint64_t i = payload_size; i <= count * whole; i++)
        assert_int_equal(out[i], 0xa5);
    assert_int_equal(node.count, count);
    assert_int_equal(node.level, 3);
    assert_int_equal(node.payload_size, payload_size);
    uint8_t *planes = out + count * sizeof(mospt_vertex);
    assert_true(node.vertices_hash == mospt_hash(out, count * sizeof(mospt_vertex)));
    assert_true(node.attributes_hash == mospt_hash(planes, count * (size_t)schema->stored_size));
    assert_true(mospt_payload_points_hash(schema, out, planes, count) == hash);
    mospt_payload_complete(schema, (const mospt_vertex *)(const void *)out, count, planes);
    assert_int_equal(out[count * whole], 0xa5);
    for (uint32_t i = 0; i < count; i++) {
        assert_memory_equal(out + i * sizeof(mospt_vertex), picked + i * stride,
                            sizeof(mospt_vertex));
        for (uint32_t k = 0; k < schema->count; k++)
            assert_value(&schema->at[k], picked + i * stride,
                         planes + (size_t)count * schema->at[k].offset +
                             i * mospt_attribute_size(&schema->at[k]));
    }
    free(records), free(out), free(order), free(picked), free(blocks);
}

static void planes_hold_what_records_held(void **state)
{
    static const uint32_t counts[] = {0, 1, 2, 255, 256, 257, 1000};
    mospt_schema none = {0}, one = {0}, all = {0};
    mospt_err err = {0};
    char name[16];
    (void)state;
    CORE_NEED(mospt_schema_add(&one, "scan", MOSPT_U16, 1, &err));
    for (int t = 0; t < MOSPT_TYPE_COUNT; t++)
        for (uint32_t components = 1; components <= 4; components++) {
            snprintf(name, sizeof name, "t%d_%u", t, components);
            CORE_NEED(mospt_schema_add(&all, name, (mospt_type)t, components, &err));
        }
    for (size_t k = 0; k < sizeof counts / sizeof counts[0]; k++) {
        check(&none, 300, counts[k]);
        check(&one, 300, counts[k]);
        check(&all, 300, counts[k]);
    }
}

/* Of which many are taken out of the records at a time. */
static void attributes_of_a_byte_or_two_are_packed(void **state)
{
    static const uint32_t counts[] = {1, 15, 16, 17, 256, 300};
    mospt_schema s = {0};
    mospt_err err = {0};
    char name[16];
    (void)state;
    for (int i = 0; i < 40; i++) {
        snprintf(name, sizeof name, "a%d", i);
        CORE_NEED(mospt_schema_add(&s, name, i % 16 == 15 ? MOSPT_U16 : MOSPT_I8, 1, &err));
        for (size_t k = 0; k < sizeof counts / sizeof counts[0]; k++)
            check(&s, 50, counts[k]);
    }
}

/* Whichever they are, first, last or all. */
static void what_is_not_stored_comes_back(void **state)
{
    static const uint32_t counts[] = {0, 1, 17, 300};
    static const uint8_t constant[MOSPT_CONSTANT_SIZE_MAX] = {1, 0, 255, 7, 6, 5, 4, 3};
    (void)state;
    for (uint32_t kept = 0; kept < 3 * 3 * 3 * 3 * 3; kept++) {
        mospt_schema s = {0};
        mospt_err err = {0};
        CORE_NEED(mospt_schema_add(&s, "a", MOSPT_U8, 1, &err));
        CORE_NEED(mospt_schema_add(&s, "rgb", MOSPT_U16, 3, &err));
        CORE_NEED(mospt_schema_add(&s, "b", MOSPT_F64, 1, &err));
        CORE_NEED(mospt_schema_add(&s, "twice", MOSPT_U16, 3, &err));
        CORE_NEED(mospt_schema_add(&s, "c", MOSPT_U16, 2, &err));
        for (uint32_t k = 0, rest = kept; k < s.count; k++, rest /= 3)
            if (mospt_attribute_can_be(&s.at[k], (mospt_storage)(rest % 3)))
                mospt_schema_keep(&s, k, (mospt_storage)(rest % 3), constant);
        for (size_t k = 0; k < sizeof counts / sizeof counts[0]; k++)
            check(&s, 50, counts[k]);
    }
}

static void the_widest_rows_are_packed(void **state)
{
    mospt_schema s = {0};
    mospt_err err = {0};
    char name[16];
    (void)state;
    for (int i = 0; i < 8; i++) {
        snprintf(name, sizeof name, "a%d", i);
        CORE_NEED(mospt_schema_add(&s, name, MOSPT_F64, 255, &err));
    }
    CORE_NEED(mospt_schema_add(&s, "b", MOSPT_U8, 64, &err));
    assert_int_equal(s.row_size, MOSPT_ROW_SIZE_MAX);
    check(&s, 20, 300);
}

static void the_sum_of_hashes_does_not_depend_on_the_order_but_on_every_byte(void **state)
{
    uint8_t records[50 * 18], back[50 * 18];
    uint64_t random = 1;
    (void)state;
    for (size_t i = 0; i < sizeof records; i++)
        records[i] = (uint8_t)core_random(&random);
    for (size_t i = 0; i < 50; i++)
        memcpy(back + i * 18, records + (49 - i) * 18, 18);
    uint64_t sum = mospt_hash_records(records, 18, 50);
    assert_true(sum == mospt_hash_records(back, 18, 50));
    for (size_t i = 0; i < sizeof records; i++) {
        records[i] ^= 1;
        assert_true(sum != mospt_hash_records(records, 18, 50));
        records[i] ^= 1;
    }
    assert_true(sum != mospt_hash_records(records, 18, 49));
    assert_true(mospt_hash_records(records, 18, 0) == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(planes_hold_what_records_held),
        cmocka_unit_test(attributes_of_a_byte_or_two_are_packed),
        cmocka_unit_test(what_is_not_stored_comes_back),
        cmocka_unit_test(the_widest_rows_are_packed),
        cmocka_unit_test(the_sum_of_hashes_does_not_depend_on_the_order_but_on_every_byte),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
