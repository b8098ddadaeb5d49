/* scripts/bench_laz.c - how fast LAZ is decoded.
 *
 *     bench_laz FILE...
 *
 * One line per file and number of threads: millions of points per second of wall time and of
 * processor time, the best of five passes, and how many times faster than with one thread. Every
 * pass must deliver the same bytes. */
#include "preprocess/ahead.h"
#include "preprocess/laz.h"

#include <inttypes.h>
#include <stdio.h>
#include <time.h>

enum { PASSES = 5 };

static double seconds(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

typedef struct {
    double wall_s, cpu_s;
    uint64_t count, sum;
} pass;

static bool decode(prep_laz *laz, size_t length, pass *out, mospt_err *err)
{
    const uint8_t *records;
    size_t got;
    pass p = {.wall_s = -seconds(CLOCK_MONOTONIC), .cpu_s = -seconds(CLOCK_PROCESS_CPUTIME_ID)};
    do {
        if (!prep_laz_read(laz, 65536, &records, &got, err)) return false;
        for (size_t i = 0; i < got; i++)
            p.sum = p.sum * 31 + records[i * length] + records[i * length + length - 1];
        p.count += got;
    } while (got > 0);
    p.wall_s += seconds(CLOCK_MONOTONIC);
    p.cpu_s += seconds(CLOCK_PROCESS_CPUTIME_ID);
    *out = p;
    return true;
}

static bool bench(prep_input *input, const prep_las_header *h, uint32_t threads, pass *best,
                  mospt_err *err)
{
    prep_laz *laz = NULL;
    if (!prep_laz_open(input, h, threads, &laz, err)) return false;
    bool ok = true;
    for (int i = 0; i < PASSES && ok; i++, prep_laz_rewind(laz)) {
        pass p;
        ok = decode(laz, h->record_length, &p, err);
        if (ok && best->count > 0 && (p.count != best->count || p.sum != best->sum))
            ok = mospt_err_set(err, MOSPT_EFORMAT, mospt_nowhere(), "two passes differ");
        if (!ok) break;
        if (i == 0) best->wall_s = best->cpu_s = 1e9;
        best->count = p.count;
        best->sum = p.sum;
        if (p.wall_s < best->wall_s) best->wall_s = p.wall_s;
        if (p.cpu_s < best->cpu_s) best->cpu_s = p.cpu_s;
    }
    prep_laz_close(laz);
    return ok;
}

static bool bench_file(const char *path, mospt_err *err)
{
    prep_input *input = NULL;
    prep_las_header h = {0};
    if (!prep_input_open(path, &input, err)) return false;
    bool ok = prep_las_header_read(input, &h, err);
    pass best = {0};
    double alone_s = 0;
    for (uint32_t threads = 1; threads <= PREP_AHEAD_THREADS_MAX && ok; threads *= 2) {
        ok = bench(input, &h, threads, &best, err);
        if (!ok) break;
        if (threads == 1) alone_s = best.wall_s;
        printf("%s: %" PRIu64
               " points of format %u, %u threads: %.2f M/s, %.2f M/s of one core, x %.2f\n",
               path, best.count, h.point_format, threads, (double)best.count / best.wall_s * 1e-6,
               (double)best.count / best.cpu_s * 1e-6, alone_s / best.wall_s);
    }
    prep_input_close(input);
    return ok;
}

int main(int argc, char **argv)
{
    int failures = 0;
    for (int i = 1; i < argc; i++) {
        mospt_err err;
        char text[2048];
        if (bench_file(argv[i], &err)) continue;
        mospt_err_text(&err, text, sizeof text);
        fprintf(stderr, "bench_laz: %s\n", text);
        failures++;
    }
    return failures > 0;
}
