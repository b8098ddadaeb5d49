#include "render/stage.h"
#include "tests/render_tools.h"

#include <sched.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    rgl *gl;
    rend_stage *stage;
    rend_view_of view;
} scene;

static void start(const render_site *site, const rend_limits *limits, scene *s)
{
    mospt_err err = {0};
    const rend_camera_options camera = {0};
    *s =
        (scene){.view = {.width = 640, .height = 360, .budget_points = REND_ALL, .min_node_px = 1}};
    CORE_NEED(rgl_null_create(&s->gl, &err));
    CORE_NEED(rend_stage_create(site->dataset, s->gl, limits, NULL, NULL, &s->stage, &err));
    CORE_NEED(rend_camera_make(&camera, site->dataset, 640, 360, &s->view.camera, &err));
}

static void stop(scene *s)
{
    assert_int_equal(rgl_null_record(s->gl).overruns, 0);
    rend_stage_destroy(s->stage);
    rgl_destroy(s->gl);
}

static rgl_record still(const render_site *site, uint64_t ram, uint64_t gpu, rend_figures *figures)
{
    scene s;
    mospt_err err = {0};
    const rend_limits limits = {.ram_cache_bytes = ram, .gpu_cache_bytes = gpu};
    start(site, &limits, &s);
    CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
    rgl_record record = rgl_null_record(s.gl);
    rend_stage_figures(s.stage, figures);
    assert_int_equal(record.points_drawn, figures->points_drawn);
    stop(&s);
    return record;
}

/* Frames until nothing more is to come; returns how many. */
static uint32_t converge(scene *s)
{
    mospt_err err = {0};
    uint32_t frames = 0;
    for (rend_progress progress = REND_AGAIN; progress != REND_SETTLED; frames++) {
        CORE_NEED(rend_stage_frame(s->stage, &s->view, &progress, &err));
        assert_true(frames < 1000000);
        if (progress == REND_WAITING) sched_yield();
    }
    return frames;
}

static void a_still_is_the_same_whatever_the_cache_sizes(void **unused)
{
    (void)unused;
    render_site site;
    rend_figures whole, small;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    rgl_record large = still(&site, 0, 0, &whole);
    assert_true(whole.points_drawn > 1000);
    const uint64_t sizes[] = {1, 40000, 100000, 300000};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
            rgl_record record = still(&site, sizes[i], sizes[k], &small);
            assert_true(record.sequence_hash == large.sequence_hash);
            assert_true(record.octants_hash == large.octants_hash);
            assert_int_equal(record.points_drawn, large.points_drawn);
            assert_true(small.gpu_used <= small.gpu_limit && small.ram_used <= small.ram_limit);
            if (sizes[k] < 300000) assert_true(small.gpu_limit < whole.gpu_limit);
        }
    render_site_fini(&site);
}

static void frames_converge_to_the_still(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    rend_figures figures, whole;
    mospt_err err = {0};
    const rend_limits limits = {0};
    rend_progress progress;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    rgl_record picture = still(&site, 0, 0, &whole);
    start(&site, &limits, &s);
    assert_true(converge(&s) > 2); /* coarse nodes first */
    rgl_record before = rgl_null_record(s.gl);
    CORE_NEED(rend_stage_frame(s.stage, &s.view, &progress, &err));
    rgl_record after = rgl_null_record(s.gl);
    rend_stage_figures(s.stage, &figures);
    assert_int_equal(progress, REND_SETTLED);
    assert_int_equal(figures.pending, 0);
    assert_int_equal(after.points_drawn - before.points_drawn, picture.points_drawn);
    assert_int_equal(after.points_uploaded, before.points_uploaded);
    assert_true(after.octants_hash == picture.octants_hash);
    stop(&s);
    render_site_fini(&site);
}

/* A cache that cannot hold the view shows what it holds, and comes to rest. */
static void a_small_gpu_cache_does_not_thrash(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    rend_figures figures;
    const rend_limits limits = {.ram_cache_bytes = 1, .gpu_cache_bytes = 200000};
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    start(&site, &limits, &s);
    converge(&s);
    rend_stage_figures(s.stage, &figures);
    assert_true(figures.points_drawn > 0 && figures.budget_spent);
    assert_true(figures.gpu_used <= figures.gpu_limit);
    /* The camera moves on: old nodes make room for new ones. */
    uint64_t state = 5;
    for (int i = 0; i < 20; i++) {
        s.view.camera = render_camera_random(&site.dataset->metadata.grid, &state);
        converge(&s);
    }
    stop(&s);
    render_site_fini(&site);
}

static void the_budget_holds_in_frames_and_stills(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    rend_figures figures;
    mospt_err err = {0};
    const rend_limits limits = {0};
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    start(&site, &limits, &s);
    for (uint64_t budget = 0; budget < 20000; budget = 2 * budget + 100) {
        s.view.budget_points = budget;
        converge(&s);
        rend_stage_figures(s.stage, &figures);
        uint64_t in_frame = figures.points_drawn;
        CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
        rend_stage_figures(s.stage, &figures);
        assert_true(in_frame <= budget);
        assert_int_equal(figures.points_drawn, in_frame);
    }
    stop(&s);
    render_site_fini(&site);
}

static void a_damaged_node_is_counted_once_and_left_out(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    rend_figures figures, whole;
    mospt_err err = {0};
    const rend_limits limits = {0};
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    still(&site, 0, 0, &whole);
    render_site_damage(&site, 1);
    uint64_t lost = site.dataset->hierarchy.nodes[1].count;
    start(&site, &limits, &s);
    converge(&s);
    converge(&s);
    rend_stage_figures(s.stage, &figures);
    assert_int_equal(figures.damaged_nodes, 1);
    assert_int_equal(figures.damaged_points, lost);
    assert_int_equal(figures.damage.code, MOSPT_EFORMAT);
    assert_int_equal(figures.nodes_drawn, whole.nodes_drawn - 1);
    CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
    rend_stage_figures(s.stage, &figures);
    assert_int_equal(figures.damaged_nodes, 1);
    assert_int_equal(figures.nodes_drawn, whole.nodes_drawn - 1);
    stop(&s);
    render_site_fini(&site);
}

static void one_point_is_a_picture(void **unused)
{
    (void)unused;
    render_site site;
    rend_figures figures;
    render_site_make(CORE_UNIFORM, 1, NULL, &site);
    assert_int_equal(still(&site, 0, 0, &figures).points_drawn, 1);
    render_site_fini(&site);
    render_site_make(CORE_IDENTICAL, 500, NULL, &site);
    still(&site, 0, 0, &figures);
    assert_true(figures.points_drawn > 0);
    render_site_fini(&site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_still_is_the_same_whatever_the_cache_sizes),
        cmocka_unit_test(frames_converge_to_the_still),
        cmocka_unit_test(a_small_gpu_cache_does_not_thrash),
        cmocka_unit_test(the_budget_holds_in_frames_and_stills),
        cmocka_unit_test(a_damaged_node_is_counted_once_and_left_out),
        cmocka_unit_test(one_point_is_a_picture),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
