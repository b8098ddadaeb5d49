/* preprocess/e57_bits.h - integers packed into as many bits as their range needs, the lowest bit
 * first (ASTM E2807, bitPackCodec). Floating-point values are 32 or 64 bits of the same stream, so
 * one function unpacks everything. */
#pragma once
#include <stddef.h>
#include <stdint.h>

/* Bits of a value between `low` and `high`, 0 to 64; 0 where they are equal: such a field takes no
 * room at all. */
unsigned prep_e57_bits_width(int64_t low, int64_t high);

/* Unpacks `count` values.
 * in       readable for 9 bytes behind the one in which the last value ends
 * bit      where the first value begins
 * width    0 to 64
 * out      [count], without sign: the caller adds the least value of the range */
void prep_e57_bits_unpack(const uint8_t *in, size_t bit, unsigned width, uint32_t count,
                          uint64_t *out);
