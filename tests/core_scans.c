#include "tests/core_scans.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LAS_HEADER = 227, LAS_VLR = 54, GEOKEYS = 16, LAS_RECORD = 20 };

static FILE *open_file(const char *path)
{
    FILE *f = fopen(path, "wb");
    if (f == NULL) abort();
    return f;
}

/* A record of GeoTIFF keys with the code of a projected system. */
static void put_geokeys(uint8_t *p, uint16_t epsg)
{
    const uint16_t keys[GEOKEYS / 2] = {1, 1, 0, 1, 3072, 0, 1, epsg};
    memcpy(p + 2, "LASF_Projection", 15);
    memcpy(p + 18, &(uint16_t){34735}, 2);
    memcpy(p + 20, &(uint16_t){GEOKEYS}, 2);
    memcpy(p + LAS_VLR, keys, GEOKEYS);
}

void core_las_write(const char *path, const core_las *las)
{
    uint8_t h[LAS_HEADER] = "LASF";
    uint32_t begin = LAS_HEADER + (las->epsg != 0 ? LAS_VLR + GEOKEYS : 0);
    size_t size = begin + (size_t)las->count * LAS_RECORD;
    uint8_t *bytes = calloc(1, size);
    if (bytes == NULL) abort();
    h[24] = 1, h[25] = 2;
    memcpy(h + 94, &(uint16_t){LAS_HEADER}, 2);
    memcpy(h + 96, &begin, 4);
    memcpy(h + 100, &(uint32_t){las->epsg != 0}, 4);
    memcpy(h + 105, &(uint16_t){LAS_RECORD}, 2);
    memcpy(h + 107, &las->count, 4);
    memcpy(h + 111, &las->count, 4);
    for (int a = 0; a < 3; a++) {
        double low = INFINITY, high = -INFINITY;
        for (uint32_t i = 0; i < las->count; i++) {
            double v = las->xyz[i][a] * las->scale[a] + las->offset[a];
            low = fmin(low, v), high = fmax(high, v);
        }
        if (las->low != NULL) low = las->low[a], high = las->high[a];
        memcpy(h + 131 + 8 * a, &las->scale[a], 8);
        memcpy(h + 155 + 8 * a, &las->offset[a], 8);
        memcpy(h + 179 + 16 * a, &high, 8);
        memcpy(h + 187 + 16 * a, &low, 8);
    }
    memcpy(bytes, h, LAS_HEADER);
    if (las->epsg != 0) put_geokeys(bytes + LAS_HEADER, las->epsg);
    for (uint32_t i = 0; i < las->count; i++) {
        uint8_t *r = bytes + begin + (size_t)i * LAS_RECORD;
        memcpy(r, las->xyz[i], 12);
        memcpy(r + 12, &(uint16_t){(uint16_t)i}, 2);
        r[14] = 1 | 1 << 3;
        r[15] = 2;
        memcpy(r + 18, &(uint16_t){77}, 2);
    }
    FILE *f = open_file(path);
    if (fwrite(bytes, 1, size - las->missing, f) != size - las->missing || fclose(f) != 0) abort();
    free(bytes);
}

void core_ply_write(const char *path, const double (*xyz)[3], uint32_t count)
{
    FILE *f = open_file(path);
    fprintf(f,
            "ply\nformat binary_little_endian 1.0\nelement vertex %u\nproperty double x\nproperty "
            "double y\n"
            "property double z\nproperty uint tag\nend_header\n",
            count);
    for (uint32_t i = 0; i < count; i++)
        fwrite(xyz[i], sizeof(double), 3, f), fwrite(&i, sizeof i, 1, f);
    if (fclose(f) != 0) abort();
}

void core_text_write(const char *path, const double (*xyz)[3], uint32_t count)
{
    FILE *f = open_file(path);
    for (uint32_t i = 0; i < count; i++)
        fprintf(f, "%.17g %.17g %.17g %u %u 200\n", xyz[i][0], xyz[i][1], xyz[i][2], i & 255,
                i >> 8 & 255);
    if (fclose(f) != 0) abort();
}
