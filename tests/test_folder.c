#include "preprocess/folder.h"
#include "tests/scan_points.h"
#include "tests/write_las.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

static char root[512];

static void put(const char *name, const void *bytes, size_t size)
{
    char path[2048];
    snprintf(path, sizeof path, "%s/%s", root, name);
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, size, f), size);
    fclose(f);
}

static void put_text(const char *name, const char *text)
{
    put(name, text, strlen(text));
}

static void make_folder(const char *name)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", root, name);
    assert_int_equal(mkdir(path, 0777), 0);
}

static void make_link(const char *target, const char *name)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", root, name);
    assert_int_equal(symlink(target, path), 0);
}

static int set_up(void **state)
{
    (void)state;
    static const write_las_options las = {.minor = 2, .count = 3, .scale = {1, 1, 1}};
    size_t size;
    snprintf(root, sizeof root, "%s/site", scan_points_folder());
    if (mkdir(root, 0777) != 0) return -1;
    uint8_t *bytes = write_las(&las, &size);
    make_folder("b");
    make_folder("b/deep");
    make_folder("old.ipts");
    make_folder(".cache");
    put("z.las", bytes, size);
    put("a.las", bytes, size);
    put("B.las", bytes, size);
    put("b/deep/scan.bin", bytes, size); /* LAS by its content */
    put("old.ipts/inside.las", bytes, size);
    put(".hidden.las", bytes, size);
    put(".cache/x.las", bytes, size);
    put("cut.las", bytes, 100);
    put("empty.laz", bytes, 0);
    free(bytes);
    put_text("b/points.txt", "1 2 3\n4 5 6\n");
    put_text("b/readme.txt", "This is no scan.\nNot at all, really.\nBut text.\n");
    put_text("b/pose.dat", "0 0 0 hello\n");
    put_text("notes.md", "1 2 3\n");
    put_text("broken.xyz", "nothing here\n");
    put_text("cloud.e57", "ASTM-E57 and so on");
    put_text("cloud.pcd", "# .PCD v0.7\n");
    put_text("picture.png", "\x89PNG\r\n\x1a\n");
    put_text("mesh.ply",
             "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
             "property float z\nend_header\n1 2 3\n");
    make_link("..", "b/loop");
    make_link("z.las", "same.las"); /* comes before the file itself in the order of names */
    make_link("nowhere", "dangling.las");
    return 0;
}

static void list_paths(const char *const *paths, size_t count, prep_folder_list *out)
{
    mospt_err err;
    if (!prep_folder_list_make(paths, count, out, &err)) fail_msg("%s: %s", err.file, err.message);
}

static void check_names(const prep_folder_file *files, size_t count, const char *const *names,
                        size_t name_count)
{
    for (size_t i = 0; i < count && i < name_count; i++)
        assert_string_equal(files[i].name, names[i]);
    assert_int_equal(count, name_count);
}

static void a_folder_is_listed_in_order(void **state)
{
    (void)state;
    static const char *const scans[] = {
        "B.las",     "a.las",   "b/deep/scan.bin", "b/points.txt", "broken.xyz", "cloud.e57",
        "cloud.pcd", "cut.las", "empty.laz",       "mesh.ply",     "z.las"};
    static const char *const others[] = {"b/pose.dat", "b/readme.txt", "notes.md", "picture.png"};
    const char *path = root;
    prep_folder_list list;
    list_paths(&path, 1, &list);
    check_names(list.files, list.count, scans, sizeof scans / sizeof scans[0]);
    check_names(list.unknown, list.unknown_count, others, sizeof others / sizeof others[0]);
    char expected[1024];
    snprintf(expected, sizeof expected, "%s/a.las", root);
    assert_string_equal(list.files[1].path, expected);
    prep_folder_list_fini(&list);
    assert_int_equal(list.count, 0);
}

