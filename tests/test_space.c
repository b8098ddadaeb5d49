#include "render/space.h"
#include "render/tour.h"
#include "tests/render_tools.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { X = 40, Y = 30, Z = 12 };

/* A floor, and a wall at x = 20 with a door at y = 24. */
static rend_space house(void)
{
    rend_space s = {.cell_m = 0.25, .size = {X, Y, Z}};
    s.floor = malloc(X * Y * Z);
    s.narrow = malloc(X * Y * Z);
    for (int z = 0; z < Z; z++)
        for (int y = 0; y < Y; y++)
            for (int x = 0; x < X; x++) {
                bool wall = x == 20 && (y < 22 || y > 26);
                s.floor[(z * Y + y) * X + x] = !(z == 0 || wall);
            }
    assert_true(rend_space_derive(&s));
    return s;
}

static size_t cell(int x, int y, int z)
{
    return (size_t)((z * Y + y) * X + x);
}

static void the_floor_is_as_far_down_as_it_is(void **unused)
{
    (void)unused;
    rend_space s = house();
    for (int z = 0; z < Z; z++) {
        assert_int_equal(s.floor[cell(3, 3, z)], z);
        assert_int_equal(s.floor[cell(20, 3, z)], 0);
        assert_int_equal(s.narrow[cell(19, 3, z)], 1);
        assert_int_equal(s.narrow[cell(18, 3, z)], 1);
        if (z > 0) assert_int_equal(s.narrow[cell(17, 3, z)], 0);
    }
    for (size_t c = 0; c < X * Y * Z; c += 7) {
        double at[3];
        rend_space_middle(&s, c, at);
        assert_true(rend_space_cell(&s, at) == c);
    }
    rend_space_fini(&s);
}

static void the_way_goes_through_the_door_at_eye_height(void **unused)
{
    (void)unused;
    rend_space s = house();
    size_t *cells, count;
    mospt_err err = {0};
    CORE_NEED(rend_space_route(&s, cell(5, 5, 7), cell(35, 5, 7), 1.65, &cells, &count, &err));
    assert_true(cells[0] == cell(5, 5, 7) && cells[count - 1] == cell(35, 5, 7));
    for (size_t i = 0; i < count; i++) {
        assert_true(s.floor[cells[i]] > 0);
        assert_true(s.floor[cells[i]] >= 6 && s.floor[cells[i]] <= 8);
        if (i == 0) continue;
        long x = (long)(cells[i] % X) - (long)(cells[i - 1] % X);
        long y = (long)(cells[i] / X % Y) - (long)(cells[i - 1] / X % Y);
        long z = (long)(cells[i] / X / Y) - (long)(cells[i - 1] / X / Y);
        assert_true(labs(x) <= 1 && labs(y) <= 1 && labs(z) <= 1);
    }
    free(cells);
    rend_space_fini(&s);
}

static void one_can_walk_where_the_floor_hangs_together(void **unused)
{
    (void)unused;
    rend_space s = house();
    mospt_err err = {0};
    uint8_t *on_foot;
    /* A table in the larger room, whose top is no place to walk on; and no door. */
    for (int z = 0; z < Z; z++)
        for (int y = 0; y < Y; y++)
            s.floor[cell(12, y, z)] = s.floor[cell(20, y, z)] = 0;
    for (int x = 25; x < 29; x++)
        s.floor[cell(x, 10, 3)] = 0;
    assert_true(rend_space_derive(&s));
    CORE_NEED(rend_space_walkable(&s, 1.65, &on_foot, &err));
    for (size_t c = 0; c < X * Y * Z; c++)
        if (on_foot[c]) assert_true(c % X > 20 && s.floor[c] >= 6 && s.floor[c] <= 8);
    assert_true(on_foot[cell(32, 10, 7)] && !on_foot[cell(27, 10, 7)]);
    free(on_foot);
    rend_space_fini(&s);
}

