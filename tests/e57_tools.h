/* tests/e57_tools.h - scans to write, and what the reader makes of them. */
#pragma once
#include "preprocess/e57.h"
#include "tests/scan_points.h"
#include "tests/write_e57.h"

enum { E57_COUNT = 3000 };

/* Values for any field: a scan of every kind is made of these. */
typedef struct {
    double x[E57_COUNT], y[E57_COUNT], z[E57_COUNT],
        unit[E57_COUNT];          /* all of them floats, unit in 0..1 */
    int64_t number[3][E57_COUNT]; /* 0..255 */
    int64_t flag[E57_COUNT];      /* 0, 1 */
    int64_t state3[E57_COUNT];    /* 0, 1, 2 */
} e57_values;

extern e57_values e57_v;

/* Fills them; first of all. */
void e57_tools_init(void);

write_e57_field e57_real(const char *name, write_e57_kind kind, const double *values);
write_e57_field e57_whole(const char *name, const int64_t *integers, int64_t low, int64_t high);

/* A scan with Cartesian coordinates in single precision, and room for more fields. */
typedef struct {
    write_e57_field field[24];
    write_e57_scan scan;
} e57_made;

void e57_begin(e57_made *m);
void e57_add(e57_made *m, write_e57_field field);
void e57_add_rgb(e57_made *m, int64_t high);

/* All points of one scan, in one batch. */
typedef struct {
    prep_scan_info info;
    prep_batch batch;
    uint64_t dropped[PREP_DROP_REASONS];
    mospt_err damage; /* MOSPT_OK in its code if there is none */
    char crs[256];
} e57_loaded;

/* Reads scan `index`; at most `capacity` points of it. `memory` may be NULL. */
bool e57_load_scan(const char *path, uint32_t index, prep_scan_memory *memory, uint32_t capacity,
                   e57_loaded *out, mospt_err *err);
void e57_unload(e57_loaded *l);

/* The same for bytes, a file and a scan that must be readable; the scan without damage. */
void e57_load_bytes(const uint8_t *bytes, size_t size, uint32_t index, e57_loaded *out);
void e57_load_file(const write_e57_file *file, uint32_t index, e57_loaded *out);
void e57_load_made(const e57_made *m, e57_loaded *out);

/* And for those that must be refused, with the path in the error. */
mospt_err e57_refuse_bytes(const uint8_t *bytes, size_t size);
mospt_err e57_refuse_file(const write_e57_file *file);

/* An attribute's plane, which must be there and of that type. */
const void *e57_plane(const e57_loaded *l, const char *name, mospt_type type, uint32_t components);
bool e57_has_plane(const e57_loaded *l, const char *name);

/* The points are those of e57_begin(), all of them. */
void e57_check_xyz(const e57_loaded *l);
