#include "render/outline.h"

#include "render/camera.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define AROUND_STEPS 16

/* ---- the box ---- */

enum { BINS = 1024, TRIM_ROUNDS = 12 };

/* Adds a node's points to the bins of one axis, spread evenly over its cube. */
static void spread(const mospt_grid *grid, const mospt_node *node, int axis, double low,
                   double bin_width, double bins[BINS])
{
    double from = ((double)node->corner[axis] - low) / bin_width;
    double width = (double)mospt_cell_width(grid, node->level) / bin_width;
    int first = (int)fmax(floor(from), 0), last = (int)fmin(floor(from + width), BINS - 1);
    for (int b = first; b <= last; b++)
        bins[b] += node->count / (double)(last - first + 1);
}

/* Fills the bins of one axis; returns how many points are in them. Only nodes that are small
 * against the range say where points are; those of the upper levels are spread over all of it. */
static double fill_bins(const mospt_dataset *dataset, int axis, double low, double high,
                        double bins[BINS])
{
    const mospt_hierarchy *h = &dataset->hierarchy;
    double sum = 0;
    memset(bins, 0, BINS * sizeof *bins);
    for (uint32_t n = 0; n < h->count; n++) {
        if ((double)mospt_cell_width(&dataset->metadata.grid, h->nodes[n].level) >
            (high - low) / 16)
            continue;
        spread(&dataset->metadata.grid, &h->nodes[n], axis, low, (high - low) / BINS, bins);
        sum += h->nodes[n].count;
    }
    return sum;
}

/* The bins left when those at both ends are cut off that hold less than `share` of the points. */
static void trim_bins(const double bins[BINS], double share, int *first, int *last)
{
    *first = 0, *last = BINS - 1;
    for (double below = bins[0]; below < share && *first < *last; below += bins[*first])
        ++*first;
    for (double above = bins[*last]; above < share && *first < *last; above += bins[*last])
        --*last;
}

/* One round of trimming along one axis. */
static bool trim_axis(const mospt_dataset *dataset, int axis, double *low, double *high)
{
    double bins[BINS], bin_width = (*high - *low) / BINS;
    int first, last;
    if (!(bin_width > 1)) return false;
    double sum = fill_bins(dataset, axis, *low, *high, bins);
    if (sum < 0.8 * (double)dataset->hierarchy.point_count) return false;
    trim_bins(bins, 1e-3 * sum, &first, &last);
    /* A few metres less are no reason: an overview shows all of a site that has no outliers. */
    if (last + 1 - first > BINS / 2) return false;
    *high = *low + bin_width * (last + 1);
    *low += bin_width * first;
    return true;
}

void rend_outline_bounds(const mospt_dataset *dataset, double low[3], double high[3])
{
    const mospt_grid *grid = &dataset->metadata.grid;
    uint32_t box_low[3], box_high[3];
    rend_frame_bounds(dataset, box_low, box_high);
    for (int a = 0; a < 3; a++) {
        double from = box_low[a], to = (double)box_high[a];
        bool again = true;
        for (int round = 0; again && round < TRIM_ROUNDS; round++)
            again = trim_axis(dataset, a, &from, &to);
        low[a] = mospt_grid_axis_to_world(grid, a, (uint32_t)from);
        high[a] = mospt_grid_axis_to_world(grid, a, (uint32_t)fmin(ceil(to), UINT32_MAX));
    }
}

/* ---- points ---- */

enum { ENOUGH = 1 << 14, MOST = 1 << 20, FEWEST = 8 };

static bool add_point(rend_outline *out, uint32_t *capacity, const double at[3], mospt_err *err)
{
    if (out->count == *capacity) {
        uint32_t larger = *capacity > 0 ? 2 * *capacity : ENOUGH;
        void *moved = realloc(out->at, larger * sizeof *out->at);
        if (moved == NULL) return mospt_err_nomem(err, larger * sizeof *out->at);
        out->at = moved, *capacity = larger;
    }
    memcpy(out->at[out->count++], at, sizeof *out->at);
    return true;
}

/* Adds those of some vertices that are inside of the box. */
static bool add_vertices(const mospt_grid *grid, const mospt_vertex *v, uint32_t count,
                         rend_outline *out, uint32_t *capacity, mospt_err *err)
{
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t g[3] = {v[i].x, v[i].y, v[i].z};
        double p[3];
        bool inside = true;
        for (int a = 0; a < 3; a++) {
            p[a] = mospt_grid_axis_to_world(grid, a, g[a]) - out->middle[a];
            inside = inside && fabs(p[a]) <= 0.5 * (out->high[a] - out->low[a]) + grid->step;
        }
        if (inside && !add_point(out, capacity, p, err)) return false;
    }
    return true;
}

/* A level of a MOSPT has a point in each cell of it: a few levels of the root are spread evenly
 * over the site. Deeper nodes are asked only where the site is small in its root. */
