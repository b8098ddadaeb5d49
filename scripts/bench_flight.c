#include "scripts/bench_flight.h"

#include "render/tour.h"

static bool make_curve(rend_path *path, rend_curve **out, double *duration_s, mospt_err *err)
{
    *duration_s = rend_path_duration(path);
    bool ok = rend_curve_create(path, out, err);
    rend_path_fini(path);
    return ok;
}

bool bench_flight_make(const mospt_dataset *dataset, double aspect, bench_flight *out,
                       mospt_err *err)
{
    rend_path path;
    *out = (bench_flight){0};
    return rend_tour_orbit(dataset, aspect, &path, err) &&
           make_curve(&path, &out->orbit, &out->orbit_s, err) &&
           rend_tour_walk(dataset, &path, err) && make_curve(&path, &out->walk, &out->walk_s, err);
}

void bench_flight_fini(bench_flight *flight)
{
    rend_curve_destroy(flight->orbit);
    rend_curve_destroy(flight->walk);
    *flight = (bench_flight){0};
}

rend_camera bench_flight_at(const bench_flight *f, double t, double later_s)
{
    rend_moment moment;
    if (t < 0.5) rend_curve_at(f->orbit, 2 * t * f->orbit_s + later_s, &moment);
    else rend_curve_at(f->walk, (2 * t - 1) * f->walk_s + later_s, &moment);
    return moment.camera;
}
