/* preprocess/number.h - decimal numbers from text, fast, and the same bits as strtod() in the C
 * locale.
 *
 * Below 2^53, digits and a small power of ten make a double in one multiplication or division
 * (Clinger, How to Read Floating Point Numbers Accurately, PLDI 1990). Up to 19 digits and powers
 * up to 10^27 are exact in integers of 128 bits. Of longer numbers, the first 19 digits are an
 * interval whose ends are mostly the same double. What is left goes to strtod(). */
#pragma once
#include <stdbool.h>

/* Parses one number at the start of [text, end). Accepts what strtod() accepts, except hexadecimal,
 * and the ways in which programs print what is no number: nan, -nan(ind), inf, 1.#QNAN, -1.#INF.
 * returns  the first character behind it; NULL: no number, `out` is not touched */
const char *prep_number_parse(const char *text, const char *end, double *out);
