/* A thousand scans in one site, and few files that may be open at a time. argv[1] is the program.
 */
#include "tests/core_scans.h"
#include "tests/core_tools.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

enum {
    SCANS = 1000,
    SCANS_PER_FOLDER = 90,
    POINTS_SMALL = 40,
    POINTS_LARGE = 50000, /* of the first scan, so that there is an octree */
    POINTS_MAX = POINTS_LARGE + SCANS * POINTS_SMALL,
    OPEN_FILES = 32,
    DONE = 0,
};

static const double origin[3] = {690000, 5330000, 500};

static const char *program;
static char *folder;
static int32_t (*points)[3]; /* [point_count], owned: millimetres from the origin */
static uint32_t point_count;

static uint32_t size_of_scan(uint32_t scan)
{
    return scan == 0 ? POINTS_LARGE : 1 + scan % POINTS_SMALL;
}

static void write_scan(uint32_t scan)
{
    static const char *const extensions[3] = {"las", "ply", "xyz"};
    const int32_t(*at)[3] = (const int32_t(*)[3])points + point_count;
    uint32_t count = size_of_scan(scan);
    uint64_t random = scan + 1;
    double(*world)[3] = malloc(count * sizeof *world);
    assert_non_null(world);
    for (uint32_t i = 0; i < count; i++)
        for (int a = 0; a < 3; a++) {
            int32_t step = (int32_t)core_below(&random, a == 2 ? 10000 : 100000);
            points[point_count + i][a] = step;
            world[i][a] = origin[a] + step * 0.001;
        }
    point_count += count;
    char *path =
        core_path(folder, "scans/%02u/%u.%s", scan / SCANS_PER_FOLDER, scan, extensions[scan % 3]);
    if (scan % 3 == 0)
        core_las_write(path, &(core_las){.scale = {0.001, 0.001, 0.001},
                                         .offset = {origin[0], origin[1], origin[2]},
                                         .xyz = at,
                                         .count = count});
    else if (scan % 3 == 1) core_ply_write(path, (const double(*)[3])world, count);
    else core_text_write(path, (const double(*)[3])world, count);
    free(world), free(path);
}

static void make_folder(const char *name, uint32_t number)
{
    char *path = core_path(folder, name, number);
    assert_int_equal(mkdir(path, 0777), 0);
    free(path);
}

static int compare_points(const void *a, const void *b)
{
    const int32_t *p = a, *q = b;
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k]) return p[k] < q[k] ? -1 : 1;
    return 0;
}

static int set_up(void **state)
{
    (void)state;
    folder = core_folder_make();
    points = malloc(sizeof *points * POINTS_MAX);
    assert_non_null(points);
    make_folder("scans", 0);
    for (uint32_t f = 0; f * SCANS_PER_FOLDER < SCANS; f++)
        make_folder("scans/%02u", f);
    for (uint32_t s = 0; s < SCANS; s++)
        write_scan(s);
    qsort(points, point_count, sizeof *points, compare_points);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    core_folder_remove(folder);
    free(points);
    return 0;
}

/* Runs the program with a limit on open files; returns the exit code.
 * arguments  NULL behind the last; the first is the program's name */
static int run(char *const *arguments)
{
    int status;
    pid_t child = fork();
    if (child == 0) {
        const struct rlimit few = {OPEN_FILES, OPEN_FILES};
        if (freopen("/dev/null", "wb", stdout) == NULL || setrlimit(RLIMIT_NOFILE, &few) != 0)
            _exit(98);
        execv(program, arguments);
        _exit(99);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

/* Whatever order they come in, the points are those that were written. */
static void assert_all_points(const mospt_dataset *dataset)
{
    mospt_err err = {0};
    int32_t(*found)[3] = malloc(sizeof *found * point_count);
    uint32_t count = 0;
    assert_non_null(found);
    assert_int_equal(dataset->metadata.point_count, point_count);
    for (uint32_t n = 0; n < dataset->hierarchy.count; n++) {
        uint32_t node_count = dataset->hierarchy.nodes[n].count;
        mospt_vertex *v = malloc(node_count * sizeof *v);
        assert_non_null(v);
        CORE_NEED(mospt_dataset_read_vertices(dataset, n, v, &err));
        assert_true(node_count <= point_count - count);
        for (uint32_t i = 0; i < node_count; i++, count++) {
            double world[3];
            mospt_grid_to_world(&dataset->metadata.grid, (const uint32_t[]){v[i].x, v[i].y, v[i].z},
                                world);
            for (int a = 0; a < 3; a++)
                found[count][a] = (int32_t)lround((world[a] - origin[a]) * 1000);
        }
        free(v);
    }
    assert_int_equal(count, point_count);
    qsort(found, count, sizeof *found, compare_points);
    assert_memory_equal(found, points, sizeof *found * count);
    free(found);
}

static void assert_all_sources(const mospt_metadata *metadata)
{
    assert_int_equal(metadata->source_count, SCANS);
    for (uint32_t s = 0; s < SCANS; s++) {
        const mospt_source *source = &metadata->sources[s];
        uint32_t f, scan;
        assert_int_equal(sscanf(source->name, "%u/%u.", &f, &scan), 2);
        assert_int_equal(source->points, size_of_scan(scan));
        assert_int_equal(source->dropped, 0);
        assert_null(source->damage);
    }
}

static void a_thousand_scans_are_built_with_few_files_open(void **state)
{
    (void)state;
    char *scans = core_path(folder, "scans"), *output = core_path(folder, "site.ipts");
    char name[] = "instantpoints";
    mospt_dataset *dataset;
    mospt_err err = {0};
    char *const build[] = {name,      "build",         scans, "-o", output,
                           "--quiet", "--inner-depth", "3",   NULL};
    assert_int_equal(run(build), DONE);
    assert_int_equal(run((char *[]){name, "check", output, NULL}), DONE);
    CORE_NEED(mospt_dataset_open(output, &dataset, &err));
    assert_true(dataset->metadata.file_count >= 3);
    assert_all_sources(&dataset->metadata);
    assert_all_points(dataset);
    mospt_dataset_close(dataset);
    core_folder_remove(output);
    free(scans);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_thousand_scans_are_built_with_few_files_open),
    };
    if (argc < 2) return 2;
    program = argv[1];
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
