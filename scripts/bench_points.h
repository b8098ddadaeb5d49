/* scripts/bench_points.h - all points of a dataset in memory. */
#pragma once
#include "mospt/dataset.h"
#include "render/select.h"

typedef struct {
    mospt_vertex *vertices; /* [count], owned; node after node */
    uint64_t count;
    uint64_t *first; /* [nodes], owned: where each node begins */
} bench_points;

bool bench_points_load(const mospt_dataset *dataset, bench_points *out, mospt_err *err);
void bench_points_fini(bench_points *points);

/* A random order, always the same: of it, the first share is a uniform random subset. Nodes are no
 * longer where they were. */
void bench_points_shuffle(bench_points *points);

/* Copies what a selection draws, in its order.
 * out      [selection->points] */
void bench_points_gather(const bench_points *points, const rend_selection *selection,
                         mospt_vertex *out);
