#include "tests/ref_select.h"
#include "tests/render_tools.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    mospt_grid grid;
    mospt_hierarchy tree;
    rend_selector *selector;
    uint8_t *residency;
} fixture;

static void start(fixture *f, uint32_t bits, uint32_t depth, uint32_t most, uint64_t seed)
{
    *f = (fixture){.grid = render_grid(bits), .selector = rend_select_create()};
    render_tree_make(&f->grid, depth, most, seed, &f->tree);
    f->residency = malloc(f->tree.count);
    memset(f->residency, REND_RESIDENT, f->tree.count);
}

static void stop(fixture *f)
{
    rend_select_destroy(f->selector);
    mospt_hierarchy_fini(&f->tree);
    free(f->residency);
}

static rend_select_input input_for(const fixture *f, const rend_frame *frame, uint64_t budget)
{
    return (rend_select_input){.hierarchy = &f->tree,
                               .grid = &f->grid,
                               .frame = frame,
                               .residency = f->residency,
                               .budget_points = budget,
                               .min_node_px = 4};
}

static const rend_selection *run(fixture *f, const rend_select_input *in)
{
    const rend_selection *out = NULL;
    mospt_err err = {0};
    CORE_NEED(rend_select_run(f->selector, in, &out, &err));
    return out;
}

/* Looks at the root cube from outside, with all of it in view. */
static rend_camera overview(const mospt_grid *grid)
{
    double low[3], high[3];
    rend_camera camera;
    for (int a = 0; a < 3; a++) {
        low[a] = mospt_grid_axis_to_world(grid, a, grid->root[a]);
        high[a] = low[a] + ldexp(grid->step, (int)grid->bits);
    }
    rend_camera_overview(low, high, 16.0 / 9, 1, &camera);
    return camera;
}

static double walk(const rend_select_input *in, const rend_selection *s, const uint32_t place[3])
{
    uint32_t node = 0;
    for (uint32_t bit = in->grid->bits; bit-- > 0;) {
        uint32_t octant =
            (place[0] >> bit & 1) | (place[1] >> bit & 1) << 1 | (place[2] >> bit & 1) << 2;
        uint32_t found = s->octants[8 * (size_t)node + octant];
        if (found & REND_SPLAT) {
            float width;
            memcpy(&width, &found, sizeof width);
            return -(double)width;
        }
        assert_true(found > node && found < s->draw_count);
        node = found;
    }
    return 1;
}

/* Rounding takes less than one point of each level, and floats a little. */
static void assert_count(const mospt_hierarchy *tree, double real, uint32_t count)
{
    assert_true(count <= real * 1.001 + 0.01);
    assert_true(count >= real * 0.999 - tree->inner_depth - 2);
}

static void assert_twins(const rend_select_input *in, const rend_selection *s,
                         const ref_selection *r, uint64_t *state)
{
    double *left = malloc(in->hierarchy->count * sizeof *left);
    assert_non_null(left);
    memcpy(left, r->points, in->hierarchy->count * sizeof *left);
    assert_int_equal(s->stopped, r->stopped);
    if (s->points > 10) assert_true(fabs((double)s->cell_px / r->cell_px - 1) < 1e-3);
    for (uint32_t i = 0; i < s->draw_count; i++) {
        assert_count(in->hierarchy, left[s->draws[i].node], s->draws[i].count);
        left[s->draws[i].node] = 0;
    }
    for (uint32_t i = 0; i < s->request_count; i++) {
        assert_int_equal(in->residency[s->requests[i].node], REND_ABSENT);
        assert_true(left[s->requests[i].node] > 0.9);
        left[s->requests[i].node] = 0;
    }
    for (uint32_t n = 0; n < in->hierarchy->count; n++)
        assert_count(in->hierarchy, left[n], 0);
    for (int i = 0; s->draw_count > 0 && i < 50; i++) {
        uint32_t place[3];
        for (int a = 0; a < 3; a++)
            place[a] = in->grid->root[a] +
                       core_below(state, (uint32_t)(mospt_cell_width(in->grid, 0) - 1));
        double ratio = walk(in, s, place) / ref_select_cell_at(in, s, place);
        assert_true(ratio > 0.999 && ratio < 1.001);
    }
    free(left);
}

