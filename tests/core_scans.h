/* tests/core_scans.h - tiny scan files of every format, written as a test wants them. */
#pragma once
#include <stddef.h>
#include <stdint.h>

typedef struct {
    double scale[3], offset[3];
    const int32_t (*xyz)[3]; /* [count] */
    uint32_t count;
    const double *low, *high; /* [3] bounds in the header; NULL: the true ones */
    uint16_t epsg;            /* code of its coordinate reference system; 0: it says nothing */
    uint32_t missing;         /* bytes that the file is shorter than it should be */
} core_las;

/* LAS 1.2, point format 0; intensity is the index of the point. */
void core_las_write(const char *path, const core_las *las);

/* Binary little-endian PLY with double x, y, z and a property "tag". */
void core_ply_write(const char *path, const double (*xyz)[3], uint32_t count);

/* "x y z r g b" lines with 17 digits. */
void core_text_write(const char *path, const double (*xyz)[3], uint32_t count);
