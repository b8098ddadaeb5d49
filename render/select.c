#include "render/select.h"

#include "render/sweep.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NONE = 0xffffffff, FLOOR_PARTS = 4 }; /* of half a node's width, see select.h */
/* Cells of a surface that are this much of a point wide, or less, close it. */
#define CLOSED 0.8f

/* A node that has been looked at and is not skipped. */
typedef struct {
    uint32_t node;
    uint32_t parent; /* the seen one whose child it is */
    uint32_t next;   /* in its bucket; NONE ends it */
    uint32_t levels; /* index of its first one */
    float begin;     /* x = 1 / cell^2 at which its first points appear */
    float width_px;  /* at its nearest visible point */
    uint32_t draw;   /* index of the draw of it, or of the nearest ancestor that is drawn */
} seen_node;

struct rend_selector {
    rend_selection result;
    seen_node *seen;  /* [seen_capacity], owned */
    uint32_t *popped; /* [popped_capacity], owned: which, in that order */
    rend_growth *levels;
    uint32_t draw_capacity, request_capacity, seen_capacity, popped_capacity, level_capacity;
    uint32_t seen_count, popped_count, level_count;
    uint32_t bucket[REND_SWEEP_BUCKETS]; /* first seen node of each, NONE */
    rend_sweep sweep;
};

/* One traversal. */
typedef struct {
    const rend_select_input *in;
    rend_selector *s;
    float focal2; /* square of the frame's focal length */
    float corner_cos2;
    double x_max; /* 1 / cell_px^2 */
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
    free(selector->seen);
    free(selector->popped);
    free(selector->levels);
    free(selector);
}

/* Room for `more` in an array that doubles. */
static void *grown(void *array, uint32_t *capacity, uint32_t count, uint32_t more, size_t size,
                   mospt_err *err)
{
    if (more <= *capacity - count) return array;
    uint32_t wanted = *capacity > 0 ? 2 * *capacity : 1024;
    while (wanted - count < more)
        wanted *= 2;
    void *larger = realloc(array, wanted * size);
    if (larger == NULL) {
        mospt_err_nomem(err, wanted * size);
        return NULL;
    }
    *capacity = wanted;
    return larger;
}

static bool reserve(walk *w, mospt_err *err)
{
    rend_selector *s = w->s;
    void *seen = grown(s->seen, &s->seen_capacity, s->seen_count, 1, sizeof *s->seen, err);
    if (seen == NULL) return false;
    s->seen = seen;
    void *levels = grown(s->levels, &s->level_capacity, s->level_count, MOSPT_LEVELS_MAX,
                         sizeof *s->levels, err);
    if (levels == NULL) return false;
    s->levels = levels;
    return true;
}

/* Where a node is in this frame. */
typedef struct {
    float centre[3]; /* from the eye, grid axes, steps */
    float half;      /* of its width */
} placed;

static placed place(const walk *w, const mospt_node *n)
{
    double half = 0.5 * (double)mospt_cell_width(w->in->grid, n->level);
    placed p = {.half = (float)half};
    for (int a = 0; a < 3; a++)
        p.centre[a] = (float)((double)n->corner[a] + half - w->in->frame->eye[a]);
    return p;
}

static float along(const float plane[3], const float v[3])
{
    return plane[0] * v[0] + plane[1] * v[1] + plane[2] * v[2];
}

static bool is_outside(const rend_frame *f, const placed *p)
{
    for (int i = 0; i < 5; i++)
        if (along(f->plane[i], p->centre) + p->half * f->plane_reach[i] < 0) return true;
    return false;
}

static bool is_clipped(const walk *w, const mospt_node *n)
{
    return w->in->clip != NULL &&
           rend_clip_misses(w->in->clip, n->corner, mospt_cell_width(w->in->grid, n->level));
}

/* Square of the largest projected width of the cube, were it at any of its visible places. Two
 * bounds on how near to the eye's plane those are, each better than the other somewhere: the near
 * side of the cube along the view axis, and its nearest point at the angle of the picture's corner.
 */
static float width2_at_nearest(const walk *w, const placed *p)
{
    const rend_frame *f = w->in->frame;
    float gap2 = 0, ahead = along(f->plane[4], p->centre) - p->half * f->plane_reach[4];
    for (int a = 0; a < 3; a++) {
        float gap = fmaxf(fabsf(p->centre[a]) - p->half, 0);
        gap2 += gap * gap;
    }
    float nearest = p->half / FLOOR_PARTS, w2 = fmaxf(gap2 * w->corner_cos2, nearest * nearest);
    if (ahead > 0) w2 = fmaxf(w2, ahead * ahead);
    return 4 * p->half * p->half * w->focal2 / w2;
}

