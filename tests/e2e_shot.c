#include "render/choice.h"
#include "render/shot.h"
#include "tests/ref_picture.h"
#include "tests/render_tools.h"

#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 480, HEIGHT = 270, PIXELS = WIDTH * HEIGHT };

static rend_renderer renderer; /* the program's argument: gl or cpu */

static void take(const render_site *site, const char *name, rend_shot_options options,
                 rend_shot_result *result)
{
    mospt_err err = {0};
    char *path = core_path(site->folder, "%s", name);
    options.path = path;
    options.engine.renderer = renderer;
    if (options.width == 0) options.width = WIDTH, options.height = HEIGHT;
    CORE_NEED(rend_shot(site->dataset, &options, result, &err));
    free(path);
}

static void assert_same_picture(const render_site *a, const char *a_name, const render_site *b,
                                const char *b_name)
{
    char *a_path = core_path(a->folder, "%s", a_name), *b_path = core_path(b->folder, "%s", b_name);
    size_t a_size, b_size;
    uint8_t *x = core_file_read(a_path, &a_size), *y = core_file_read(b_path, &b_size);
    assert_int_equal(a_size, b_size);
    assert_memory_equal(x, y, a_size);
    free(x);
    free(y);
    free(a_path);
    free(b_path);
}

/* Pixels that are not of the background, which must be black. */
static void covered_pixels(const render_site *site, const char *name, uint8_t covered[PIXELS])
{
    char *path = core_path(site->folder, "%s", name);
    png_image image = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&image, path));
    image.format = PNG_FORMAT_RGB;
    assert_int_equal(image.width, WIDTH);
    assert_int_equal(image.height, HEIGHT);
    uint8_t *rgb = malloc(PNG_IMAGE_SIZE(image));
    assert_true(png_image_finish_read(&image, NULL, rgb, 0, NULL));
    for (size_t i = 0; i < PIXELS; i++)
        covered[i] = rgb[3 * i] | rgb[3 * i + 1] | rgb[3 * i + 2] ? 1 : 0;
    free(rgb);
    free(path);
}

/* White points of one pixel on black. */
static const rend_look MASK = {.size_mode = REND_SIZE_FIXED,
                               .point_px = 1,
                               .colour = REND_COLOUR_ELEVATION,
                               .no_edl = true,
                               .has_background = true};

/* clip     shares of the site's extent; NULL: none */
static void compare_with_raw(core_kind kind, const rend_camera_options *camera,
                             const rend_box *clip, double may_miss)
{
    render_site site;
    rend_camera c;
    mospt_err err = {0};
    rend_shot_result result;
    uint8_t *ours = malloc(PIXELS), *raw = malloc(PIXELS);
    uint32_t both = 0, only_ours = 0, only_raw = 0;
    rend_look look = MASK;
    render_site_make(kind, 60000, NULL, &site);
    const mospt_metadata *m = &site.dataset->metadata;
    look.has_clip = clip != NULL;
    for (int a = 0; clip != NULL && a < 3; a++) {
        look.clip.low[a] = m->low[a] + clip->low[a] * (m->high[a] - m->low[a]);
        look.clip.high[a] = m->low[a] + clip->high[a] * (m->high[a] - m->low[a]);
    }
    take(&site, "mask.png", (rend_shot_options){.look = look, .camera = *camera}, &result);
    covered_pixels(&site, "mask.png", ours);
    CORE_NEED(rend_camera_make(camera, site.dataset, WIDTH, HEIGHT, &c, &err));
    ref_picture_cover(site.dataset, &c, clip != NULL ? &look.clip : NULL, WIDTH, HEIGHT, raw);
    for (size_t i = 0; i < PIXELS; i++)
        both += ours[i] && raw[i], only_ours += ours[i] > raw[i], only_raw += raw[i] > ours[i];
    assert_true(both > 500);
    /* GL places points on 1/256 of a pixel; levels below a pixel may leave one out. */
    assert_true(only_ours <= both / 100 + 2);
    assert_true(only_raw <= both * may_miss + 2);
    free(ours);
    free(raw);
    render_site_fini(&site);
}

