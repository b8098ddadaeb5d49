#include "render/look.h"
#include "render/clip.h"
#include "render/scheme.h"
#include "tests/core_tools.h"

#include <math.h>
#include <string.h>

/* It has a scan and a tag for each point, and a normal; of this, no more is looked at. */
static mospt_dataset dataset;
static rend_choice choices[REND_CHOICES_MAX];
static uint32_t choice_count;

static int list_choices(void **unused)
{
    (void)unused;
    mospt_schema *schema = &dataset.metadata.schema;
    mospt_err err = {0};
    CORE_NEED(mospt_schema_add(schema, "scan", MOSPT_U16, 1, &err));
    CORE_NEED(mospt_schema_add(schema, "tag", MOSPT_U32, 1, &err));
    CORE_NEED(mospt_schema_add(schema, "normal", MOSPT_F32, 3, &err));
    choice_count = rend_choice_list(&dataset.metadata, choices);
    assert_int_equal(choice_count, 6); /* rgb, elevation, scan, density, tag, normal */
    return 0;
}

static bool press_colour(rend_look *look, int key, bool shift)
{
    return rend_look_press_colour(look, key, shift, choices, choice_count);
}

static void points_grow_and_shrink_by_a_pixel_within_limits(void **unused)
{
    (void)unused;
    rend_look look = {0};
    assert_true(rend_look_press(&look, '+', false));
    assert_true(look.size_mode == REND_SIZE_FIXED && look.point_px == 2);
    assert_true(rend_look_press(&look, '-', false) && look.point_px == 1);
    assert_true(rend_look_press(&look, '-', false) && look.point_px == 1);
    for (int i = 0; i < 100; i++)
        rend_look_press(&look, '+', false);
    assert_true(look.point_px == 32);
    assert_true(rend_look_press(&look, '0', false) && look.size_mode == REND_SIZE_AUTO);
    rend_look_press(&look, '-', false); /* the smallest there are, whatever they were before */
    assert_true(look.size_mode == REND_SIZE_FIXED && look.point_px == 1);
}

static void a_key_that_means_nothing_changes_nothing(void **unused)
{
    (void)unused;
    const rend_look before = {.colour = REND_COLOUR_SCAN, .brightness = 2, .has_range = true};
    rend_look look = before;
    assert_false(rend_look_press(&look, 'X', true) || press_colour(&look, 'X', true));
    assert_false(rend_look_press(&look, 'C', false) || press_colour(&look, '+', false));
    assert_false(press_colour(&look, '0', false));
    assert_memory_equal(&look, &before, sizeof look);
    assert_true(rend_look_press(&look, 'L', false) && look.no_edl); /* of shading */
}

static void colours_are_chosen_by_number_and_one_by_one(void **unused)
{
    (void)unused;
    rend_look look = {.has_range = true, .map = REND_MAP_TURBO};
    for (int key = '1'; key <= '9'; key++) {
        look.has_range = true, look.map = REND_MAP_TURBO;
        assert_true(press_colour(&look, key, false));
        assert_int_equal(look.colour, key - '1');
        assert_true(!look.has_range && look.map == REND_MAP_USUAL);
    }
    look.colour = REND_COLOUR_RGB;
    assert_true(press_colour(&look, 'C', true)); /* backwards, to the last */
    assert_true(look.colour == REND_COLOUR_ATTRIBUTE);
    assert_string_equal(look.attribute, "normal");
    press_colour(&look, 'C', true);
    assert_string_equal(look.attribute, "tag");
    press_colour(&look, 'C', false), press_colour(&look, 'C', false);
    assert_int_equal(look.colour, REND_COLOUR_RGB);
}

/* From the one that is shown, through all, and round again: none is "usual". */
static void maps_go_round(void **unused)
{
    (void)unused;
    const rend_colour colours[] = {REND_COLOUR_ELEVATION, REND_COLOUR_INTENSITY};
    for (int i = 0; i < 2; i++) {
        rend_look look = {.colour = colours[i]};
        rend_map first = rend_choice_map(&look);
        bool seen[REND_MAP_COUNT] = {false};
        for (int k = 1; k < REND_MAP_COUNT; k++) {
            assert_true(press_colour(&look, 'M', false));
            assert_false(look.map == REND_MAP_USUAL || seen[look.map]);
            seen[look.map] = true;
        }
        assert_int_equal(look.map, first);
    }
}

static void brightness_goes_up_and_down_again(void **unused)
{
    (void)unused;
    rend_look look = {0};
    assert_true(press_colour(&look, '.', false) && look.brightness == 1.25);
    assert_true(press_colour(&look, ',', false) && look.brightness == 1);
    assert_true(press_colour(&look, ',', false) && look.brightness == 0.8);
}

