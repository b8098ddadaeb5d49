#include "render/paint.h"
#include "tests/render_tools.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { POINTS = 500 };

/* A dataset of one node that exists in memory alone, and values of every type for its points. */
typedef struct {
    mospt_dataset dataset;
    mospt_node node;
    mospt_vertex vertices[POINTS];
    double values[MOSPT_TYPE_COUNT][POINTS][3];
    uint8_t *planes; /* owned */
} one_node;

static void make_node(one_node *n)
{
    uint64_t state = 11;
    mospt_err err = {0};
    *n = (one_node){.node = {.count = POINTS, .first_child = MOSPT_NO_NODE}};
    n->dataset.metadata.grid = render_grid(16);
    n->dataset.hierarchy = (mospt_hierarchy){.nodes = &n->node, .count = 1};
    mospt_schema *schema = &n->dataset.metadata.schema;
    for (int t = 0; t < MOSPT_TYPE_COUNT; t++)
        CORE_NEED(mospt_schema_add(schema, mospt_type_name((mospt_type)t), (mospt_type)t, 3, &err));
    n->planes = malloc((size_t)schema->row_size * POINTS);
    uint8_t *at = n->planes;
    for (int t = 0; t < MOSPT_TYPE_COUNT; t++)
        for (int i = 0; i < POINTS; i++)
            for (int c = 0; c < 3; c++, at += mospt_type_size((mospt_type)t)) {
                mospt_type_write((mospt_type)t, 300 * core_unit(&state) - 50, at);
                n->values[t][i][c] = mospt_type_read((mospt_type)t, at);
            }
    for (int i = 0; i < POINTS; i++)
        n->vertices[i] = (mospt_vertex){.x = core_below(&state, 1 << 16),
                                        .y = core_below(&state, 1 << 16),
                                        .z = core_below(&state, 1 << 16),
                                        .r = (uint8_t)i,
                                        .g = (uint8_t)(3 * i),
                                        .b = 7,
                                        .i = (uint8_t)(5 * i)};
}

static rend_paint paint_of(const one_node *n, rend_paint_source source)
{
    rend_paint p = {.source = source, .dataset = &n->dataset, .attribute = -1, .high = 255};
    rend_ramp_fill(REND_MAP_TURBO, &p.ramp);
    return p;
}

static void every_component_of_every_type_is_read(void **unused)
{
    (void)unused;
    one_node *n = malloc(sizeof *n);
    make_node(n);
    for (int t = 0; t < MOSPT_TYPE_COUNT; t++)
        for (uint32_t c = 0; c < 3; c++) {
            rend_paint p = paint_of(n, REND_PAINT_VALUE);
            p.attribute = t, p.component = c;
            assert_true(rend_paint_needs_attributes(&p));
            for (uint32_t i = 0; i < POINTS; i++)
                assert_true(rend_paint_value(&p, 0, n->vertices, n->planes, i) ==
                            n->values[t][i][c]);
        }
    free(n->planes);
    free(n);
}

static void painting_gives_each_point_the_colour_of_its_value(void **unused)
{
    (void)unused;
    one_node *n = malloc(sizeof *n);
    make_node(n);
    mospt_vertex painted[POINTS];
    memcpy(painted, n->vertices, sizeof painted);
    rend_paint p = paint_of(n, REND_PAINT_VALUE);
    p.attribute = MOSPT_F64, p.component = 1, p.low = -20, p.high = 120;
    rend_paint_apply(&p, 0, n->planes, painted);
    for (int i = 0; i < POINTS; i++) {
        double t = fmin(fmax((n->values[MOSPT_F64][i][1] + 20) / 140, 0), 1);
        const uint8_t *wanted = p.ramp.rgb[(int)floor(255 * t + 0.5)];
        assert_memory_equal(&painted[i].r, wanted, 3);
        assert_memory_equal(&painted[i].x, &n->vertices[i].x, 12);
        assert_int_equal(painted[i].i, n->vertices[i].i);
    }
    free(n->planes);
    free(n);
}

