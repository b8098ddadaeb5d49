#include "render/scheme.h"
#include "render/sample.h"
#include "tests/render_tools.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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

/* The site's attribute "tag" goes by another name, for as long as a test runs. */
static void rename_tag(const char *name)
{
    mospt_attribute *tag = &site.dataset->metadata.schema.at[1];
    memset(tag->name, 0, sizeof tag->name);
    memcpy(tag->name, name, strlen(name));
}

static void make(const rend_look *look, rend_paint *paint, rend_legend *legend)
{
    mospt_err err = {0};
    rend_scheme *s = rend_scheme_create(site.dataset);
    CORE_NEED(rend_scheme_make(s, look, paint, legend, &err));
    rend_scheme_destroy(s);
}

/* The slow way: values of the nodes of the levels that are sampled, sorted by insertion. */
static uint32_t slow_values(const rend_paint *paint, double **out)
{
    const mospt_hierarchy *h = &site.dataset->hierarchy;
    mospt_err err = {0};
    uint32_t count = 0;
    double *values = malloc((h->point_count + 1) * sizeof *values);
    for (uint32_t level = 0; level < 64; level++) {
        uint64_t up_to = 0;
        for (uint32_t n = 0; n < h->count; n++)
            if (h->nodes[n].level <= level) up_to += h->nodes[n].count;
        if (level > 0 && up_to > REND_SAMPLE_POINTS) break;
        for (uint32_t n = 0; n < h->count; n++) {
            if (h->nodes[n].level != level) continue;
            mospt_vertex *v = malloc(mospt_dataset_vertices_size(site.dataset, n) + 1);
            uint8_t *planes =
                malloc(h->nodes[n].count * site.dataset->metadata.schema.row_size + 1);
            CORE_NEED(mospt_dataset_read_vertices(site.dataset, n, v, &err));
            CORE_NEED(mospt_dataset_read_attributes(site.dataset, n, v, planes, &err));
            for (uint32_t i = 0; i < h->nodes[n].count; i++)
                values[count++] = rend_paint_value(paint, n, v, planes, i);
            free(v);
            free(planes);
        }
    }
    *out = values;
    return count;
}

static uint32_t count_below(const double *values, uint32_t count, double limit)
{
    uint32_t below = 0;
    for (uint32_t i = 0; i < count; i++)
        below += values[i] < limit;
    return below;
}

