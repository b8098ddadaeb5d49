#include "render/stage.h"
#include "tests/render_tools.h"

#include <math.h>
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

static void boxes_side_by_side_show_each_point_once(void **unused)
{
    (void)unused;
    render_site site;
    rend_figures figures;
    uint64_t sum = 0;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    uint64_t whole = still(&site, 0, 0, &figures).points_drawn;
    const mospt_grid *grid = &site.dataset->metadata.grid;
    for (int box = 0; box < 8; box++) {
        scene s;
        mospt_err err = {0};
        const rend_limits limits = {.gpu_cache_bytes = box % 2 ? 1 : 0};
        start(&site, &limits, &s);
        s.view.look.has_clip = true;
        for (int a = 0; a < 3; a++) {
            uint32_t cut = grid->root[a] + (uint32_t)(mospt_cell_width(grid, 0) / 5 * 2 + 3);
            bool upper = box >> a & 1;
            s.view.look.clip.low[a] =
                upper ? mospt_grid_axis_to_world(grid, a, cut + 1) : -INFINITY;
            s.view.look.clip.high[a] = upper ? INFINITY : mospt_grid_axis_to_world(grid, a, cut);
        }
        CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
        rend_stage_figures(s.stage, &figures);
        rgl_record record = rgl_null_record(s.gl);
        sum += record.points_drawn;
        assert_true(record.points_drawn <= figures.points_drawn); /* nodes are not cut */
        assert_true(record.points_drawn < whole);
        stop(&s);
    }
    assert_int_equal(sum, whole);
    render_site_fini(&site);
}

