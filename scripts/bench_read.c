/* scripts/bench_read.c - the parts of scripts/bench_read that are no shell.
 *
 *     bench_read write FORMAT COUNT FILE     a panorama of so many points
 *     bench_read read FILE COUNT RUNS CORES  median seconds of a run, on so many processors
 *
 * A panorama is what a scanner on a tripod sees in a hall: rows of neighbouring directions, ranges
 * with a little noise, intensity and colour. Reading goes through prep_scan_read(), as in the
 * builder, and must find every point. */
#include "preprocess/scan.h"
#include "scripts/bench_time.h"
#include "tests/write_e57.h"
#include "tests/write_las.h"
#include "tests/write_laz.h"

#include <inttypes.h>
#include <math.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { COLUMN_POINTS = 1000, RUNS_MAX = 100, LAS_HEADER = 227, LAS_RECORD = 26, LAZ_CHUNK = 50000 };

typedef struct {
    double xyz[3];
    uint16_t intensity;
    uint8_t rgb[3];
} point;

static uint32_t draw(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 33);
}

/* Column by column, bottom to top; a hall of 40 x 30 x 12 m around the scanner, in the coordinates
 * of a site. */
static point make_point(uint32_t i, uint32_t count, uint64_t *state)
{
    static const double half[3] = {20, 15, 6}, origin[3] = {4500.0, 5300.0, 400.0};
    double columns = ceil((double)count / COLUMN_POINTS);
    double turn = 2 * 3.14159265358979 * floor((double)i / COLUMN_POINTS) / columns;
    double rise = 3.0 * ((double)(i % COLUMN_POINTS) / COLUMN_POINTS - 0.5);
    double d[3] = {cos(turn) * cos(rise), sin(turn) * cos(rise), sin(rise)}, range = 1e9;
    for (int a = 0; a < 3; a++) {
        double wall = half[a] / fmax(fabs(d[a]), 1e-9);
        if (wall < range) range = wall;
    }
    range += (double)(draw(state) % 1000) * 4e-6;
    point p;
    for (int a = 0; a < 3; a++)
        p.xyz[a] = origin[a] + d[a] * range;
    p.intensity = (uint16_t)(20000 / range + draw(state) % 64);
    for (int c = 0; c < 3; c++)
        p.rgb[c] = (uint8_t)(100 + 20 * (uint32_t)c + draw(state) % 16);
    return p;
}

static bool write_ply(FILE *f, uint32_t count, bool is_ascii)
{
    uint64_t state = 1;
    fprintf(f,
            "ply\nformat %s 1.0\nelement vertex %u\nproperty float x\nproperty float y\nproperty "
            "float z\n"
            "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
            is_ascii ? "ascii" : "binary_little_endian", count);
    for (uint32_t i = 0; i < count; i++) {
        point p = make_point(i, count, &state);
        float xyz[3] = {(float)p.xyz[0], (float)p.xyz[1], (float)p.xyz[2]};
        if (is_ascii)
            fprintf(f, "%.4f %.4f %.4f %u %u %u\n", p.xyz[0], p.xyz[1], p.xyz[2], p.rgb[0],
                    p.rgb[1], p.rgb[2]);
        else if (fwrite(xyz, sizeof xyz, 1, f) != 1 || fwrite(p.rgb, 3, 1, f) != 1) return false;
    }
    return true;
}

static bool write_pcd(FILE *f, uint32_t count, bool is_ascii)
{
    uint64_t state = 1;
    fprintf(f,
            "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 "
            "4\nTYPE F F F U\n"
            "COUNT 1 1 1 1\nWIDTH %u\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS %u\nDATA %s\n",
            count, count, is_ascii ? "ascii" : "binary");
    for (uint32_t i = 0; i < count; i++) {
        point p = make_point(i, count, &state);
        struct {
            float xyz[3];
            uint32_t rgb;
        } row = {{(float)p.xyz[0], (float)p.xyz[1], (float)p.xyz[2]},
                 (uint32_t)p.rgb[0] << 16 | (uint32_t)p.rgb[1] << 8 | p.rgb[2]};
        if (is_ascii) fprintf(f, "%.4f %.4f %.4f %u\n", p.xyz[0], p.xyz[1], p.xyz[2], row.rgb);
        else if (fwrite(&row, sizeof row, 1, f) != 1) return false;
    }
    return true;
}