static void where_there_is_no_way_it_goes_through_the_wall_once(void **unused)
{
    (void)unused;
    rend_space s = house();
    size_t *cells, count, solid = 0;
    mospt_err err = {0};
    for (int z = 0; z < Z; z++)
        for (int y = 0; y < Y; y++)
            s.floor[cell(20, y, z)] = 0;
    CORE_NEED(rend_space_route(&s, cell(5, 5, 7), cell(35, 5, 7), 1.65, &cells, &count, &err));
    for (size_t i = 0; i < count; i++)
        solid += s.floor[cells[i]] == 0;
    assert_int_equal(solid, 1);
    free(cells);
    CORE_NEED(rend_space_route(&s, cell(5, 5, 7), cell(5, 5, 7), 1.65, &cells, &count, &err));
    assert_int_equal(count, 1);
    free(cells);
    rend_space_fini(&s);
}

static void a_tour_visits_the_scan_positions_in_order(void **unused)
{
    (void)unused;
    render_site site;
    rend_path path;
    mospt_err err = {0};
    render_site_make(CORE_CLUSTERED, 60000, NULL, &site);
    mospt_metadata *m = &site.dataset->metadata;
    mospt_source *own = m->sources, sources[3];
    uint32_t own_count = m->source_count;
    memset(sources, 0, sizeof sources);
    for (int i = 0; i < 3; i++) {
        sources[i].has_pose = true;
        for (int a = 0; a < 3; a++)
            sources[i].pose[4 * a + 3] =
                m->low[a] + (m->high[a] - m->low[a]) * (a == 0 ? 0.2 + 0.3 * i : 0.5);
    }
    m->sources = sources, m->source_count = 3;
    CORE_NEED(rend_tour_walk(site.dataset, &path, &err));
    m->sources = own, m->source_count = own_count;
    CORE_NEED(rend_path_is_valid(&path, &err));
    uint32_t next = 0;
    for (uint32_t i = 0; i < path.count && next < 3; i++) {
        double d2 = 0;
        for (int a = 0; a < 3; a++)
            d2 += pow(path.keys[i].camera.eye[a] - sources[next].pose[4 * a + 3], 2);
        if (sqrt(d2) < 3) next++;
    }
    assert_int_equal(next, 3);
    rend_path_fini(&path);
    render_site_fini(&site);
}

static void an_orbit_sees_the_whole_site_from_all_sides(void **unused)
{
    (void)unused;
    render_site site;
    rend_path path;
    mospt_err err = {0};
    render_site_make(CORE_PLANE, 20000, NULL, &site);
    CORE_NEED(rend_tour_orbit(site.dataset, 16.0 / 9, &path, &err));
    CORE_NEED(rend_path_is_valid(&path, &err));
    const mospt_metadata *m = &site.dataset->metadata;
    for (uint32_t i = 0; i < 8 * path.count; i++) {
        const rend_camera *c = &path.keys[i / 8].camera;
        double right[3], up[3], back[3], x = 0, y = 0, z = 0;
        rend_camera_axes(c, right, up, back);
        for (int a = 0; a < 3; a++) {
            double d = ((i >> a & 1) ? m->high[a] : m->low[a]) - c->eye[a];
            x += right[a] * d, y += up[a] * d, z -= back[a] * d;
        }
        double reach = z * tan(c->fov_rad / 2);
        assert_true(z > 0 && fabs(x) < 1.01 * 16 / 9 * reach && fabs(y) < 1.01 * reach);
    }
    rend_path_fini(&path);
    render_site_fini(&site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_floor_is_as_far_down_as_it_is),
        cmocka_unit_test(the_way_goes_through_the_door_at_eye_height),
        cmocka_unit_test(one_can_walk_where_the_floor_hangs_together),
        cmocka_unit_test(where_there_is_no_way_it_goes_through_the_wall_once),
        cmocka_unit_test(a_tour_visits_the_scan_positions_in_order),
        cmocka_unit_test(an_orbit_sees_the_whole_site_from_all_sides),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
