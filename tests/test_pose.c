/* tests/test_pose.c - matrices beside scans, and in lists. */
#include "core_tools.h"

#include "preprocess/pose.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char *folder;

static void write_text(const char *name, const char *text)
{
    char *path = core_path(folder, "%s", name);
    core_file_write(path, text, strlen(text));
    free(path);
}

static bool find(const prep_pose_list *list, const char *name, bool *found, double m[16],
                 mospt_err *err)
{
    char *path = core_path(folder, "%s", name);
    bool ok = prep_pose_find(list, path, "scan name", found, m, err);
    free(path);
    return ok;
}

static void a_sidecar_is_found_by_both_names(void **state)
{
    (void)state;
    static const char *const sidecars[] = {"a.las.pose.txt", "a.pose.txt"};
    mospt_err err;
    for (int k = 0; k < 2; k++) {
        double m[16] = {0};
        bool found = true;
        CORE_NEED(find(NULL, "a.las", &found, m, &err));
        assert_false(found);
        write_text(sidecars[k], "0 -1 0 10\n1 0 0 20\n0 0 1 30\n0 0 0 1\n");
        CORE_NEED(find(NULL, "a.las", &found, m, &err));
        assert_true(found);
        const double in[3] = {1, 2, 3};
        double out[3];
        prep_pose_apply(m, in, out);
        assert_true(out[0] == 8 && out[1] == 21 && out[2] == 33);
        char *path = core_path(folder, "%s", sidecars[k]);
        assert_true(prep_pose_is_sidecar(path));
        remove(path);
        free(path);
    }
}

static void a_sidecar_may_have_comments(void **state)
{
    (void)state;
    double m[16];
    bool found;
    mospt_err err;
    write_text("a.pose.txt", "\xef\xbb\xbf# of station 5\r\n1 0 0 5 # x\r\n0 1 0 6\r\n0 0 1 7\r\n");
    CORE_NEED(find(NULL, "a.las", &found, m, &err));
    assert_true(found && m[3] == 5 && m[7] == 6 && m[11] == 7 && m[15] == 1);
}

static void what_is_no_matrix_is_refused(void **state)
{
    (void)state;
    static const char *const wrong[] = {"",
                                        "1 2 3",
                                        "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 2",
                                        "1 0 0 0 0 1 0 0 0 0 0 0",
                                        "1 0 0 0 0 1 0 0 0 0 1 x",
                                        "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 5",
                                        "nan 0 0 0 0 1 0 0 0 0 1 0"};
    mospt_err err;
    double m[16];
    bool found;
    for (size_t k = 0; k < sizeof wrong / sizeof wrong[0]; k++) {
        write_text("a.pose.txt", wrong[k]);
        CORE_FAILS(find(NULL, "a.las", &found, m, &err), MOSPT_EFORMAT);
        assert_non_null(strstr(err.file, "a.pose.txt"));
    }
}

static void a_list_names_files_and_scans(void **state)
{
    (void)state;
    mospt_err err;
    prep_pose_list list;
    double m[16];
    bool found;
    char *path = core_path(folder, "poses.txt");
    write_text("poses.txt",
               "# name, matrix\n\nb 1 0 0 1 0 1 0 0 0 0 1 0\r\n"
               "c.las, 1,0,0,2, 0,1,0,0, 0,0,1,0\n\"scan name\" 1 0 0 3 0 1 0 0 0 0 1 0 0 0 0 1");
    CORE_NEED(prep_pose_list_read(path, &list, &err));
    assert_int_equal(list.count, 3);
    CORE_NEED(find(&list, "b.las", &found, m, &err));
    assert_true(found && m[3] == 1);
    CORE_NEED(find(&list, "c.las", &found, m, &err));
    assert_true(found && m[3] == 2);
    CORE_NEED(find(&list, "other.las", &found, m, &err));
    assert_true(found && m[3] == 3);
    prep_pose_list_fini(&list);

    write_text("poses.txt", "\xef\xbb\xbfs2/a 1 0 0 7 0 1 0 0 0 0 1 0\n");
    CORE_NEED(prep_pose_list_read(path, &list, &err));
    static const char *const paths[] = {"x/s2/a.las", "s2/a.las", "s1/a.las", "xs2/a.las", "a.las"};
    for (int i = 0; i < 5; i++) {
        CORE_NEED(prep_pose_find(&list, paths[i], "a.las", &found, m, &err));
        assert_int_equal(found, i < 2);
    }
    prep_pose_list_fini(&list);
    write_text("poses.txt", "b 1 0 0 1 0 1 0 0 0 0 1 0\nc 1 2\n");
    CORE_FAILS(prep_pose_list_read(path, &list, &err), MOSPT_EFORMAT);
    assert_int_equal(err.place, 2);
    free(path);
}

static void products_apply_the_right_one_first(void **state)
{
    (void)state;
    const double turn[16] = {0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    const double shift[16] = {1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1};
    const double in[3] = {1, 2, 3};
    double both[16], a[3], b[3];
    prep_pose_multiply(shift, turn, both);
    prep_pose_apply(turn, in, a);
    prep_pose_apply(shift, a, b);
    prep_pose_apply(both, in, a);
    assert_memory_equal(a, b, sizeof a);
}

static int make_folder(void **state)
{
    (void)state;
    folder = core_folder_make();
    return folder == NULL;
}

static int remove_folder(void **state)
{
    (void)state;
    core_folder_remove(folder);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_sidecar_is_found_by_both_names, make_folder,
                                        remove_folder),
        cmocka_unit_test_setup_teardown(a_sidecar_may_have_comments, make_folder, remove_folder),
        cmocka_unit_test_setup_teardown(what_is_no_matrix_is_refused, make_folder, remove_folder),
        cmocka_unit_test_setup_teardown(a_list_names_files_and_scans, make_folder, remove_folder),
        cmocka_unit_test(products_apply_the_right_one_first),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
