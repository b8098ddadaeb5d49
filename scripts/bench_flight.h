/* scripts/bench_flight.h - what benchmarks fly: half of it around the site, half of it through it
 * from scan to scan. */
#pragma once
#include "mospt/dataset.h"
#include "render/curve.h"

typedef struct {
    rend_curve *orbit, *walk; /* owned: outside, inside */
    double orbit_s, walk_s;
} bench_flight;

/* errors   MOSPT_ENOMEM, MOSPT_EIO; bench_flight_fini() releases what there is */
bool bench_flight_make(const mospt_dataset *dataset, double aspect, bench_flight *out,
                       mospt_err *err);
void bench_flight_fini(bench_flight *flight);

/* t, 0 to 1; later_s after that */
rend_camera bench_flight_at(const bench_flight *flight, double t, double later_s);
