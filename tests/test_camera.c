#include "render/camera.h"
#include "render/outline.h"
#include "tests/render_tools.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Where a world position is seen, in units of half the picture, and at which distance along the
 * view axis. */
static void project(const rend_camera *c, double aspect, const double world[3], double out[3])
{
    double right[3], up[3], back[3], eye[3] = {0, 0, 0}, d[3];
    rend_camera_axes(c, right, up, back);
    for (int a = 0; a < 3; a++)
        d[a] = world[a] - c->eye[a];
    for (int a = 0; a < 3; a++)
        eye[0] += right[a] * d[a], eye[1] += up[a] * d[a], eye[2] -= back[a] * d[a];
    double t = tan(c->fov_rad / 2);
    out[0] = eye[0] / (eye[2] * t * aspect), out[1] = eye[1] / (eye[2] * t), out[2] = eye[2];
}

static void an_overview_shows_all_of_a_box_and_fills_the_picture(void **unused)
{
    (void)unused;
    uint64_t state = 1;
    for (int i = 0; i < 500; i++) {
        double low[3], high[3], aspect = 0.5 + 2 * core_unit(&state), widest = 0;
        for (int a = 0; a < 3; a++) {
            low[a] = 1e6 * (core_unit(&state) - 0.5);
            high[a] = low[a] + pow(10, 4 * core_unit(&state) - 1);
        }
        rend_camera c;
        rend_camera_overview(low, high, aspect, 0.2 + 1.5 * core_unit(&state), &c);
        for (int corner = 0; corner < 8; corner++) {
            double p[3], at[3];
            for (int a = 0; a < 3; a++)
                p[a] = (corner >> a & 1) ? high[a] : low[a];
            project(&c, aspect, p, at);
            assert_true(at[2] > 0);
            assert_true(fabs(at[0]) < 1 && fabs(at[1]) < 1);
            widest = fmax(widest, fmax(fabs(at[0]), fabs(at[1])));
        }
        assert_true(widest > 0.9);
        assert_true(c.eye[2] > c.target[2]); /* from above */
    }
}

static void flat_linear_and_single_point_boxes_are_fine(void **unused)
{
    (void)unused;
    const double boxes[][2][3] = {
        {{0, 0, 0}, {10, 10, 0}},  {{0, 0, 0}, {10, 0, 0}},
        {{0, 0, 0}, {0, 0, 10}},   {{500000, 5400000, 100}, {500000, 5400000, 100}},
        {{0, 0, 0}, {0, 0, 0}},    {{0, 0, 0}, {10000, 5, 2}},
        {{0, 0, 0}, {5, 10000, 2}}};
    for (size_t i = 0; i < sizeof boxes / sizeof *boxes; i++) {
        rend_camera c;
        double at[3], middle[3];
        rend_camera_overview(boxes[i][0], boxes[i][1], 16.0 / 9, 1, &c);
        for (int a = 0; a < 3; a++)
            middle[a] = (boxes[i][0][a] + boxes[i][1][a]) / 2;
        project(&c, 16.0 / 9, middle, at);
        assert_true(isfinite(at[0]) && isfinite(at[1]) && at[2] > 0);
        assert_true(fabs(at[0]) < 1 && fabs(at[1]) < 1);
    }
}

