#include "preprocess/implied.h"

#include "mospt/payload.h"
#include "mospt/wide.h"

#include <stddef.h>

/* Bytes of a record that are compared together. */
enum { WINDOW = 16 };
typedef uint8_t window __attribute__((vector_size(WINDOW)));

static bool has(uint64_t set, uint32_t k)
{
    return set >> k & 1;
}

static const uint8_t *row_of(const mospt_attribute *a, const uint8_t *record)
{
    return record + sizeof(mospt_vertex) + a->offset;
}

static void begin(prep_implied *o, const mospt_schema *schema, const uint8_t *record)
{
    o->has_points = true;
    for (uint32_t k = 0; k < schema->count; k++) {
        const mospt_attribute *a = &schema->at[k];
        if (mospt_attribute_can_be(a, MOSPT_CONSTANT))
            memcpy(o->value[k], row_of(a, record), mospt_attribute_size(a));
        else o->varies |= UINT64_C(1) << k;
        if (!mospt_attribute_can_be(a, MOSPT_OF_COLOUR)) o->off_colour |= UINT64_C(1) << k;
    }
}

/* Bits in which some record differs from the first one, in the window that begins at `at`. */
MOSPT_WIDE static window find_differences(const uint8_t *records, size_t stride, uint32_t count,
                                          size_t at)
{
    window first, w, differences = {0};
    memcpy(&first, records + at, WINDOW);
    for (uint32_t i = 1; i < count; i++) {
        memcpy(&w, records + i * stride + at, WINDOW);
        differences |= w ^ first;
    }
    return differences;
}

/* The attributes of the set that have bytes in [begin, begin + WINDOW) of a record. */
static uint64_t within(const mospt_schema *schema, uint64_t set, size_t begin)
{
    uint64_t found = 0;
    for (uint32_t k = 0; k < schema->count; k++) {
        const mospt_attribute *a = &schema->at[k];
        size_t at = sizeof(mospt_vertex) + a->offset;
        if (has(set, k) && at < begin + WINDOW && begin < at + mospt_attribute_size(a))
            found |= UINT64_C(1) << k;
    }
    return found;
}

static bool differs(const mospt_attribute *a, window differences, size_t begin)
{
    size_t at = sizeof(mospt_vertex) + a->offset, end = at + mospt_attribute_size(a);
    bool found = false;
    for (size_t i = at > begin ? at - begin : 0; i < WINDOW && begin + i < end; i++)
        found = found || differences[i] != 0;
    return found;
}

/* Of the attributes that are the same so far, those that are not among these records. */
static uint64_t find_varying(uint64_t same, const mospt_schema *schema, const uint8_t *records,
                             uint32_t count)
{
    size_t stride = mospt_record_size(schema);
    uint64_t varying = 0;
    for (size_t at = sizeof(mospt_vertex); at < stride; at += WINDOW) {
        size_t begin = at + WINDOW <= stride ? at : stride - WINDOW;
        uint64_t here = within(schema, same & ~varying, begin);
        if (here == 0) continue;
        window differences = find_differences(records, stride, count, begin);
        for (uint32_t k = 0; k < schema->count; k++)
            if (has(here, k) && differs(&schema->at[k], differences, begin))
                varying |= UINT64_C(1) << k;
    }
    return varying;
}

/* The same for six bytes at the end of the window, from twice the bytes of the colour. */
MOSPT_WIDE static window find_colour_differences(const uint8_t *records, size_t stride,
                                                 uint32_t count, size_t at)
{
    window w, differences = {0};
    for (uint32_t i = 0; i < count; i++, records += stride) {
        window colour = {0};
        memcpy(&colour, records + offsetof(mospt_vertex, r), 4);
        memcpy(&w, records + at, WINDOW);
        differences |= w ^ __builtin_shufflevector(colour, colour, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 0,
                                                   0, 1, 1, 2, 2);
    }
    return differences;
}

static bool is_of_colour(const mospt_attribute *a, const uint8_t *records, size_t stride,
                         uint32_t count)
{
    size_t end = sizeof(mospt_vertex) + a->offset + mospt_attribute_size(a);
    window differences = find_colour_differences(records, stride, count, end - WINDOW);
    return !differs(a, differences, end - WINDOW);
}

void prep_implied_look(prep_implied *o, const mospt_schema *schema, const uint8_t *records,
                       uint32_t count)
{
    prep_implied block = {0};
    if (count == 0) return;
    begin(&block, schema, records);
    block.varies |= o->varies, block.off_colour |= o->off_colour; /* that is known */
    block.varies |= find_varying(~block.varies, schema, records, count);
    for (uint32_t k = 0; k < schema->count; k++)
        if (!has(block.off_colour, k) &&
            !is_of_colour(&schema->at[k], records, mospt_record_size(schema), count))
            block.off_colour |= UINT64_C(1) << k;
    prep_implied_add(o, schema, &block);
}

void prep_implied_add(prep_implied *o, const mospt_schema *schema, const prep_implied *more)
{
    if (!more->has_points) return;
    if (!o->has_points) {
        *o = *more;
        return;
    }
    o->varies |= more->varies;
    o->off_colour |= more->off_colour;
    for (uint32_t k = 0; k < schema->count; k++)
        if (!has(o->varies, k) &&
            memcmp(o->value[k], more->value[k], mospt_attribute_size(&schema->at[k])) != 0)
            o->varies |= UINT64_C(1) << k;
}

void prep_implied_apply(const prep_implied *o, mospt_schema *schema)
{
    for (uint32_t k = 0; o->has_points && k < schema->count; k++) {
        if (!has(o->varies, k)) mospt_schema_keep(schema, k, MOSPT_CONSTANT, o->value[k]);
        else if (!has(o->off_colour, k)) mospt_schema_keep(schema, k, MOSPT_OF_COLOUR, NULL);
    }
}
