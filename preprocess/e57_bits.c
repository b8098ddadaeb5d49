#include "preprocess/e57_bits.h"

#include "preprocess/bytes.h"

#include <stdbool.h>

unsigned prep_e57_bits_width(int64_t low, int64_t high)
{
    uint64_t range = (uint64_t)high - (uint64_t)low;
    return range == 0 ? 0 : 64 - (unsigned)__builtin_clzll(range);
}

static void unpack_bytes(const uint8_t *in, unsigned width, uint32_t count, uint64_t *out)
{
    switch (width) {
    case 8:
        for (uint32_t i = 0; i < count; i++)
            out[i] = in[i];
        break;
    case 16:
        for (uint32_t i = 0; i < count; i++)
            out[i] = prep_le16(in + 2 * (size_t)i);
        break;
    case 32:
        for (uint32_t i = 0; i < count; i++)
            out[i] = prep_le32(in + 4 * (size_t)i);
        break;
    default:
        for (uint32_t i = 0; i < count; i++)
            out[i] = prep_le64(in + 8 * (size_t)i);
        break;
    }
}

/* Up to 57 bits lie in the eight bytes that begin with their first one. */
static void unpack_narrow(const uint8_t *in, size_t bit, unsigned width, uint32_t count,
                          uint64_t *out)
{
    uint64_t mask = (UINT64_C(1) << width) - 1;
    for (uint32_t i = 0; i < count; i++, bit += width)
        out[i] = prep_le64(in + (bit >> 3)) >> (bit & 7) & mask;
}

static void unpack_wide(const uint8_t *in, size_t bit, unsigned width, uint32_t count,
                        uint64_t *out)
{
    uint64_t mask = UINT64_MAX >> (64 - width);
    for (uint32_t i = 0; i < count; i++, bit += width) {
        const uint8_t *p = in + (bit >> 3);
        unsigned shift = bit & 7;
        uint64_t value = prep_le64(p) >> shift;
        if (shift != 0) value |= (uint64_t)p[8] << (64 - shift);
        out[i] = value & mask;
    }
}

void prep_e57_bits_unpack(const uint8_t *in, size_t bit, unsigned width, uint32_t count,
                          uint64_t *out)
{
    bool is_aligned = bit % 8 == 0 && (width == 8 || width == 16 || width == 32 || width == 64);
    if (width == 0) memset(out, 0, count * sizeof *out);
    else if (is_aligned) unpack_bytes(in + bit / 8, width, count, out);
    else if (width <= 57) unpack_narrow(in, bit, width, count, out);
    else unpack_wide(in, bit, width, count, out);
}