static void the_twin_agrees(void **unused)
{
    (void)unused;
    uint64_t state = 1;
    uint32_t compared = 0, rounds = 0;
    for (uint64_t seed = 1; seed <= 30; seed++) {
        fixture f;
        start(&f, 6 + core_below(&state, 25), 1 + core_below(&state, 7),
              1 + core_below(&state, 120), seed);
        for (int camera = 0; camera < 20; camera++, rounds++) {
            rend_frame frame;
            rend_camera c = render_camera_random(&f.grid, &state);
            render_frame_make(&c, &f.grid, &frame);
            for (uint32_t n = 0; n < f.tree.count; n++)
                f.residency[n] = core_below(&state, 8) > 0;
            rend_select_input in = input_for(
                &f, &frame, core_below(&state, 3) == 0 ? REND_ALL : core_below(&state, 100000));
            if (core_below(&state, 3) == 0) in.residency = NULL;
            if (core_below(&state, 4) == 0) in.min_node_px = 0;
            if (core_below(&state, 4) == 0) in.cell_px = (float)exp(4 * core_unit(&state) - 2);
            rend_clip clip;
            if (core_below(&state, 3) == 0) {
                for (int a = 0; a < 3; a++) {
                    uint32_t width = (uint32_t)(mospt_cell_width(&f.grid, 0) - 1);
                    clip.low[a] = f.grid.root[a] + core_below(&state, width);
                    clip.high[a] = f.grid.root[a] + core_below(&state, width);
                }
                in.clip = &clip;
            }
            ref_selection r;
            ref_select(&in, &r);
            if (!r.close_call) assert_twins(&in, run(&f, &in), &r, &state), compared++;
            ref_select_fini(&r);
        }
        stop(&f);
    }
    assert_true(compared * 2 > rounds);
}

static void the_budget_is_never_exceeded(void **unused)
{
    (void)unused;
    fixture f;
    uint64_t state = 2;
    uint32_t spent = 0;
    start(&f, 20, 5, 3000, 5);
    for (int i = 0; i < 500; i++) {
        rend_frame frame;
        rend_camera c = render_camera_random(&f.grid, &state);
        render_frame_make(&c, &f.grid, &frame);
        rend_select_input in = input_for(&f, &frame, core_below(&state, 100000));
        const rend_selection *s = run(&f, &in);
        uint64_t sum = 0;
        for (uint32_t d = 0; d < s->draw_count; d++) {
            sum += s->draws[d].count;
            assert_true(s->draws[d].count <= f.tree.nodes[s->draws[d].node].count);
        }
        assert_int_equal(sum, s->points);
        assert_true(sum <= in.budget_points);
        spent += s->stopped;
    }
    assert_true(spent > 100);
    stop(&f);
}

static void what_is_drawn_and_requested_fits_the_gpu_cache(void **unused)
{
    (void)unused;
    fixture f;
    uint64_t state = 3;
    start(&f, 20, 5, 2000, 6);
    for (int i = 0; i < 200; i++) {
        rend_frame frame;
        rend_camera c = render_camera_random(&f.grid, &state);
        render_frame_make(&c, &f.grid, &frame);
        for (uint32_t n = 0; n < f.tree.count; n++)
            f.residency[n] = core_below(&state, 3) > 0;
        rend_select_input in = input_for(&f, &frame, REND_ALL);
        in.page_limit = core_below(&state, 3000) + 1, in.page_points = 64;
        const rend_selection *s = run(&f, &in);
        uint64_t pages = 0;
        for (uint32_t d = 0; d < s->draw_count; d++)
            pages += (f.tree.nodes[s->draws[d].node].count + 63) / 64;
        for (uint32_t r = 0; r < s->request_count; r++)
            pages += (f.tree.nodes[s->requests[r].node].count + 63) / 64;
        assert_true(pages <= in.page_limit);
    }
    stop(&f);
}

static void requests_and_draws_come_largest_first(void **unused)
{
    (void)unused;
    fixture f;
    uint64_t state = 4;
    start(&f, 20, 5, 2000, 7);
    for (int i = 0; i < 100; i++) {
        rend_frame frame;
        rend_camera c = render_camera_random(&f.grid, &state);
        render_frame_make(&c, &f.grid, &frame);
        for (uint32_t n = 1; n < f.tree.count; n++)
            f.residency[n] = core_below(&state, 4) > 0;
        rend_select_input in = input_for(&f, &frame, REND_ALL);
        const rend_selection *s = run(&f, &in);
        for (uint32_t r = 0; r < s->request_count; r++)
            assert_int_equal(f.residency[s->requests[r].node], REND_ABSENT);
        for (uint32_t d = 1; d < s->draw_count; d++) {
            assert_true(s->draws[d].parent < d);
            assert_int_equal(s->draws[s->draws[d].parent].node,
                             f.tree.nodes[s->draws[d].node].parent);
        }
    }
    stop(&f);
}

