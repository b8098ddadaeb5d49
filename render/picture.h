/* render/picture.h - one picture of what is on the GPU: what is selected, in which order, hidden
 * behind what, and drawn how.
 *
 * Drawn in one go or in parts, by render/live.h and render/still.h.
 * threads  the one that has the context */
#pragma once
#include "render/camera.h"
#include "render/order.h"
#include "render/select.h"
#include "render/store.h"

typedef struct {
    rend_camera camera;
    uint32_t width, height; /* pixels */
    rend_look look;
    uint64_t budget_points; /* REND_ALL: no limit */
    float min_node_px;      /* 0: see render/select.h */
    float cell_px;          /* likewise */
    bool no_occlusion;      /* nodes hidden behind others are drawn, too */
    int parts;              /* RGL_TO_WINDOW or 0 */
} rend_view_of;

typedef struct {
    const mospt_dataset *dataset; /* borrowed, like the two below */
    rgl *gl;
    rend_store *store;
    uint32_t bounds_low[3], bounds_high[3]; /* of all points */
    rend_selector *selector;                /* owned */
    rend_occlusion *occlusion;              /* owned: what earlier pictures hid */

    rend_frame frame;
    rend_clip clip; /* of the selection, if the view has one */
    const rend_selection *selection;
    rend_order order;
    rend_figures figures; /* those of the picture */
} rend_picture;

bool rend_picture_init(rend_picture *picture, const mospt_dataset *dataset, rgl *gl,
                       rend_store *store, mospt_err *err);
void rend_picture_fini(rend_picture *picture); /* {0} is fine */

/* Goes on with another dataset, like the store; the selection in hand is void. */
void rend_picture_swap(rend_picture *picture, const mospt_dataset *dataset);

/* What a selection for this view starts from, with everything resident and nothing hidden. The
 * picture's frame is that of the view from here on. */
rend_select_input rend_picture_aim(rend_picture *picture, const rend_view_of *view);

/* Selects and sorts: the selection, the order, and figures of a picture that nothing was drawn of.
 */
bool rend_picture_select(rend_picture *picture, const rend_view_of *view,
                         const rend_select_input *input, mospt_err *err);

/* The node of the i-th draw in the order, and how many points it draws. */
const rend_draw *rend_picture_at(const rend_picture *picture, uint32_t i);

/* Draws the draws from .. to - 1 of the order, as far as they are on the GPU.
 * parts    of the picture, as rgl_draw() takes them, without those of the view */
bool rend_picture_draw(rend_picture *picture, const rend_view_of *view, uint32_t from, uint32_t to,
                       int parts, mospt_err *err);

/* How the picture is shaded, and how large its points are. */
rgl_scene rend_picture_scene(const rend_picture *picture, const rend_view_of *view);

/* The depths of what has been drawn are what things can be hidden behind from here on. Without
 * memory for them nothing is.
 * view     whose points they are */
bool rend_picture_look_behind(rend_picture *picture, const rend_view_of *view, mospt_err *err);

/* Fewer points than that are not worth a look at what they hide. */
enum { REND_OCCLUSION_POINTS_MIN = 200000 };
