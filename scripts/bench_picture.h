/* scripts/bench_picture.h - how alike two pictures are. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

/* Luminance of a picture, 0 to 255.
 * rgb      [count * 3] */
void bench_luminance(const uint8_t *rgb, uint32_t count, float *out);

/* Structural similarity (Wang, Bovik, Sheikh and Simoncelli 2004): mean over all pixels with a
 * Gaussian window of 11 x 11, sigma 1.5, cut off at the borders, and the usual constants.
 * a, b     [width * height] luminances
 * returns  1 for the same picture; negative without memory */
double bench_similarity(const float *a, const float *b, uint32_t width, uint32_t height);

/* Of the pixels that `full` covers, the share that `ours` does not; depths, 1: nothing there. */
double bench_missing(const float *full, const float *ours, uint32_t count);

/* How much more or less a picture changes to the next one than the full picture does: mean absolute
 * difference, levels of 255. */
double bench_flicker(const float *full[2], const float *ours[2], uint32_t count);