/* Step 1 comes before step 2: a node that is out of sight still ends the traversal when it would
 * exceed the budget. */
static void the_budget_is_looked_at_before_the_frustum(void **unused)
{
    (void)unused;
    fixture f;
    start(&f, 20, 5, 1, 8);
    rend_camera c = overview(&f.grid);
    rend_frame frame;
    for (int a = 0; a < 3; a++)
        c.target[a] = 2 * c.eye[a] - c.target[a]; /* looks away */
    render_frame_make(&c, &f.grid, &frame);
    rend_select_input in = input_for(&f, &frame, 0);
    const rend_selection *s = run(&f, &in);
    assert_true(s->stopped);
    assert_int_equal(s->culled, 0);
    in.budget_points = REND_ALL;
    s = run(&f, &in);
    assert_false(s->stopped);
    assert_int_equal(s->culled, 1);
    assert_int_equal(s->draw_count, 0);
    stop(&f);
}

/* Steps 2 and 3 come before step 4: what is not seen, or too small, is not asked for. */
static void only_what_would_be_seen_is_requested(void **unused)
{
    (void)unused;
    fixture f;
    start(&f, 20, 5, 400, 9);
    rend_camera c = overview(&f.grid);
    rend_frame frame;
    render_frame_make(&c, &f.grid, &frame);
    memset(f.residency, REND_ABSENT, f.tree.count);
    f.residency[0] = REND_RESIDENT;
    rend_select_input in = input_for(&f, &frame, REND_ALL);
    assert_int_equal(run(&f, &in)->request_count, f.tree.nodes[0].child_count);
    in.min_node_px = 1e6f;
    const rend_selection *s = run(&f, &in);
    assert_int_equal(s->request_count, 0);
    assert_int_equal(s->small, f.tree.nodes[0].child_count);
    assert_int_equal(s->draw_count, 1); /* the root is never too small */
    for (int a = 0; a < 3; a++)
        c.target[a] = 2 * c.eye[a] - c.target[a];
    render_frame_make(&c, &f.grid, &frame);
    in.min_node_px = 4;
    f.residency[0] = REND_ABSENT;
    assert_int_equal(run(&f, &in)->request_count, 0);
    stop(&f);
}

static void the_root_shows_a_level_when_its_cells_are_a_pixel_wide(void **unused)
{
    (void)unused;
    fixture f;
    start(&f, 20, 6, 1, 10);
    const mospt_node *root = &f.tree.nodes[0];
    double width = ldexp(f.grid.step, 20), low[3];
    mospt_grid_to_world(&f.grid, f.grid.root, low);
    for (double level = 0; level <= 7; level += 0.25) {
        /* Straight ahead of the near face, where a cell of `level` is one pixel wide. */
        rend_camera c = {.up = {0, 0, 1}, .fov_rad = 1};
        double focal = 180 / tan(0.5), distance = width / pow(2, level) * focal;
        for (int a = 0; a < 3; a++)
            c.eye[a] = c.target[a] = low[a] + width / 2;
        c.eye[1] = low[1] - distance;
        rend_frame frame;
        render_frame_make(&c, &f.grid, &frame);
        rend_select_input in = input_for(&f, &frame, REND_ALL);
        in.cell_px = 1;
        const rend_selection *s = run(&f, &in);
        uint32_t whole = (uint32_t)level, next = root->level_end[whole + (level > whole)];
        double part = (pow(4, level - whole) - 1) / 3,
               wanted = root->level_end[whole] + part * (next - root->level_end[whole]);
        assert_int_equal(s->draw_count, 1);
        assert_true(s->draws[0].count <= wanted + 1e-3 * next);
        assert_true(s->draws[0].count >= wanted - 1 - 1e-3 * next);
    }
    stop(&f);
}