/* Frames until nothing more is to come; returns how many. */
static uint32_t converge(scene *s)
{
    mospt_err err = {0};
    uint32_t frames = 0;
    for (rend_progress progress = REND_AGAIN; progress != REND_SETTLED; frames++) {
        CORE_NEED(rend_stage_frame(s->stage, &s->view, NULL, &progress, &err));
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
    CORE_NEED(rend_stage_frame(s.stage, &s.view, NULL, &progress, &err));
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

static rgl_record blended(const render_site *site, uint64_t gpu, bool frames)
{
    scene s;
    rend_progress progress;
    rend_figures figures;
    mospt_err err = {0};
    const rend_limits limits = {.gpu_cache_bytes = gpu};
    start(site, &limits, &s);
    s.view.look.blend_slab = 0.01f;
    CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
    if (frames) CORE_NEED(rend_stage_frame(s.stage, &s.view, NULL, &progress, &err));
    rgl_record record = rgl_null_record(s.gl);
    rend_stage_figures(s.stage, &figures);
    if (!frames) assert_int_equal(record.points_drawn, figures.points_drawn);
    stop(&s);
    return record;
}

static void blending_draws_every_point_twice_and_counts_it_once(void **unused)
{
    (void)unused;
    render_site site;
    rend_figures figures;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    rgl_record plain = still(&site, 0, 0, &figures);
    assert_int_equal(plain.points_again, 0);
    const uint64_t sizes[] = {0, 40000, 300000}; /* one part, and several */
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        rgl_record r = blended(&site, sizes[i], false);
        assert_int_equal(r.points_drawn, plain.points_drawn);
        assert_int_equal(r.points_again, plain.points_drawn);
        assert_true(r.picture_hash == plain.picture_hash && r.again_hash == plain.picture_hash);
        assert_int_equal(r.begins, 1);
        assert_int_equal(r.ends, 1);
    }
    rgl_record both = blended(&site, 0, true);
    assert_int_equal(both.points_drawn, 2 * plain.points_drawn);
    assert_true(both.again_hash == both.picture_hash);
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

static uint64_t points_in_frame(scene *s)
{
    mospt_err err = {0};
    rend_progress progress;
    uint64_t before = rgl_null_record(s->gl).points_drawn;
    CORE_NEED(rend_stage_frame(s->stage, &s->view, NULL, &progress, &err));
    return rgl_null_record(s->gl).points_drawn - before;
}

/* One frame with an allowance; returns what it drew, in both rounds of blending. */
static uint64_t part_of(scene *s, const rend_allowance *allowed, rend_progress *progress)
{
    mospt_err err = {0};
    rgl_record before = rgl_null_record(s->gl);
    CORE_NEED(rend_stage_frame(s->stage, &s->view, allowed, progress, &err));
    rgl_record after = rgl_null_record(s->gl);
    return after.points_drawn - before.points_drawn + after.points_again - before.points_again;
}

static uint32_t largest_node(const render_site *site)
{
    uint32_t largest = 0;
    for (uint32_t n = 0; n < site->dataset->hierarchy.count; n++)
        if (site->dataset->hierarchy.nodes[n].count > largest)
            largest = site->dataset->hierarchy.nodes[n].count;
    return largest;
}

static void a_picture_in_parts_is_the_same_picture(void **unused)
{
    (void)unused;
    render_site site;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    const rend_limits limits = {0};
    for (int blend = 0; blend < 2; blend++) {
        scene s;
        rend_progress progress;
        rend_figures figures;
        start(&site, &limits, &s);
        s.view.look.blend_slab = blend ? 0.01f : 0;
        converge(&s);
        uint64_t all = part_of(&s, NULL, &progress);
        rgl_record whole = rgl_null_record(s.gl);
        for (uint64_t points = 1; points < 40000; points = 5 * points + 99) {
            const rend_allowance allowed = {.points = points};
            uint64_t most = points + largest_node(&site);
            rgl_record before = rgl_null_record(s.gl);
            uint32_t parts = 0;
            do {
                assert_true(part_of(&s, &allowed, &progress) <= most);
                parts++;
            } while (progress == REND_PART);
            assert_int_equal(progress, REND_SETTLED);
            assert_true(points >= all || parts > 1);
            rgl_record now = rgl_null_record(s.gl);
            assert_true(now.picture_hash == whole.picture_hash);
            assert_true(now.again_hash == whole.again_hash);
            assert_int_equal(now.begins, before.begins + 1);
            assert_int_equal(now.ends, before.ends + 1);
            rend_stage_figures(s.stage, &figures);
            assert_int_equal(figures.points_drawn, now.points_drawn - before.points_drawn);
        }
        stop(&s);
    }
    render_site_fini(&site);
}

static void another_view_begins_another_picture(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    rend_progress progress;
    const rend_limits limits = {0};
    const rend_allowance allowed = {.points = 3000};
    uint64_t state = 5;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    start(&site, &limits, &s);
    converge(&s);
    part_of(&s, &allowed, &progress);
    assert_int_equal(progress, REND_PART);
    s.view.camera = render_camera_random(&site.dataset->metadata.grid, &state);
    rgl_record before = rgl_null_record(s.gl);
    part_of(&s, &allowed, &progress);
    assert_int_equal(rgl_null_record(s.gl).begins, before.begins + 1);
    converge(&s);
    uint64_t picture = rgl_null_record(s.gl).picture_hash;
    do
        part_of(&s, &allowed, &progress);
    while (progress == REND_PART);
    assert_true(rgl_null_record(s.gl).picture_hash == picture);
    stop(&s);
    render_site_fini(&site);
}

static void uploads_of_a_frame_keep_to_what_is_allowed(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    const rend_limits limits = {0};
    const rend_allowance allowed = {.points = 2000, .upload_bytes = 16000};
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    start(&site, &limits, &s);
    for (rend_progress progress = REND_AGAIN; progress != REND_SETTLED;) {
        uint64_t before = rgl_null_record(s.gl).points_uploaded;
        part_of(&s, &allowed, &progress);
        uint64_t uploaded = rgl_null_record(s.gl).points_uploaded - before;
        assert_true(uploaded <= 1000 + largest_node(&site));
        if (progress == REND_WAITING) sched_yield();
    }
    rend_figures figures;
    rend_stage_figures(s.stage, &figures);
    assert_int_equal(figures.uploaded_bytes, 16 * rgl_null_record(s.gl).points_uploaded);
    assert_int_equal(figures.pending, 0);
    stop(&s);
    render_site_fini(&site);
}

/* The null backend says that there is a wall before everything, and then that there is none. */
static void what_was_hidden_comes_back_when_the_wall_is_gone(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    rend_figures all, figures;
    rend_progress progress;
    const rend_limits limits = {0};
    uint64_t state = 9;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    start(&site, &limits, &s);
    converge(&s);
    rend_stage_figures(s.stage, &all);
    s.view.budget_points = all.points_drawn / 2; /* what exceeds it is worth looking behind */
    converge(&s);
    rend_stage_figures(s.stage, &all);
    assert_int_equal(all.nodes_hidden, 0);
    assert_true(all.budget_spent);
    for (int moves = 0; moves < 2; moves++) {
        rgl_null_set_depth(s.gl, 0);
        if (moves) s.view.camera.target[0] += 0.5;
        else s.view.look.point_px = 2; /* drawn otherwise */
        converge(&s);
        rend_stage_figures(s.stage, &figures);
        assert_true(figures.nodes_hidden > 0 && figures.points_drawn < all.points_drawn);
        rgl_null_set_depth(s.gl, 1);
        if (moves) s.view.camera = render_camera_random(&site.dataset->metadata.grid, &state);
        else s.view.look.point_px = 3;
        part_of(&s, NULL, &progress);
        rend_stage_figures(s.stage, &figures);
        assert_true(figures.nodes_hidden == 0 || progress != REND_SETTLED);
        converge(&s);
        rend_stage_figures(s.stage, &figures);
        assert_int_equal(figures.nodes_hidden, 0);
    }
    s.view.no_occlusion = true;
    rgl_null_set_depth(s.gl, 0);
    converge(&s);
    rend_stage_figures(s.stage, &figures);
    assert_int_equal(figures.nodes_hidden, 0);
    stop(&s);
    render_site_fini(&site);
}

static void another_generation_takes_over_what_is_the_same(void **unused)
{
    (void)unused;
    render_site few, more;
    mospt_err err = {0};
    const rend_limits limits[] = {{0}, {.ram_cache_bytes = 1, .gpu_cache_bytes = 200000}};
    const rend_colour colours[] = {REND_COLOUR_RGB, REND_COLOUR_ELEVATION, REND_COLOUR_DENSITY};
    render_site_make(CORE_CLUSTERED, 30000, NULL, &few);
    render_more_make(30000, &more);
    for (int l = 0; l < 2; l++)
        for (int c = 0; c < 3; c++) {
            scene s, fresh;
            rend_progress progress;
            const rend_allowance allowed = {.points = 3000};
            start(&few, &limits[l], &s);
            start(&more, &limits[l], &fresh);
            s.view.look.colour = fresh.view.look.colour = colours[c];
            fresh.view.camera = s.view.camera;
            converge(&s);
            part_of(&s, &allowed, &progress); /* in the middle of a picture */
            rend_figures before, after, all;
            rend_stage_figures(s.stage, &before);
            CORE_NEED(rend_stage_swap(s.stage, more.dataset, &err));
            converge(&s);
            converge(&fresh);
            assert_true(rgl_null_record(s.gl).picture_hash ==
                        rgl_null_record(fresh.gl).picture_hash);
            rend_stage_figures(s.stage, &after);
            rend_stage_figures(fresh.stage, &all);
            bool keeps = l == 0 && c == 0; /* colours that stay, and room */
            uint64_t again = after.loaded_bytes - before.loaded_bytes;
            if (keeps) assert_true(again > 0 && again < all.loaded_bytes * 9 / 10);
            before = after;
            CORE_NEED(rend_stage_swap(s.stage, few.dataset, &err));
            converge(&s);
            rend_stage_figures(s.stage, &after);
            again = after.uploaded_bytes - before.uploaded_bytes;
            if (keeps) assert_true(again > 0 && again < all.uploaded_bytes * 9 / 10);
            stop(&s);
            stop(&fresh);
        }
    render_site_fini(&few);
    render_site_fini(&more);
}

typedef struct {
    uint32_t asked, refuses; /* times */
} reset_driver;

static bool renew(void *user, mospt_err *err)
{
    reset_driver *d = user;
    return ++d->asked > d->refuses ||
           mospt_err_set(err, MOSPT_EIO, mospt_nowhere(), "it is not back yet");
}

static void a_driver_that_is_reset_changes_no_picture(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    reset_driver driver = {.refuses = 2};
    rend_figures figures;
    mospt_err err = {0};
    const rend_limits limits = {.gpu_cache_bytes = 256 << 10}; /* several parts to a picture */
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    rgl_record whole = still(&site, 0, 0, &figures);
    start(&site, &limits, &s);
    CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
    rgl_set_renew(s.gl, renew, &driver);
    rgl_pretend_reset(s.gl);
    CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
    assert_true(rgl_null_record(s.gl).picture_hash == whole.picture_hash);
    rend_stage_figures(s.stage, &figures);
    assert_int_equal(figures.resets, 1);
    assert_int_equal(driver.asked, 3);
    /* It is found when the picture is read: the picture is drawn again. */
    uint8_t rgb[3];
    rgl_pretend_reset(s.gl);
    CORE_FAILS(rgl_read_pixels(s.gl, false, 1, 1, rgb, &err), MOSPT_EIO);
    CORE_NEED(rend_stage_recover(s.stage, &err));
    CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
    assert_true(rgl_null_record(s.gl).picture_hash == whole.picture_hash);
    stop(&s);
    render_site_fini(&site);
}

static void a_window_goes_on_after_a_reset(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    reset_driver driver = {0};
    rend_figures figures;
    mospt_err err = {0};
    const rend_limits limits = {0};
    rend_progress progress;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    start(&site, &limits, &s);
    rgl_set_renew(s.gl, renew, &driver);
    converge(&s);
    uint64_t picture = rgl_null_record(s.gl).picture_hash;
    uint64_t uploaded = rgl_null_record(s.gl).points_uploaded;
    rend_stage_figures(s.stage, &figures);
    uint64_t loaded = figures.loaded_bytes;
    rgl_pretend_reset(s.gl);
    CORE_NEED(rend_stage_frame(s.stage, &s.view, NULL, &progress, &err));
    assert_int_equal(progress, REND_AGAIN); /* it is all gone, but in memory */
    converge(&s);
    assert_true(rgl_null_record(s.gl).picture_hash == picture);
    assert_int_equal(rgl_null_record(s.gl).points_uploaded, 2 * uploaded);
    rend_stage_figures(s.stage, &figures);
    assert_int_equal(figures.loaded_bytes, loaded);
    assert_int_equal(figures.resets, 1);
    /* In the middle of a picture that is drawn in parts. */
    const rend_allowance few = {.points = 1};
    s.view.camera.target[0] += 1;
    CORE_NEED(rend_stage_frame(s.stage, &s.view, &few, &progress, &err));
    assert_int_equal(progress, REND_PART);
    rgl_pretend_reset(s.gl);
    CORE_NEED(rend_stage_frame(s.stage, &s.view, &few, &progress, &err));
    converge(&s);
    rend_stage_figures(s.stage, &figures);
    assert_int_equal(figures.resets, 2);
    /* Nobody gives another context. */
    rgl_set_renew(s.gl, NULL, NULL);
    rgl_pretend_reset(s.gl);
    CORE_FAILS(rend_stage_frame(s.stage, &s.view, NULL, &progress, &err), MOSPT_EIO);
    assert_true(rgl_is_lost(s.gl));
    CORE_FAILS(rend_stage_frame(s.stage, &s.view, NULL, &progress, &err), MOSPT_EIO);
    stop(&s);
    render_site_fini(&site);
}

static void graphics_memory_that_is_short_is_used_as_far_as_it_goes(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    rend_figures figures;
    mospt_err err = {0};
    const rend_limits limits = {0};
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    rgl_record whole = still(&site, 0, 0, &figures);
    uint64_t all = figures.gpu_limit / 16;
    start(&site, &limits, &s);
    converge(&s);
    for (uint64_t room = all / 2; room > all / 20; room /= 2) { /* less and less of it */
        rgl_null_set_room(s.gl, room);
        s.view.camera.target[0] += 1; /* something to upload */
        s.view.look.colour =
            s.view.look.colour == REND_COLOUR_RGB ? REND_COLOUR_SCAN : REND_COLOUR_RGB;
        converge(&s);
        rend_stage_figures(s.stage, &figures);
        assert_true(figures.gpu_limit <= 16 * room && figures.gpu_halved > 0);
        assert_true(figures.points_drawn > 0);
    }
    stop(&s);
    start(&site, &limits, &s);
    rgl_null_set_room(s.gl, all / 4);
    CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
    assert_true(rgl_null_record(s.gl).picture_hash == whole.picture_hash);
    stop(&s);
    /* At least one node must fit. */
    CORE_NEED(rgl_null_create(&s.gl, &err));
    rgl_null_set_room(s.gl, 1);
    CORE_FAILS(rend_stage_create(site.dataset, s.gl, &limits, NULL, NULL, &s.stage, &err),
               MOSPT_ENOMEM);
    rgl_destroy(s.gl);
    render_site_fini(&site);
}

/* A frame that misses nothing has read what the next place misses, and nothing of it was uploaded.
 */
static void what_will_be_seen_is_read_ahead(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    rend_progress progress;
    rend_figures figures;
    const rend_limits limits = {0};
    uint64_t state = 5;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    start(&site, &limits, &s);
    s.view.budget_points = 3000;
    s.view.camera = render_camera_random(&site.dataset->metadata.grid, &state);
    converge(&s);
    rend_camera elsewhere = {0};
    rend_allowance allowed = {.ahead = &elsewhere};
    do { /* somewhere where something is missing */
        elsewhere = render_camera_random(&site.dataset->metadata.grid, &state);
        part_of(&s, &allowed, &progress);
        rend_stage_figures(s.stage, &figures);
    } while (figures.ahead == 0);
    uint64_t uploaded = figures.uploaded_bytes, loaded;
    do { /* until all of it is there */
        sched_yield();
        part_of(&s, &allowed, &progress);
        rend_stage_figures(s.stage, &figures);
    } while (figures.ahead > 0);
    assert_int_equal(figures.uploaded_bytes, uploaded);
    loaded = figures.loaded_bytes;
    s.view.camera = elsewhere;
    part_of(&s, NULL, &progress);
    rend_stage_figures(s.stage, &figures);
    assert_int_equal(figures.loaded_bytes, loaded);
    assert_true(figures.uploaded_bytes > uploaded);
    stop(&s);
    render_site_fini(&site);
}

static const rend_look LOOKS[] = {
    {.colour = REND_COLOUR_RGB},
    {.colour = REND_COLOUR_SCAN},
    {.colour = REND_COLOUR_ELEVATION},
    {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag"},
    {.colour = REND_COLOUR_ELEVATION, .map = REND_MAP_TURBO},
    {.colour = REND_COLOUR_RGB, .brightness = 2},
};
enum { LOOK_COUNT = sizeof LOOKS / sizeof *LOOKS };

static void new_colours_replace_the_old_ones_without_a_gap(void **unused)
{
    (void)unused;
    render_site site;
    const rend_limits limits[] = {{0}, {.ram_cache_bytes = 1}};
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    for (int l = 0; l < 2; l++) {
        scene s;
        rend_figures figures;
        start(&site, &limits[l], &s);
        converge(&s);
        uint64_t all = points_in_frame(&s);
        for (int i = 1; i <= LOOK_COUNT; i++) {
            s.view.look = LOOKS[i % LOOK_COUNT];
            assert_int_equal(points_in_frame(&s), all); /* in the old colours */
            rend_stage_figures(s.stage, &figures);
            assert_true(figures.pending > 0);
            converge(&s);
            assert_int_equal(points_in_frame(&s), all);
            rend_stage_figures(s.stage, &figures);
            assert_int_equal(figures.pending, 0);
        }
        stop(&s);
    }
    render_site_fini(&site);
}

static uint64_t picture_of(const render_site *site, const rend_look *look)
{
    scene s;
    mospt_err err = {0};
    const rend_limits limits = {0};
    start(site, &limits, &s);
    s.view.look = *look;
    CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
    uint64_t hash = rgl_null_record(s.gl).picture_hash;
    stop(&s);
    return hash;
}

/* The dataset says something else of the same bytes. */
static void trade_names(mospt_schema *schema)
{
    char name[MOSPT_ATTRIBUTE_NAME_MAX];
    memcpy(name, schema->at[0].name, sizeof name);
    memcpy(schema->at[0].name, schema->at[1].name, sizeof name);
    memcpy(schema->at[1].name, name, sizeof name);
}

/* A paint knows its attribute by number, a look by name. */
static void attributes_may_stand_elsewhere_in_another_generation(void **unused)
{
    (void)unused;
    enum { MARKED, TRADED, RETYPED, NEWER };
    render_site site, newer[NEWER];
    mospt_err err = {0};
    const rend_limits limits[] = {{0}, {.ram_cache_bytes = 1}};
    const rend_look looks[] = {
        {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag"},
        {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag", .has_range = true, .range = {0, 3e4}},
    };
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    render_marked_make(30000, &newer[MARKED]);
    for (int n = TRADED; n < NEWER; n++)
        render_site_make(CORE_CLUSTERED, 30000, NULL, &newer[n]);
    trade_names(&newer[TRADED].dataset->metadata.schema);
    mospt_attribute *tag = &newer[RETYPED].dataset->metadata.schema.at[1];
    tag->type = MOSPT_I8, tag->components = 4;
    for (int n = 0; n < NEWER; n++)
        for (int i = 0; i < 4; i++) {
            scene s;
            uint64_t before = picture_of(&site, &looks[i % 2]);
            uint64_t after = picture_of(&newer[n], &looks[i % 2]);
            assert_true((before == after) == (n == MARKED));
            start(&site, &limits[i / 2], &s);
            s.view.look = looks[i % 2];
            converge(&s);
            assert_true(rgl_null_record(s.gl).picture_hash == before);
            CORE_NEED(rend_stage_swap(s.stage, newer[n].dataset, &err));
            converge(&s);
            assert_true(rgl_null_record(s.gl).picture_hash == after);
            CORE_NEED(rend_stage_swap(s.stage, site.dataset, &err));
            converge(&s);
            assert_true(rgl_null_record(s.gl).picture_hash == before);
            stop(&s);
        }
    for (int n = 0; n < NEWER; n++)
        render_site_fini(&newer[n]);
    render_site_fini(&site);
}

/* In frames and in stills, with all in the caches and with next to nothing. */
static void repainted_points_are_those_of_a_fresh_start(void **unused)
{
    (void)unused;
    render_site site;
    mospt_err err = {0};
    const rend_limits limits[] = {{0},
                                  {.ram_cache_bytes = 1},
                                  {.budget_points = 1, .ram_cache_bytes = 1, .gpu_cache_bytes = 1}};
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    for (int l = 0; l < 3; l++) {
        scene s;
        start(&site, &limits[l], &s);
        for (int i = 0; i < 2 * LOOK_COUNT; i++) {
            s.view.look = LOOKS[i % LOOK_COUNT];
            uint64_t wanted = picture_of(&site, &s.view.look);
            if (l < 2) { /* the last cache does not hold a frame */
                converge(&s);
                assert_true(rgl_null_record(s.gl).picture_hash == wanted);
                s.view.look = LOOKS[(i + 1) % LOOK_COUNT];
                wanted = picture_of(&site, &s.view.look);
            }
            CORE_NEED(rend_stage_still(s.stage, &s.view, &err));
            assert_true(rgl_null_record(s.gl).picture_hash == wanted);
        }
        stop(&s);
    }
    render_site_fini(&site);
}

static void colours_that_cannot_be_shown_change_nothing(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    mospt_err err = {0};
    const rend_limits limits = {0};
    rend_progress progress;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    start(&site, &limits, &s);
    converge(&s);
    uint64_t before = rgl_null_record(s.gl).picture_hash;
    s.view.look.colour = REND_COLOUR_TIME;
    CORE_FAILS(rend_stage_frame(s.stage, &s.view, NULL, &progress, &err), MOSPT_EINVAL);
    CORE_FAILS(rend_stage_still(s.stage, &s.view, &err), MOSPT_EINVAL);
    s.view.look.colour = REND_COLOUR_RGB;
    converge(&s);
    assert_true(rgl_null_record(s.gl).picture_hash == before);
    stop(&s);
    render_site_fini(&site);
}

/* Vertices can be shown without their attributes, but not painted by them. */
static void damaged_attributes_are_damage_only_where_they_are_shown(void **unused)
{
    (void)unused;
    render_site site;
    scene s;
    rend_figures figures;
    const rend_limits limits = {0};
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    site.dataset->hierarchy.nodes[1].attributes_hash ^= 1;
    start(&site, &limits, &s);
    for (int i = 0; i < 6; i++) {
        s.view.look.colour = i % 2 == 0 ? REND_COLOUR_RGB : REND_COLOUR_SCAN;
        if (i == 1) { /* nothing of the node in the old colours */
            stop(&s);
            start(&site, &limits, &s);
            s.view.look.colour = REND_COLOUR_SCAN;
        }
        converge(&s);
        rend_stage_figures(s.stage, &figures);
        assert_int_equal(figures.damaged_nodes, i % 2);
    }
    stop(&s);
    render_site_fini(&site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_still_is_the_same_whatever_the_cache_sizes),
        cmocka_unit_test(boxes_side_by_side_show_each_point_once),
        cmocka_unit_test(frames_converge_to_the_still),
        cmocka_unit_test(blending_draws_every_point_twice_and_counts_it_once),
        cmocka_unit_test(a_small_gpu_cache_does_not_thrash),
        cmocka_unit_test(the_budget_holds_in_frames_and_stills),
        cmocka_unit_test(a_damaged_node_is_counted_once_and_left_out),
        cmocka_unit_test(one_point_is_a_picture),
        cmocka_unit_test(new_colours_replace_the_old_ones_without_a_gap),
        cmocka_unit_test(attributes_may_stand_elsewhere_in_another_generation),
        cmocka_unit_test(repainted_points_are_those_of_a_fresh_start),
        cmocka_unit_test(colours_that_cannot_be_shown_change_nothing),
        cmocka_unit_test(damaged_attributes_are_damage_only_where_they_are_shown),
        cmocka_unit_test(a_picture_in_parts_is_the_same_picture),
        cmocka_unit_test(another_view_begins_another_picture),
        cmocka_unit_test(uploads_of_a_frame_keep_to_what_is_allowed),
        cmocka_unit_test(what_was_hidden_comes_back_when_the_wall_is_gone),
        cmocka_unit_test(another_generation_takes_over_what_is_the_same),
        cmocka_unit_test(a_driver_that_is_reset_changes_no_picture),
        cmocka_unit_test(a_window_goes_on_after_a_reset),
        cmocka_unit_test(graphics_memory_that_is_short_is_used_as_far_as_it_goes),
        cmocka_unit_test(what_will_be_seen_is_read_ahead),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