static void a_frame_is_a_rotation_that_looks_at_its_target(void **unused)
{
    (void)unused;
    uint64_t state = 2;
    mospt_grid grid = render_grid(24);
    for (int i = 0; i < 300; i++) {
        rend_camera c = render_camera_random(&grid, &state);
        rend_frame f;
        if (i % 3 == 0)
            memcpy(c.target, c.eye, sizeof c.target), c.target[2] -= 5; /* straight down */
        render_frame_make(&c, &grid, &f);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) {
                float dot = 0;
                for (int r = 0; r < 3; r++)
                    dot += f.rotation[3 * a + r] * f.rotation[3 * b + r];
                assert_true(fabsf(dot - (float)(a == b)) < 1e-5f);
            }
        float at[3] = {0, 0, 0};
        for (int a = 0; a < 3; a++) {
            double d = (c.target[a] - grid.offset[a]) / grid.step - (double)grid.base[a] - f.eye[a];
            for (int r = 0; r < 3; r++)
                at[r] += f.rotation[3 * a + r] * (float)d;
        }
        assert_true(at[2] < 0 && fabsf(at[0]) < 1e-4f * -at[2] && fabsf(at[1]) < 1e-4f * -at[2]);
        assert_true(f.near_w > 0 && f.far_w > f.near_w);
        /* Anchor and offset give the eye back. */
        for (int a = 0; a < 3; a++)
            assert_true(fabs((double)f.anchor[a] - (double)f.offset[a] - f.eye[a]) <
                        1e-6 * ldexp(1, 24));
    }
}

/* The site as it stands, and half a million metres away: not one bit of a frame differs. */
static void a_frame_does_not_depend_on_where_the_site_stands(void **unused)
{
    (void)unused;
    uint64_t state = 3;
    mospt_grid here = render_grid(17), there = here;
    here.step = there.step = 0.001;
    const int64_t shift[3] = {500000000, 5400000000, 250000};
    for (int a = 0; a < 3; a++)
        there.base[a] += shift[a];
    for (int i = 0; i < 300; i++) {
        rend_camera a = render_camera_random(&here, &state), b = a;
        rend_frame f, g;
        for (int k = 0; k < 3; k++)
            b.eye[k] += (double)shift[k] * 0.001, b.target[k] += (double)shift[k] * 0.001;
        render_frame_make(&a, &here, &f);
        render_frame_make(&b, &there, &g);
        assert_memory_equal(&f, &g, sizeof f);
    }
}

static void depth_and_distance_are_each_others_inverse(void **unused)
{
    (void)unused;
    rend_frame f = {.near_w = 0.01f, .far_w = 1e5f};
    assert_true(fabsf(rend_frame_depth_to_w(&f, 0) / 0.01f - 1) < 1e-5f);
    assert_true(fabsf(rend_frame_depth_to_w(&f, 1) / 1e5f - 1) < 1e-4f);
    for (float w = 0.02f; w < 9e4f; w *= 1.7f) {
        float depth = log2f(w / f.near_w) / log2f(f.far_w / f.near_w);
        assert_true(fabsf(rend_frame_depth_to_w(&f, depth) / w - 1) < 1e-4f);
    }
}