static void a_range_leaves_out_a_hundredth_at_each_end(void **unused)
{
    (void)unused;
    const rend_look looks[] = {{.colour = REND_COLOUR_ELEVATION},
                               {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag"}};
    for (int i = 0; i < 2; i++) {
        rend_paint paint;
        rend_legend legend;
        double *values;
        make(&looks[i], &paint, &legend);
        uint32_t count = slow_values(&paint, &values);
        uint32_t below = count_below(values, count, paint.low);
        uint32_t up_to = count_below(values, count, nextafter(paint.high, INFINITY));
        assert_true(count > 1000 && paint.low < paint.high);
        assert_true(below <= count / 100 && count - up_to <= count / 100);
        assert_true(count_below(values, count, nextafter(paint.low, INFINITY)) > count / 100);
        assert_true(legend.has_bar && legend.ticks[0][0] != '\0' && legend.row_count == 0);
        free(values);
    }
}

static void a_range_that_is_given_is_taken(void **unused)
{
    (void)unused;
    rend_paint paint;
    rend_legend legend;
    const rend_look look = {.colour = REND_COLOUR_ATTRIBUTE,
                            .attribute = "tag",
                            .has_range = true,
                            .range = {-2, 6},
                            .map = REND_MAP_DIVERGING};
    make(&look, &paint, &legend);
    assert_true(paint.low == -2 && paint.high == 6 && !paint.classes);
    const char *ticks[] = {"-2.0", "0.0", "2.0", "4.0", "6.0"};
    for (int t = 0; t < REND_LEGEND_TICKS; t++)
        assert_string_equal(legend.ticks[t], ticks[t]);
    assert_string_equal(legend.title, "tag");
    rend_ramp map;
    rend_ramp_fill(REND_MAP_DIVERGING, &map);
    assert_memory_equal(&paint.ramp, &map, sizeof map);
    assert_memory_equal(&legend.ramp, &map, sizeof map);
}

static void scans_are_listed_by_name(void **unused)
{
    (void)unused;
    rend_paint paint;
    rend_legend legend;
    make(&(rend_look){.colour = REND_COLOUR_SCAN}, &paint, &legend);
    assert_true(paint.classes && !legend.has_bar);
    assert_int_equal(legend.row_count, 2);
    assert_string_equal(legend.rows[0].words, "a.las");
    assert_string_equal(legend.rows[1].words, "b/c.ply");
    for (int s = 0; s < 2; s++)
        assert_memory_equal(legend.rows[s].rgb, rend_paint_colour(&paint, s), 3);
}

/* "scan" read as a class: the values 0 and 1, and their names. */
static void classes_are_those_that_occur(void **unused)
{
    (void)unused;
    rend_paint paint;
    rend_legend legend;
    mospt_schema *schema = &site.dataset->metadata.schema;
    memcpy(schema->at[0].name, "classification", 15);
    make(&(rend_look){.colour = REND_COLOUR_CLASSIFICATION}, &paint, &legend);
    assert_int_equal(legend.row_count, 2);
    assert_string_equal(legend.rows[0].words, "0  never classified");
    assert_string_equal(legend.rows[1].words, "1  unclassified");
    memcpy(schema->at[0].name, "channel", 8); /* an attribute of few integers */
    make(&(rend_look){.colour = REND_COLOUR_ATTRIBUTE, .attribute = "channel"}, &paint, &legend);
    assert_true(paint.classes);
    assert_int_equal(legend.row_count, 2);
    assert_string_equal(legend.rows[1].words, "1");
    memset(schema->at[0].name, 0, sizeof schema->at[0].name);
    memcpy(schema->at[0].name, "scan", 5);
}

static void time_is_relative_in_a_unit_that_suits_it(void **unused)
{
    (void)unused;
    rend_paint paint;
    rend_legend legend;
    const struct {
        double seconds;
        const char *title, *last;
    } cases[] = {{10, "Time since 1000.000, s", "10.0"},
                 {600, "Time since 1000.000, min", "10.0"},
                 {36000, "Time since 1000.000, h", "10.0"},
                 {864000, "Time since 1000.000, days", "10.0"}};
    rename_tag("gps_time");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const rend_look look = {.colour = REND_COLOUR_TIME,
                                .has_range = true,
                                .range = {1000, 1000 + cases[i].seconds}};
        make(&look, &paint, &legend);
        assert_string_equal(legend.title, cases[i].title);
        assert_string_equal(legend.ticks[REND_LEGEND_TICKS - 1], cases[i].last);
    }
    rename_tag("tag");
}

static void density_is_listed_by_spacing(void **unused)
{
    (void)unused;
    rend_paint paint;
    rend_legend legend;
    make(&(rend_look){.colour = REND_COLOUR_DENSITY}, &paint, &legend);
    assert_true(paint.classes && legend.row_count > 1 && legend.row_count < 20);
    assert_non_null(strstr(legend.rows[0].words, " and wider"));
    assert_non_null(strstr(legend.rows[legend.row_count - 1].words, " and closer"));
}

static void what_is_not_there_is_an_error_that_names_what_is(void **unused)
{
    (void)unused;
    mospt_err err = {0};
    rend_paint paint;
    rend_legend legend;
    rend_scheme *s = rend_scheme_create(site.dataset);
    const rend_look looks[] = {
        {.colour = REND_COLOUR_INTENSITY},
        {.colour = REND_COLOUR_CLASSIFICATION},
        {.colour = REND_COLOUR_RETURN},
        {.colour = REND_COLOUR_TIME},
        {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "reflectance"},
        {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag:2"},
        {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag:"},
        {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag:0"},
        {.colour = REND_COLOUR_ATTRIBUTE, .attribute = ""},
    };
    for (size_t i = 0; i < sizeof looks / sizeof *looks; i++) {
        CORE_FAILS(rend_scheme_fits(site.dataset, &looks[i], &err), MOSPT_EINVAL);
        assert_non_null(strstr(err.message, "rgb, elevation, scan, density, tag"));
        CORE_FAILS(rend_scheme_make(s, &looks[i], &paint, &legend, &err), MOSPT_EINVAL);
    }
    CORE_FAILS(rend_scheme_fits(site.dataset, &(rend_look){.colour = REND_COLOUR_DISTANCE}, &err),
               MOSPT_EINVAL);
    assert_non_null(strstr(err.message, "no scan says where its scanner stood"));
    assert_true(rend_scheme_fits(
        site.dataset, &(rend_look){.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag:1"}, &err));
    rend_scheme_destroy(s);
}

static void ranges_and_maps_are_for_values(void **unused)
{
    (void)unused;
    mospt_err err = {0};
    const rend_look looks[] = {
        {.has_range = true, .range = {0, 1}},
        {.map = REND_MAP_TURBO},
        {.colour = REND_COLOUR_SCAN, .has_range = true, .range = {0, 1}},
        {.colour = REND_COLOUR_SCAN, .map = REND_MAP_TURBO},
        {.colour = REND_COLOUR_DENSITY, .has_range = true, .range = {0, 1}},
        {.colour = REND_COLOUR_ELEVATION, .has_range = true, .range = {1, 1}},
        {.colour = REND_COLOUR_ELEVATION, .has_range = true, .range = {NAN, 1}},
    };
    for (size_t i = 0; i < sizeof looks / sizeof *looks; i++)
        CORE_FAILS(rend_scheme_fits(site.dataset, &looks[i], &err), MOSPT_EINVAL);
    const rend_look fine = {.colour = REND_COLOUR_DENSITY, .map = REND_MAP_TURBO};
    CORE_NEED(rend_scheme_fits(site.dataset, &fine, &err));
}

static void stepping_goes_through_all_that_is_offered_and_back(void **unused)
{
    (void)unused;
    rend_choice choices[REND_CHOICES_MAX];
    mospt_err err = {0};
    uint32_t count = rend_choice_list(&site.dataset->metadata, choices);
    assert_int_equal(count, 5); /* rgb, elevation, scan, density, tag */
    rend_look look = {.colour = REND_COLOUR_RGB, .has_range = true};
    for (uint32_t i = 1; i <= count; i++) {
        rend_choice_step(choices, count, 1, &look);
        assert_int_equal(look.colour, choices[i % count].colour);
        assert_false(look.has_range);
        CORE_NEED(rend_scheme_fits(site.dataset, &look, &err));
    }
    /* The look keeps its attribute, whatever becomes of the list. */
    rend_choice_use(&choices[4], &look);
    memcpy(choices[4].attribute, "other", 6);
    assert_string_equal(look.attribute, "tag");
    memcpy(choices[4].attribute, "tag", 4);
    look.colour = REND_COLOUR_RGB;
    for (uint32_t i = 1; i <= count; i++) {
        rend_choice_step(choices, count, -1, &look);
        assert_int_equal(look.colour, choices[(count - i) % count].colour);
    }
    rend_choice_read("density", &look);
    assert_int_equal(look.colour, REND_COLOUR_DENSITY);
    rend_choice_read("tag", &look);
    assert_int_equal(look.colour, REND_COLOUR_ATTRIBUTE);
    assert_string_equal(look.attribute, "tag");
}

static void looks_that_paint_alike_are_the_same(void **unused)
{
    (void)unused;
    const rend_look a = {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag"};
    rend_look b = {.colour = REND_COLOUR_ATTRIBUTE, .attribute = "tag", .point_px = 9};
    assert_true(rend_scheme_same(&a, &b));
    b.map = REND_MAP_GREY;
    assert_false(rend_scheme_same(&a, &b));
    b = a, memcpy(b.attribute, "scan", 5);
    assert_false(rend_scheme_same(&a, &b));
    b = a, b.has_range = true, b.range[1] = 1;
    assert_false(rend_scheme_same(&a, &b));
    b = a, b.colour = REND_COLOUR_RGB;
    assert_false(rend_scheme_same(&a, &b));
}

static void a_legend_stays_in_its_picture(void **unused)
{
    (void)unused;
    const rgl_metrics metrics = {.advance = 8, .line = 16};
    static rend_legend legend = {.title = "Scans", .note = "grey: no value", .rows_left_out = 3};
    rgl_label labels[REND_LEGEND_LABELS_MAX];
    for (legend.row_count = 0; legend.row_count < REND_LEGEND_ROWS_MAX; legend.row_count++)
        memset(legend.rows[legend.row_count].words, 'w', sizeof legend.rows->words - 1);
    memset(legend.ticks, '8', sizeof legend.ticks);
    for (int t = 0; t < REND_LEGEND_TICKS; t++)
        legend.ticks[t][31] = '\0';
    for (int bar = 0; bar < 2; bar++) {
        legend.has_bar = bar;
        if (bar) legend.row_count = 0;
        for (uint32_t height = 200; height < 1000; height += 50) {
            uint32_t count = rend_legend_labels(&legend, &metrics, 640, height, 20, labels);
            assert_in_range(count, 4, REND_LEGEND_LABELS_MAX);
            for (uint32_t i = 0; i < count; i++) {
                bool panel = labels[i].panel_size[1] > 0;
                float bottom = labels[i].y + (panel ? labels[i].panel_size[1] : metrics.line);
                assert_true(labels[i].x >= 0 && labels[i].x < 640 && labels[i].y >= 20);
                assert_true(bottom <= (float)height);
            }
        }
    }
    legend.title[0] = '\0';
    assert_int_equal(rend_legend_labels(&legend, &metrics, 640, 480, 0, labels), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_range_leaves_out_a_hundredth_at_each_end),
        cmocka_unit_test(a_range_that_is_given_is_taken),
        cmocka_unit_test(scans_are_listed_by_name),
        cmocka_unit_test(classes_are_those_that_occur),
        cmocka_unit_test(time_is_relative_in_a_unit_that_suits_it),
        cmocka_unit_test(density_is_listed_by_spacing),
        cmocka_unit_test(what_is_not_there_is_an_error_that_names_what_is),
        cmocka_unit_test(ranges_and_maps_are_for_values),
        cmocka_unit_test(stepping_goes_through_all_that_is_offered_and_back),
        cmocka_unit_test(looks_that_paint_alike_are_the_same),
        cmocka_unit_test(a_legend_stays_in_its_picture),
    };
    return cmocka_run_group_tests(tests, make_site, remove_site);
}
