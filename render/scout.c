#include "render/scout.h"

#include "render/select.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdlib.h>

enum { AHEAD_FRAMES = 24 };

struct rend_scout {
    const mospt_dataset *dataset;
    const rend_take *take;
    const rend_curve *curve;
    double seconds_per_frame;
    uint64_t first, end;
    pthread_t thread;
    rend_selector *selector;
    uint64_t *seen; /* [node count], owned: frame + 2 in which a node was last selected */
    uint32_t low[3], high[3];

    /* Guarded by `lock`. */
    pthread_mutex_t lock;
    pthread_cond_t changed;
    uint64_t reached;
    bool quit;
};

/* Waits until a frame is near enough; false if the recording is over. */
static bool wait_for_turn(rend_scout *s, uint64_t frame)
{
    pthread_mutex_lock(&s->lock);
    while (!s->quit && frame > s->reached + AHEAD_FRAMES)
        pthread_cond_wait(&s->changed, &s->lock);
    bool go = !s->quit;
    pthread_mutex_unlock(&s->lock);
    return go;
}

/* What the frame before had is in memory, or on its way there. */
static void ask_for(rend_scout *s, uint32_t node, uint64_t frame)
{
    const mospt_node *n = &s->dataset->hierarchy.nodes[node];
    if (s->seen[node] < frame + 1)
        posix_fadvise(s->dataset->fd[n->payload_file], (off_t)n->payload_offset,
                      (off_t)mospt_dataset_vertices_size(s->dataset, node), POSIX_FADV_WILLNEED);
    s->seen[node] = frame + 2;
}

static bool look_at(rend_scout *s, const rend_view_of *view, uint64_t frame)
{
    rend_frame of_view;
    const rend_selection *selection;
    const mospt_grid *grid = &s->dataset->metadata.grid;
    rend_clip clip;
    if (view->look.has_clip) rend_clip_make(grid, &view->look.clip, &clip);
    rend_frame_make(&view->camera, grid, s->low, s->high, view->width, view->height, &of_view);
    const rend_select_input input = {.hierarchy = &s->dataset->hierarchy,
                                     .grid = grid,
                                     .frame = &of_view,
                                     .budget_points = view->budget_points,
                                     .min_node_px = view->min_node_px,
                                     .clip = view->look.has_clip ? &clip : NULL};
    if (!rend_select_run(s->selector, &input, &selection, NULL)) return false;
    for (uint32_t i = 0; i < selection->draw_count; i++)
        ask_for(s, selection->draws[i].node, frame);
    return true;
}

/* Without memory the recording does without a scout. */
static void *run(void *user)
{
    rend_scout *s = user;
    for (uint64_t frame = s->first; frame < s->end && wait_for_turn(s, frame); frame++) {
        rend_view_of view;
        double time_s = (double)frame * s->seconds_per_frame;
        for (uint32_t pass = 0; pass < rend_take_views(s->take); pass++)
            if (!rend_take_view(s->take, s->curve, time_s, pass, &view) ||
                !look_at(s, &view, frame))
                return NULL;
    }
    return NULL;
}

bool rend_scout_start(const mospt_dataset *dataset, const rend_take *take, const rend_curve *curve,
                      double seconds_per_frame, uint64_t first, uint64_t end, rend_scout **out,
                      mospt_err *err)
{
    rend_scout *s = calloc(1, sizeof *s);
    if (s == NULL) return mospt_err_nomem(err, sizeof *s);
    s->dataset = dataset, s->take = take, s->curve = curve;
    s->seconds_per_frame = seconds_per_frame;
    s->first = s->reached = first, s->end = end;
    s->selector = rend_select_create();
    s->seen = calloc((size_t)dataset->hierarchy.count + 1, sizeof *s->seen);
    rend_frame_bounds(dataset, s->low, s->high);
    bool ok = (s->selector != NULL && s->seen != NULL) || mospt_err_nomem(err, 0);
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->changed, NULL);
    if (ok && pthread_create(&s->thread, NULL, run, s) != 0)
        ok = mospt_err_set(err, MOSPT_EIO, mospt_nowhere(), "no thread could be started");
    if (ok) {
        *out = s;
        return true;
    }
    pthread_cond_destroy(&s->changed);
    pthread_mutex_destroy(&s->lock);
    rend_select_destroy(s->selector);
    free(s->seen);
    free(s);
    return false;
}

void rend_scout_destroy(rend_scout *scout)
{
    if (scout == NULL) return;
    pthread_mutex_lock(&scout->lock);
    scout->quit = true;
    pthread_cond_broadcast(&scout->changed);
    pthread_mutex_unlock(&scout->lock);
    pthread_join(scout->thread, NULL);
    pthread_cond_destroy(&scout->changed);
    pthread_mutex_destroy(&scout->lock);
    rend_select_destroy(scout->selector);
    free(scout->seen);
    free(scout);
}

void rend_scout_reached(rend_scout *scout, uint64_t frame)
{
    pthread_mutex_lock(&scout->lock);
    scout->reached = frame;
    pthread_cond_broadcast(&scout->changed);
    pthread_mutex_unlock(&scout->lock);
}