static void a_cut_takes_away_what_is_in_front(void **unused)
{
    (void)unused;
    rend_look look = {.clip = {.low = {5, 5, 5}, .high = {6, 6, 6}}}; /* of a clip that is off */
    const rend_camera north = {.eye = {0, -9, 1}, .up = {0, 0, 1}, .fov_rad = 1};
    const rend_camera down = {.eye = {0, 1, 9}, .up = {0, 0, 1}, .fov_rad = 1};
    const double place[3] = {1, 2, 3};
    rend_look_cut(&look, &north, place);
    rend_box wanted = rend_clip_open();
    wanted.low[1] = 2;
    assert_true(look.has_clip);
    assert_memory_equal(&look.clip, &wanted, sizeof wanted);
    rend_look_cut(&look, &down, place); /* the first cut stays */
    wanted.high[2] = 3;
    assert_memory_equal(&look.clip, &wanted, sizeof wanted);
    rend_look_cut(&look, &north, NULL);
    assert_false(look.has_clip);
}

static void a_keyframe_keeps_what_has_changed(void **unused)
{
    (void)unused;
    const rend_look opening = {
        .colour = REND_COLOUR_SCAN, .has_clip = true, .clip.high = {1, 1, 1}};
    const rend_box open = rend_clip_open();
    rend_look look = opening;
    rend_key key = {0};
    look.point_px = 3; /* is no business of a keyframe */
    rend_look_keep(&look, &opening, &key);
    assert_true(key.colour[0] == '\0' && !key.has_clip);
    rend_choice_read("tag:1", &look);
    look.clip.high[2] = 4;
    rend_look_keep(&look, &opening, &key);
    assert_string_equal(key.colour, "tag:1");
    assert_true(key.has_clip && key.clip.high[2] == 4 && key.clip.high[1] == 1);
    look.colour = REND_COLOUR_DENSITY, look.has_clip = false;
    rend_look_keep(&look, &opening, &key);
    assert_string_equal(key.colour, "density");
    assert_true(key.has_clip);
    assert_memory_equal(&key.clip, &open, sizeof open); /* nothing is cut away any more */
}

static void recall(rend_look *look, const rend_look *opening, const char *colour,
                   const rend_box *clip)
{
    rend_look_recall(look, opening, colour, clip, &dataset);
}

static void a_moment_is_seen_as_it_was_kept(void **unused)
{
    (void)unused;
    static const char *const names[] = {"rgb", "elevation", "scan",     "density",
                                        "tag", "normal",    "normal:1", "normal:3"};
    const rend_look opening = {.colour = REND_COLOUR_ELEVATION};
    for (int i = 0; i < 8; i++) {
        rend_look kept = opening, look = {.colour = REND_COLOUR_RGB};
        rend_key key = {0};
        rend_choice_read(names[i], &kept);
        kept.has_clip = true, kept.clip.low[0] = i, kept.clip.high[0] = 9;
        rend_look_keep(&kept, &opening, &key);
        assert_true((key.colour[0] == '\0') == (i == 1));
        recall(&look, &opening, key.colour, key.has_clip ? &key.clip : NULL);
        if (i == 1) assert_int_equal(look.colour, REND_COLOUR_RGB); /* it does not say */
        else assert_true(rend_choice_same(&look, &kept));
        assert_true(look.has_clip);
        assert_memory_equal(&look.clip, &kept.clip, sizeof look.clip);
    }
}

static void
a_moment_that_says_nothing_has_the_colours_of_before_and_the_clip_of_the_opening(void **unused)
{
    (void)unused;
    for (int has_clip = 0; has_clip < 2; has_clip++)
        for (int empty = 0; empty < 2; empty++) {
            const rend_look opening = {.has_clip = has_clip, .clip = {.high = {1, 2, 3}}};
            rend_look look = {.colour = REND_COLOUR_SCAN, .has_clip = true};
            recall(&look, &opening, empty ? "" : NULL, NULL);
            assert_int_equal(look.colour, REND_COLOUR_SCAN);
            assert_int_equal(look.has_clip, has_clip);
            if (has_clip) assert_memory_equal(&look.clip, &opening.clip, sizeof look.clip);
        }
}