/* Whatever is missing, a splat is as wide as the cells that are there. */
static void a_missing_child_leaves_no_gap(void **unused)
{
    (void)unused;
    fixture f;
    uint64_t state = 11;
    uint32_t missing = 0;
    start(&f, 20, 3, 800, 11);
    for (int i = 0; i < 50; i++) {
        rend_frame frame;
        rend_camera c = render_camera_random(&f.grid, &state);
        render_frame_make(&c, &f.grid, &frame);
        for (uint32_t n = 1; n < f.tree.count; n++)
            f.residency[n] = core_below(&state, 4) > 0;
        rend_select_input in = input_for(&f, &frame, REND_ALL);
        const rend_selection *s = run(&f, &in);
        for (uint32_t r = 0; r < s->request_count; r++) {
            /* Any point in the missing node is at least as wide as the finest cells of its parent.
             */
            const mospt_node *n = &f.tree.nodes[s->requests[r].node];
            double cell = pow(2, mospt_cell_bits(&f.grid, f.tree.nodes[n->parent].level) - 3);
            assert_true(walk(&in, s, n->corner) >= cell);
            missing++;
        }
    }
    assert_true(missing > 50);
    stop(&f);
}

/* While the eye moves, no node's part of the picture jumps, and none is without its parent. */
static void points_come_one_after_the_other(void **unused)
{
    enum { FRAMES = 400 };
    (void)unused;
    fixture f;
    uint32_t appeared = 0;
    start(&f, 20, 5, 2000, 14);
    uint32_t *before = calloc(f.tree.count, sizeof *before),
             *now = calloc(f.tree.count, sizeof *now);
    assert_true(before != NULL && now != NULL);
    rend_camera c = overview(&f.grid);
    double way[3];
    for (int a = 0; a < 3; a++)
        way[a] = (c.target[a] - c.eye[a]) * 1.0 / FRAMES;
    for (int i = 0; i < FRAMES; i++) {
        rend_frame frame;
        for (int a = 0; a < 3; a++)
            c.eye[a] += 0.5 * way[a];
        render_frame_make(&c, &f.grid, &frame);
        rend_select_input in = input_for(&f, &frame, REND_ALL);
        in.min_node_px = 0;
        const rend_selection *s = run(&f, &in);
        memset(now, 0, f.tree.count * sizeof *now);
        for (uint32_t d = 0; d < s->draw_count; d++) {
            uint32_t node = s->draws[d].node;
            now[node] = s->draws[d].count;
            if (i == 0 || before[node] == now[node]) continue;
            appeared += before[node] == 0;
            assert_true(now[node] <= before[node] + 3 + f.tree.nodes[node].count / 10);
        }
        uint32_t *swap = before;
        before = now, now = swap;
    }
    assert_true(appeared > 100);
    free(before), free(now);
    stop(&f);
}

/* From picture to picture a node that has arrived shows more, with smaller splats, up to what it
 * would show if it had always been there; its ancestors stay as they are. */
static void what_has_arrived_grows_in(void **unused)
{
    (void)unused;
    fixture f;
    uint32_t grew = 0;
    start(&f, 20, 3, 800, 16);
    uint8_t *ages = malloc(f.tree.count);
    uint32_t *grown = calloc(f.tree.count, sizeof *grown),
             *before = calloc(f.tree.count, sizeof *before);
    assert_true(ages != NULL && grown != NULL && before != NULL);
    rend_camera c = overview(&f.grid);
    rend_frame frame;
    render_frame_make(&c, &f.grid, &frame);
    rend_select_input in = input_for(&f, &frame, REND_ALL);
    const rend_selection *s = run(&f, &in);
    uint64_t all = s->points, last = 0;
    for (uint32_t d = 0; d < s->draw_count; d++)
        grown[s->draws[d].node] = s->draws[d].count;
    in.ages = ages;
    for (uint32_t age = 0; age <= REND_GROWN; age++) {
        for (uint32_t n = 0; n < f.tree.count; n++)
            ages[n] = (uint8_t)(f.tree.nodes[n].level < 2 ? REND_GROWN : age);
        s = run(&f, &in);
        assert_true(s->points > last);
        last = s->points;
        for (uint32_t d = 0; d < s->draw_count; d++) {
            uint32_t node = s->draws[d].node, count = s->draws[d].count;
            assert_true(count <= grown[node] && count >= before[node]);
            if (f.tree.nodes[node].level < 2) assert_int_equal(count, grown[node]);
            else grew += count > before[node] && before[node] > 0;
            before[node] = count;
        }
    }
    assert_true(last == all && grew > 100);
    free(ages), free(grown), free(before);
    stop(&f);
}

