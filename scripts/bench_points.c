#include "scripts/bench_points.h"

#include <stdlib.h>
#include <string.h>

bool bench_points_load(const mospt_dataset *dataset, bench_points *out, mospt_err *err)
{
    const mospt_hierarchy *h = &dataset->hierarchy;
    bench_points p = {.vertices = malloc(h->point_count * sizeof *p.vertices),
                      .first = malloc(h->count * sizeof *p.first)};
    bool ok = (p.vertices != NULL && p.first != NULL) || mospt_err_nomem(err, h->point_count * 16);
    for (uint32_t n = 0; ok && n < h->count; n++) {
        p.first[n] = p.count;
        ok = mospt_dataset_read_vertices(dataset, n, p.vertices + p.count, err);
        p.count += h->nodes[n].count;
    }
    if (!ok) bench_points_fini(&p);
    else *out = p;
    return ok;
}

void bench_points_fini(bench_points *points)
{
    free(points->vertices);
    free(points->first);
    *points = (bench_points){0};
}

/* Steele, Lea and Flood's SplitMix64. */
static uint64_t next_random(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

void bench_points_shuffle(bench_points *points)
{
    uint64_t state = 1;
    for (uint64_t i = points->count; i > 1; i--) {
        uint64_t k = (uint64_t)(((__uint128_t)next_random(&state) * i) >> 64);
        mospt_vertex swap = points->vertices[i - 1];
        points->vertices[i - 1] = points->vertices[k];
        points->vertices[k] = swap;
    }
}

void bench_points_gather(const bench_points *points, const rend_selection *selection,
                         mospt_vertex *out)
{
    for (uint32_t i = 0; i < selection->draw_count; i++) {
        const rend_draw *d = &selection->draws[i];
        memcpy(out, points->vertices + points->first[d->node], d->count * sizeof *out);
        out += d->count;
    }
}