static void colours_that_are_not_there_are_not_recalled(void **unused)
{
    (void)unused;
    static const char *const names[] = {"time",     "distance", "nonsense", "TAG",
                                        "normal:0", "normal:4", "normal:",  "normal:1x"};
    for (int i = 0; i < 8; i++) {
        rend_look look = {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag"}, before = look;
        recall(&look, &before, names[i], NULL);
        assert_true(rend_choice_same(&look, &before));
    }
}

/* One that stayed would keep the colours from being shown. */
static void ranges_and_maps_come_and_go_with_the_colours_that_they_were_given_with(void **unused)
{
    (void)unused;
    static const char *const others[] = {"rgb", "density", "normal", "normal:2"};
    const rend_look opening = {.colour = REND_COLOUR_ELEVATION,
                               .has_range = true,
                               .range = {1, 5},
                               .map = REND_MAP_INFERNO};
    for (int i = 0; i < 4; i++) {
        rend_look look = opening;
        mospt_err err = {0};
        look.map = REND_MAP_TURBO;
        recall(&look, &opening, "elevation", NULL); /* as it is */
        assert_true(look.has_range && look.map == REND_MAP_TURBO);
        recall(&look, &opening, others[i], NULL);
        assert_string_equal(rend_choice_shown(&look), others[i]);
        assert_true(!look.has_range && look.map == REND_MAP_USUAL);
        CORE_NEED(rend_scheme_fits(&dataset, &look, &err));
        look.has_range = true, look.range[1] = 7;
        recall(&look, &opening, "elevation", NULL);
        assert_true(rend_scheme_same(&look, &opening));
    }
}

static void another_dataset_gets_a_look_that_it_can_show(void **unused)
{
    (void)unused;
    static mospt_dataset moved, bare; /* the same attributes elsewhere; none */
    const rend_look looks[] = {
        {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag", .has_range = true, .range = {1, 2}},
        {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "normal:3", .map = REND_MAP_TURBO},
        {.colour = REND_COLOUR_SCAN},
    };
    mospt_schema *schema = &moved.metadata.schema;
    mospt_err err = {0};
    CORE_NEED(mospt_schema_add(schema, "normal", MOSPT_F32, 3, &err));
    CORE_NEED(mospt_schema_add(schema, "mark", MOSPT_U8, 1, &err));
    CORE_NEED(mospt_schema_add(schema, "tag", MOSPT_U64, 1, &err));
    CORE_NEED(mospt_schema_add(schema, "scan", MOSPT_U16, 1, &err));
    for (int i = 0; i < 3; i++) {
        rend_look look = looks[i];
        rend_look_fit(&look, &moved);
        assert_true(rend_scheme_same(&look, &looks[i]));
        rend_look_fit(&look, &bare);
        assert_int_equal(look.colour, REND_COLOUR_RGB);
        CORE_NEED(rend_scheme_fits(&bare, &look, &err));
    }
}

static void a_look_is_told_in_words(void **unused)
{
    (void)unused;
    char text[96], little[6];
    rend_look look = {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag", .no_edl = true};
    rend_look_text(&look, text, sizeof text);
    assert_string_equal(text, "tag  no lighting");
    look.colour = REND_COLOUR_RGB, look.size_mode = REND_SIZE_FIXED, look.no_edl = false;
    rend_look_text(&look, text, sizeof text);
    assert_string_equal(text, "rgb  1 px  ");
    look.point_px = 2.5f;
    rend_look_text(&look, text, sizeof text);
    assert_string_equal(text, "rgb  2.5 px  ");
    rend_look_text(&look, little, sizeof little);
    assert_string_equal(little, "rgb  ");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_grow_and_shrink_by_a_pixel_within_limits),
        cmocka_unit_test(a_key_that_means_nothing_changes_nothing),
        cmocka_unit_test(colours_are_chosen_by_number_and_one_by_one),
        cmocka_unit_test(maps_go_round),
        cmocka_unit_test(brightness_goes_up_and_down_again),
        cmocka_unit_test(a_cut_takes_away_what_is_in_front),
        cmocka_unit_test(a_keyframe_keeps_what_has_changed),
        cmocka_unit_test(a_moment_is_seen_as_it_was_kept),
        cmocka_unit_test(
            a_moment_that_says_nothing_has_the_colours_of_before_and_the_clip_of_the_opening),
        cmocka_unit_test(colours_that_are_not_there_are_not_recalled),
        cmocka_unit_test(ranges_and_maps_come_and_go_with_the_colours_that_they_were_given_with),
        cmocka_unit_test(another_dataset_gets_a_look_that_it_can_show),
        cmocka_unit_test(a_look_is_told_in_words),
    };
    return cmocka_run_group_tests(tests, list_choices, NULL);
}
