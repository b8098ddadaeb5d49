#include "tests/ref_select.h"

#include <math.h>
#include <stdlib.h>

typedef struct {
    double nearest_px;
    bool outside;
} view_of_node;

/* True where a float might decide otherwise. */
static bool close_to(double a, double b)
{
    return fabs(a - b) <= 1e-4 * (fabs(a) + fabs(b)) && a != b;
}

static view_of_node look(const rend_select_input *in, uint32_t node, bool *close_call)
{
    const mospt_node *n = &in->hierarchy->nodes[node];
    const rend_frame *f = in->frame;
    double half = (double)mospt_cell_width(in->grid, n->level) / 2, c[3], to_centre = 0, to_box = 0;
    view_of_node v = {.outside = false};
    for (int a = 0; a < 3; a++) {
        c[a] = n->corner[a] + half - f->eye[a];
        to_centre += c[a] * c[a];
        double gap = fabs(c[a]) > half ? fabs(c[a]) - half : 0;
        to_box += gap * gap;
    }
    for (int p = 0; p < 5; p++) {
        /* The corner farthest along the plane's inward normal. */
        double farthest = 0;
        for (int a = 0; a < 3; a++)
            farthest += f->plane[p][a] * (c[a] + (f->plane[p][a] > 0 ? half : -half));
        if (farthest < 0) v.outside = true;
        if (fabs(farthest) < 1e-4 * (half + sqrt(to_centre))) *close_call = true;
    }
    uint64_t width = mospt_cell_width(in->grid, n->level);
    for (int a = 0; in->clip != NULL && a < 3; a++)
        if ((uint64_t)n->corner[a] + width - 1 < in->clip->low[a] ||
            n->corner[a] > in->clip->high[a] || in->clip->low[a] > in->clip->high[a])
            v.outside = true;
    double ahead = 0;
    for (int a = 0; a < 3; a++)
        ahead += f->plane[4][a] * (c[a] - (f->plane[4][a] > 0 ? half : -half));
    double w = fmax(sqrt(to_box) * f->corner_cos, ahead);
    v.nearest_px = 2 * half * f->focal_px / fmax(w, half / 4);
    return v;
}

static double grown(double x, double begin, double points)
{
    return points * fmin(fmax((x / begin - 1) / 3, 0), 1);
}

/* Points of a node that is `width_px` wide. */
static double points_at(const rend_select_input *in, uint32_t node, double width_px, double cell_px)
{
    const mospt_node *n = &in->hierarchy->nodes[node];
    uint32_t depth = in->hierarchy->inner_depth;
    double x = pow(cell_px, -2), begin = pow(width_px, -2), finest = begin * pow(4, depth), sum = 0;
    if (node == 0) {
        sum = 1;
        for (uint32_t i = 1; i <= depth; i++)
            sum += grown(x, begin * pow(4, i - 1), n->level_end[i] - n->level_end[i - 1]);
    } else sum = grown(x, finest / 4, n->level_end[depth]);
    return sum + grown(x, finest, n->count - n->level_end[depth]);
}

/* Fills in what each node shows; returns the sum. */
static double show(const rend_select_input *in, uint32_t node, double cell_px, ref_selection *out)
{
    const mospt_node *n = &in->hierarchy->nodes[node];
    view_of_node v = look(in, node, &out->close_call);
    rend_residency state = in->residency == NULL ? REND_RESIDENT : in->residency[node];
    if (v.outside) return 0;
    if (node > 0 && v.nearest_px < (double)in->min_node_px) return 0;
    if (node > 0 && close_to(v.nearest_px, (double)in->min_node_px)) out->close_call = true;
    double sum = state == REND_DAMAGED ? 0 : points_at(in, node, v.nearest_px, cell_px);
    out->points[node] = sum;
    if (state != REND_ABSENT)
        for (uint32_t c = 0; c < n->child_count; c++)
            sum += show(in, n->first_child + c, cell_px, out);
    return sum;
}

static double sum_at(const rend_select_input *in, double cell_px, ref_selection *out)
{
    for (uint32_t n = 0; n < in->hierarchy->count; n++)
        out->points[n] = 0;
    return show(in, 0, cell_px, out);
}

void ref_select(const rend_select_input *in, ref_selection *out)
{
    double fine = (double)(in->cell_px > 0 ? in->cell_px : REND_CELL_PX_DEFAULT), coarse = 1e6;
    double budget = (double)in->budget_points;
    *out = (ref_selection){.points = calloc(in->hierarchy->count, sizeof *out->points)};
    out->stopped = sum_at(in, fine, out) > budget;
    if (!out->stopped) coarse = fine;
    for (int i = 0; i < 60 && out->stopped; i++) {
        double middle = sqrt(fine * coarse);
        if (sum_at(in, middle, out) > budget) fine = middle;
        else coarse = middle;
    }
    out->cell_px = coarse;
    if (sum_at(in, coarse, out) > budget) sum_at(in, 1e9, out); /* not even the root's first */
}

void ref_select_fini(ref_selection *s)
{
    free(s->points);
    *s = (ref_selection){0};
}

double ref_select_cell_at(const rend_select_input *in, const rend_selection *s,
                          const uint32_t place[3])
{
    const rend_draw *found = NULL;
    uint32_t depth = in->hierarchy->inner_depth, octant = 0, level = 0;
    bool unused;
    for (uint32_t i = 0; i < s->draw_count; i++) {
        const mospt_node *n = &in->hierarchy->nodes[s->draws[i].node];
        if (!mospt_cell_contains(in->grid, n->corner, n->level, place[0], place[1], place[2]))
            continue;
        if (found == NULL || n->level > in->hierarchy->nodes[found->node].level)
            found = &s->draws[i];
    }
    if (found == NULL) return 0;
    const mospt_node *n = &in->hierarchy->nodes[found->node];
    uint32_t bits = mospt_cell_bits(in->grid, n->level);
    double width = pow(2, bits), px = look(in, found->node, &unused).nearest_px;
    double cell = fmin(fmax(width * (double)s->cell_px / px, width / pow(2, depth)), width);
    for (int a = 0; bits > 0 && a < 3; a++)
        octant |= (uint32_t)(place[a] >> (bits - 1) & 1) << a;
    if (!(n->child_mask >> octant & 1)) {
        while (level < depth && n->level_end[level] < found->count - found->count / 4)
            level++;
        cell = fmax(cell, width / pow(2, level));
    }
    return fmax(cell, 1);
}
