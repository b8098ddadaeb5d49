#include "scripts/bench_picture.h"

#include <math.h>
#include <stdlib.h>

enum { RADIUS = 5 };

void bench_luminance(const uint8_t *rgb, uint32_t count, float *out)
{
    for (uint32_t i = 0; i < count; i++)
        out[i] = 0.299f * rgb[3 * i] + 0.587f * rgb[3 * i + 1] + 0.114f * rgb[3 * i + 2];
}

static void blur_line(const float *in, uint32_t count, uint32_t stride, float *out)
{
    /* exp(-d^2 / (2 1.5^2)) */
    static const float bell[RADIUS + 1] = {1,           0.80073740f, 0.41111229f,
                                           0.13533528f, 0.02856550f, 0.00386592f};
    for (int64_t i = 0; i < count; i++) {
        float sum = 0, weights = 0;
        for (int64_t k = i < RADIUS ? 0 : i - RADIUS; k <= i + RADIUS && k < count; k++) {
            float weight = bell[k > i ? k - i : i - k];
            sum += weight * in[k * stride], weights += weight;
        }
        out[i * stride] = sum / weights;
    }
}

/* The same along all rows and then all columns; both are the same for pictures of one value. */
static void blur(float *picture, float *work, uint32_t width, uint32_t height)
{
    for (uint32_t y = 0; y < height; y++)
        blur_line(picture + (size_t)y * width, width, 1, work + (size_t)y * width);
    for (uint32_t x = 0; x < width; x++)
        blur_line(work + x, height, width, picture + x);
}

double bench_similarity(const float *a, const float *b, uint32_t width, uint32_t height)
{
    const float c1 = 6.5025f, c2 = 58.5225f; /* (0.01 * 255)^2, (0.03 * 255)^2 */
    size_t n = (size_t)width * height;
    float *m = malloc(6 * n * sizeof *m);
    double sum = 0;
    if (m == NULL) return -1;
    for (size_t i = 0; i < n; i++)
        m[i] = a[i], m[n + i] = b[i], m[2 * n + i] = a[i] * a[i], m[3 * n + i] = b[i] * b[i],
        m[4 * n + i] = a[i] * b[i];
    for (size_t k = 0; k < 5; k++)
        blur(m + k * n, m + 5 * n, width, height);
    for (size_t i = 0; i < n; i++) {
        float ma = m[i], mb = m[n + i], va = m[2 * n + i] - ma * ma, vb = m[3 * n + i] - mb * mb,
              cov = m[4 * n + i] - ma * mb;
        sum += (double)((2 * ma * mb + c1) * (2 * cov + c2) /
                        ((ma * ma + mb * mb + c1) * (va + vb + c2)));
    }
    free(m);
    return sum / (double)n;
}

double bench_missing(const float *full, const float *ours, uint32_t count)
{
    uint32_t covered = 0, missing = 0;
    for (uint32_t i = 0; i < count; i++) {
        covered += full[i] < 1;
        missing += full[i] < 1 && ours[i] >= 1;
    }
    return covered > 0 ? (double)missing / covered : 0;
}

double bench_flicker(const float *full[2], const float *ours[2], uint32_t count)
{
    double sum = 0;
    for (uint32_t i = 0; i < count; i++)
        sum += (double)fabsf((ours[1][i] - ours[0][i]) - (full[1][i] - full[0][i]));
    return sum / count;
}