static void all_points_cover_what_a_plain_draw_covers(void **unused)
{
    (void)unused;
    const rend_camera_options overview = {0};
    compare_with_raw(CORE_PLANE, &overview, NULL, 0.08);
    compare_with_raw(CORE_CLUSTERED, &overview, NULL, 0.08);
}

static void seen_from_inside_not_a_pixel_is_missing(void **unused)
{
    (void)unused;
    render_site site;
    render_site_make(CORE_UNIFORM, 999, NULL, &site);
    rend_camera_options inside = {.has_eye = true, .has_target = true};
    const mospt_metadata *m = &site.dataset->metadata;
    for (int a = 0; a < 3; a++)
        inside.eye[a] = (m->low[a] + m->high[a]) / 2, inside.target[a] = m->high[a];
    render_site_fini(&site);
    compare_with_raw(CORE_UNIFORM, &inside, NULL, 0.01);
}

static void a_clip_box_cuts_exactly(void **unused)
{
    (void)unused;
    const rend_camera_options overview = {0};
    const rend_box middle = {{0.2, 0.35, 0}, {0.6, 0.8, 0.55}},
                   half_open = {{-INFINITY, -INFINITY, 0.25}, {0.5, INFINITY, INFINITY}};
    compare_with_raw(CORE_CLUSTERED, &overview, &middle, 0.08);
    compare_with_raw(CORE_UNIFORM, &overview, &half_open, 0.08);
}

static void the_same_options_give_the_same_bytes(void **unused)
{
    (void)unused;
    render_site site;
    rend_shot_result a, b;
    render_site_make(CORE_CLUSTERED, 60000, NULL, &site);
    take(&site, "a.png", (rend_shot_options){.limits = {.budget_points = 20000}}, &a);
    take(&site, "b.png", (rend_shot_options){.limits = {.budget_points = 20000}}, &b);
    assert_same_picture(&site, "a.png", &site, "b.png");
    assert_true(a.points_drawn <= 20000 && a.points_drawn > 0 && a.points_drawn == b.points_drawn);
    render_site_fini(&site);
}

static uint8_t *read_rgb(const render_site *site, const char *name)
{
    char *path = core_path(site->folder, "%s", name);
    png_image image = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&image, path));
    image.format = PNG_FORMAT_RGB;
    uint8_t *rgb = malloc(PNG_IMAGE_SIZE(image));
    assert_true(png_image_finish_read(&image, NULL, rgb, 0, NULL));
    free(path);
    return rgb;
}

/* The eye in the middle of one of many rooms. */
static rend_camera_options inside_of_a_room(const render_site *site)
{
    const mospt_metadata *m = &site->dataset->metadata;
    rend_camera_options camera = {.has_eye = true, .has_target = true};
    for (int a = 0; a < 3; a++)
        camera.eye[a] = m->low[a] + (a < 2 ? 20 : 4), camera.target[a] = camera.eye[a];
    camera.target[0] += 10, camera.target[1] += 4;
    return camera;
}

static void what_is_hidden_does_not_show_and_is_not_drawn(void **unused)
{
    (void)unused;
    render_site site;
    rend_shot_result all, seen;
    uint32_t differ = 0;
    render_rooms_make(3000000, &site);
    rend_shot_options o = {.camera = inside_of_a_room(&site)};
    take(&site, "seen.png", o, &seen);
    o.limits.no_occlusion = true;
    take(&site, "all.png", o, &all);
    assert_int_equal(all.nodes_hidden, 0);
    assert_true(seen.nodes_hidden > 10 && seen.points_hidden > 1000);
    assert_true(seen.points_drawn < all.points_drawn * 4 / 10);
    uint8_t *a = read_rgb(&site, "seen.png"), *b = read_rgb(&site, "all.png");
    for (size_t i = 0; i < PIXELS; i++)
        for (size_t c = 0, done = 0; c < 3 && !done; c++)
            if (abs(a[3 * i + c] - b[3 * i + c]) > 2) differ++, done = 1;
    assert_true(differ <= PIXELS / 50); /* seen through the gaps of walls made of random points */
    o.limits = (rend_limits){.gpu_cache_bytes = 1, .ram_cache_bytes = 1};
    take(&site, "small.png", o, &all);
    assert_int_equal(all.points_drawn, seen.points_drawn);
    assert_same_picture(&site, "seen.png", &site, "small.png");
    free(a);
    free(b);
    render_site_fini(&site);
}

