/* How long the selection of a frame takes.
 *   bench_select [DATASET] [--nodes N] [--budget N] [--frames N]
 * Selects frames (300) of a flight around and over a hierarchy: that of a dataset, or a made-up
 * one: hills, with as many nodes (100,000) and points of a tripod's surfaces. Prints the median,
 * the 99th percentile and the longest, milliseconds, and how much was selected. Every selection is
 * checked: within the budget, and spending nine tenths of it unless cells are down to a pixel. */
#include "mospt/dataset.h"
#include "render/select.h"
#include "scripts/bench_time.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BITS = 24, DEPTH = 7 };

typedef struct {
    const char *dataset;
    uint32_t nodes, frames;
    uint64_t budget;
} options;

/* Height of the hills, as a share of the root's width. */
static double hill(double x, double y)
{
    return 0.3 + 0.1 * sin(9 * x) * cos(7 * y) + 0.02 * sin(50 * x + 40 * y);
}

/* True if the hills pass through the cube; its height against theirs at nine places. */
static bool is_occupied(const mospt_grid *grid, const uint32_t corner[3], uint32_t level)
{
    double root = ldexp(1, BITS), width = (double)mospt_cell_width(grid, level) / root,
           low = corner[2] / root, least = 1, most = 0;
    for (int i = 0; i < 9; i++) {
        double h =
            hill(corner[0] / root + width * (i % 3) / 2, corner[1] / root + width * (i / 3) / 2);
        least = fmin(least, h), most = fmax(most, h);
    }
    return least < low + width && most >= low;
}

/* A surface: four times as many points with each level. */
static void fill(mospt_node *n)
{
    for (uint32_t i = 0; i <= DEPTH + 1; i++)
        n->level_end[i] = i <= DEPTH ? 1u << 2 * i : n->level_end[DEPTH] + 100;
    n->count = n->level_end[DEPTH + 1];
    n->parent = n->first_child = MOSPT_NO_NODE;
}

static bool make_hills(uint32_t most, const mospt_grid *grid, mospt_hierarchy *out, mospt_err *err)
{
    mospt_hierarchy h = {.inner_depth = DEPTH, .refinement = MOSPT_REFINE_ADD, .count = 1};
    h.nodes = calloc((size_t)most + 8, sizeof *h.nodes);
    if (h.nodes == NULL) return mospt_err_nomem(err, (size_t)most * sizeof *h.nodes);
    for (uint32_t n = 0; n < h.count; n++) {
        mospt_node *node = &h.nodes[n];
        fill(node);
        for (uint32_t o = 0; o < 8 && h.count < most; o++) {
            mospt_node *child = &h.nodes[h.count];
            mospt_cell_child(grid, node->corner, node->level, o, child->corner);
            if (!is_occupied(grid, child->corner, node->level + 1u)) continue;
            child->level = (uint16_t)(node->level + 1);
            node->child_mask = (uint8_t)(node->child_mask | 1u << o);
            node->child_count++, h.count++;
        }
        h.point_count += node->count;
    }
    *out = h;
    return mospt_hierarchy_link(out, grid, err);
}

/* From outside to just above the middle, turning. */
static void camera_at(double t, const double low[3], const double high[3], rend_camera *out)
{
    double angle = 2 * 3.14159265358979 * t, radius = 1 - 0.95 * t;
    *out = (rend_camera){.up = {0, 0, 1}, .fov_rad = 1};
    for (int a = 0; a < 3; a++) {
        double middle = (low[a] + high[a]) / 2, half = (high[a] - low[a]) / 2;
        double away[3] = {cos(angle), sin(angle), 0.8};
        out->eye[a] = middle + half * radius * 2 * away[a] * (a == 2 ? 0.5 : 1);
        out->target[a] = middle + half * 0.3 * (a == 2 ? -0.2 : sin(3 * angle + a));
    }
}