static bool add_node(const mospt_dataset *dataset, uint32_t node, rend_outline *out,
                     uint32_t *capacity, mospt_err *err)
{
    const mospt_node *n = &dataset->hierarchy.nodes[node];
    mospt_vertex *v = malloc(mospt_dataset_vertices_size(dataset, node));
    bool ok = v != NULL || mospt_err_nomem(err, mospt_dataset_vertices_size(dataset, node));
    if (ok && mospt_dataset_read_vertices(dataset, node, v, NULL)) {
        uint32_t from = 0;
        for (uint32_t i = 0; ok && i < dataset->hierarchy.inner_depth + 2; i++) {
            if (node == 0 && out->count >= ENOUGH) break;
            ok = add_vertices(&dataset->metadata.grid, v + from, n->level_end[i] - from, out,
                              capacity, err);
            from = n->level_end[i];
        }
    }
    free(v);
    return ok;
}

static bool meets_box(const mospt_grid *grid, const mospt_node *node, const rend_outline *o)
{
    double low[3], width = (double)mospt_cell_width(grid, node->level) * grid->step;
    mospt_grid_to_world(grid, node->corner, low);
    for (int a = 0; a < 3; a++)
        if (low[a] > o->high[a] || low[a] + width < o->low[a]) return false;
    return true;
}

static bool add_points(const mospt_dataset *dataset, rend_outline *out, mospt_err *err)
{
    const mospt_hierarchy *h = &dataset->hierarchy;
    uint32_t capacity = 0;
    for (uint32_t n = 0; n < h->count && out->count < MOST; n++) {
        bool new_level = n > 0 && h->nodes[n].level > h->nodes[n - 1].level;
        if (new_level && out->count >= ENOUGH) break;
        if (meets_box(&dataset->metadata.grid, &h->nodes[n], out) &&
            !add_node(dataset, n, out, &capacity, err))
            return false;
    }
    for (int corner = 0; out->count < FEWEST && corner < 8; corner++) {
        double p[3];
        for (int a = 0; a < 3; a++)
            p[a] = ((corner >> a & 1) ? 0.5 : -0.5) * (out->high[a] - out->low[a]);
        if (corner == 0) out->count = 0;
        if (!add_point(out, &capacity, p, err)) return false;
    }
    return true;
}

/* ---- islands ---- */

/* A stray island has less than a fiftieth of the points, all of them less than a fifth. */
enum {
    CELLS_MOST = 64,
    CELLS_FEWEST = 8,
    PER_CELL = 4,
    REACH = 2,
    ISLAND_SHARE = 50,
    ISLANDS_SHARE = 5
};

typedef struct {
    double half[3], cell_m;
    uint32_t size[3];
    uint32_t *points; /* [cells], owned */
    uint32_t *island; /* [cells], owned: 0 none yet */
    uint32_t *stack;  /* [cells], owned */
} islands;

static size_t cell_of(const islands *s, const double p[3])
{
    size_t cell = 0;
    for (int a = 2; a >= 0; a--) {
        double i = floor((p[a] + s->half[a]) / s->cell_m);
        cell = cell * s->size[a] + (uint32_t)fmin(fmax(i, 0), s->size[a] - 1);
    }
    return cell;
}

static size_t cells_in(const islands *s)
{
    return (size_t)s->size[0] * s->size[1] * s->size[2];
}

/* Counts the points in cells, so many along the longest side. Returns how many are filled. */
static uint32_t fill_cells(const rend_outline *o, uint32_t along, islands *s)
{
    uint32_t filled = 0;
    double longest = 0;
    for (int a = 0; a < 3; a++) {
        s->half[a] = 0.5 * (o->high[a] - o->low[a]);
        longest = fmax(longest, 2 * s->half[a]);
    }
    s->cell_m = longest / along;
    for (int a = 0; a < 3; a++)
        s->size[a] = (uint32_t)fmin(floor(2 * s->half[a] / s->cell_m) + 1, along);
    memset(s->points, 0, cells_in(s) * sizeof *s->points);
    for (uint32_t i = 0; i < o->count; i++)
        filled += s->points[cell_of(s, o->at[i])]++ == 0;
    return filled;
}

/* Marks all that hangs together with a cell; returns its points. */
static uint64_t flood(islands *s, size_t from, uint32_t island)
{
    uint64_t points = 0;
    size_t height = 0;
    s->stack[height++] = (uint32_t)from;
    s->island[from] = island;
    while (height > 0) {
        size_t cell = s->stack[--height];
        int at[3] = {(int)(cell % s->size[0]), (int)(cell / s->size[0] % s->size[1]),
                     (int)(cell / s->size[0] / s->size[1])};
        points += s->points[cell];
        for (int z = at[2] - REACH; z <= at[2] + REACH; z++)
            for (int y = at[1] - REACH; y <= at[1] + REACH; y++)
                for (int x = at[0] - REACH; x <= at[0] + REACH; x++) {
                    if (x < 0 || y < 0 || z < 0 || x >= (int)s->size[0] || y >= (int)s->size[1] ||
                        z >= (int)s->size[2])
                        continue;
                    size_t next = ((size_t)z * s->size[1] + (size_t)y) * s->size[0] + (size_t)x;
                    if (s->points[next] == 0 || s->island[next] != 0) continue;
                    s->island[next] = island;
                    s->stack[height++] = (uint32_t)next;
                }
    }
    return points;
}

