/* tests/fuzz_split.c - text and ascii PLY large enough to be parsed by several threads: the same
 * points, counts and damage as with one, whatever the lines are. */
#include "tests/scan_points.h"

#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { LEAST = 2200 * 1024, MOST = 2500 * 1024 }; /* two blocks and more */

static bool read_all(const char *path, scan_points *out, mospt_err *err)
{
    *err = (mospt_err){0};
    return scan_points_read(path, NULL, 5000, out, err);
}

/* The readers start as many threads as there are processors to use. */
static bool read_alone(const char *path, scan_points *out, mospt_err *err)
{
    cpu_set_t all, one;
    int cpu = sched_getcpu();
    if (cpu < 0 || sched_getaffinity(0, sizeof all, &all) != 0) abort();
    CPU_ZERO(&one);
    CPU_SET((size_t)cpu, &one);
    if (sched_setaffinity(0, sizeof one, &one) != 0) abort();
    bool ok = read_all(path, out, err);
    sched_setaffinity(0, sizeof all, &all);
    return ok;
}

static bool are_equal(const scan_points *a, const scan_points *b)
{
    if (a->count != b->count || a->is_damaged != b->is_damaged ||
        memcmp(a->dropped, b->dropped, sizeof a->dropped) != 0)
        return false;
    if (a->is_damaged &&
        (a->damage.place != b->damage.place || strcmp(a->damage.message, b->damage.message) != 0))
        return false;
    if (a->count == 0) return true;
    for (uint32_t k = 0; k < a->info.attributes.count; k++) {
        size_t size = mospt_attribute_size(&a->info.attributes.at[k]);
        if (memcmp(a->plane[k], b->plane[k], a->count * size) != 0) return false;
    }
    return memcmp(a->xyz, b->xyz, a->count * 3 * sizeof *a->xyz) == 0 &&
           memcmp(a->rgbi, b->rgbi, 4 * a->count) == 0;
}

static void check(const char *path)
{
    scan_points many, one;
    mospt_err many_err, one_err;
    bool ok = read_all(path, &many, &many_err);
    if (read_alone(path, &one, &one_err) != ok) abort();
    if (ok) {
        if (!are_equal(&many, &one)) abort();
        scan_points_fini(&many);
        scan_points_fini(&one);
    } else if (many_err.code != one_err.code || strcmp(many_err.message, one_err.message) != 0) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static char text[MOST + 4096];
    if (size < 2) return 0;
    bool is_ply = data[0] % 2 == 0;
    size_t piece = size < MOST - LEAST ? size : MOST - LEAST, n = 0;
    if (is_ply)
        n = (size_t)snprintf(text, sizeof text,
                             "ply\nformat ascii 1.0\nelement vertex %u\nproperty float x\nproperty "
                             "float y\nproperty float z\nend_header\n1 2 3\n",
                             data[1] * 1000u + 1);
    while (n < LEAST) {
        memcpy(text + n, data, piece);
        n += piece;
    }
    check(scan_points_file(is_ply ? "split.ply" : "split.txt", text, n));
    return 0;
}