/* Walls of points so far apart that the rooms behind are seen through them. */
static void what_is_seen_between_points_is_not_hidden(void **unused)
{
    (void)unused;
    render_site site;
    rend_shot_result all, seen;
    uint8_t *with = malloc(PIXELS), *without = malloc(PIXELS);
    uint32_t covered = 0, gone = 0;
    render_rooms_make(800000, &site);
    rend_shot_options o = {.look = MASK, .camera = inside_of_a_room(&site)};
    take(&site, "seen.png", o, &seen);
    o.limits.no_occlusion = true;
    take(&site, "all.png", o, &all);
    covered_pixels(&site, "seen.png", with);
    covered_pixels(&site, "all.png", without);
    for (size_t i = 0; i < PIXELS; i++)
        covered += without[i], gone += without[i] > with[i];
    assert_true(all.points_drawn > 200000 && covered > PIXELS / 4 && covered < PIXELS);
    assert_true(gone <= covered / 20); /* of random points; two fifths if walls were closed */
    free(with);
    free(without);
    render_site_fini(&site);
}

static void cache_sizes_do_not_show(void **unused)
{
    (void)unused;
    render_site site;
    rend_shot_result all, paged;
    render_site_make(CORE_CLUSTERED, 60000, NULL, &site);
    take(&site, "a.png", (rend_shot_options){.path = NULL}, &all);
    take(&site, "b.png",
         (rend_shot_options){.limits = {.ram_cache_bytes = 1, .gpu_cache_bytes = 1}}, &paged);
    assert_same_picture(&site, "a.png", &site, "b.png");
    assert_int_equal(all.points_drawn, paged.points_drawn);
    for (int shape = 0; shape < REND_SHAPE_COUNT; shape++) { /* every point drawn twice */
        const rend_look look = {.blend_slab = 0.02f, .shape = (rend_shape)shape, .fill_px = 2};
        take(&site, "a.png", (rend_shot_options){.look = look}, &all);
        take(&site, "b.png",
             (rend_shot_options){.look = look,
                                 .limits = {.ram_cache_bytes = 1, .gpu_cache_bytes = 1}},
             &paged);
        assert_same_picture(&site, "a.png", &site, "b.png");
        assert_int_equal(all.points_drawn, paged.points_drawn);
    }
    render_site_fini(&site);
}

static void a_site_does_not_shake_at_utm_coordinates(void **unused)
{
    (void)unused;
    render_site here, there;
    rend_shot_result result;
    mospt_grid grid = {0};
    render_site_make(CORE_CLUSTERED, 60000, NULL, &here);
    grid = here.dataset->metadata.grid;
    const int64_t shift[3] = {(int64_t)(500000 / grid.step), (int64_t)(5400000 / grid.step), 0};
    render_site_make(CORE_CLUSTERED, 60000, shift, &there);
    take(&here, "here.png", (rend_shot_options){.path = NULL}, &result);
    take(&there, "there.png", (rend_shot_options){.path = NULL}, &result);
    assert_same_picture(&here, "here.png", &there, "there.png");
    rend_shot_options inside = {.camera = {.has_eye = true, .has_target = true}};
    const mospt_metadata *m = &here.dataset->metadata;
    for (int a = 0; a < 3; a++)
        inside.camera.eye[a] = (m->low[a] + m->high[a]) / 2, inside.camera.target[a] = m->high[a];
    take(&here, "here.png", inside, &result);
    for (int a = 0; a < 3; a++)
        inside.camera.eye[a] += (double)shift[a] * grid.step,
            inside.camera.target[a] += (double)shift[a] * grid.step;
    take(&there, "there.png", inside, &result);
    assert_same_picture(&here, "here.png", &there, "there.png");
    render_site_fini(&here);
    render_site_fini(&there);
}

