/* cli_value.h - numbers, boxes and colours as a command line writes them.
 *
 * Each returns false for anything else, with `out` in an unknown state. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

/* Digits and nothing else, from low to high. */
bool cli_value_count(const char *text, uint64_t low, uint64_t high, uint64_t *out);
bool cli_value_u32(const char *text, uint32_t low, uint32_t high, uint32_t *out);

/* Two such, from 1 on, with one of the characters of `between` between them. */
bool cli_value_pair(const char *text, const char *between, uint32_t out[2]);

/* A positive number with a unit: K, M, G, T, of `base` (1000 for points, 1024 for bytes). */
bool cli_value_amount(const char *text, double base, uint64_t *out);

/* From low to high. */
bool cli_value_real(const char *text, double low, double high, double *out);
bool cli_value_float(const char *text, double low, double high, float *out);

/* X,Y,Z, all finite. */
bool cli_value_triple(const char *text, double out[3]);

/* Low x, y, z, high x, y, z; -inf and inf are numbers, too. */
bool cli_value_box(const char *text, double out[6]);

/* A name or six hexadecimal digits; ends at a comma or at the end.
 * out      0 to 1 */
bool cli_value_rgb(const char *text, float out[3], const char **end);
