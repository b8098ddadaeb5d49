#include "preprocess/number.h"

#include <locale.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Longer numbers are no measurement. */
enum { NUMBER_MAX = 511 };

static const double power_of_ten[23] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                        1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                        1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

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

    int exponent = 0;
    if (p < end && (*p | 32) == 'e') parse_exponent(&p, end, &exponent);
    if (p - text > NUMBER_MAX) return NULL;
    long power = exponent - fraction;
    /* 19 digits cannot have overflowed 64 bits; below 2^53 they are a double as they stand */
    if (digits > 19 || mantissa > 1ull << 53 || power < -22 || power > 22) {
        *out = parse_slowly(text, p);
        return p;
    }
    double value = (double)mantissa;
    value = power < 0 ? value / power_of_ten[-power] : value * power_of_ten[power];
    *out = is_negative ? -value : value;
    return p;
}
