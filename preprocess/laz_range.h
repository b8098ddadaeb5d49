/* preprocess/laz_range.h - the arithmetic decoder of LAZ, its adaptive models, and the integers
 * coded with them.
 *
 * "LAZ Specification 1.4", sections on the entropy coder and the integer compressor; the coder is
 * that of A. Said, "Introduction to Arithmetic Coding", HPL-2004-76. A range decoder keeps an
 * interval of `length` and the place of the code in it, `value` < length; damaged data may break
 * that, so nothing here relies on it: every symbol returned is in the alphabet, and every step
 * takes at most PREP_LAZ_STEP_MAX bytes.
 *
 * Nothing here knows where the bytes end. Whoever decodes makes sure beforehand that there are
 * enough of them, see laz_stream.h. That, and keeping the decoder in a local variable, is what
 * makes it fast. */
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define PREP_LAZ_INLINE static inline __attribute__((always_inline))

enum {
    PREP_LAZ_STEP_MAX = 3, /* bytes that one symbol or one group of plain bits consumes */
    PREP_LAZ_INTEGER_MAX = 4 * PREP_LAZ_STEP_MAX,
    PREP_LAZ_PEEK =
        4, /* bytes behind the next one that are looked at, whether they are needed or not */
    PREP_LAZ_SYMBOLS_MAX = 516,
};

typedef struct {
    uint32_t value, length;
    const uint8_t *next;
} prep_laz_range;

/* Adaptive frequencies of an alphabet. */
typedef struct {
    uint16_t symbols;
    uint16_t left;   /* symbols until the next adaptation */
    uint16_t cycle;  /* symbols between two of them */
    uint16_t shift;  /* from a place in the distribution to the entry of `start` */
    uint32_t total;  /* of the counts, at the last adaptation */
    uint16_t *count; /* [symbols] */
    uint16_t *start; /* [32768 >> shift] symbol at the first place that leads to this entry */
    uint16_t low[];  /* [symbols + 1] place where a symbol begins, of 32768; strictly rising */
} prep_laz_model;

/* The same for one bit. */
typedef struct {
    uint16_t zeros, total, zero_part, cycle, left;
} prep_laz_bit;

/* Where models are made as they are needed; nothing is freed but all of them at once. */
typedef struct {
    uint8_t *bytes; /* [size], owned */
    size_t used, size;
} prep_laz_arena;

/* Integers, coded as a prediction and a correction whose magnitude comes first. */
typedef struct {
    uint32_t bits;             /* 8, 16 or 32 */
    uint32_t magnitude;        /* of the correction read last; picks contexts of what follows */
    prep_laz_bit one;          /* magnitude 0: the correction is 0 or 1 */
    prep_laz_model *value[33]; /* by magnitude; NULL until needed */
} prep_laz_integer;

/* Bytes that a model of so many symbols takes of the arena. */
size_t prep_laz_model_size(uint32_t symbols);
/* Bytes that all models of an integer take, with its contexts. */
size_t prep_laz_integer_size(uint32_t bits, uint32_t contexts);

/* Makes a model in which all symbols are equally likely. The arena was made large enough for all
 * that can be asked. */
prep_laz_model *prep_laz_model_make(prep_laz_arena *arena, uint32_t symbols);
void prep_laz_model_adapt(prep_laz_model *model);
void prep_laz_bit_init(prep_laz_bit *bit);
void prep_laz_bit_adapt(prep_laz_bit *bit);
void prep_laz_integer_init(prep_laz_integer *integer, uint32_t bits);

/* Takes the first four bytes of a code. */
void prep_laz_range_begin(prep_laz_range *range, const uint8_t *bytes);

/* Takes whole bytes until the interval is wide enough again. Without a branch: whether a byte is
 * due is as good as random. */