static void what_a_vertex_has_needs_no_attributes(void **unused)
{
    (void)unused;
    one_node *n = malloc(sizeof *n);
    make_node(n);
    const rend_paint_source sources[] = {REND_PAINT_STORED, REND_PAINT_RGB, REND_PAINT_INTENSITY,
                                         REND_PAINT_HEIGHT, REND_PAINT_LEVEL};
    for (size_t s = 0; s < sizeof sources / sizeof *sources; s++) {
        mospt_vertex painted[POINTS];
        memcpy(painted, n->vertices, sizeof painted);
        rend_paint p = paint_of(n, sources[s]);
        assert_false(rend_paint_needs_attributes(&p));
        rend_paint_apply(&p, 0, NULL, painted);
        bool same = memcmp(painted, n->vertices, sizeof painted) == 0;
        assert_true(same == (sources[s] == REND_PAINT_STORED));
    }
    rend_paint p = paint_of(n, REND_PAINT_HEIGHT);
    assert_true(rend_paint_value(&p, 0, n->vertices, NULL, 9) ==
                mospt_grid_axis_to_world(&n->dataset.metadata.grid, 2, n->vertices[9].z));
    p.source = REND_PAINT_INTENSITY;
    assert_true(rend_paint_value(&p, 0, n->vertices, NULL, 9) == n->vertices[9].i);
    free(n->planes);
    free(n);
}

static void a_neutral_curve_changes_nothing(void **unused)
{
    (void)unused;
    one_node *n = malloc(sizeof *n);
    make_node(n);
    mospt_vertex painted[POINTS];
    memcpy(painted, n->vertices, sizeof painted);
    rend_paint p = paint_of(n, REND_PAINT_RGB);
    rend_ramp_curve(1, 1, &p.ramp);
    rend_paint_apply(&p, 0, NULL, painted);
    assert_memory_equal(painted, n->vertices, sizeof painted);
    rend_ramp_curve(2, 1, &p.ramp);
    rend_paint_apply(&p, 0, NULL, painted);
    for (int i = 0; i < POINTS; i++)
        assert_int_equal(painted[i].r, n->vertices[i].r < 128 ? 2 * n->vertices[i].r : 255);
    free(n->planes);
    free(n);
}

static void values_beyond_the_range_have_the_colours_of_its_ends(void **unused)
{
    (void)unused;
    rend_paint p = {.low = 10, .high = 20};
    rend_ramp_fill(REND_MAP_VIRIDIS, &p.ramp);
    const struct {
        double value;
        int step;
    } cases[] = {{10, 0},    {20, 255},       {-1e300, 0},    {1e300, 255}, {15, 128},
                 {9.999, 0}, {INFINITY, 255}, {-INFINITY, 0}, {11, 26}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_ptr_equal(rend_paint_colour(&p, cases[i].value), p.ramp.rgb[cases[i].step]);
    p.high = p.low; /* all values alike */
    assert_ptr_equal(rend_paint_colour(&p, 10), p.ramp.rgb[128]);
    const uint8_t *none = rend_paint_colour(&p, NAN);
    assert_true(none[0] == none[1] && none[1] == none[2]);
}

static void classes_are_numbers_of_colours(void **unused)
{
    (void)unused;
    rend_paint p = {.classes = true};
    for (uint32_t i = 0; i < 256; i++)
        rend_ramp_hue(i, p.ramp.rgb[i]);
    assert_ptr_equal(rend_paint_colour(&p, 0), p.ramp.rgb[0]);
    assert_ptr_equal(rend_paint_colour(&p, 255), p.ramp.rgb[255]);
    assert_ptr_equal(rend_paint_colour(&p, 65538), p.ramp.rgb[2]);
    assert_ptr_equal(rend_paint_colour(&p, -1), rend_paint_colour(&p, NAN));
    assert_ptr_equal(rend_paint_colour(&p, 1e30), rend_paint_colour(&p, NAN));
}

static void directions_are_red_green_and_blue(void **unused)
{
    (void)unused;
    one_node *n = malloc(sizeof *n);
    make_node(n);
    const float normals[4][3] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}, {NAN, 5, -5}};
    const uint8_t wanted[4][3] = {{255, 128, 128}, {128, 0, 128}, {128, 128, 255}, {0, 255, 0}};
    const mospt_attribute *a = &n->dataset.metadata.schema.at[MOSPT_F32];
    memcpy(n->planes + (size_t)a->offset * POINTS, normals, sizeof normals);
    rend_paint p = paint_of(n, REND_PAINT_DIRECTION);
    p.attribute = MOSPT_F32;
    rend_paint_apply(&p, 0, n->planes, n->vertices);
    for (int i = 0; i < 4; i++)
        assert_memory_equal(&n->vertices[i].r, wanted[i], 3);
    free(n->planes);
    free(n);
}

