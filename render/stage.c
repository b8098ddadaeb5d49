#include "render/stage.h"

#include "render/still.h"

#include <stdlib.h>

struct rend_stage {
    rend_store *store; /* owned */
    rend_colours colours;
    rend_picture picture;
    rend_live live;
};

bool rend_stage_create(const mospt_dataset *dataset, rgl *gl, const rend_limits *limits,
                       rend_loader_wake *wake, void *user, rend_stage **out, mospt_err *err)
{
    rend_stage *s = calloc(1, sizeof *s);
    if (s == NULL) return mospt_err_nomem(err, sizeof *s);
    if (!rend_store_create(dataset, gl, limits, wake, user, &s->store, err) ||
        !rend_colours_init(&s->colours, dataset, err) ||
        !rend_picture_init(&s->picture, dataset, gl, s->store, err) ||
        !rend_live_init(&s->live, &s->picture, err)) {
        rend_stage_destroy(s);
        return false;
    }
    *out = s;
    return true;
}

void rend_stage_destroy(rend_stage *stage)
{
    if (stage == NULL) return;
    rend_live_fini(&stage->live);
    rend_picture_fini(&stage->picture);
    rend_colours_fini(&stage->colours);
    rend_store_destroy(stage->store);
    free(stage);
}

bool rend_stage_swap(rend_stage *stage, const mospt_dataset *dataset, mospt_err *err)
{
    rend_live_drop(&stage->live);
    if (!rend_colours_swap(&stage->colours, dataset, err)) return false;
    if (!rend_store_swap(stage->store, dataset, err)) return false;
    rend_picture_swap(&stage->picture, dataset);
    return rend_live_swap(&stage->live, err);
}

/* What is on the GPU stays there, to be drawn until it has been replaced. */
static bool use_colours(rend_stage *s, const rend_look *look, mospt_err *err)
{
    rend_paint_change change;
    if (!rend_colours_use(&s->colours, look, &change, err)) return false;
    if (change != REND_PAINT_KEPT)
        rend_store_paint(s->store, &s->colours.paint, change == REND_PAINT_EQUAL);
    return true;
}

bool rend_stage_recover(rend_stage *stage, mospt_err *err)
{
    if (!rgl_is_lost(stage->picture.gl)) return false;
    rend_live_drop(&stage->live);
    return rend_store_recover(stage->store, err);
}

/* True if what has failed can be tried again. */
static bool get_over(rend_stage *s, mospt_err *err)
{
    rend_live_drop(&s->live);
    return rend_stage_recover(s, err) ||
           (!rgl_is_lost(s->picture.gl) && rend_store_halve(s->store, err));
}

bool rend_stage_frame(rend_stage *stage, const rend_view_of *view, const rend_allowance *allowed,
                      rend_progress *progress, mospt_err *err)
{
    static const rend_allowance unlimited = {0};
    if (allowed == NULL) allowed = &unlimited;
    if (!use_colours(stage, &view->look, err)) return false;
    while (!rend_live_frame(&stage->live, view, allowed, progress, err))
        if (!get_over(stage, err)) return false;
    return true;
}

bool rend_stage_still(rend_stage *stage, const rend_view_of *view, mospt_err *err)
{
    rend_live_drop(&stage->live);
    if (!use_colours(stage, &view->look, err)) return false;
    while (!rend_still_draw(&stage->picture, view, err))
        if (!get_over(stage, err)) return false;
    return true;
}

bool rend_stage_expect(rend_stage *stage, const rend_view_of *view, mospt_err *err)
{
    rend_live_drop(&stage->live);
    return use_colours(stage, &view->look, err) && rend_still_expect(&stage->picture, view, err);
}

void rend_stage_figures(rend_stage *stage, rend_figures *out)
{
    *out = stage->picture.figures;
    rend_store_figures(stage->store, out);
}

const rend_legend *rend_stage_legend(const rend_stage *stage)
{
    return &stage->colours.legend;
}

const rend_frame *rend_stage_last_frame(const rend_stage *stage)
{
    return &stage->picture.frame;
}

const rend_selection *rend_stage_last_selection(const rend_stage *stage)
{
    return stage->picture.selection;
}