static bool is_right(const rend_selection *s, uint64_t budget)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < s->draw_count; i++)
        sum += s->draws[i].count;
    return sum == s->points && sum <= budget && (!s->stopped || sum >= budget - budget / 10);
}

static bool run(const options *o, const mospt_hierarchy *tree, const mospt_grid *grid,
                const uint32_t low[3], const uint32_t high[3], mospt_err *err)
{
    double *ms = calloc(o->frames, sizeof *ms), from[3], to[3], points = 0, draws = 0, looked = 0;
    rend_selector *selector = rend_select_create();
    if (ms == NULL || selector == NULL) return mospt_err_nomem(err, 0);
    mospt_grid_to_world(grid, low, from);
    mospt_grid_to_world(grid, high, to);
    for (uint32_t i = 0; i < o->frames; i++) {
        rend_camera camera;
        rend_frame frame;
        const rend_selection *s;
        camera_at((double)i / o->frames, from, to, &camera);
        rend_frame_make(&camera, grid, low, high, 1280, 720, &frame);
        const rend_select_input input = {.hierarchy = tree,
                                         .grid = grid,
                                         .frame = &frame,
                                         .budget_points = o->budget,
                                         .cell_px = 0.25f};
        double start = bench_now_ms();
        if (!rend_select_run(selector, &input, &s, err)) return false;
        ms[i] = bench_now_ms() - start;
        if (!is_right(s, o->budget))
            return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(), "frame %u is wrong", i);
        points += (double)s->points, draws += s->draw_count, looked += s->visited;
    }
    bench_sort(ms, o->frames);
    printf("nodes %u  budget %.1f M  selected %.1f M points in %.0f nodes of %.0f looked at\n",
           tree->count, (double)o->budget * 1e-6, points / o->frames * 1e-6, draws / o->frames,
           looked / o->frames);
    printf("select_ms median %.3f  p99 %.3f  max %.3f\n", ms[o->frames / 2],
           ms[o->frames * 99 / 100], ms[o->frames - 1]);
    rend_select_destroy(selector);
    free(ms);
    return true;
}

static bool bench(const options *o, mospt_err *err)
{
    mospt_grid grid = {.step = 0x1p-10, .bits = BITS};
    mospt_hierarchy tree;
    mospt_dataset *dataset;
    uint32_t low[3] = {0}, high[3] = {(1u << BITS) - 1, (1u << BITS) - 1, (1u << BITS) - 1};
    bool ok;
    if (o->dataset == NULL) {
        ok = make_hills(o->nodes, &grid, &tree, err) && run(o, &tree, &grid, low, high, err);
        mospt_hierarchy_fini(&tree);
        return ok;
    }
    if (!mospt_dataset_open(o->dataset, &dataset, err)) return false;
    rend_frame_bounds(dataset, low, high);
    ok = run(o, &dataset->hierarchy, &dataset->metadata.grid, low, high, err);
    mospt_dataset_close(dataset);
    return ok;
}

int main(int argc, char **argv)
{
    options o = {.nodes = 100000, .frames = 300, .budget = 10000000};
    mospt_err err = {0};
    for (int i = 1; i < argc; i++) {
        bool has_value = i + 1 < argc;
        if (strcmp(argv[i], "--nodes") == 0 && has_value) o.nodes = (uint32_t)atol(argv[++i]);
        else if (strcmp(argv[i], "--frames") == 0 && has_value)
            o.frames = (uint32_t)atol(argv[++i]);
        else if (strcmp(argv[i], "--budget") == 0 && has_value)
            o.budget = (uint64_t)atof(argv[++i]);
        else if (argv[i][0] != '-') o.dataset = argv[i];
        else {
            fprintf(stderr,
                    "usage: bench_select [DATASET] [--nodes N] [--budget N] [--frames N]\n");
            return 2;
        }
    }
    if (o.nodes > 0 && o.frames > 0 && bench(&o, &err)) return 0;
    char text[512];
    mospt_err_text(&err, text, sizeof text);
    fprintf(stderr, "bench_select: %s\n", text);
    return 1;
}