static void a_zero_can_stand_for_no_value(void **unused)
{
    (void)unused;
    one_node *n = malloc(sizeof *n);
    make_node(n);
    const double times[2] = {0, 5};
    const mospt_attribute *a = &n->dataset.metadata.schema.at[MOSPT_F64];
    memcpy(n->planes + (size_t)a->offset * POINTS, times, sizeof times);
    rend_paint p = paint_of(n, REND_PAINT_VALUE);
    p.attribute = MOSPT_F64;
    assert_true(rend_paint_value(&p, 0, n->vertices, n->planes, 0) == 0);
    p.zero_is_none = true;
    assert_true(isnan(rend_paint_value(&p, 0, n->vertices, n->planes, 0)));
    p.component = 1;
    assert_true(rend_paint_value(&p, 0, n->vertices, n->planes, 0) == 5);
    free(n->planes);
    free(n);
}

static void distance_is_to_the_scanner_of_each_point(void **unused)
{
    (void)unused;
    one_node *n = malloc(sizeof *n);
    make_node(n);
    mospt_metadata *m = &n->dataset.metadata;
    mospt_source sources[2] = {{.has_pose = true}, {.has_pose = false}};
    m->sources = sources, m->source_count = 2;
    const uint32_t at[3] = {n->vertices[0].x, n->vertices[0].y, n->vertices[0].z};
    double world[3];
    mospt_grid_to_world(&m->grid, at, world);
    /* A scanner 2, 3 and 6 metres away along the axes is 7 metres away. */
    sources[0].pose[3] = world[0] + 2, sources[0].pose[7] = world[1] - 3;
    sources[0].pose[11] = world[2] + 6;
    rend_paint p = paint_of(n, REND_PAINT_DISTANCE);
    assert_true(fabs(rend_paint_value(&p, 0, n->vertices, NULL, 0) - 7) < 1e-9);
    /* With scan numbers: the second scan has no pose, a third one does not exist. */
    p.attribute = MOSPT_U16;
    for (uint16_t scan = 0; scan < 3; scan++) {
        memcpy(n->planes + (size_t)m->schema.at[MOSPT_U16].offset * POINTS, &scan, 2);
        double distance = rend_paint_value(&p, 0, n->vertices, n->planes, 0);
        assert_true(scan == 0 ? fabs(distance - 7) < 1e-9 : isnan(distance));
    }
    free(n->planes);
    free(n);
}

static bool holds(const mospt_grid *grid, const mospt_node *node, const mospt_vertex *v)
{
    uint64_t width = mospt_cell_width(grid, node->level);
    return v->x - node->corner[0] < width && v->y - node->corner[1] < width &&
           v->z - node->corner[2] < width;
}

static void level_is_that_of_the_deepest_node_around_a_point(void **unused)
{
    (void)unused;
    render_site site;
    render_site_make(CORE_CLUSTERED, 20000, NULL, &site);
    const mospt_hierarchy *h = &site.dataset->hierarchy;
    rend_paint p = {.source = REND_PAINT_LEVEL, .dataset = site.dataset, .attribute = -1};
    mospt_err err = {0};
    uint32_t deeper = 0;
    for (uint32_t n = 0; n < h->count; n++) {
        mospt_vertex *v = malloc(mospt_dataset_vertices_size(site.dataset, n) + 1);
        CORE_NEED(mospt_dataset_read_vertices(site.dataset, n, v, &err));
        for (uint32_t i = 0; i < h->nodes[n].count; i += 7) {
            uint32_t level = 0;
            for (uint32_t k = 0; k < h->count; k++)
                if (holds(&site.dataset->metadata.grid, &h->nodes[k], &v[i]) &&
                    h->nodes[k].level > level)
                    level = h->nodes[k].level;
            assert_true(rend_paint_value(&p, n, v, NULL, i) == level);
            deeper += level > h->nodes[n].level;
        }
        free(v);
    }
    assert_true(deeper > 10);
    render_site_fini(&site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_component_of_every_type_is_read),
        cmocka_unit_test(painting_gives_each_point_the_colour_of_its_value),
        cmocka_unit_test(what_a_vertex_has_needs_no_attributes),
        cmocka_unit_test(a_neutral_curve_changes_nothing),
        cmocka_unit_test(values_beyond_the_range_have_the_colours_of_its_ends),
        cmocka_unit_test(classes_are_numbers_of_colours),
        cmocka_unit_test(directions_are_red_green_and_blue),
        cmocka_unit_test(a_zero_can_stand_for_no_value),
        cmocka_unit_test(distance_is_to_the_scanner_of_each_point),
        cmocka_unit_test(level_is_that_of_the_deepest_node_around_a_point),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