PREP_LAZ_INLINE void prep_laz_range_widen(prep_laz_range *r)
{
    const uint8_t *p = r->next;
    uint32_t ahead = (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
    uint32_t bits = (uint32_t)__builtin_clz(r->length | 1) & 24;
    r->value = (uint32_t)(((uint64_t)r->value << 32 | ahead) << bits >> 32);
    r->length <<= bits;
    r->next = p + (bits >> 3);
}

PREP_LAZ_INLINE uint32_t prep_laz_range_symbol(prep_laz_range *r, prep_laz_model *m)
{
    uint32_t unit = r->length >> 15;
    uint32_t at = r->value / unit;
    if (at > 32767) at = 32767; /* what rounding left over at the end belongs to the last symbol */
    uint32_t symbol = m->start[at >> m->shift];
    while (m->low[symbol + 1] <= at)
        symbol++;
    uint32_t low = m->low[symbol] * unit, high = m->low[symbol + 1] * unit;
    r->value -= low;
    r->length = (symbol + 1 == m->symbols ? r->length : high) - low;
    prep_laz_range_widen(r);
    m->count[symbol]++;
    if (__builtin_expect(--m->left == 0, 0)) prep_laz_model_adapt(m);
    return symbol;
}

PREP_LAZ_INLINE uint32_t prep_laz_range_bit(prep_laz_range *r, prep_laz_bit *b)
{
    uint32_t zero = b->zero_part * (r->length >> 13);
    bool is_one = r->value >= zero;
    if (is_one) {
        r->value -= zero;
        r->length -= zero;
    } else {
        r->length = zero;
        b->zeros++;
    }
    prep_laz_range_widen(r);
    if (__builtin_expect(--b->left == 0, 0)) prep_laz_bit_adapt(b);
    return is_one;
}

/* Bits without a model, at most 19. */
PREP_LAZ_INLINE uint32_t prep_laz_range_few_bits(prep_laz_range *r, uint32_t bits)
{
    r->length >>= bits;
    uint32_t read = r->value / r->length;
    r->value -= read * r->length;
    prep_laz_range_widen(r);
    return read & ((1u << bits) - 1);
}

/* bits     1 to 32 */
PREP_LAZ_INLINE uint32_t prep_laz_range_bits(prep_laz_range *r, uint32_t bits)
{
    if (bits <= 19) return prep_laz_range_few_bits(r, bits);
    uint32_t low = prep_laz_range_few_bits(r, 16);
    return low | prep_laz_range_few_bits(r, bits - 16) << 16;
}

PREP_LAZ_INLINE uint64_t prep_laz_range_bits_64(prep_laz_range *r)
{
    uint64_t low = prep_laz_range_bits(r, 32);
    return low | (uint64_t)prep_laz_range_bits(r, 32) << 32;
}

/* The model in `slot`, made at its first use. */
PREP_LAZ_INLINE prep_laz_model *prep_laz_model_at(prep_laz_model **slot, prep_laz_arena *arena,
                                                  uint32_t symbols)
{
    if (__builtin_expect(*slot == NULL, 0)) *slot = prep_laz_model_make(arena, symbols);
    return *slot;
}

/* Reads an integer.
 * context  slot of the model that the magnitude is read with
 * returns  its lower `bits` bits */
PREP_LAZ_INLINE uint32_t prep_laz_integer_read(prep_laz_range *r, prep_laz_arena *arena,
                                               prep_laz_integer *integer, prep_laz_model **context,
                                               uint32_t prediction)
{
    uint32_t k = prep_laz_range_symbol(r, prep_laz_model_at(context, arena, integer->bits + 1));
    uint32_t correction;
    integer->magnitude = k;
    if (k == 0) {
        correction = prep_laz_range_bit(r, &integer->one);
    } else if (k < 32) {
        uint32_t modelled = k < 8 ? k : 8;
        correction =
            prep_laz_range_symbol(r, prep_laz_model_at(&integer->value[k], arena, 1u << modelled));
        if (k > 8) correction = correction << (k - 8) | prep_laz_range_bits(r, k - 8);
        /* codes of the upper half mean 2^(k-1) + 1 to 2^k, those of the lower half the same below
         * zero */
        correction += correction >> (k - 1) ? 1 : 1 - (1u << k);
    } else {
        correction = 1u << 31;
    }
    return (prediction + correction) & (0xffffffffu >> (32 - integer->bits));
}
