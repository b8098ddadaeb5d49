#include "render/select.h"

#include <cglm/cglm.h>
#include <math.h>
#include <stdlib.h>

typedef struct {
    float size_px; /* at the centre */
    uint32_t node;
    uint32_t parent; /* in the draw list */
} queued;

struct rend_selector {
    rend_selection result;
    uint32_t draw_capacity, request_capacity;
    queued *heap; /* [heap_capacity], owned; the largest on top */
    uint32_t heap_count, heap_capacity;
};

/* Where a node is in this frame. */
typedef struct {
    vec3 centre; /* from the eye, grid axes, steps */
    float half;  /* of its width */
} placed;

/* One traversal. */
typedef struct {
    const rend_select_input *in;
    rend_selector *s;
    float min_node_px, cell_px;
    uint64_t pages;
} walk;

rend_selector *rend_select_create(void)
{
    return calloc(1, sizeof(rend_selector));
}

void rend_select_destroy(rend_selector *selector)
{
    if (selector == NULL) return;
    free(selector->result.draws);
    free(selector->result.octants);
    free(selector->result.requests);
    free(selector->heap);
    free(selector);
}

/* Room for one more of `size` bytes in an array that doubles. */
static bool grow(void **array, uint32_t *capacity, uint32_t count, size_t size, mospt_err *err)
{
    if (count < *capacity) return true;
    uint32_t wanted = *capacity > 0 ? 2 * *capacity : 1024;
    void *larger = realloc(*array, wanted * size);
    if (larger == NULL) return mospt_err_nomem(err, wanted * size);
    *array = larger, *capacity = wanted;
    return true;
}

/* Larger first; of equal ones the one that stands first in the hierarchy, so that a frame does not
 * depend on history. */
static bool goes_before(const queued *a, const queued *b)
{
    return a->size_px != b->size_px ? a->size_px > b->size_px : a->node < b->node;
}

static bool push(rend_selector *s, queued item, mospt_err *err)
{
    void *heap = s->heap;
    if (!grow(&heap, &s->heap_capacity, s->heap_count, sizeof item, err)) return false;
    s->heap = heap;
    uint32_t at = s->heap_count++;
    for (; at > 0 && goes_before(&item, &s->heap[(at - 1) / 2]); at = (at - 1) / 2)
        s->heap[at] = s->heap[(at - 1) / 2];
    s->heap[at] = item;
    return true;
}

static queued pop(rend_selector *s)
{
    queued top = s->heap[0], last = s->heap[--s->heap_count];
    uint32_t at = 0;
    for (uint32_t child; (child = 2 * at + 1) < s->heap_count; at = child) {
        if (child + 1 < s->heap_count && goes_before(&s->heap[child + 1], &s->heap[child])) child++;
        if (!goes_before(&s->heap[child], &last)) break;
        s->heap[at] = s->heap[child];
    }
    s->heap[at] = last;
    return top;
}

static placed place(const walk *w, uint32_t node)
{
    const mospt_node *n = &w->in->hierarchy->nodes[node];
    double half = 0.5 * (double)mospt_cell_width(w->in->grid, n->level);
    placed p = {.half = (float)half};
    for (int a = 0; a < 3; a++)
        p.centre[a] = (float)((double)n->corner[a] + half - w->in->frame->eye[a]);
    return p;
}

static float along(const float plane[3], const vec3 v)
{
    return plane[0] * v[0] + plane[1] * v[1] + plane[2] * v[2];
}

static bool is_outside(const rend_frame *f, const placed *p)
{
    for (int i = 0; i < 5; i++)
        if (along(f->plane[i], p->centre) + p->half * f->plane_reach[i] < 0) return true;
    return false;
}

/* Projected width of the cube at its centre. Around the eye the distance ends at half the width, or
 * the one cube whose middle the eye happens to be in would be infinitely urgent. */
static float size_at_centre(const rend_frame *f, const placed *p)
{
    float distance = sqrtf(along(p->centre, p->centre));
    return 2 * p->half * f->focal_px / fmaxf(distance, p->half);
}

/* Largest projected width of the cube, were it at any of its visible places; infinite around the
 * eye. Two bounds on how near to the eye's plane those are, each better than the other somewhere:
 * the near side of the cube along the view axis, and its nearest point at the angle of the
 * picture's corner. */
