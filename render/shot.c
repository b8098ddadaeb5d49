#include "render/shot.h"

#include "render/engine.h"
#include "render/image.h"
#include "render/stage.h"

#include <stdlib.h>
#include <time.h>

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static bool draw_and_read(rend_stage *stage, rgl *gl, const rend_view_of *view, uint8_t *rgb,
                          mospt_err *err)
{
    do {
        if (!rend_stage_still(stage, view, err)) return false;
        if (rgl_read_pixels(gl, false, view->width, view->height, rgb, err)) return true;
    } while (rend_stage_recover(stage, err));
    return false;
}

static bool draw(const mospt_dataset *dataset, rgl *gl, const rend_shot_options *options,
                 const rend_view_of *view, uint8_t *rgb, rend_shot_result *result, mospt_err *err)
{
    rend_stage *stage = NULL;
    rend_figures figures;
    double start = now_ms();
    bool ok = rend_stage_create(dataset, gl, &options->limits, NULL, NULL, &stage, err) &&
              draw_and_read(stage, gl, view, rgb, err) &&
              (!options->legend ||
               rend_legend_draw(rend_stage_legend(stage), view->width, view->height, rgb, err));
    if (ok) {
        rend_stage_figures(stage, &figures);
        *result = (rend_shot_result){
            .points_drawn = figures.points_drawn,
            .budget_points = view->budget_points,
            .points_in_view = figures.points_in_view,
            .nodes_drawn = figures.nodes_drawn,
            .nodes_hidden = figures.nodes_hidden,
            .points_hidden = figures.points_hidden,
            .budget_spent = figures.budget_spent,
            .loaded_bytes = figures.loaded_bytes,
            .draw_ms = now_ms() - start,
            .damaged_nodes = figures.damaged_nodes,
            .damaged_points = figures.damaged_points,
            .damage = figures.damage,
            .resets = figures.resets,
        };
        strncpy(result->renderer, rgl_renderer(gl), sizeof result->renderer - 1);
    }
    rend_stage_destroy(stage);
    return ok;
}

static bool make_view(const mospt_dataset *dataset, const rend_shot_options *options,
                      rend_view_of *out, mospt_err *err)
{
    rend_view_of view = {
        .width = options->width > 0 ? options->width : REND_WIDTH_DEFAULT,
        .height = options->height > 0 ? options->height : REND_HEIGHT_DEFAULT,
        .look = options->look,
        .budget_points =
            options->limits.budget_points > 0 ? options->limits.budget_points : REND_ALL,
        .min_node_px = options->limits.min_node_px,
        .no_occlusion = options->limits.no_occlusion,
    };
    if (view.width > REND_SIZE_MAX || view.height > REND_SIZE_MAX)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "a picture of %u x %u is larger than %d x %d", view.width, view.height,
                             REND_SIZE_MAX, REND_SIZE_MAX);
    if (!rend_camera_make(&options->camera, dataset, view.width, view.height, &view.camera, err))
        return false;
    *out = view;
    return true;
}

bool rend_shot(const mospt_dataset *dataset, const rend_shot_options *options,
               rend_shot_result *result, mospt_err *err)
{
    double start = now_ms();
    rend_view_of view;
    if (!make_view(dataset, options, &view, err)) return false;
    rend_shot_result shot = {0};
    rend_engine engine = {0};
    size_t size = (size_t)view.width * view.height * 3;
    uint8_t *rgb = malloc(size);
    bool ok = rgb != NULL || mospt_err_nomem(err, size);
    ok = ok && rend_engine_open(&options->engine, &engine, err) &&
         draw(dataset, engine.gl, options, &view, rgb, &shot, err) &&
         rend_image_write(options->path, rgb, view.width, view.height, err);
    rend_engine_close(&engine);
    free(rgb);
    shot.total_ms = now_ms() - start;
    if (ok && result != NULL) *result = shot;
    return ok;
}