static void add_level(walk *w, float begin, uint32_t points)
{
    rend_selector *s = w->s;
    if (points == 0) return;
    s->levels[s->level_count++] = (rend_growth){begin, points};
}

/* The levels of a node, as they grow. Returns where the first one begins.
 * begin    of a level with cells as wide as the node */
static float add_levels(walk *w, const mospt_node *n, uint32_t node, float begin)
{
    uint32_t depth = w->in->hierarchy->inner_depth;
    float finest = ldexpf(begin, 2 * (int)depth);
    if (node == 0)
        for (uint32_t i = 1; i <= depth; i++)
            add_level(w, ldexpf(begin, 2 * (int)i - 2), n->level_end[i] - n->level_end[i - 1]);
    else add_level(w, finest / 4, n->level_end[depth]);
    add_level(w, finest, n->count - n->level_end[depth]);
    return node == 0 ? 0 : finest / 4;
}

/* Steps 2 and 3; what passes them is queued.
 * parent   the seen one, NONE for the root */
static bool look_at(walk *w, uint32_t node, uint32_t parent, mospt_err *err)
{
    rend_selector *s = w->s;
    const mospt_node *n = &w->in->hierarchy->nodes[node];
    placed p = place(w, n);
    s->result.visited++;
    if (is_outside(w->in->frame, &p) || is_clipped(w, n)) {
        s->result.culled++;
        return true;
    }
    float width2 = width2_at_nearest(w, &p), begin = 1 / width2,
          shows = ldexpf(begin, 2 * (int)w->in->hierarchy->inner_depth - 2),
          min2 = w->in->min_node_px * w->in->min_node_px;
    if (node != 0 && ((double)shows >= w->x_max || width2 < min2)) {
        s->result.small++;
        return true;
    }
    if (!reserve(w, err)) return false;
    seen_node seen = {.node = node,
                      .parent = parent,
                      .levels = s->level_count,
                      .width_px = sqrtf(width2),
                      .draw = REND_NO_DRAW};
    seen.begin = add_levels(w, n, node, begin);
    uint32_t bucket = rend_sweep_bucket(seen.begin);
    if (bucket < s->sweep.bucket) bucket = s->sweep.bucket; /* rounding */
    seen.next = s->bucket[bucket];
    s->bucket[bucket] = s->seen_count;
    s->seen[s->seen_count++] = seen;
    return true;
}

static rend_residency residency_of(const walk *w, uint32_t node)
{
    return w->in->residency == NULL ? REND_RESIDENT : w->in->residency[node];
}

static bool look_at_children(walk *w, uint32_t seen, mospt_err *err)
{
    const mospt_node *n = &w->in->hierarchy->nodes[w->s->seen[seen].node];
    for (uint32_t c = 0; c < n->child_count; c++)
        if (!look_at(w, n->first_child + c, seen, err)) return false;
    return true;
}

/* Step 1, of the GPU cache: false if it is full. */
static bool take_pages(walk *w, const mospt_node *n)
{
    const rend_select_input *in = w->in;
    if (in->page_limit == 0) return true;
    uint64_t pages = (n->count + (uint64_t)in->page_points - 1) / in->page_points;
    if (w->pages + pages > in->page_limit) return false;
    w->pages += pages;
    return true;
}

/* Levels of a seen node: up to where those of the next one begin. */
static uint32_t levels_end(const rend_selector *s, uint32_t seen)
{
    return seen + 1 < s->seen_count ? s->seen[seen + 1].levels : s->level_count;
}

static bool is_hidden(const walk *w, const mospt_node *n)
{
    return w->in->occlusion != NULL &&
           rend_occlusion_hides(w->in->occlusion, n->corner,
                                mospt_cell_width(w->in->grid, n->level));
}

/* A node that shows nothing. */
static void never_grow(rend_selector *s, uint32_t seen)
{
    for (uint32_t i = s->seen[seen].levels; i < levels_end(s, seen); i++)
        s->levels[i].points = 0;
}

/* Step 4, the first as far as it concerns the cache, and what hides, which only nodes that would be
 * drawn are asked about. */
