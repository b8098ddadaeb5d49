#include "tests/ref_select.h"

#include <math.h>
#include <stdlib.h>

typedef struct {
    double centre_px, nearest_px;
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
    double width_px = 2 * half * f->focal_px;
    v.centre_px = width_px / fmax(sqrt(to_centre), half);
    v.nearest_px = w > 0 ? width_px / w : INFINITY;
    if (w != 0 && fabs(w) < 1e-4 * half) *close_call = true;
    return v;
}

static double or_one(float value)
{
    return value > 0 ? (double)value : 1;
}

void ref_select(const rend_select_input *in, ref_selection *out)
{
    uint32_t n_max = in->hierarchy->count, depth = in->hierarchy->inner_depth, waiting = 0;
    ref_selection r = {0};
    r.draw_node = calloc(n_max, sizeof(uint32_t)),
    r.draw_count_of = calloc(n_max, sizeof(uint32_t));
    r.finest = calloc(n_max, sizeof(uint32_t)), r.request = calloc(n_max, sizeof(uint32_t));
    uint32_t *list = calloc(n_max, sizeof(uint32_t));
    uint64_t pages = 0;
    double min_px = in->min_node_px > 0 ? (double)in->min_node_px : pow(2, (double)depth - 1);
    list[waiting++] = 0;
    while (waiting > 0 && !r.stopped) {
        uint32_t best = 0;
        double best_px = -1;
        for (uint32_t i = 0; i < waiting; i++) {
            double px = look(in, list[i], &r.close_call).centre_px;
            if (i > 0 && close_to(px, best_px)) r.close_call = true;
            if (px > best_px || (px == best_px && list[i] < list[best])) best = i, best_px = px;
        }
        uint32_t node = list[best];
        list[best] = list[--waiting];
        const mospt_node *n = &in->hierarchy->nodes[node];
        view_of_node v = look(in, node, &r.close_call);
        double px = v.nearest_px;
        uint32_t level = 0;
        for (; level <= depth && px > or_one(in->cell_px); level++)
            px /= 2;
        for (uint32_t i = 0; i <= depth; i++)
            if (close_to(v.nearest_px / pow(2, i), or_one(in->cell_px))) r.close_call = true;
        if (close_to(v.nearest_px, min_px)) r.close_call = true;
        uint32_t count = n->level_end[level];
        rend_residency state = in->residency == NULL ? REND_RESIDENT : in->residency[node];
        uint64_t node_pages =
            in->page_limit > 0 ? (n->count + in->page_points - 1) / in->page_points : 0;
        if (state == REND_DAMAGED) count = 0, node_pages = 0;

        bool over = count > in->budget_points - r.points ||
                    (in->page_limit > 0 && pages + node_pages > in->page_limit);
        if (over) r.stopped = true;                            /* step 1 */
        else if (v.outside) continue;                          /* step 2 */
        else if (node != 0 && v.nearest_px < min_px) continue; /* step 3 */
        else if (state == REND_ABSENT) r.request[r.requests++] = node, pages += node_pages;
        else { /* step 4 */ pages += node_pages;
            for (uint32_t c = 0; c < n->child_count; c++)
                list[waiting++] = n->first_child + c;
            if (state == REND_DAMAGED) continue;
            r.draw_node[r.draws] = node;
            r.draw_count_of[r.draws] = count;
            r.finest[r.draws++] = level < depth ? level : depth;
            r.points += count;
        }
    }
    free(list);
    *out = r;
}

void ref_select_fini(ref_selection *s)
{
    free(s->draw_node);
    free(s->draw_count_of);
    free(s->finest);
    free(s->request);
    *s = (ref_selection){0};
}

double ref_select_cell_at(const rend_select_input *in, const ref_selection *s,
                          const uint32_t place[3])
{
    uint32_t found = MOSPT_NO_NODE;
    for (uint32_t i = 0; i < s->draws; i++) {
        const mospt_node *n = &in->hierarchy->nodes[s->draw_node[i]];
        if (!mospt_cell_contains(in->grid, n->corner, n->level, place[0], place[1], place[2]))
            continue;
        if (found == MOSPT_NO_NODE || n->level > in->hierarchy->nodes[s->draw_node[found]].level)
            found = i;
    }
    if (found == MOSPT_NO_NODE) return 0;
    const mospt_node *n = &in->hierarchy->nodes[s->draw_node[found]];
    uint32_t bits = mospt_cell_bits(in->grid, n->level), octant = 0, level = s->finest[found];
    for (int a = 0; bits > 0 && a < 3; a++)
        octant |= (uint32_t)(place[a] >> (bits - 1) & 1) << a;
    if (!(n->child_mask >> octant & 1)) {
        uint32_t most = s->draw_count_of[found] - s->draw_count_of[found] / 4;
        for (level = 0; level < s->finest[found] && n->level_end[level] < most;)
            level++;
    }
    return bits > level ? pow(2, bits - level) : 1;
}
