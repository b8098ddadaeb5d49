#include "scripts/bench_render.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

rend_view_of bench_render_view(const bench_render *b, double t, double later_s, uint64_t budget)
{
    rend_view_of view = *b->view;
    view.camera = bench_flight_at(&b->flight, t, later_s);
    view.budget_points = budget;
    return view;
}

/* What render/picture.c makes of the usual look, at one pixel a point. */
static rgl_scene plain_scene(const bench_render *b, const rend_frame *frame)
{
    const rend_look *look = &b->view->look;
    return (rgl_scene){.frame = *frame,
                       .grid_bits = b->dataset->metadata.grid.bits,
                       .px_min = 1,
                       .px_max = 1,
                       .blend_slab = look->blend_slab,
                       .fill_px = look->fill_px,
                       .edl_strength = look->no_edl ? 0 : 24,
                       .edl_radius_px = fmaxf(1, (float)frame->height / 720),
                       .background_top = {0.36f, 0.39f, 0.43f},
                       .background_bottom = {0.20f, 0.21f, 0.23f}};
}

bool bench_render_raw(bench_render *b, const rend_frame *frame, const rend_selection *sizes,
                      const int32_t *first, const int32_t *count, uint32_t ranges, mospt_err *err)
{
    const rgl_batch batch = {.shape = sizes != NULL ? RGL_ROUND : RGL_SQUARE,
                             .smallest = sizes == NULL,
                             .first = first,
                             .count = count,
                             .range_count = ranges};
    rgl_scene scene = plain_scene(b, frame);
    if (sizes != NULL) {
        scene.octants = sizes->octants, scene.octant_nodes = sizes->draw_count;
        scene.splat_scale = 1.25f, scene.px_max = REND_POINT_PX_MAX_DEFAULT;
    }
    int parts = RGL_BEGIN | RGL_END | (scene.blend_slab > 0 ? RGL_AGAIN : 0);
    return rgl_draw(b->raw, &scene, &batch, 1, parts, err);
}

static bool open_engines(bench_render *b, mospt_err *err)
{
    if (!rend_engine_open(&b->o->common.engine, &b->engine, err)) return false;
    printf("%s, %ux%u, %.1f M points, budget %.1f M, %u frames\n", rgl_renderer(b->engine.gl),
           b->view->width, b->view->height, (double)b->points.count * 1e-6,
           (double)b->view->budget_points * 1e-6, b->o->frames);
    if (b->engine.context != NULL) return rgl_gl_create(&b->raw, err);
    if (!rend_engine_open(&b->o->common.engine, &b->second, err)) return false;
    b->raw = b->second.gl;
    return true;
}

static bool run(const bench_render_options *o, mospt_err *err)
{
    bench_render b = {.o = o, .view = &o->common.view};
    const rend_view_of *v = b.view;
    b.selector = rend_select_create();
    b.loop = plain_loop_create(v->width, v->height, o->common.engine.threads);
    if (b.selector == NULL || b.loop == NULL) return mospt_err_nomem(err, 0);
    bool ok = mospt_dataset_open(o->common.dataset, &b.dataset, err) &&
              bench_points_load(b.dataset, &b.points, err) &&
              bench_flight_make(b.dataset, (double)v->width / v->height, &b.flight, err) &&
              open_engines(&b, err) && (!o->speed || bench_speed_measure(&b, err)) &&
              (!o->quality || bench_quality_measure(&b, err));
    if (b.raw != b.second.gl) rgl_destroy(b.raw);
    rend_engine_close(&b.second);
    rend_engine_close(&b.engine);
    rend_select_destroy(b.selector);
    plain_loop_destroy(b.loop);
    bench_flight_fini(&b.flight);
    bench_points_fini(&b.points);
    mospt_dataset_close(b.dataset);
    return ok;
}

static bool set_value(bench_render_options *o, const char *name, const char *value)
{
    rend_view_of *v = &o->common.view;
    if (strcmp(name, "--frames") == 0) o->frames = (uint32_t)atol(value);
    else if (strcmp(name, "--views") == 0) o->views = (uint32_t)atol(value);
    else if (strcmp(name, "--cell") == 0) v->cell_px = (float)atof(value);
    else if (strcmp(name, "--blend") == 0) v->look.blend_slab = (float)(atof(value) / 100);
    else if (strcmp(name, "--fill") == 0) v->look.fill_px = (uint32_t)atol(value);
    else return false;
    return true;
}

static int set(void *user, const char *name, const char *value)
{
    bench_render_options *o = user;
    if (strcmp(name, "--speed") == 0) o->quality = false;
    else if (strcmp(name, "--quality") == 0) o->speed = false;
    else return value != NULL && set_value(o, name, value) ? 2 : 0;
    return 1;
}

int main(int argc, char **argv)
{
    bench_render_options o = {.common = bench_options_usual(),
                              .frames = 100,
                              .views = 20,
                              .speed = true,
                              .quality = true};
    mospt_err err = {0};
    o.common.engine.threads = 2; /* of the plain loop, too */
    if (!bench_options_parse(argc, argv, set, &o, &o.common) || o.frames == 0 || o.views == 0 ||
        o.common.engine.threads == 0 || (!o.speed && !o.quality)) {
        fprintf(stderr, "bench_render: see scripts/bench_render\n");
        return 2;
    }
    return run(&o, &err) ? 0 : bench_options_fail("bench_render", &err);
}
