/* preprocess/number.h - decimal numbers from text, fast, and the same bits as strtod() in the C
 * locale.
 *
 * Up to 19 digits and a small power of ten are exact in one multiplication or division (Clinger,
 * How to Read Floating Point Numbers Accurately, PLDI 1990); what is not goes to strtod(). */
#pragma once
#include <stdbool.h>

/* Parses one number at the start of [text, end). Accepts what strtod() accepts, except hexadecimal,
 * and the ways in which programs print what is no number: nan, -nan(ind), inf, 1.#QNAN, -1.#INF.
 * returns  the first character behind it; NULL: no number, `out` is not touched */
const char *prep_number_parse(const char *text, const char *end, double *out);