static bool write_lines(FILE *f, uint32_t count, bool is_ptx)
{
    uint64_t state = 1;
    if (is_ptx)
        fprintf(f, "%u\n%u\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n",
                count / COLUMN_POINTS, COLUMN_POINTS);
    for (uint32_t i = 0; i < count; i++) {
        point p = make_point(i, count, &state);
        fprintf(f, "%.4f %.4f %.4f ", p.xyz[0], p.xyz[1], p.xyz[2]);
        if (is_ptx) fprintf(f, "%.6f", p.intensity / 65535.0);
        else fprintf(f, "%u", p.intensity);
        fprintf(f, " %u %u %u\n", p.rgb[0], p.rgb[1], p.rgb[2]);
    }
    return true;
}

/* LAS 1.2, point format 2. */
static uint8_t *make_las(uint32_t count, size_t *size)
{
    static const double origin[3] = {4500.0, 5300.0, 400.0};
    uint64_t state = 1;
    *size = LAS_HEADER + (size_t)count * LAS_RECORD;
    uint8_t *las = calloc(1, *size);
    if (las == NULL) return NULL;
    memcpy(las, "LASF", 4);
    las[24] = 1, las[25] = 2;
    write_las_u16(las + 94, LAS_HEADER);
    write_las_u32(las + 96, LAS_HEADER);
    las[104] = 2;
    write_las_u16(las + 105, LAS_RECORD);
    write_las_u32(las + 107, count);
    write_las_u32(las + 111, count);
    for (size_t a = 0; a < 3; a++) {
        write_las_f64(las + 131 + 8 * a, 0.0001);
        write_las_f64(las + 155 + 8 * a, origin[a]);
        write_las_f64(las + 179 + 16 * a, origin[a] + 25);
        write_las_f64(las + 187 + 16 * a, origin[a] - 25);
    }
    for (uint32_t i = 0; i < count; i++) {
        uint8_t *record = las + LAS_HEADER + (size_t)i * LAS_RECORD;
        point p = make_point(i, count, &state);
        for (int a = 0; a < 3; a++)
            write_las_u32(record + 4 * a,
                          (uint32_t)(int32_t)lrint((p.xyz[a] - origin[a]) / 0.0001));
        write_las_u16(record + 12, p.intensity);
        record[14] = 1 | 1 << 3; /* first return of one */
        for (int c = 0; c < 3; c++)
            write_las_u16(record + 20 + 2 * c, p.rgb[c] * 257u);
    }
    return las;
}

static uint8_t *make_laz(uint32_t count, size_t *size)
{
    size_t las_size;
    uint8_t *las = make_las(count, &las_size);
    if (las == NULL) return NULL;
    uint8_t *laz = write_laz(las, las_size, &(write_laz_options){.chunk_points = LAZ_CHUNK}, size);
    free(las);
    return laz;
}

/* Coordinates as floats, the rest as integers of as many bits as they need. */
static uint8_t *make_e57(uint32_t count, size_t *size)
{
    static const char *const names[7] = {"cartesianX", "cartesianY", "cartesianZ", "intensity",
                                         "colorRed",   "colorGreen", "colorBlue"};
    uint64_t state = 1;
    double *values = malloc(3 * (size_t)count * sizeof *values);
    int64_t *integers = malloc(4 * (size_t)count * sizeof *integers);
    if (values == NULL || integers == NULL) abort();
    for (uint32_t i = 0; i < count; i++) {
        point p = make_point(i, count, &state);
        for (size_t a = 0; a < 3; a++)
            values[a * count + i] = p.xyz[a];
        integers[i] = p.intensity;
        for (size_t c = 0; c < 3; c++)
            integers[(1 + c) * count + i] = p.rgb[c];
    }
    write_e57_field fields[7] = {0};
    for (size_t k = 0; k < 7; k++) {
        fields[k].name = names[k];
        fields[k].kind = k < 3 ? WRITE_E57_FLOAT : WRITE_E57_INTEGER;
        if (k < 3) fields[k].values = values + k * count;
        else fields[k].integers = integers + (k - 3) * count;
        fields[k].high = k < 3 ? 0 : k == 3 ? 65535 : 255;
    }
    const write_e57_scan scan = {.name = "hall",
                                 .fields = fields,
                                 .field_count = 7,
                                 .count = count,
                                 .piece = 8000,
                                 .dealing = WRITE_E57_BALANCED};
    uint8_t *bytes = write_e57(&(write_e57_file){.scans = &scan, .scan_count = 1}, size);
    free(values);
    free(integers);
    return bytes;
}