static void a_damaged_node_does_not_hide_what_is_below(void **unused)
{
    (void)unused;
    fixture f;
    start(&f, 20, 5, 400, 12);
    rend_camera c = overview(&f.grid);
    rend_frame frame;
    render_frame_make(&c, &f.grid, &frame);
    rend_select_input in = input_for(&f, &frame, REND_ALL);
    uint32_t whole = run(&f, &in)->draw_count;
    f.residency[0] = f.residency[2] = REND_DAMAGED;
    const rend_selection *s = run(&f, &in);
    assert_int_equal(s->draw_count, whole - 2);
    assert_int_equal(s->request_count, 0);
    stop(&f);
}

static void the_same_frame_is_selected_alike(void **unused)
{
    (void)unused;
    fixture f, g;
    uint64_t state = 13;
    start(&f, 20, 5, 500, 13);
    start(&g, 20, 5, 500, 13);
    for (int i = 0; i < 20; i++) {
        rend_frame frame, other;
        rend_camera c = render_camera_random(&f.grid, &state),
                    d = render_camera_random(&f.grid, &state);
        render_frame_make(&c, &f.grid, &frame);
        render_frame_make(&d, &f.grid, &other);
        rend_select_input in = input_for(&f, &frame, 50000),
                          between = input_for(&g, &other, REND_ALL);
        const rend_selection *s = run(&f, &in);
        run(&g, &between); /* the workspace has a history */
        const rend_selection *t = run(&g, &in);
        assert_int_equal(s->draw_count, t->draw_count);
        for (uint32_t n = 0; n < s->draw_count; n++) {
            assert_int_equal(s->draws[n].node, t->draws[n].node);
            assert_int_equal(s->draws[n].count, t->draws[n].count);
        }
        assert_memory_equal(s->octants, t->octants, 8 * sizeof *s->octants * s->draw_count);
    }
    stop(&f);
    stop(&g);
}

/* A wall in front of everything: only what reaches up to it, or stands around the eye, is drawn. */
static void hidden_nodes_are_skipped_and_counted(void **unused)
{
    (void)unused;
    fixture f;
    rend_frame frame;
    start(&f, 16, 5, 3000, 11);
    rend_camera camera = overview(&f.grid);
    render_frame_make(&camera, &f.grid, &frame);
    rend_select_input in = input_for(&f, &frame, REND_ALL);
    uint32_t all = run(&f, &in)->draw_count;
    rend_occlusion *occlusion = rend_occlusion_create();
    float *depths = rend_occlusion_depths(occlusion, frame.width, frame.height);
    assert_non_null(depths);
    for (uint32_t i = 0; i < frame.width * frame.height; i++)
        depths[i] = i % frame.width < frame.width / 2 ? 0 : 1;
    rend_occlusion_learn(occlusion, &frame, false);
    in.occlusion = occlusion;
    const rend_selection *s = run(&f, &in);
    assert_true(s->draw_count < all && s->draw_count > 1 && s->hidden > 0 && s->points_hidden > 0);
    for (uint32_t i = 0; i < s->draw_count; i++) {
        const mospt_node *n = &f.tree.nodes[s->draws[i].node];
        assert_false(
            rend_occlusion_hides(occlusion, n->corner, mospt_cell_width(&f.grid, n->level)));
    }
    rend_occlusion_forget(occlusion);
    assert_int_equal(run(&f, &in)->draw_count, all);
    rend_occlusion_destroy(occlusion);
    stop(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_twin_agrees),
        cmocka_unit_test(the_budget_is_never_exceeded),
        cmocka_unit_test(what_is_drawn_and_requested_fits_the_gpu_cache),
        cmocka_unit_test(requests_and_draws_come_largest_first),
        cmocka_unit_test(the_budget_is_looked_at_before_the_frustum),
        cmocka_unit_test(only_what_would_be_seen_is_requested),
        cmocka_unit_test(the_root_shows_a_level_when_its_cells_are_a_pixel_wide),
        cmocka_unit_test(points_come_one_after_the_other),
        cmocka_unit_test(a_missing_child_leaves_no_gap),
        cmocka_unit_test(what_has_arrived_grows_in),
        cmocka_unit_test(a_damaged_node_does_not_hide_what_is_below),
        cmocka_unit_test(the_same_frame_is_selected_alike),
        cmocka_unit_test(hidden_nodes_are_skipped_and_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
