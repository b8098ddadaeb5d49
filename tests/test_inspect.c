/* tests/test_inspect.c - what a scan file says of itself, and whether that is noticed where it is
 * not true. */
#include "core_scans.h"
#include "core_tools.h"

#include "preprocess/inspect.h"

#include <stdlib.h>
#include <string.h>

static const int32_t points[3][3] = {{0, 0, 0}, {1000, 2000, 3000}, {2000, 4000, 6000}};

static void look(const core_las *las, prep_inspection *out)
{
    mospt_err err;
    char *folder = core_folder_make(), *path = core_path(folder, "a.las");
    core_las_write(path, las);
    CORE_NEED(prep_inspect(path, 0, NULL, false, out, &err));
    core_folder_remove(folder);
    free(path);
}

static void points_are_counted_and_measured(void **state)
{
    (void)state;
    prep_inspection in;
    look(
        &(core_las){
            .scale = {0.001, 0.001, 0.001}, .offset = {10, 20, 30}, .xyz = points, .count = 3},
        &in);
    assert_true(in.was_read);
    assert_int_equal(in.points, 3);
    for (int a = 0; a < 3; a++) {
        assert_true(in.low[a] == 10 * (a + 1));
        assert_true(in.mean[a] == 11 * (a + 1));
        assert_true(in.high[a] == 12 * (a + 1));
    }
    assert_int_equal(in.note_count, 0);
}

static void bounds_that_lie_are_noted(void **state)
{
    (void)state;
    prep_inspection in;
    const double low[3] = {0, 0, 0}, high[3] = {0, 0, 0};
    look(&(core_las){.scale = {0.001, 0.001, 0.001},
                     .offset = {10, 20, 30},
                     .xyz = points,
                     .count = 3,
                     .low = low,
                     .high = high},
         &in);
    assert_int_equal(in.note_count, 3);
    assert_non_null(strstr(in.notes[0], "x reaches from 0 to 0"));
}

static void missing_points_are_damage_and_far_ones_a_note(void **state)
{
    (void)state;
    prep_inspection in;
    look(&(core_las){.scale = {1e6, 1e6, 1e6}, .xyz = points, .count = 3, .missing = 5}, &in);
    assert_int_equal(in.points, 2);
    assert_int_equal(in.damage.code, MOSPT_EFORMAT);
    assert_true(in.note_count >= 1);
    assert_non_null(strstr(in.notes[in.note_count - 1], "coordinates reach"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_are_counted_and_measured),
        cmocka_unit_test(bounds_that_lie_are_noted),
        cmocka_unit_test(missing_points_are_damage_and_far_ones_a_note),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
