/* render/sample.h - points that stand for all of a dataset: those of its coarsest nodes, whole
 * levels of the outer octree, spread evenly over the site. */
#pragma once
#include "render/paint.h"

/* Levels are added as long as there are no more points in them; that of the root always. */
enum { REND_SAMPLE_POINTS = 250000 };

typedef struct rend_sample rend_sample;

/* Reads it. Damaged nodes are left out.
 * errors   MOSPT_ENOMEM */
bool rend_sample_read(const mospt_dataset *dataset, rend_sample **out, mospt_err *err);
void rend_sample_destroy(rend_sample *sample);

/* Values that a paint shows, ascending, without those that are not finite. */
typedef struct {
    double *at; /* [count], owned: released by free() */
    uint32_t count;
    bool some_missing; /* there were points without a value */
} rend_values;

bool rend_sample_values(const rend_sample *sample, const rend_paint *paint, rend_values *out,
                        mospt_err *err);
