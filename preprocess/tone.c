#include "preprocess/tone.h"

#include <math.h>
#include <stdlib.h>

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

prep_tone prep_tone_make(double *values, size_t count)
{
    size_t n = 0;
    bool is_integer = true;
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(values[i])) continue;
        is_integer = is_integer && values[i] == floor(values[i]);
        values[n++] = values[i];
    }
    if (n == 0) return (prep_tone){.is_flat = true};
    qsort(values, n, sizeof *values, compare);
    double low = values[0], high = values[n - 1];
    if (low == high) return (prep_tone){.is_flat = true, .low = low - 255, .scale = 1};
    if (is_integer && low >= 0 && high > 1 && high <= 255) return (prep_tone){.scale = 1};
    size_t tail = n / 200;
    if (values[tail] < values[n - 1 - tail]) {
        low = values[tail];
        high = values[n - 1 - tail];
    }
    return (prep_tone){.low = low, .scale = 255 / (high - low)};
}