static bool pop(walk *w, uint32_t seen, mospt_err *err)
{
    rend_selector *s = w->s;
    uint32_t node = s->seen[seen].node;
    const mospt_node *n = &w->in->hierarchy->nodes[node];
    rend_residency residency = residency_of(w, node);
    if (is_hidden(w, n)) {
        s->result.hidden++;
        s->result.points_hidden += n->count;
        never_grow(s, seen);
        return true;
    }
    if (residency == REND_DAMAGED) never_grow(s, seen);
    else if (!take_pages(w, n)) {
        s->result.stopped = true;
        return true;
    }
    for (uint32_t i = s->seen[seen].levels; i < levels_end(s, seen); i++)
        rend_sweep_add(&s->sweep, s->levels[i]);
    void *popped =
        grown(s->popped, &s->popped_capacity, s->popped_count, 1, sizeof *s->popped, err);
    if (popped == NULL) return false;
    s->popped = popped;
    s->popped[s->popped_count++] = seen;
    s->result.points_in_view += n->count;
    return residency == REND_ABSENT || look_at_children(w, seen, err);
}

/* Pops what begins to show in each bucket, and what that brings in, until the budget is spent. */
static bool traverse(walk *w, mospt_err *err)
{
    rend_selector *s = w->s;
    rend_sweep *sweep = &s->sweep;
    if (!look_at(w, 0, NONE, err)) return false;
    for (;; rend_sweep_advance(sweep)) {
        uint32_t *first = &s->bucket[sweep->bucket];
        while (*first != NONE && !s->result.stopped) {
            uint32_t seen = *first;
            *first = s->seen[seen].next;
            if (!pop(w, seen, err)) return false;
            /* Out of the way of what did not fit the cache. */
            if (!s->result.stopped) s->seen[seen].next = seen;
        }
        if (s->result.stopped || rend_sweep_end(sweep->bucket) >= w->x_max) return true;
        if (rend_sweep_points(sweep) + 1 >= (double)w->in->budget_points) return true;
    }
}

/* What was not popped does not grow. */
static void forget_the_rest(rend_selector *s)
{
    for (uint32_t i = 0; i < s->seen_count; i++)
        if (s->seen[i].next != i) never_grow(s, i);
}

/* The cell size that the budget buys, as x. The root's first point is there at any. */
static double spend(walk *w)
{
    rend_selector *s = w->s;
    double from = rend_sweep_begin(s->sweep.bucket),
           to = fmin(rend_sweep_end(s->sweep.bucket), w->x_max);
    forget_the_rest(s);
    double x = rend_sweep_solve(s->levels, s->level_count, (double)w->in->budget_points - 1,
                                fmin(from, to), to);
    if (x < w->x_max) s->result.stopped = true;
    return x;
}

static bool request(walk *w, const seen_node *seen, mospt_err *err)
{
    rend_selection *r = &w->s->result;
    void *requests =
        grown(r->requests, &w->s->request_capacity, r->request_count, 1, sizeof *r->requests, err);
    if (requests == NULL) return false;
    r->requests = requests;
    r->requests[r->request_count++] = (rend_request){seen->node, seen->width_px};
    return true;
}

