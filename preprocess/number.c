#include "preprocess/number.h"

#include <locale.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Longer numbers are no measurement. */
enum { NUMBER_MAX = 511 };

enum {
    DIGITS_MAX = 19,        /* that always fit in 64 bits */
    POWER_OF_FIVE_MAX = 27, /* likewise */
};

static const double power_of_ten[23] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                        1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                        1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

static const uint64_t power_of_five[POWER_OF_FIVE_MAX + 1] = {
    1u,
    5u,
    25u,
    125u,
    625u,
    3125u,
    15625u,
    78125u,
    390625u,
    1953125u,
    9765625u,
    48828125u,
    244140625u,
    1220703125u,
    6103515625u,
    30517578125u,
    152587890625u,
    762939453125u,
    3814697265625u,
    19073486328125u,
    95367431640625u,
    476837158203125u,
    2384185791015625u,
    11920928955078125u,
    59604644775390625u,
    298023223876953125u,
    1490116119384765625u,
    7450580596923828125u,
};

static inline bool is_digit(const char *p, const char *end)
{
    return p < end && (unsigned char)(*p - '0') < 10;
}

static const char *match(const char *p, const char *end, const char *word)
{
    size_t n = strlen(word);
    return (size_t)(end - p) >= n && strncasecmp(p, word, n) == 0 ? p + n : NULL;
}

/* nan, nan(ind), inf, infinity, and the rest of 1.#QNAN; p stands behind the sign. */
static const char *parse_special(const char *p, const char *end, bool is_negative, double *out)
{
    static const struct {
        const char *word;
        bool is_nan;
    } words[] = {{"nan", true},     {"infinity", false}, {"inf", false},   {"1.#qnan", true},
                 {"1.#snan", true}, {"1.#ind", true},    {"1.#inf", false}};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        const char *q = match(p, end, words[i].word);
        if (q == NULL) continue;
        if (words[i].is_nan && q < end && *q == '(') {
            const char *close = memchr(q, ')', (size_t)(end - q));
            if (close != NULL) q = close + 1;
        }
        while (words[i].word[0] == '1' && is_digit(q, end))
            q++; /* 1.#INF00 */
        *out = words[i].is_nan ? (double)NAN : (double)INFINITY;
        if (is_negative) *out = -*out;
        return q;
    }
    return NULL;
}

static double parse_slowly(const char *text, const char *end)
{
    char copy[NUMBER_MAX + 1];
    memcpy(copy, text, (size_t)(end - text));
    copy[end - text] = '\0';
    /* the program's locale may have decimal commas; the C locale needs no memory and costs nothing
     * to ask for */
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    double value = strtod_l(copy, NULL, c);
    freelocale(c);
    return value;
}

/* The exponent behind a mantissa; false if what stands there is none ("1e", "1em"). */
static bool parse_exponent(const char **text, const char *end, int *out)
{
    const char *p = *text + 1;
    bool is_negative = p < end && *p == '-';
    if (p < end && (*p == '-' || *p == '+')) p++;
    if (!is_digit(p, end)) return false;
    int value = 0;
    for (; is_digit(p, end); p++) {
        if (value < 100000) value = value * 10 + (*p - '0');
    }
    *out = is_negative ? -value : value;
    *text = p;
    return true;
}

/* A number: top bit of `bits` set, the value bits * 2^exponent and, if is_more, a little above. */
typedef struct {
    uint64_t bits;
    int exponent;
    bool is_more;
} wide;

static wide normalise(unsigned __int128 n, int exponent, bool is_more)
{
    uint64_t high = (uint64_t)(n >> 64), low = (uint64_t)n;
    if (high == 0) {
        int zeros = __builtin_clzll(low);
        return (wide){low << zeros, exponent - zeros, is_more};
    }
    int zeros = __builtin_clzll(high);
    n <<= zeros;
    return (wide){(uint64_t)(n >> 64), exponent + 64 - zeros, is_more || (uint64_t)n != 0};
}

