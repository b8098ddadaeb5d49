#include "preprocess/implied.h"

#include "mospt/turn.h"
#include "mospt/wide.h"

#include <string.h>

static bool has(uint64_t set, uint32_t k)
{
    return set >> k & 1;
}

void prep_implied_begin(mospt_schema *schema, const uint8_t *const *planes)
{
    for (uint32_t k = 0; k < schema->count; k++)
        if (mospt_attribute_can_be(&schema->at[k], MOSPT_CONSTANT))
            mospt_schema_keep(schema, k, MOSPT_CONSTANT, planes[k]);
}

/* Each value of a plane is that of the point before it. */
static bool is_constant(const mospt_attribute *a, const uint8_t *plane, uint32_t count)
{
    size_t size = mospt_attribute_size(a);
    return memcmp(plane, a->constant, size) == 0 &&
           memcmp(plane, plane + size, (count - 1) * size) == 0;
}

/* The colours of four points fill a row, and twice as much, without intensity, one and a half. */
MOSPT_WIDE static bool is_of_colour(const uint8_t *plane, const uint8_t *rgbi, uint32_t count)
{
    enum { POINTS = 4, HALF = MOSPT_TURN / 2, SIZE = 6 };
    mospt_row differences = {0};
    uint32_t i = 0;
    for (; i + POINTS <= count; i += POINTS) {
        mospt_row c, first, last;
        const uint8_t *values = plane + (size_t)i * SIZE;
        memcpy(&c, rgbi + 4 * (size_t)i, sizeof c);
        memcpy(&first, values, sizeof first);
        memcpy(&last, values + HALF, sizeof last); /* half of it again */
        differences |=
            first ^ __builtin_shufflevector(c, c, 0, 0, 1, 1, 2, 2, 4, 4, 5, 5, 6, 6, 8, 8, 9, 9);
        differences |= last ^ __builtin_shufflevector(c, c, 5, 5, 6, 6, 8, 8, 9, 9, 10, 10, 12, 12,
                                                      13, 13, 14, 14);
    }
    bool found = false;
    for (int b = 0; b < MOSPT_TURN; b++)
        found = found || differences[b] != 0;
    for (; i < count; i++)
        for (uint32_t b = 0; b < SIZE; b++)
            found = found || plane[i * SIZE + b] != rgbi[4 * i + b / 2];
    return !found;
}

void prep_implied_look(const mospt_attribute *a, uint32_t k, const uint8_t *plane,
                       const uint8_t *rgbi, uint32_t count, prep_differing *differs)
{
    if (count == 0) return;
    if (a->storage == MOSPT_CONSTANT && !has(differs->in_value, k) && !is_constant(a, plane, count))
        differs->in_value |= UINT64_C(1) << k;
    if (mospt_attribute_can_be(a, MOSPT_OF_COLOUR) && !has(differs->from_colour, k) &&
        !is_of_colour(plane, rgbi, count))
        differs->from_colour |= UINT64_C(1) << k;
}

bool prep_implied_holds(const mospt_schema *schema, const prep_differing *differs)
{
    bool holds = true;
    for (uint32_t k = 0; k < schema->count; k++) {
        mospt_storage storage = schema->at[k].storage;
        holds = holds && !(storage == MOSPT_CONSTANT && has(differs->in_value, k)) &&
                !(storage == MOSPT_OF_COLOUR && has(differs->from_colour, k));
    }
    return holds;
}

void prep_implied_correct(mospt_schema *schema, const prep_differing *differs)
{
    for (uint32_t k = 0; k < schema->count; k++) {
        const mospt_attribute *a = &schema->at[k];
        bool is_colour =
            mospt_attribute_can_be(a, MOSPT_OF_COLOUR) && !has(differs->from_colour, k);
        if (a->storage == MOSPT_CONSTANT && has(differs->in_value, k))
            mospt_schema_keep(schema, k, is_colour ? MOSPT_OF_COLOUR : MOSPT_IN_PLANE, NULL);
        else if (a->storage == MOSPT_OF_COLOUR && !is_colour)
            mospt_schema_keep(schema, k, MOSPT_IN_PLANE, NULL);
    }
}