static void every_look_can_be_drawn(void **unused)
{
    (void)unused;
    render_site site;
    rend_shot_result result;
    rend_choice choices[REND_CHOICES_MAX];
    render_site_make(CORE_CLUSTERED, 5000, NULL, &site);
    uint32_t count = rend_choice_list(&site.dataset->metadata, choices);
    for (uint32_t c = 0; c < count; c++)
        for (int mode = REND_SIZE_AUTO; mode <= REND_SIZE_WORLD; mode++) {
            rend_look look = {.size_mode = (rend_size_mode)mode, .point_px = 5};
            rend_choice_use(&choices[c], &look);
            look.point_m = 3 * (float)site.dataset->metadata.grid.step,
            look.no_edl = mode == REND_SIZE_FIXED;
            for (int s = 0; s < 4 * REND_SHAPE_COUNT; s++) {
                look.shape = (rend_shape)(s / 4);
                look.blend_slab = s & 1 ? 0.01f : 0;
                look.fill_px = s & 2 ? 1 : 0;
                take(&site, "a.png", (rend_shot_options){.look = look, .width = 37, .height = 23},
                     &result);
                assert_true(result.points_drawn > 0);
            }
        }
    render_site_fini(&site);
}

static void one_point_and_copies_of_it_can_be_drawn(void **unused)
{
    (void)unused;
    const core_kind kinds[] = {CORE_UNIFORM, CORE_IDENTICAL, CORE_LINE};
    const uint32_t counts[] = {1, 1000, 1000};
    for (int i = 0; i < 3; i++) {
        render_site site;
        rend_shot_result result;
        uint8_t *covered = malloc(PIXELS);
        uint32_t sum = 0;
        render_site_make(kinds[i], counts[i], NULL, &site);
        take(&site, "a.png", (rend_shot_options){.look = MASK}, &result);
        covered_pixels(&site, "a.png", covered);
        for (size_t p = 0; p < PIXELS; p++)
            sum += covered[p];
        assert_true(sum >= 1);
        free(covered);
        render_site_fini(&site);
    }
}

static void what_cannot_be_drawn_is_an_error_and_no_file(void **unused)
{
    (void)unused;
    render_site site;
    mospt_err err = {0};
    render_site_make(CORE_CLUSTERED, 2000, NULL, &site);
    char *path = core_path(site.folder, "a.png"),
         *nowhere = core_path(site.folder, "no/such/a.png");
    uint32_t before = core_entries(site.folder);
    CORE_FAILS(
        rend_shot(site.dataset, &(rend_shot_options){.path = path, .width = 1 << 20}, NULL, &err),
        MOSPT_EINVAL);
    CORE_FAILS(rend_shot(site.dataset, &(rend_shot_options){.path = nowhere}, NULL, &err),
               MOSPT_EIO);
    assert_int_equal(core_entries(site.folder), before);
    free(path);
    free(nowhere);
    render_site_fini(&site);
}

static void damage_is_told_and_drawn_around(void **unused)
{
    (void)unused;
    render_site site;
    rend_shot_result result;
    render_site_make(CORE_CLUSTERED, 60000, NULL, &site);
    render_site_damage(&site, 2);
    take(&site, "a.png", (rend_shot_options){.path = NULL}, &result);
    assert_int_equal(result.damaged_nodes, 1);
    assert_int_equal(result.damage.code, MOSPT_EFORMAT);
    render_site_fini(&site);
}

int main(int argc, char **argv)
{
    renderer = argc > 1 && strcmp(argv[1], "gl") == 0 ? REND_RENDERER_GL : REND_RENDERER_CPU;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_points_cover_what_a_plain_draw_covers),
        cmocka_unit_test(seen_from_inside_not_a_pixel_is_missing),
        cmocka_unit_test(a_clip_box_cuts_exactly),
        cmocka_unit_test(the_same_options_give_the_same_bytes),
        cmocka_unit_test(what_is_hidden_does_not_show_and_is_not_drawn),
        cmocka_unit_test(what_is_seen_between_points_is_not_hidden),
        cmocka_unit_test(cache_sizes_do_not_show),
        cmocka_unit_test(a_site_does_not_shake_at_utm_coordinates),
        cmocka_unit_test(every_look_can_be_drawn),
        cmocka_unit_test(one_point_and_copies_of_it_can_be_drawn),
        cmocka_unit_test(what_cannot_be_drawn_is_an_error_and_no_file),
        cmocka_unit_test(damage_is_told_and_drawn_around),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