/* mantissa * 10^power, cut to 64 bits; mantissa > 0, |power| <= POWER_OF_FIVE_MAX. */
static wide scale(uint64_t mantissa, int power)
{
    if (power >= 0)
        return normalise((unsigned __int128)mantissa * power_of_five[power], power, false);
    /* Both shifted to the top of their 64 bits, the quotient has 63 bits at least. */
    uint64_t divisor = power_of_five[-power];
    int left = __builtin_clzll(mantissa), right = __builtin_clzll(divisor);
    divisor <<= right;
    unsigned __int128 dividend = (unsigned __int128)(mantissa << left) << 63;
    uint64_t quotient = (uint64_t)(dividend / divisor);
    bool is_more = dividend != (unsigned __int128)quotient * divisor;
    return normalise(quotient, power - 63 - left + right, is_more);
}

/* To 53 bits, to the nearest, and halfway to even. */
static double round_to_double(wide w)
{
    uint64_t bits = w.bits >> 11, rest = w.bits & 0x7ff;
    bits += rest > 0x400 || (rest == 0x400 && (w.is_more || (bits & 1) != 0));
    uint64_t power = (uint64_t)(w.exponent + 11 + 1023) << 52; /* far from both of its ends */
    double factor;
    memcpy(&factor, &power, sizeof factor);
    return (double)bits * factor;
}

/* The digits that count, as far as they fit, of a mantissa that may have a point in it.
 * dropped  out, how many do not fit */
static uint64_t take_digits(const char *p, const char *end, long *dropped)
{
    uint64_t mantissa = 0;
    int taken = 0;
    *dropped = 0;
    for (; p < end; p++) {
        if (*p == '.') continue;
        if (taken == DIGITS_MAX) {
            ++*dropped;
            continue;
        }
        mantissa = mantissa * 10 + (uint64_t)(*p - '0');
        taken += mantissa > 0;
    }
    return mantissa;
}

/* mantissa * 10^power, correctly rounded.
 * is_cut   the number is larger, by less than one unit of the mantissa
 * returns  false if only strtod() knows */
static bool multiply(uint64_t mantissa, long power, bool is_cut, double *out)
{
    if (mantissa == 0) {
        *out = 0;
        return true;
    }
    if (power < -POWER_OF_FIVE_MAX || power > POWER_OF_FIVE_MAX) return false;
    *out = round_to_double(scale(mantissa, (int)power));
    return !is_cut || *out == round_to_double(scale(mantissa + 1, (int)power));
}

const char *prep_number_parse(const char *text, const char *end, double *out)
{
    const char *p = text;
    bool is_negative = p < end && *p == '-';
    if (p < end && (*p == '-' || *p == '+')) p++;

    uint64_t mantissa = 0;
    const char *start = p;
    for (; is_digit(p, end); p++)
        mantissa = mantissa * 10 + (uint64_t)(*p - '0');
    long digits = p - start, fraction = 0;
    if (p < end && *p == '.') {
        const char *dot = p++;
        for (; is_digit(p, end); p++)
            mantissa = mantissa * 10 + (uint64_t)(*p - '0');
        fraction = p - dot - 1;
        digits += fraction;
        if (p < end && *p == '#') return parse_special(start, end, is_negative, out);
    }
    if (digits == 0) return parse_special(start, end, is_negative, out);

    const char *digits_end = p;
    int exponent = 0;
    if (p < end && (*p | 32) == 'e') parse_exponent(&p, end, &exponent);
    if (p - text > NUMBER_MAX) return NULL;
    long power = exponent - fraction, dropped = 0;
    if (digits > DIGITS_MAX) mantissa = take_digits(start, digits_end, &dropped);
    double value;
    if (dropped == 0 && mantissa <= 1ull << 53 && power >= -22 && power <= 22) {
        value = (double)mantissa;
        value = power < 0 ? value / power_of_ten[-power] : value * power_of_ten[power];
    } else if (!multiply(mantissa, power + dropped, dropped > 0, &value)) {
        value = parse_slowly(start, p);
    }
    *out = is_negative ? -value : value;
    return p;
}
