#include "render/live.h"

#include <stdlib.h>
#include <string.h>

/* 64 MiB cross any bus in a few milliseconds; more in one frame would be felt as a stutter. */
#define UPLOAD_BYTES_PER_FRAME (64 * REND_MIB)
/* While less than this share of the points is hidden, depths are read back now and then only. */
#define HIDDEN_SHARE_MIN 0.05
enum { LOOK_EVERY = 8, LOOKS_AT_REST = 6 };

bool rend_live_init(rend_live *live, rend_picture *picture, mospt_err *err)
{
    *live = (rend_live){.picture = picture, .ahead = rend_select_create()};
    return (live->ahead != NULL || mospt_err_nomem(err, 0)) && rend_live_swap(live, err);
}

bool rend_live_swap(rend_live *live, mospt_err *err)
{
    size_t count = live->picture->dataset->hierarchy.count;
    free(live->ages), free(live->young);
    live->ages = malloc(count + 1);
    live->young = malloc((count + 1) * sizeof *live->young);
    live->young_count = 0;
    if (live->ages == NULL || live->young == NULL) return mospt_err_nomem(err, count);
    memset(live->ages, REND_GROWN, count);
    return true;
}

void rend_live_fini(rend_live *live)
{
    rend_select_destroy(live->ahead);
    free(live->ages), free(live->young);
    *live = (rend_live){0};
}

void rend_live_drop(rend_live *live)
{
    live->begun = false;
}

/* ---- fetching ---- */

/* What the frame in hand may upload, and has. */
typedef struct {
    uint64_t most, bytes;
    rend_progress progress;
} fetching;

/* The vertices of a missing node, to be uploaded now. NULL: they are to be read, which is asked for
 * here, or the frame has uploaded enough. */
static const mospt_vertex *take(rend_picture *p, uint32_t node, fetching *f)
{
    const mospt_vertex *vertices = rend_store_vertices(p->store, node);
    p->figures.pending++;
    if (vertices == NULL) rend_store_want(p->store, node);
    else f->progress = REND_AGAIN;
    if (vertices == NULL || f->bytes >= f->most) return NULL;
    f->bytes += mospt_dataset_vertices_size(p->dataset, node);
    return vertices;
}

/* Puts new colours over the old ones: a node keeps its place. */
static bool fetch_stale(rend_picture *p, fetching *f, mospt_err *err)
{
    for (uint32_t i = 0; i < p->selection->draw_count; i++) {
        uint32_t node = p->selection->draws[i].node;
        if (!rend_store_is_stale(p->store, node)) continue;
        const mospt_vertex *vertices = take(p, node, f);
        if (vertices != NULL && !rend_store_replace(p->store, node, vertices, err)) return false;
    }
    return true;
}

/* What the selection asked for, as far as it is not there or damaged yet. */
static bool fetch_requested(rend_live *live, fetching *f, mospt_err *err)
{
    rend_picture *p = live->picture;
    for (uint32_t i = 0; i < p->selection->request_count; i++) {
        uint32_t node = p->selection->requests[i].node;
        if (rend_store_residency(p->store)[node] != REND_ABSENT) {
            f->progress = REND_AGAIN; /* since an earlier part of this picture */
            continue;
        }
        const mospt_vertex *vertices = take(p, node, f);
        if (vertices == NULL) continue;
        /* The selection asks for no more than fits, and what was just put there must not make room
         * for what comes next. */
        if (!rend_store_put(p->store, node, vertices, err)) return false;
        if (live->ages[node] == REND_GROWN) live->young[live->young_count++] = node;
        live->ages[node] = 0;
    }
    return true;
}

/* Asks for what will be missing, into main memory and no further: on the GPU it might push out what
 * is drawn. */
static bool fetch_ahead(rend_live *live, const rend_camera *camera, mospt_err *err)
{
    rend_picture *p = live->picture;
    rend_frame frame;
    const rend_selection *selection;
    rend_select_input input = rend_picture_aim(p, &live->view);
    rend_frame_make(camera, input.grid, p->bounds_low, p->bounds_high, live->view.width,
                    live->view.height, &frame);
    input.frame = &frame;
    input.residency = rend_store_residency(p->store);
    if (!rend_select_run(live->ahead, &input, &selection, err)) return false;
    uint64_t bytes = 0, most = rend_store_memory(p->store) / 4;
    for (uint32_t i = 0; i < selection->request_count && bytes < most; i++) {
        uint32_t node = selection->requests[i].node;
        if (rend_store_has_vertices(p->store, node)) continue;
        rend_store_want(p->store, node);
        bytes += mospt_dataset_vertices_size(p->dataset, node);
    }
    p->figures.ahead = rend_store_wanted(p->store);
    return true;
}

/* Uploads what is in main memory, and asks the loader for the rest. */
static bool fetch(rend_live *live, const rend_allowance *allowed, rend_progress *progress,
                  mospt_err *err)
{
    rend_picture *p = live->picture;
    fetching f = {.most =
                      allowed->upload_bytes > 0 ? allowed->upload_bytes : UPLOAD_BYTES_PER_FRAME,
                  .progress = REND_SETTLED};
    p->figures.pending = 0;
    p->figures.ahead = 0;
    rend_store_want_nothing(p->store);
    if (!fetch_stale(p, &f, err) || !fetch_requested(live, &f, err)) return false;
    uint32_t wanted = rend_store_wanted(p->store);
    *progress = f.progress == REND_SETTLED && wanted > 0 ? REND_WAITING : f.progress;
    if (wanted == 0 && allowed->ahead != NULL && !fetch_ahead(live, allowed->ahead, err))
        return false;
    return rend_store_ask(p->store, err);
}

