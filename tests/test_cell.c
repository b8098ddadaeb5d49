/* Cells as bit strings, against a twin that goes bit by bit. */
#include "mospt/cell.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static uint32_t next_random(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state ^ *state >> 15;
}

/* Bit `level` of a coordinate, counted from the upper end of the cell; below its resolution 0. */
static uint64_t bit_of(uint32_t v, uint32_t cell_bits, uint32_t level)
{
    return level < cell_bits ? v >> (cell_bits - 1 - level) & 1 : 0;
}

static uint64_t slow_code(uint32_t x, uint32_t y, uint32_t z, uint32_t cell_bits, uint32_t depth)
{
    uint64_t code = 0;
    for (uint32_t level = 0; level < depth; level++)
        code = code << 3 | bit_of(x, cell_bits, level) | bit_of(y, cell_bits, level) << 1 |
               bit_of(z, cell_bits, level) << 2;
    return code;
}

static void codes_of_many_are_those_of_each(void **state)
{
    static const uint32_t counts[] = {1, 7, 8, 15, 16, 17, 63, MOSPT_CELL_POINTS_MAX};
    mospt_cell_points p;
    uint64_t codes[MOSPT_CELL_POINTS_MAX];
    uint32_t seed = 1, short_codes[MOSPT_CELL_POINTS_MAX];
    (void)state;
    for (uint32_t bits = 0; bits <= 32; bits++)
        for (uint32_t depth = 1; depth <= MOSPT_CODE_LEVELS; depth++) {
            uint32_t count = counts[next_random(&seed) % (sizeof counts / sizeof counts[0])];
            for (uint32_t i = 0; i < count; i++)
                p.x[i] = next_random(&seed), p.y[i] = next_random(&seed),
                p.z[i] = next_random(&seed);
            mospt_cell_codes(&p, count, bits, depth, codes);
            if (depth <= 10) mospt_cell_codes_short(&p, count, bits, depth, short_codes);
            for (uint32_t i = 0; i < count; i++) {
                uint64_t right = slow_code(p.x[i], p.y[i], p.z[i], bits, depth);
                assert_true(mospt_cell_code(p.x[i], p.y[i], p.z[i], bits, depth) == right);
                assert_true(codes[i] == right);
                if (depth <= 10) assert_true(short_codes[i] == right);
            }
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(codes_of_many_are_those_of_each)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
