/* Colours as they end up in pictures. */
#include "render/scheme.h"
#include "render/shot.h"
#include "tests/render_tools.h"

#include <png.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 480, HEIGHT = 270, PIXELS = WIDTH * HEIGHT };

static render_site site;

static int make_site(void **unused)
{
    (void)unused;
    render_site_make(CORE_CLUSTERED, 30000, NULL, &site);
    return 0;
}

static int remove_site(void **unused)
{
    (void)unused;
    render_site_fini(&site);
    return 0;
}

/* Points of one pixel on black, without lighting: each pixel has the colour of a point. */
static rend_shot_options plain(const rend_look *look)
{
    rend_shot_options o = {.width = WIDTH, .height = HEIGHT, .look = *look};
    o.look.size_mode = REND_SIZE_FIXED, o.look.point_px = 1;
    o.look.no_edl = o.look.has_background = true;
    return o;
}

static uint8_t *take(rend_shot_options options)
{
    mospt_err err = {0};
    char *path = core_path(site.folder, "picture.png");
    png_image image = {.version = PNG_IMAGE_VERSION};
    options.path = path;
    CORE_NEED(rend_shot(site.dataset, &options, NULL, &err));
    assert_true(png_image_begin_read_from_file(&image, path));
    image.format = PNG_FORMAT_RGB;
    assert_int_equal(image.width, WIDTH);
    assert_int_equal(image.height, HEIGHT);
    uint8_t *rgb = malloc(PNG_IMAGE_SIZE(image));
    assert_true(png_image_finish_read(&image, NULL, rgb, 0, NULL));
    free(path);
    return rgb;
}

static void cache_sizes_do_not_show_in_any_colours(void **unused)
{
    (void)unused;
    rend_choice choices[REND_CHOICES_MAX];
    uint32_t count = rend_choice_list(&site.dataset->metadata, choices);
    assert_true(count > 4);
    for (uint32_t c = 0; c < count; c++) {
        rend_shot_options options = {.width = WIDTH, .height = HEIGHT, .legend = true};
        rend_choice_use(&choices[c], &options.look);
        uint8_t *all = take(options);
        options.limits = (rend_limits){.ram_cache_bytes = 1, .gpu_cache_bytes = 1};
        uint8_t *paged = take(options);
        assert_memory_equal(all, paged, 3 * PIXELS);
        free(all);
        free(paged);
    }
}

static bool is_of_legend(const rend_legend *legend, const uint8_t rgb[3])
{
    for (uint32_t r = 0; r < legend->row_count; r++)
        if (memcmp(legend->rows[r].rgb, rgb, 3) == 0) return true;
    for (int s = 0; legend->has_bar && s < REND_RAMP_STEPS; s++)
        if (memcmp(legend->ramp.rgb[s], rgb, 3) == 0) return true;
    return false;
}

static void every_pixel_has_a_colour_of_the_legend(void **unused)
{
    (void)unused;
    const rend_look looks[] = {{.colour = REND_COLOUR_SCAN},
                               {.colour = REND_COLOUR_DENSITY},
                               {.colour = REND_COLOUR_ELEVATION, .map = REND_MAP_TURBO},
                               {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag"}};
    rend_scheme *scheme = rend_scheme_create(site.dataset);
    for (size_t l = 0; l < sizeof looks / sizeof *looks; l++) {
        mospt_err err = {0};
        rend_paint paint;
        rend_legend legend;
        uint32_t covered = 0;
        CORE_NEED(rend_scheme_make(scheme, &looks[l], &paint, &legend, &err));
        uint8_t *rgb = take(plain(&looks[l]));
        for (size_t i = 0; i < PIXELS; i++) {
            const uint8_t *p = rgb + 3 * i;
            if ((p[0] | p[1] | p[2]) == 0) continue;
            covered++;
            assert_true(is_of_legend(&legend, p));
        }
        assert_true(covered > 500);
        free(rgb);
    }
    rend_scheme_destroy(scheme);
}

static void a_legend_covers_a_corner_and_nothing_else(void **unused)
{
    (void)unused;
    rend_shot_options options = plain(&(rend_look){.colour = REND_COLOUR_SCAN});
    uint8_t *without = take(options);
    options.legend = true;
    uint8_t *with = take(options);
    uint32_t changed = 0, white = 0, elsewhere = 0;
    for (size_t i = 0; i < PIXELS; i++) {
        if (memcmp(with + 3 * i, without + 3 * i, 3) == 0) continue;
        changed++;
        white += with[3 * i] > 200 && with[3 * i + 1] > 200 && with[3 * i + 2] > 200;
        elsewhere += i % WIDTH < WIDTH / 2 || i / WIDTH > HEIGHT / 2;
    }
    assert_true(changed > 1000 && white > 50);
    assert_int_equal(elsewhere, 0);
    free(without);
    free(with);
    /* RGB needs no explanation. */
    options.look.colour = REND_COLOUR_RGB;
    with = take(options);
    options.legend = false;
    without = take(options);
    assert_memory_equal(with, without, 3 * PIXELS);
    free(without);
    free(with);
}

static uint64_t sum_of(uint8_t *rgb)
{
    uint64_t sum = 0;
    for (size_t i = 0; i < 3 * PIXELS; i++)
        sum += rgb[i];
    free(rgb);
    return sum;
}

static void brightness_and_gamma_lift_rgb_alone(void **unused)
{
    (void)unused;
    const rend_look as_stored = {0}, bright = {.brightness = 1.5}, lifted = {.gamma = 2},
                    scan = {.colour = REND_COLOUR_SCAN},
                    bright_scan = {.colour = REND_COLOUR_SCAN, .brightness = 1.5, .gamma = 2};
    uint64_t stored = sum_of(take(plain(&as_stored)));
    assert_true(sum_of(take(plain(&bright))) > stored);
    assert_true(sum_of(take(plain(&lifted))) > stored);
    assert_true(sum_of(take(plain(&scan))) == sum_of(take(plain(&bright_scan))));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cache_sizes_do_not_show_in_any_colours),
        cmocka_unit_test(every_pixel_has_a_colour_of_the_legend),
        cmocka_unit_test(a_legend_covers_a_corner_and_nothing_else),
        cmocka_unit_test(brightness_and_gamma_lift_rgb_alone),
    };
    return cmocka_run_group_tests(tests, make_site, remove_site);
}
