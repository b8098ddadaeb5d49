#include "preprocess/tone.h"

#include "mospt/wide.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Sorts values that are whole numbers of 16 bits, as most are, by counting them. Returns false
 * where one is not. */
static bool sort_by_counting(double *values, size_t count)
{
    uint16_t counts[UINT16_MAX + 1] = {0};
    bool fits = count <= UINT16_MAX;
    for (size_t i = 0; fits && i < count; i++) {
        fits = values[i] >= 0 && values[i] <= UINT16_MAX && values[i] == (uint16_t)values[i];
        if (fits) counts[(uint16_t)values[i]]++;
    }
    for (uint32_t v = 0, out = 0; fits && out < count; v++)
        for (uint32_t i = 0; i < counts[v]; i++)
            values[out++] = v;
    return fits;
}

/* Half of the points should not be darker than this share of white... */
static const double MEDIAN_SHOWN = 0.35;
/* ... but noise in the dark is not to be blown up without bound. */
static const double POWER_MIN = 0.4;

static prep_tone make_curve(double low, double high, double power)
{
    prep_tone tone = {.low = low, .scale = (PREP_TONE_STEPS - 1) / (high - low)};
    for (int i = 0; i < PREP_TONE_STEPS; i++)
        tone.curve[i] = (uint8_t)(255 * pow(i / (PREP_TONE_STEPS - 1.0), power) + 0.5);
    return tone;
}

prep_tone prep_tone_make(double *values, size_t count)
{
    prep_tone tone = {.is_flat = true};
    size_t n = 0;
    for (size_t i = 0; i < count; i++)
        if (isfinite(values[i])) values[n++] = values[i];
    if (n > 0 && !sort_by_counting(values, n)) qsort(values, n, sizeof *values, compare);
    if (n == 0 || values[0] == values[n - 1]) {
        memset(tone.curve, 255, sizeof tone.curve);
        return tone;
    }
    size_t tail = n / 200;
    if (!(values[tail] < values[n - 1 - tail])) tail = 0;
    double low = values[tail], high = values[n - 1 - tail];
    double median = (values[n / 2] - low) / (high - low), power = POWER_MIN;
    if (median > 0) power = median < MEDIAN_SHOWN ? log(MEDIAN_SHOWN) / log(median) : 1;
    return make_curve(low, high, power > POWER_MIN ? power : POWER_MIN);
}

enum { BLOCK = 256 };

/* Places on the curve, so that the vector unit has only numbers to deal with. */
MOSPT_WIDE static void find_places(const prep_tone *tone, const uint16_t *values, uint32_t count,
                                   int32_t *places)
{
    for (uint32_t i = 0; i < count; i++) {
        double place = (values[i] - tone->low) * tone->scale + 0.5;
        place = place > 0 ? place : 0;
        places[i] = (int32_t)(place < PREP_TONE_STEPS - 1 ? place : PREP_TONE_STEPS - 1);
    }
}

void prep_tone_apply_16(const prep_tone *tone, const uint16_t *values, uint32_t count,
                        uint8_t *shown)
{
    int32_t places[BLOCK];
    for (uint32_t n; count > 0; values += n, shown += n, count -= n) {
        n = count < BLOCK ? count : BLOCK;
        find_places(tone, values, n, places);
        for (uint32_t i = 0; i < n; i++)
            shown[i] = tone->curve[places[i]];
    }
}
