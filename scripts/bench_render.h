/* scripts/bench_render.h - what the two halves of bench_render, speed and quality, have in common;
 * scripts/bench_render explains. */
#pragma once
#include "render/engine.h"
#include "render/stage.h"
#include "scripts/bench_flight.h"
#include "scripts/bench_options.h"
#include "scripts/bench_points.h"
#include "scripts/plain_loop.h"

typedef struct {
    bench_options common;
    uint32_t frames, views;
    bool speed, quality;
} bench_render_options;

typedef struct {
    const bench_render_options *o;
    const rend_view_of *view; /* of the options: without a camera */
    mospt_dataset *dataset;
    bench_points points;
    rend_engine engine, second; /* the second one draws points as they are */
    rgl *raw;
    rend_selector *selector;
    plain_loop *loop;
    bench_flight flight;
} bench_render;

/* t        of the flight, 0 to 1; later_s after that */
rend_view_of bench_render_view(const bench_render *b, double t, double later_s, uint64_t budget);

/* Draws points as they are, those in the arena of b->raw.
 * sizes    of a selection of everything; NULL: all points are one pixel wide */
bool bench_render_raw(bench_render *b, const rend_frame *frame, const rend_selection *sizes,
                      const int32_t *first, const int32_t *count, uint32_t ranges, mospt_err *err);

/* bench_speed.c: how fast pictures are drawn, everything resident, then with a GPU cache of a tenth
 * and nothing read yet. */
bool bench_speed_measure(bench_render *b, mospt_err *err);

/* bench_quality.c: how good they are. Comes last: b->points are gone afterwards. */
bool bench_quality_measure(bench_render *b, mospt_err *err);