/* ---- drawing ---- */

static bool is_same_shape(const rend_look *a, const rend_look *b)
{
    return a->size_mode == b->size_mode && a->point_px == b->point_px && a->point_m == b->point_m &&
           a->has_clip == b->has_clip && memcmp(&a->clip, &b->clip, sizeof a->clip) == 0;
}

/* What a wall hid that has been cut away, or that is drawn with smaller points, is hidden no more.
 */
static void forget_other_shapes(rend_live *live, const rend_view_of *view)
{
    if (!view->no_occlusion && is_same_shape(&view->look, &live->view.look)) return;
    rend_occlusion_forget(live->picture->occlusion);
    live->points_before = 0;
}

/* Another picture is about to be drawn. */
static void grow(rend_live *live)
{
    uint32_t kept = 0;
    live->is_growing = live->young_count > 0 && !live->in_parts;
    for (uint32_t i = 0; i < live->young_count; i++) {
        uint8_t *age = &live->ages[live->young[i]];
        *age = live->in_parts ? REND_GROWN : (uint8_t)(*age + 1);
        if (*age < REND_GROWN) live->young[kept++] = live->young[i];
    }
    live->young_count = kept;
}

static bool begin_picture(rend_live *live, const rend_view_of *view, mospt_err *err)
{
    rend_picture *p = live->picture;
    forget_other_shapes(live, view);
    rend_select_input input = rend_picture_aim(p, view);
    input.residency = rend_store_residency(p->store);
    input.page_limit = rend_store_page_count(p->store);
    input.occlusion = p->occlusion;
    input.ages = live->in_parts ? NULL : live->ages;
    live->is_guess = !rend_occlusion_aim(p->occlusion, &p->frame);
    if (!rend_picture_select(p, view, &input, err)) return false;
    grow(live);
    rend_store_unpin_all(p->store);
    for (uint32_t i = 0; i < p->selection->draw_count; i++)
        if (!rend_store_pin(p->store, p->selection->draws[i].node, err)) return false;
    live->begun = true, live->again = false, live->next = 0;
    live->view = *view;
    return true;
}

/* How far the order goes in one frame. */
static uint32_t end_of_part(const rend_live *live, uint64_t most)
{
    uint64_t points = 0;
    uint32_t to = live->next;
    for (; to < live->picture->selection->draw_count; to++) {
        points += rend_picture_at(live->picture, to)->count;
        if (most > 0 && points > most && to > live->next) break;
    }
    return to;
}

/* Draws a part; the hand lets go of the picture with the last one. Blending takes a second round,
 * but for a picture of one part. */
static bool draw_part(rend_live *live, uint64_t most, mospt_err *err)
{
    rend_picture *p = live->picture;
    bool blend = live->view.look.blend_slab > 0;
    uint32_t from = live->next, to = end_of_part(live, most);
    bool first = from == 0 && !live->again, end = to == p->selection->draw_count;
    bool again = blend && (live->again || (first && end));
    bool last = end && again == blend;
    live->in_parts = first ? !last : live->in_parts;
    int parts = (first ? RGL_BEGIN : 0) | (again ? RGL_AGAIN : 0) | (last ? RGL_END : 0);
    rend_figures before = p->figures;
    if (!rend_picture_draw(p, &live->view, from, to, parts, err)) return false;
    p->figures.points_total += p->figures.points_drawn - before.points_drawn;
    if (live->again)
        p->figures.points_drawn = before.points_drawn, p->figures.nodes_drawn = before.nodes_drawn;
    live->begun = !last;
    live->again = live->again || end;
    live->next = end ? 0 : to;
    return true;
}

/* After a picture: what it hides, for the next one. At rest pictures follow each other until what
 * is hidden stays the same; while little is, not every picture is looked behind. */
static bool look_behind(rend_live *live, rend_progress *progress, mospt_err *err)
{
    const rend_selection *r = live->picture->selection;
    uint64_t points = r->points + r->points_hidden;
    bool pays = r->stopped || points > REND_OCCLUSION_POINTS_MIN || r->hidden > 0;
    bool little = (double)r->points_hidden < HIDDEN_SHARE_MIN * (double)points;
    bool same = r->hidden == live->hidden_before && r->points == live->points_before;
    live->hidden_before = r->hidden, live->points_before = r->points;
    if (live->view.no_occlusion || !pays) return true;
    if (!live->is_guess && (same || ++live->looks > LOOKS_AT_REST)) return true;
    if (r->hidden > 0 || r->stopped) *progress = REND_AGAIN;
    if (live->is_guess) live->looks = 0;
    if (live->is_guess && little && ++live->guesses % LOOK_EVERY != 0) return true;
    return rend_picture_look_behind(live->picture, &live->view, err);
}

bool rend_live_frame(rend_live *live, const rend_view_of *view, const rend_allowance *allowed,
                     rend_progress *progress, mospt_err *err)
{
    rend_store_take_loaded(live->picture->store);
    bool goes_on = live->begun && memcmp(view, &live->view, sizeof *view) == 0;
    if (!goes_on && !begin_picture(live, view, err)) return false;
    if (!draw_part(live, allowed->points, err) || !fetch(live, allowed, progress, err))
        return false;
    if (live->begun) *progress = REND_PART;
    else if (live->is_growing) *progress = REND_AGAIN;
    return live->begun || look_behind(live, progress, err);
}
