#include "render/picture.h"

#include <math.h>

bool rend_picture_init(rend_picture *picture, const mospt_dataset *dataset, rgl *gl,
                       rend_store *store, mospt_err *err)
{
    *picture = (rend_picture){.gl = gl,
                              .store = store,
                              .selector = rend_select_create(),
                              .occlusion = rend_occlusion_create()};
    rend_picture_swap(picture, dataset);
    return (picture->selector != NULL && picture->occlusion != NULL) || mospt_err_nomem(err, 0);
}

void rend_picture_fini(rend_picture *picture)
{
    rend_select_destroy(picture->selector);
    rend_occlusion_destroy(picture->occlusion);
    rend_order_fini(&picture->order);
    *picture = (rend_picture){0};
}

void rend_picture_swap(rend_picture *picture, const mospt_dataset *dataset)
{
    picture->dataset = dataset;
    rend_frame_bounds(dataset, picture->bounds_low, picture->bounds_high);
}

rend_select_input rend_picture_aim(rend_picture *picture, const rend_view_of *view)
{
    rend_picture *p = picture;
    const mospt_grid *grid = &p->dataset->metadata.grid;
    rend_frame_make(&view->camera, grid, p->bounds_low, p->bounds_high, view->width, view->height,
                    &p->frame);
    if (view->look.has_clip) rend_clip_make(grid, &view->look.clip, &p->clip);
    return (rend_select_input){.hierarchy = &p->dataset->hierarchy,
                               .grid = grid,
                               .frame = &p->frame,
                               .budget_points = view->budget_points,
                               .min_node_px = view->min_node_px,
                               .cell_px = view->cell_px,
                               .page_points = REND_PAGE_POINTS,
                               .clip = view->look.has_clip ? &p->clip : NULL};
}

bool rend_picture_select(rend_picture *picture, const rend_view_of *view,
                         const rend_select_input *input, mospt_err *err)
{
    rend_picture *p = picture;
    if (!rend_select_run(p->selector, input, &p->selection, err)) return false;
    p->figures.points_drawn = 0;
    p->figures.nodes_drawn = 0;
    p->figures.points_in_view = p->selection->points_in_view;
    p->figures.nodes_visited = p->selection->visited;
    p->figures.nodes_hidden = p->selection->hidden;
    p->figures.points_hidden = p->selection->points_hidden;
    p->figures.budget_spent = p->selection->stopped;
    return rend_order_sort(&p->order, p->selection, &view->look, err);
}

const rend_draw *rend_picture_at(const rend_picture *picture, uint32_t i)
{
    return rend_order_at(&picture->order, i);
}

/* Batches of the draws from .. to - 1 of the order that are on the GPU. */
static bool make_batches(rend_picture *p, const rend_look *look, uint32_t from, uint32_t to,
                         mospt_err *err)
{
    rend_order_begin(&p->order);
    for (uint32_t i = from; i < to; i++) {
        const rend_draw *d = rend_picture_at(p, i);
        if (!rend_store_is_resident(p->store, d->node)) continue;
        const rend_place *place = rend_store_place(p->store, d->node);
        if (!rend_order_add(&p->order, look, i, place, REND_PAGE_POINTS, err)) return false;
        p->figures.points_drawn += d->count;
        p->figures.nodes_drawn++;
    }
    rend_order_end(&p->order);
    return true;
}

rgl_scene rend_picture_scene(const rend_picture *picture, const rend_view_of *view)
{
    const rend_picture *p = picture;
    /* A grey that whitewash and shadow both stand out from, a little lighter where the sky is. */
    static const float top[3] = {0.36f, 0.39f, 0.43f}, bottom[3] = {0.20f, 0.21f, 0.23f};
    const rend_look *look = &view->look;
    rgl_scene scene = {
        .frame = p->frame,
        .octants = look->size_mode == REND_SIZE_AUTO ? p->selection->octants : NULL,
        .octant_nodes = p->selection->draw_count,
        .grid_bits = p->dataset->metadata.grid.bits,
        .splat_scale = REND_SPLAT_PER_CELL,
        .splat_size = look->size_mode == REND_SIZE_WORLD
                          ? (float)(look->point_m / p->dataset->metadata.grid.step)
                          : 0,
        .px_min = rend_order_px_min(look),
        .px_max = rend_order_px_max(look),
        .blend_slab = look->blend_slab,
        .fill_px = look->fill_px,
        .edl_strength = look->no_edl ? 0 : (look->edl_strength > 0 ? look->edl_strength : 1) * 24,
        .edl_radius_px =
            look->edl_radius_px > 0 ? look->edl_radius_px : fmaxf(1, (float)view->height / 720),
        .clip = look->has_clip ? &p->clip : NULL,
    };
    for (int c = 0; c < 3; c++) {
        scene.background_top[c] = look->has_background ? look->background_top[c] : top[c];
        scene.background_bottom[c] = look->has_background ? look->background_bottom[c] : bottom[c];
    }
    return scene;
}

bool rend_picture_draw(rend_picture *picture, const rend_view_of *view, uint32_t from, uint32_t to,
                       int parts, mospt_err *err)
{
    rend_picture *p = picture;
    rgl_scene scene = rend_picture_scene(p, view);
    return make_batches(p, &view->look, from, to, err) &&
           rgl_draw(p->gl, &scene, p->order.batches, p->order.batch_count, parts | view->parts,
                    err);
}

bool rend_picture_look_behind(rend_picture *picture, const rend_view_of *view, mospt_err *err)
{
    rend_picture *p = picture;
    float *depths = rend_occlusion_depths(p->occlusion, p->frame.width, p->frame.height);
    if (depths == NULL) return true;
    if (!rgl_read_depths(p->gl, depths, err)) return false;
    rend_occlusion_learn(p->occlusion, &p->frame, view->look.size_mode != REND_SIZE_AUTO);
    return true;
}
