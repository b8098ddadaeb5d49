/* A window, run where there is a display (CI: Xvfb). */
#include "render/gl/window.h"
#include "render/view.h"
#include "tests/render_tools.h"

#include <png.h>
#include <stdlib.h>

enum { SHOWN_WIDTH = 640, SHOWN_HEIGHT = 400 };

static void a_window_shows_the_dataset_and_a_line_of_figures(void **unused)
{
    (void)unused;
    render_site site;
    rend_view_result result;
    mospt_err err = {0};
    render_site_make(CORE_CLUSTERED, 60000, NULL, &site);
    char *path = core_path(site.folder, "window.png");
    const rend_view_options options = {
        .frames = 30, .width = 640, .height = 400, .screenshot = path, .help = true};
    CORE_NEED(rend_view(site.dataset, &options, &result, &err));
    assert_int_equal(result.frames, 30);
    png_image image = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&image, path));
    image.format = PNG_FORMAT_RGB;
    uint8_t *rgb = malloc(PNG_IMAGE_SIZE(image));
    assert_true(png_image_finish_read(&image, NULL, rgb, 0, NULL));
    uint32_t white = 0; /* of the words in the first lines */
    for (size_t i = 0; i < (size_t)image.width * 24; i++)
        white += rgb[3 * i] > 230 && rgb[3 * i + 2] > 230;
    assert_true(white > 50);
    free(rgb);
    free(path);
    render_site_fini(&site);
}

/* The window's picture, without the lines of words at its top. */
static void show(const render_site *site, rend_renderer renderer, uint64_t reset_at, uint8_t *rgb)
{
    rend_view_result result;
    mospt_err err = {0};
    char *path = core_path(site->folder, "reset.png");
    const rend_view_options options = {.frames = 40,
                                       .width = SHOWN_WIDTH,
                                       .height = SHOWN_HEIGHT,
                                       .screenshot = path,
                                       .reset_at = reset_at,
                                       .engine = {.renderer = renderer}};
    CORE_NEED(rend_view(site->dataset, &options, &result, &err));
    assert_int_equal(result.frames, 40);
    assert_int_equal(result.resets, reset_at > 0);
    assert_int_equal(result.no_words.code, MOSPT_OK);
    png_image image = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&image, path));
    image.format = PNG_FORMAT_RGB;
    assert_true(image.width == SHOWN_WIDTH && image.height == SHOWN_HEIGHT);
    assert_true(png_image_finish_read(&image, NULL, rgb, 0, NULL));
    free(path);
}

static void a_window_goes_on_in_another_context(void **unused)
{
    (void)unused;
    enum { SIZE = 3 * SHOWN_WIDTH * SHOWN_HEIGHT, WORDS = 3 * SHOWN_WIDTH * 70 };
    render_site site;
    uint8_t *before = malloc(SIZE), *after = malloc(SIZE);
    render_site_make(CORE_CLUSTERED, 60000, NULL, &site);
    for (int r = 0; r < 2; r++) {
        rend_renderer renderer = r == 0 ? REND_RENDERER_GL : REND_RENDERER_CPU;
        show(&site, renderer, 0, before);
        show(&site, renderer, 20, after);
        assert_memory_equal(before + WORDS, after + WORDS, SIZE - WORDS);
        uint32_t white = 0; /* words are there again */
        for (size_t i = 0; i < 3 * SHOWN_WIDTH * 24; i += 3)
            white += after[i] > 230 && after[i + 2] > 230;
        assert_true(white > 50);
    }
    free(before), free(after);
    render_site_fini(&site);
}

/* What happens to the dataset behind the window, as it asks whether to stop: replaced, then
 * deleted. */
static struct {
    const char *path, *next;
    double start;
    uint32_t step;
} behind;

static void move_aside(void)
{
    char *aside = core_path(behind.path, "../aside%u", behind.step++);
    assert_int_equal(rename(behind.path, aside), 0);
    free(aside);
}

static bool change_behind(void)
{
    double now = rgl_window_seconds();
    if (behind.step == 0) behind.start = now, behind.step = 1;
    if (behind.step == 1 && now > behind.start + 1.2) {
        move_aside();
        assert_int_equal(rename(behind.next, behind.path), 0);
    }
    if (behind.step == 2 && now > behind.start + 3) move_aside();
    return now > behind.start + 4.5;
}

static void a_window_goes_on_with_what_its_dataset_becomes(void **unused)
{
    (void)unused;
    render_site few, more;
    rend_view_result result;
    mospt_err err = {0};
    render_site_make(CORE_CLUSTERED, 30000, NULL, &few);
    render_more_make(30000, &more);
    const rend_view_options options = {.width = 640, .height = 400, .should_stop = change_behind};
    behind.path = few.path, behind.next = more.path;
    CORE_NEED(rend_view(few.dataset, &options, &result, &err));
    assert_int_equal(behind.step, 3);
    assert_int_equal(result.swaps, 1);
    assert_int_equal(result.damaged_nodes, 0);
    render_site_fini(&few);
    render_site_fini(&more);
}

static void damage_is_counted_and_the_rest_is_shown(void **unused)
{
    (void)unused;
    render_site site;
    rend_view_result result;
    mospt_err err = {0};
    render_site_make(CORE_CLUSTERED, 60000, NULL, &site);
    render_site_damage(&site, 1);
    const rend_view_options options = {.frames = 30, .width = 640, .height = 400};
    CORE_NEED(rend_view(site.dataset, &options, &result, &err));
    assert_int_equal(result.frames, 30);
    assert_int_equal(result.damaged_nodes, 1);
    assert_int_equal(result.damage.code, MOSPT_EFORMAT);
    render_site_fini(&site);
}

static void without_a_display_one_sentence_says_so(void **unused)
{
    (void)unused;
    render_site site;
    mospt_err err = {0};
    const rend_view_options options = {.frames = 1};
    render_site_make(CORE_CLUSTERED, 1000, NULL, &site);
    unsetenv("DISPLAY");
    unsetenv("WAYLAND_DISPLAY");
    CORE_FAILS(rend_view(site.dataset, &options, NULL, &err), MOSPT_EINVAL);
    render_site_fini(&site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_window_shows_the_dataset_and_a_line_of_figures),
        cmocka_unit_test(a_window_goes_on_with_what_its_dataset_becomes),
        cmocka_unit_test(a_window_goes_on_in_another_context),
        cmocka_unit_test(damage_is_counted_and_the_rest_is_shown),
        cmocka_unit_test(without_a_display_one_sentence_says_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