/* A small island may be scanned densely: by the counts of nodes as small as a few cells, those that
 * hold much of all points are large, too. */
static void weigh(const islands *s, const mospt_dataset *dataset, const rend_outline *o,
                  uint64_t *points_of, uint64_t *weight_of)
{
    const mospt_hierarchy *h = &dataset->hierarchy;
    const mospt_grid *grid = &dataset->metadata.grid;
    for (uint32_t n = 0; n < h->count; n++) {
        double p[3], width = (double)mospt_cell_width(grid, h->nodes[n].level) * grid->step;
        if (width > REACH * s->cell_m || !meets_box(grid, &h->nodes[n], o)) continue;
        mospt_grid_to_world(grid, h->nodes[n].corner, p);
        for (int a = 0; a < 3; a++)
            p[a] += 0.5 * width - o->middle[a];
        uint32_t island = s->island[cell_of(s, p)];
        weight_of[island] += h->nodes[n].count;
        if (island > 0 && weight_of[island] * ISLAND_SHARE >= h->point_count)
            points_of[island] = o->count;
    }
}

/* Keeps the points of large islands. */
static void keep_large(const islands *s, const uint64_t *points_of, rend_outline *o)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < o->count; i++) {
        if (points_of[s->island[cell_of(s, o->at[i])]] * ISLAND_SHARE < o->count) continue;
        memmove(o->at[kept++], o->at[i], sizeof *o->at);
    }
    o->count = kept;
}

/* Finds the islands, and drops the small ones, unless together they are much of the site. */
static bool judge(islands *s, const mospt_dataset *dataset, rend_outline *o, uint32_t filled,
                  mospt_err *err)
{
    uint32_t count = 0;
    uint64_t large = 0, *points_of = calloc(2 * (size_t)(filled + 1), sizeof *points_of);
    if (points_of == NULL) return mospt_err_nomem(err, 2 * (filled + 1) * sizeof *points_of);
    memset(s->island, 0, cells_in(s) * sizeof *s->island);
    for (size_t c = 0; c < cells_in(s); c++) {
        if (s->points[c] == 0 || s->island[c] != 0) continue;
        count++;
        points_of[count] = flood(s, c, count);
        if (points_of[count] * ISLAND_SHARE >= o->count) large += points_of[count];
    }
    weigh(s, dataset, o, points_of, points_of + filled + 1);
    if (large * ISLANDS_SHARE >= (uint64_t)o->count * (ISLANDS_SHARE - 1))
        keep_large(s, points_of, o);
    free(points_of);
    return true;
}

/* Cells are wide enough to hold a few points each, so that what was scanned hangs together. */
static bool drop_strays(const mospt_dataset *dataset, rend_outline *o, mospt_err *err)
{
    size_t most = (size_t)CELLS_MOST * CELLS_MOST * CELLS_MOST;
    islands s = {.points = malloc(most * sizeof *s.points),
                 .island = malloc(most * sizeof *s.island),
                 .stack = malloc(most * sizeof *s.stack)};
    bool ok = (s.points != NULL && s.island != NULL && s.stack != NULL) ||
              mospt_err_nomem(err, 3 * most * sizeof *s.points);
    if (ok) {
        uint32_t along = CELLS_MOST, filled;
        while ((filled = fill_cells(o, along, &s)) * PER_CELL > o->count && along > CELLS_FEWEST)
            along /= 2;
        ok = judge(&s, dataset, o, filled, err);
    }
    free(s.points), free(s.island), free(s.stack);
    return ok;
}

bool rend_outline_make(const mospt_dataset *dataset, rend_outline *out, mospt_err *err)
{
    rend_outline o = {0};
    rend_outline_bounds(dataset, o.low, o.high);
    /* A single position has no size of its own: look at some steps around it. */
    double around = AROUND_STEPS * dataset->metadata.grid.step;
    bool single = true;
    for (int a = 0; a < 3; a++) {
        single = single && o.low[a] == o.high[a];
        around = fmax(around, 1e-6 * fabs(o.low[a]));
    }
    for (int a = 0; a < 3; a++) {
        if (single) o.low[a] -= around, o.high[a] += around;
        o.middle[a] = o.low[a] + 0.5 * (o.high[a] - o.low[a]);
    }
    bool ok = add_points(dataset, &o, err) && drop_strays(dataset, &o, err);
    if (ok) *out = o;
    else rend_outline_fini(&o);
    return ok;
}

void rend_outline_fini(rend_outline *outline)
{
    free(outline->at);
    *outline = (rend_outline){0};
}
