#include "tests/scan_points.h"

#include <ftw.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *grow(void *at, uint64_t capacity, size_t size)
{
    void *grown = realloc(at, capacity * size > 0 ? capacity * size : 1);
    if (grown == NULL) abort();
    return grown;
}

static void append(scan_points *p, const prep_batch *batch)
{
    uint64_t total = p->count + batch->count;
    if (total > p->capacity) {
        p->capacity = 2 * total;
        p->xyz = grow(p->xyz, p->capacity, 3 * sizeof *p->xyz);
        p->rgbi = grow(p->rgbi, p->capacity, 4);
        for (uint32_t k = 0; k < batch->plane_count; k++)
            p->plane[k] = grow(p->plane[k], p->capacity, batch->plane_size[k]);
    }
    memcpy(p->xyz + 3 * p->count, batch->xyz, batch->count * 3 * sizeof *p->xyz);
    memcpy(p->rgbi + 4 * p->count, batch->rgbi, batch->count * 4);
    for (uint32_t k = 0; k < batch->plane_count; k++) {
        size_t size = batch->plane_size[k];
        memcpy(p->plane[k] + p->count * size, batch->plane[k], batch->count * size);
    }
    p->count = total;
}

bool scan_points_read(const char *path, const prep_scan_options *options, uint32_t batch_size,
                      scan_points *out, mospt_err *err)
{
    scan_points p = {0};
    prep_batch batch = {0};
    prep_scan *scan;
    if (!prep_scan_open(path, 0, options, &scan, err)) return false;
    p.info = *prep_scan_describe(scan);
    bool ok = prep_batch_init(&batch, &p.info.attributes, batch_size, err);
    while (ok) {
        ok = prep_scan_read(scan, &batch, err);
        if (!ok || batch.count == 0) break;
        append(&p, &batch);
    }
    memcpy(p.dropped, prep_scan_dropped(scan), sizeof p.dropped);
    p.is_damaged = prep_scan_damage(scan) != NULL;
    if (p.is_damaged) p.damage = *prep_scan_damage(scan);
    prep_batch_fini(&batch);
    prep_scan_close(scan);
    if (ok) *out = p;
    else scan_points_fini(&p);
    return ok;
}

void scan_points_fini(scan_points *points)
{
    free(points->xyz);
    free(points->rgbi);
    for (uint32_t k = 0; k < MOSPT_ATTRIBUTES_MAX; k++)
        free(points->plane[k]);
    *points = (scan_points){0};
}

double scan_points_value(const scan_points *points, const char *attribute, uint64_t index,
                         uint32_t component)
{
    int k = mospt_schema_find(&points->info.attributes, attribute);
    if (k < 0) return (double)NAN;
    const mospt_attribute *a = &points->info.attributes.at[k];
    if (component >= a->components || index >= points->count) return (double)NAN;
    return mospt_type_read(a->type, points->plane[k] + index * mospt_attribute_size(a) +
                                        component * mospt_type_size(a->type));
}

const char *scan_points_type(const scan_points *points, const char *attribute)
{
    int k = mospt_schema_find(&points->info.attributes, attribute);
    return k < 0 ? "" : mospt_type_name(points->info.attributes.at[k].type);
}

static char folder[256];

static int remove_entry(const char *path, const struct stat *st, int type, struct FTW *ftw)
{
    (void)st, (void)type, (void)ftw;
    return remove(path);
}

static void remove_folder(void)
{
    nftw(folder, remove_entry, 16, FTW_DEPTH | FTW_PHYS);
}

const char *scan_points_folder(void)
{
    if (folder[0] != '\0') return folder;
    const char *base = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%s/readers-XXXXXX", base != NULL ? base : "/tmp");
    if (mkdtemp(folder) == NULL) abort();
    atexit(remove_folder);
    return folder;
}

const char *scan_points_file(const char *name, const void *bytes, size_t size)
{
    static char path[1024];
    snprintf(path, sizeof path, "%s/%s", scan_points_folder(), name);
    FILE *f = fopen(path, "wb");
    if (f == NULL || fwrite(bytes, 1, size, f) != size || fclose(f) != 0) abort();
    return path;
}

bool scan_points_survive(const char *name, const void *bytes, size_t size, uint64_t *count)
{
    scan_points points;
    mospt_err err = {0};
    const char *path = scan_points_file(name, bytes, size);
    bool ok = scan_points_read(path, NULL, 100, &points, &err);
    if (count != NULL) *count = ok ? points.count : 0;
    if (ok) {
        scan_points_fini(&points);
        return true;
    }
    if ((err.code != MOSPT_EFORMAT && err.code != MOSPT_EEMPTY) || strcmp(err.file, path) != 0 ||
        err.message[0] == '\0') {
        printf("%s, %zu bytes: error %d in `%s`: %s\n", name, size, (int)err.code, err.file,
               err.message);
        abort();
    }
    return false;
}

uint32_t scan_points_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 33);
}