static void a_named_file_is_always_taken(void **state)
{
    (void)state;
    char readme[1024], points[1024];
    snprintf(readme, sizeof readme, "%s/b/readme.txt", root);
    snprintf(points, sizeof points, "%s/notes.md", root);
    const char *const paths[] = {readme, points, readme};
    static const char *const names[] = {"notes.md", "readme.txt"};
    prep_folder_list list;
    list_paths(paths, 3, &list);
    check_names(list.files, list.count, names, 2);
    assert_string_equal(list.files[1].path, readme);
    assert_int_equal(list.unknown_count, 0);
    prep_folder_list_fini(&list);
}

static void the_same_file_comes_once(void **state)
{
    (void)state;
    char sub[1024], twice[1024], file[1024];
    snprintf(sub, sizeof sub, "%s/b", root);
    snprintf(twice, sizeof twice, "%s/b/../b/", root);
    snprintf(file, sizeof file, "%s/b/points.txt", root);
    const char *const paths[] = {sub, twice, file};
    prep_folder_list list;
    list_paths(paths, 3, &list);
    size_t found = 0;
    for (size_t i = 0; i < list.count; i++)
        found += strstr(list.files[i].path, "points.txt") != NULL;
    assert_int_equal(found, 1);
    prep_folder_list_fini(&list);
}

static void what_does_not_exist_is_an_error(void **state)
{
    (void)state;
    char path[1024];
    snprintf(path, sizeof path, "%s/missing", root);
    const char *const paths[] = {root, path};
    prep_folder_list list;
    mospt_err err;
    assert_false(prep_folder_list_make(paths, 2, &list, &err));
    assert_int_equal(err.code, MOSPT_EIO);
    assert_string_equal(err.file, path);
    const char *empty = "";
    assert_false(prep_folder_list_make(&empty, 1, &list, &err));
    assert_int_equal(err.code, MOSPT_EIO);
}

static void nothing_is_an_empty_list(void **state)
{
    (void)state;
    prep_folder_list list;
    list_paths(NULL, 0, &list);
    assert_int_equal(list.count, 0);
    prep_folder_list_fini(&list);
}

static void a_pipe_does_not_stop_us(void **state)
{
    (void)state;
    char path[1024];
    snprintf(path, sizeof path, "%s/pipe.las", root);
    assert_int_equal(mkfifo(path, 0666), 0);
    mospt_err err;
    prep_scan *scan;
    assert_false(prep_scan_open(path, 0, NULL, &scan, &err));
    assert_int_equal(err.code, MOSPT_EFORMAT);
    assert_false(prep_scan_open(root, 0, NULL, &scan, &err));
    assert_int_equal(err.code, MOSPT_EFORMAT);
    unlink(path);
}

static void files_of_one_name_are_told_apart(void **state)
{
    (void)state;
    char paths[3][1024], deep[1100];
    static const char *const folders[] = {"d1/s", "d2/s", "d2/t"};
    make_folder("d1");
    make_folder("d2");
    for (int i = 0; i < 3; i++) {
        make_folder(folders[i]);
        snprintf(paths[i], sizeof paths[i], "%s/%s", root, folders[i]);
        snprintf(deep, sizeof deep, "%s/one.xyz", folders[i]);
        put_text(deep, "1 2 3\n");
    }
    put_text("d2/t/two.xyz", "1 2 3\n");
    const char *const named[] = {paths[0], paths[1], paths[2]};
    static const char *const names[] = {"d1/s/one.xyz", "d2/s/one.xyz", "t/one.xyz", "two.xyz"};
    prep_folder_list list;
    list_paths(named, 3, &list);
    check_names(list.files, list.count, names, 4);
    for (size_t i = 0; i < list.count; i++)
        assert_non_null(strstr(list.files[i].path, list.files[i].name));
    prep_folder_list_fini(&list);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_folder_is_listed_in_order),
        cmocka_unit_test(a_named_file_is_always_taken),
        cmocka_unit_test(the_same_file_comes_once),
        cmocka_unit_test(files_of_one_name_are_told_apart),
        cmocka_unit_test(what_does_not_exist_is_an_error),
        cmocka_unit_test(nothing_is_an_empty_list),
        cmocka_unit_test(a_pipe_does_not_stop_us),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