static void options_that_make_no_sense_are_refused(void **unused)
{
    (void)unused;
    render_site s;
    rend_camera c;
    mospt_err err = {0};
    render_site_make(CORE_CLUSTERED, 3000, NULL, &s);
    const rend_camera_options wrong[] = {
        {.has_eye = true, .eye = {NAN, 0, 0}},
        {.has_eye = true, .eye = {1, 2, 3}, .has_target = true, .target = {1, 2, 3}},
        {.has_up = true},
        {.has_fov = true, .fov_deg = 180},
        {.has_fov = true, .fov_deg = NAN},
        {.has_target = true, .target = {0, 0, INFINITY}},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        CORE_FAILS(rend_camera_make(&wrong[i], s.dataset, 1280, 720, &c, &err), MOSPT_EINVAL);
    const rend_camera_options fine = {
        .has_eye = true, .eye = {1, 2, 3}, .has_target = true, .target = {1, 2, 2}};
    CORE_NEED(rend_camera_make(&fine, s.dataset, 1280, 720, &c, &err));
    assert_true(c.eye[2] == 3 && c.target[2] == 2);
    render_site_fini(&s);
}

/* A bird ten kilometres away must not make the site a dot. */
static void an_outlier_does_not_spoil_the_overview(void **unused)
{
    (void)unused;
    mospt_err err = {0};
    core_site site;
    mospt_dataset *dataset;
    char *folder = core_folder_make(), *path = core_path(folder, "site.ipts");
    core_site_make(CORE_UNIFORM, 20, 20000, 3, &site);
    for (uint32_t i = 0; i < site.count; i++) {
        mospt_vertex v = mospt_vertex_of(site.records + i * site.stride);
        uint32_t *xyz[3] = {&v.x, &v.y, &v.z};
        for (int a = 0; a < 3;
             a++) /* a sixty-fourth of the root cube, and one point in the far corner */
            *xyz[a] =
                site.grid.root[a] + (i == 0 ? (1u << 20) - 2 : (*xyz[a] - site.grid.root[a]) >> 6);
        memcpy(site.records + i * site.stride, &v, sizeof v);
    }
    core_dataset_make(&site, 4, 50, path);
    CORE_NEED(mospt_dataset_open(path, &dataset, &err));
    double low[3], high[3], width = ldexp(site.grid.step, 20);
    rend_outline_bounds(dataset, low, high);
    for (int a = 0; a < 3; a++)
        assert_true(high[a] - low[a] < width / 16 && high[a] - low[a] > width / 80);
    mospt_dataset_close(dataset);
    core_site_fini(&site);
    free(path);
    core_folder_remove(folder);
}

/* A site over five eighths of the cube's width, and one point of so many in its far corner. */
static double reach_with_one_far_of(uint32_t every)
{
    mospt_err err = {0};
    core_site site;
    mospt_dataset *dataset;
    rend_outline outline;
    double reach = 0;
    char *folder = core_folder_make(), *path = core_path(folder, "site.ipts");
    core_site_make(CORE_UNIFORM, 20, 20000, 3, &site);
    for (uint32_t i = 0; i < site.count; i++) {
        mospt_vertex v = mospt_vertex_of(site.records + i * site.stride);
        uint32_t *xyz[3] = {&v.x, &v.y, &v.z};
        for (int a = 0; a < 3; a++) {
            uint32_t at = *xyz[a] - site.grid.root[a];
            at = i % every == 0 ? (1u << 20) - 1 - at / 20 : at / 8 * 5;
            *xyz[a] = site.grid.root[a] + at;
        }
        memcpy(site.records + i * site.stride, &v, sizeof v);
    }
    core_dataset_make(&site, 5, 50, path);
    CORE_NEED(mospt_dataset_open(path, &dataset, &err));
    CORE_NEED(rend_outline_make(dataset, &outline, &err));
    assert_true(outline.count > 1000);
    for (uint32_t i = 0; i < outline.count; i++)
        for (int a = 0; a < 3; a++)
            reach = fmax(reach, outline.at[i][a] + outline.middle[a] - outline.low[a]);
    reach /= outline.high[0] - outline.low[0];
    rend_outline_fini(&outline);
    mospt_dataset_close(dataset);
    core_site_fini(&site);
    free(path);
    core_folder_remove(folder);
    return reach;
}

/* What was seen through a window is not the site; a second house is. */
static void small_islands_stray_and_large_ones_do_not(void **unused)
{
    (void)unused;
    double stray = reach_with_one_far_of(200), house = reach_with_one_far_of(10);
    assert_true(stray > 0.6 && stray < 0.65 && house > 0.98);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_overview_shows_all_of_a_box_and_fills_the_picture),
        cmocka_unit_test(flat_linear_and_single_point_boxes_are_fine),
        cmocka_unit_test(a_frame_is_a_rotation_that_looks_at_its_target),
        cmocka_unit_test(a_frame_does_not_depend_on_where_the_site_stands),
        cmocka_unit_test(depth_and_distance_are_each_others_inverse),
        cmocka_unit_test(options_that_make_no_sense_are_refused),
        cmocka_unit_test(an_outlier_does_not_spoil_the_overview),
        cmocka_unit_test(small_islands_stray_and_large_ones_do_not),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