static float size_at_nearest(const rend_frame *f, const placed *p)
{
    vec3 gap;
    for (int a = 0; a < 3; a++)
        gap[a] = fmaxf(fabsf(p->centre[a]) - p->half, 0);
    float w = sqrtf(along(gap, gap)) * f->corner_cos;
    w = fmaxf(w, along(f->plane[4], p->centre) - p->half * f->plane_reach[4]);
    return w > 0 ? 2 * p->half * f->focal_px / w : INFINITY;
}

static uint32_t level_for(uint32_t depth, float root_px, float cell_px)
{
    uint32_t level = 0;
    while (level <= depth && root_px > cell_px)
        root_px *= 0.5f, level++;
    return level;
}

/* The first level that holds most of the points drawn: 3/4, since a surface gains four times as
 * many with each level until its samples are reached. */
static uint32_t density_level(const mospt_node *n, uint32_t depth, uint32_t count)
{
    uint32_t level = 0;
    while (level < depth && n->level_end[level] < count - count / 4)
        level++;
    return level;
}

static uint32_t cell_log2(const walk *w, const mospt_node *n, uint32_t inner_level)
{
    uint32_t bits = mospt_cell_bits(w->in->grid, n->level);
    return bits > inner_level ? bits - inner_level : 0;
}

static bool queue_node(walk *w, uint32_t node, uint32_t parent, mospt_err *err)
{
    placed p = place(w, node);
    return push(w->s, (queued){size_at_centre(w->in->frame, &p), node, parent}, err);
}

static bool queue_children(walk *w, uint32_t node, uint32_t parent, mospt_err *err)
{
    const mospt_node *n = &w->in->hierarchy->nodes[node];
    for (uint32_t c = 0; c < n->child_count; c++)
        if (!queue_node(w, n->first_child + c, parent, err)) return false;
    return true;
}

static bool request(walk *w, const queued *q, mospt_err *err)
{
    rend_selection *r = &w->s->result;
    void *requests = r->requests;
    if (!grow(&requests, &w->s->request_capacity, r->request_count, sizeof *r->requests, err))
        return false;
    r->requests = requests;
    r->requests[r->request_count++] = (rend_request){q->node, q->size_px};
    return true;
}

/* Grows the list of draws, and the octants beside it. */
static bool grow_draws(rend_selector *s, mospt_err *err)
{
    rend_selection *r = &s->result;
    uint32_t capacity = s->draw_capacity;
    void *draws = r->draws, *octants = r->octants;
    if (!grow(&draws, &s->draw_capacity, r->draw_count, sizeof *r->draws, err)) return false;
    r->draws = draws;
    if (!grow(&octants, &capacity, r->draw_count, 8 * sizeof *r->octants, err)) {
        s->draw_capacity = capacity;
        return false;
    }
    r->octants = octants;
    return true;
}

static uint32_t octant_in(const walk *w, const mospt_node *n)
{
    uint32_t bits = mospt_cell_bits(w->in->grid, n->level), octant = 0;
    for (uint32_t a = 0; a < 3; a++)
        octant |= (uint32_t)((uint64_t)n->corner[a] >> bits & 1) << a;
    return n->level <= w->in->grid->bits ? octant : 0;
}

/* Links the octant of the parent to this draw. The parent of a draw below a damaged node is farther
 * up: there the octant keeps the size of the parent's own cells. */
static void link_to_parent(const walk *w, const queued *q)
{
    const rend_selection *r = &w->s->result;
    const mospt_node *n = &w->in->hierarchy->nodes[q->node];
    if (q->parent == REND_NO_DRAW || r->draws[q->parent].node != n->parent) return;
    r->octants[8 * (size_t)q->parent + octant_in(w, n)] = r->draw_count;
}