/* Grows the list of draws, and the octants beside it. */
static bool reserve_draw(rend_selector *s, mospt_err *err)
{
    rend_selection *r = &s->result;
    uint32_t capacity = s->draw_capacity;
    void *draws = grown(r->draws, &capacity, r->draw_count, 1, sizeof *r->draws, err);
    if (draws == NULL) return false;
    r->draws = draws;
    if (capacity == s->draw_capacity) return true;
    void *octants = realloc(r->octants, capacity * 8 * sizeof *r->octants);
    if (octants == NULL) return mospt_err_nomem(err, capacity * 8 * sizeof *r->octants);
    r->octants = octants;
    s->draw_capacity = capacity;
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
static void link_to_parent(const walk *w, const mospt_node *n, uint32_t parent)
{
    const rend_selection *r = &w->s->result;
    if (parent == REND_NO_DRAW || r->draws[parent].node != n->parent) return;
    r->octants[8 * (size_t)parent + octant_in(w, n)] = r->draw_count;
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

/* Cells in which an octant has about a point each when all are drawn, with those of a child that it
 * has; wider than they are where that child has children. Steps. */
static float spacing_in(const walk *w, const mospt_node *n, uint32_t octant)
{
    uint32_t bit = 1u << octant, depth = w->in->hierarchy->inner_depth, level = depth;
    float width = (float)mospt_cell_width(w->in->grid, n->level);
    if ((n->pending_mask & bit) != 0) return ldexpf(width, -(int)depth);
    if ((n->child_mask & bit) != 0) {
        uint32_t before = (uint32_t)__builtin_popcount(n->child_mask & (bit - 1));
        n = &w->in->hierarchy->nodes[n->first_child + before];
        width /= 2;
    }
    if ((n->child_mask | n->pending_mask) == 0) level = density_level(n, depth, n->count);
    return ldexpf(width, -(int)level);
}

/* True if one sees between the points that the picture has there, see own_px.
 * width_px of the node */
static bool is_open(const walk *w, const mospt_node *n, uint32_t octant, float width_px)
{
    const rend_select_input *in = w->in;
    if (in->own_px <= 0 && in->own_cell <= 0) return false;
    float width = (float)mospt_cell_width(in->grid, n->level);
    return spacing_in(w, n, octant) > fmaxf(CLOSED * in->own_px * width / width_px, in->own_cell);
}

static uint32_t splat_of(float width)
{
    uint32_t bits;
    width = fmaxf(width, 1);
    memcpy(&bits, &width, sizeof bits);
    return bits | REND_SPLAT;
}

static bool draw(walk *w, seen_node *seen, uint32_t parent, uint32_t count, float cell_px,
                 mospt_err *err)
{
    const mospt_node *n = &w->in->hierarchy->nodes[seen->node];
    rend_selection *r = &w->s->result;
    if (!reserve_draw(w->s, err)) return false;
    uint32_t depth = w->in->hierarchy->inner_depth, below = n->child_mask | n->pending_mask;
    float width = (float)mospt_cell_width(w->in->grid, n->level),
          finest = ldexpf(width, -(int)depth),
          reached = fminf(fmaxf(width * (cell_px / seen->width_px), finest), width),
          sampled = fmaxf(reached, ldexpf(width, -(int)density_level(n, depth, count)));
    for (uint32_t o = 0; o < 8; o++) {
        float cell = below >> o & 1 ? reached : sampled;
        if (is_open(w, n, o, seen->width_px)) cell = w->in->own_cell;
        r->octants[8 * (size_t)r->draw_count + o] = splat_of(cell);
    }
    link_to_parent(w, n, parent);
    r->draws[r->draw_count] = (rend_draw){
        .node = seen->node,
        .count = count,
        .parent = parent,
        .widest_px = (n->child_mask == 0xff ? reached : sampled) / width * seen->width_px,
    };
    r->points += count;
    seen->draw = r->draw_count++;
    return true;
}

/* The x at which a node is drawn: it grows in from its first points on. */
static double grown_to(const walk *w, const seen_node *seen, double x)
{
    const uint8_t *ages = w->in->ages;
    if (ages == NULL || ages[seen->node] >= REND_GROWN || seen->node == 0) return x;
    return fmin(x, seen->begin * pow(4, (ages[seen->node] + 1.0) / (REND_GROWN + 1)));
}

/* Draws or requests what shows at x, in the order in which it was popped: parents stand before
 * their children. */
static bool take(walk *w, double x, mospt_err *err)
{
    rend_selector *s = w->s;
    s->result.cell_px = (float)(1 / sqrt(x));
    for (uint32_t i = 0; i < s->popped_count; i++) {
        seen_node *seen = &s->seen[s->popped[i]];
        uint32_t count = seen->node == 0, parent = REND_NO_DRAW;
        double own_x = grown_to(w, seen, x);
        for (uint32_t k = seen->levels; k < levels_end(s, s->popped[i]); k++)
            count += rend_growth_at(s->levels[k], own_x);
        if (seen->parent != NONE) parent = s->seen[seen->parent].draw;
        seen->draw = parent;
        rend_residency residency = residency_of(w, seen->node);
        if (residency == REND_DAMAGED || count == 0) continue;
        if (residency == REND_ABSENT ? !request(w, seen, err)
                                     : !draw(w, seen, parent, count, (float)(1 / sqrt(own_x)), err))
            return false;
    }
    return true;
}

static void start(rend_selector *s)
{
    s->result = (rend_selection){
        .draws = s->result.draws, .octants = s->result.octants, .requests = s->result.requests};
    s->seen_count = s->popped_count = s->level_count = 0;
    s->sweep = (rend_sweep){0};
    memset(s->bucket, 0xff, sizeof s->bucket);
}

bool rend_select_run(rend_selector *selector, const rend_select_input *input,
                     const rend_selection **out, mospt_err *err)
{
    const rend_frame *f = input->frame;
    walk w = {.in = input,
              .s = selector,
              .focal2 = f->focal_px * f->focal_px,
              .corner_cos2 = f->corner_cos * f->corner_cos};
    double cell_px = (double)(input->cell_px > 0 ? input->cell_px : REND_CELL_PX_DEFAULT);
    w.x_max = 1 / (cell_px * cell_px);
    start(selector);
    *out = &selector->result;
    if (input->budget_points == 0) selector->result.stopped = true;
    if (input->budget_points == 0 || input->hierarchy->count == 0) return true;
    return traverse(&w, err) && take(&w, spend(&w), err);
}
