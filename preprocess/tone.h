/* preprocess/tone.h - from raw measurements to the 8 bits that are shown.
 *
 * Scanners write intensity in any range (0..1, -2048..2047, 16 bits of which 300 are used), so the
 * range to show is taken from a sample of the scan. The raw value is kept beside it as an
 * attribute; nothing is lost by the choice made here. */
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { PREP_TONE_STEPS = 1024 };

typedef struct {
    bool is_flat;      /* the sample holds one value only, or none: nothing to show */
    double low, scale; /* (value - low) * scale is the place on the curve */
    uint8_t curve[PREP_TONE_STEPS];
} prep_tone;

/* Chooses the range: it is stretched between the 0.5 % and the 99.5 % percentile, so that a single
 * mirror reflection does not darken the scan; scanners that count to 255 seldom use all of it, so
 * 8-bit values are stretched like all others. Where most of a scan would be dark all the same, as
 * asphalt is beside road marks, a power lifts it. values   [count], reordered; NaN and infinities
 * are passed over */
prep_tone prep_tone_make(double *values, size_t count);

/* Number of samples that are enough to choose a range. */
enum { PREP_TONE_SAMPLES = 16384 };

static inline uint8_t prep_tone_apply(const prep_tone *tone, double value)
{
    double place = (value - tone->low) * tone->scale;
    if (place >= PREP_TONE_STEPS - 1) return tone->curve[PREP_TONE_STEPS - 1];
    return tone->curve[place > 0 ? (int)(place + 0.5) : 0]; /* NaN is the darkest */
}

/* The same for many whole numbers. */
void prep_tone_apply_16(const prep_tone *tone, const uint16_t *values, uint32_t count,
                        uint8_t *shown);

/* Colours are shown as they are: only brought to 8 bits. */
typedef struct {
    double low, scale; /* shown = (value - low) * scale, rounded and clamped */
} prep_scale;

static inline uint8_t prep_scale_apply(const prep_scale *s, double value)
{
    double shown = (value - s->low) * s->scale + 0.5;
    return shown >= 255 ? 255 : shown > 0 ? (uint8_t)shown : 0; /* NaN is 0 */
}

/* 16-bit colour to 8 bits: value * 255 / 65535, rounded to nearest. */
static inline uint8_t prep_tone_from_16(uint32_t value)
{
    return (uint8_t)((value * 255 + 32895) >> 16);
}