static bool write_bytes(FILE *f, uint8_t *(*make)(uint32_t count, size_t *size), uint32_t count)
{
    size_t size;
    uint8_t *bytes = make(count, &size);
    bool ok = bytes != NULL && fwrite(bytes, 1, size, f) == size;
    free(bytes);
    return ok;
}

static bool write_format(FILE *f, const char *format, uint32_t count)
{
    if (strcmp(format, "las") == 0) return write_bytes(f, make_las, count);
    if (strcmp(format, "laz") == 0) return write_bytes(f, make_laz, count);
    if (strcmp(format, "e57") == 0) return write_bytes(f, make_e57, count);
    if (strcmp(format, "ply") == 0) return write_ply(f, count, false);
    if (strcmp(format, "ply-ascii") == 0) return write_ply(f, count, true);
    if (strcmp(format, "pcd") == 0) return write_pcd(f, count, false);
    if (strcmp(format, "pcd-ascii") == 0) return write_pcd(f, count, true);
    if (strcmp(format, "ptx") == 0) return write_lines(f, count, true);
    if (strcmp(format, "text") == 0) return write_lines(f, count, false);
    fprintf(stderr, "bench_read: no format `%s`\n", format);
    return false;
}

static int run_write(const char *format, uint32_t count, const char *path)
{
    FILE *f = fopen(path, "wb");
    bool ok = f != NULL && write_format(f, format, count);
    if (f != NULL && fclose(f) != 0) ok = false;
    if (!ok) fprintf(stderr, "bench_read: cannot write %s as %s\n", path, format);
    return ok ? 0 : 1;
}

static bool use_processors(int count)
{
    cpu_set_t all, some;
    if (sched_getaffinity(0, sizeof all, &all) != 0) return false;
    CPU_ZERO(&some);
    for (size_t i = 0; i < CPU_SETSIZE && CPU_COUNT(&some) < count; i++) {
        if (CPU_ISSET(i, &all)) CPU_SET(i, &some);
    }
    return CPU_COUNT(&some) == count && sched_setaffinity(0, sizeof some, &some) == 0;
}

static bool read_points(const char *path, uint64_t *count, double *seconds, mospt_err *err)
{
    prep_batch batch = {0};
    prep_scan *scan;
    *count = 0;
    double start_ms = bench_now_ms();
    if (!prep_scan_open(path, 0, NULL, &scan, err)) return false;
    bool ok =
        prep_batch_init(&batch, &prep_scan_describe(scan)->attributes, PREP_BATCH_CAPACITY, err);
    do {
        ok = ok && prep_scan_read(scan, &batch, err);
        *count += batch.count;
    } while (ok && batch.count > 0);
    if (prep_scan_damage(scan) != NULL) {
        if (ok) *err = *prep_scan_damage(scan);
        ok = false;
    }
    prep_batch_fini(&batch);
    prep_scan_close(scan);
    *seconds = (bench_now_ms() - start_ms) * 1e-3;
    return ok;
}

static int run_read(const char *path, uint64_t expected, int runs, int cores)
{
    double seconds[RUNS_MAX];
    if (!use_processors(cores)) {
        fprintf(stderr, "bench_read: there are no %d processors to use\n", cores);
        return 1;
    }
    for (int i = 0; i < runs; i++) {
        uint64_t count;
        mospt_err err;
        char text[2048];
        if (!read_points(path, &count, &seconds[i], &err)) {
            mospt_err_text(&err, text, sizeof text);
            fprintf(stderr, "bench_read: %s\n", text);
            return 1;
        }
        if (count == expected) continue;
        fprintf(stderr, "bench_read: %s: %" PRIu64 " points, not %" PRIu64 "\n", path, count,
                expected);
        return 1;
    }
    bench_sort(seconds, (uint32_t)runs);
    printf("%.6f\n", seconds[runs / 2]);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc == 5 && strcmp(argv[1], "write") == 0)
        return run_write(argv[2], (uint32_t)strtoul(argv[3], NULL, 10), argv[4]);
    int runs = argc == 6 ? atoi(argv[4]) : 0;
    if (argc == 6 && strcmp(argv[1], "read") == 0 && runs > 0 && runs <= RUNS_MAX)
        return run_read(argv[2], strtoull(argv[3], NULL, 10), runs, atoi(argv[5]));
    fprintf(stderr, "usage: bench_read write FORMAT COUNT FILE | read FILE COUNT RUNS CORES\n");
    return 2;
}