static bool draw(walk *w, const queued *q, float nearest_px, uint32_t count, mospt_err *err)
{
    const mospt_node *n = &w->in->hierarchy->nodes[q->node];
    rend_selection *r = &w->s->result;
    if (!grow_draws(w->s, err)) return false;
    uint32_t depth = w->in->hierarchy->inner_depth,
             level = level_for(depth, nearest_px, w->cell_px);
    uint32_t finest = level < depth ? level : depth, density = density_level(n, finest, count);
    for (uint32_t o = 0; o < 8; o++) {
        uint32_t cells = (n->child_mask | n->pending_mask) >> o & 1 ? finest : density;
        r->octants[8 * (size_t)r->draw_count + o] = REND_SPLAT | cell_log2(w, n, cells);
    }
    link_to_parent(w, q);
    r->draws[r->draw_count] = (rend_draw){
        .node = q->node,
        .count = count,
        .parent = q->parent,
        .widest_px = ldexpf(nearest_px, -(int)(n->child_mask == 0xff ? finest : density)),
    };
    r->points += count;
    return queue_children(w, q->node, r->draw_count++, err);
}

typedef enum { SEEN, CULLED, SMALL, HIDDEN } sight;

static bool is_clipped(const walk *w, uint32_t node)
{
    const mospt_node *n = &w->in->hierarchy->nodes[node];
    return w->in->clip != NULL &&
           rend_clip_misses(w->in->clip, n->corner, mospt_cell_width(w->in->grid, n->level));
}

/* Steps 2 and 3. */
static sight look_at(const walk *w, uint32_t node, const placed *p, float nearest_px)
{
    const mospt_node *n = &w->in->hierarchy->nodes[node];
    if (is_outside(w->in->frame, p) || is_clipped(w, node)) return CULLED;
    if (node != 0 && nearest_px < w->min_node_px) return SMALL;
    bool hidden =
        w->in->occlusion != NULL &&
        rend_occlusion_hides(w->in->occlusion, n->corner, mospt_cell_width(w->in->grid, n->level));
    return hidden ? HIDDEN : SEEN;
}

/* The four steps. */
static bool visit(walk *w, const queued *q, mospt_err *err)
{
    const rend_select_input *in = w->in;
    const mospt_node *n = &in->hierarchy->nodes[q->node];
    rend_selection *r = &w->s->result;
    placed p = place(w, q->node);
    float nearest_px = size_at_nearest(in->frame, &p);
    uint32_t depth = in->hierarchy->inner_depth;
    uint32_t count = mospt_linear_prefix(n->level_end, depth, nearest_px, w->cell_px);
    uint64_t pages =
        in->page_limit > 0 ? (n->count + (uint64_t)in->page_points - 1) / in->page_points : 0;
    rend_residency residency = in->residency == NULL ? REND_RESIDENT : in->residency[q->node];

    if (residency == REND_DAMAGED) count = 0, pages = 0;
    r->visited++;
    if (count > in->budget_points - r->points ||
        (in->page_limit > 0 && w->pages + pages > in->page_limit)) {
        r->stopped = true;
        return true;
    }
    sight seen = look_at(w, q->node, &p, nearest_px);
    r->culled += seen == CULLED, r->small += seen == SMALL;
    r->hidden += seen == HIDDEN, r->points_hidden += seen == HIDDEN ? count : 0;
    if (seen != SEEN) return true;
    w->pages += pages;
    r->points_in_view += n->count;
    if (residency == REND_DAMAGED) return queue_children(w, q->node, q->parent, err);
    if (residency == REND_RESIDENT) return draw(w, q, nearest_px, count, err);
    return request(w, q, err);
}

bool rend_select_run(rend_selector *selector, const rend_select_input *input,
                     const rend_selection **out, mospt_err *err)
{
    selector->result = (rend_selection){.draws = selector->result.draws,
                                        .octants = selector->result.octants,
                                        .requests = selector->result.requests};
    selector->heap_count = 0;
    walk w = {
        .in = input, .s = selector, .min_node_px = input->min_node_px, .cell_px = input->cell_px};
    if (!(w.min_node_px > 0)) w.min_node_px = ldexpf(1, (int)input->hierarchy->inner_depth - 1);
    if (!(w.cell_px > 0)) w.cell_px = 1;
    if (input->hierarchy->count > 0 && !queue_node(&w, 0, REND_NO_DRAW, err)) return false;
    while (selector->heap_count > 0 && !selector->result.stopped) {
        queued q = pop(selector);
        if (!visit(&w, &q, err)) return false;
    }
    *out = &selector->result;
    return true;
}
