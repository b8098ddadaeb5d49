/* The memory that the builder was given is the peak of the whole process, however wide its points
 * are, however they lie, and however many threads there are, and does not show in the bytes.
 * argv[1] is the program; where that is built with sanitizers, which take memory of their own, only
 * the bytes are compared. */
#include "tests/core_tools.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
enum { MEASURES = 0 };
#else
enum { MEASURES = 1 };
#endif

enum { LEAST_MIB = 64, SCALARS_MAX = 60 };

typedef enum { SPOT, CUBE, TRIPOD } kind;

static const char *program;
static float unit(uint64_t *random)
{
    return (float)core_below(random, 1 << 24) / (float)(1 << 24);
}

/* Dense near the middle, as a scanner sees a floor. */
static void place(kind k, uint64_t *random, float xyz[3])
{
    float far = unit(random), x = 2 * unit(random) - 1, y = 2 * unit(random) - 1, z = unit(random);
    float width = k == CUBE ? 1 : k == TRIPOD ? 60 * far * far * far : 0;
    xyz[0] = x * width, xyz[1] = y * width;
    xyz[2] = k == CUBE ? z : k == TRIPOD ? 0.1F * z : 0;
}

/* A scan whose points have so many attributes of four bytes, written point by point. */
static void write_scan(const char *path, kind k, uint32_t count, uint32_t scalars)
{
    uint64_t random = 1 + (uint64_t)k;
    float point[3 + SCALARS_MAX];
    FILE *out = fopen(path, "wb");
    assert_non_null(out);
    fprintf(out,
            "ply\nformat binary_little_endian 1.0\nelement vertex %u\n"
            "property float x\nproperty float y\nproperty float z\n",
            count);
    for (uint32_t a = 0; a < scalars; a++)
        fprintf(out, "property float scalar%u\n", a);
    fprintf(out, "end_header\n");
    for (uint32_t i = 0; i < count; i++) {
        place(k, &random, point);
        for (uint32_t a = 0; a < scalars; a++)
            point[3 + a] = unit(&random);
        fwrite(point, sizeof *point, 3 + scalars, out);
    }
    assert_int_equal(fclose(out), 0);
}

/* Builds with a limit of so many MiB, and so many threads. Returns the peak, MiB. */
static long build(char *scan, char *output, int mebibytes, int threads)
{
    int status;
    struct rusage used;
    char memory[16], count[16];
    snprintf(memory, sizeof memory, "%dM", mebibytes);
    snprintf(count, sizeof count, "%d", threads);
    char *const arguments[] = {"instantpoints", "build",     scan,  "-o", output, "--memory",
                               memory,          "--threads", count, "-q", NULL};
    pid_t child = fork();
    if (child == 0) {
        if (freopen("/dev/null", "wb", stdout) == NULL) _exit(98);
        execv(program, arguments);
        _exit(99);
    }
    assert_int_equal(wait4(child, &status, 0, &used), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    return used.ru_maxrss / 1024;
}

static void check(kind k, uint32_t count, uint32_t scalars, int threads)
{
    char *scan = core_path(core_folder, "scan.ply"), *least = core_path(core_folder, "least.ipts"),
         *much = core_path(core_folder, "much.ipts");
    mospt_err err = {0};
    write_scan(scan, k, count, scalars);
    struct stat size;
    assert_int_equal(stat(scan, &size), 0);
    assert_true(size.st_size > 2 * (off_t)LEAST_MIB << 20); /* or it would show nothing */
    long peak = build(scan, least, LEAST_MIB, threads);
    if (MEASURES) assert_in_range(peak, 1, LEAST_MIB);
    else print_message("built with sanitizers: the peak is not measured\n");
    build(scan, much, 4096, 2);
    assert_int_equal(core_findings(least, &err), 0);
    core_assert_same_folders(least, much);
    core_folder_remove(least), core_folder_remove(much); /* and their names */
    remove(scan);
    free(scan);
}

static void a_site_much_larger_than_its_memory_is_built_in_it(void **state)
{
    (void)state;
    check(TRIPOD, 9000000, 1, 2);
    check(TRIPOD, 9000000, 1, 32);
}

static void wide_points_are_built_in_the_least_memory(void **state)
{
    (void)state;
    check(TRIPOD, 600000, SCALARS_MAX, 2);
    check(CUBE, 600000, SCALARS_MAX, 2);
}

static void wide_points_at_one_position_are_built_in_the_least_memory(void **state)
{
    (void)state;
    check(SPOT, 600000, SCALARS_MAX, 2);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_site_much_larger_than_its_memory_is_built_in_it),
        cmocka_unit_test(wide_points_are_built_in_the_least_memory),
        cmocka_unit_test(wide_points_at_one_position_are_built_in_the_least_memory),
    };
    if (argc != 2) return 2;
    program = argv[1];
    return cmocka_run_group_tests(tests, core_folder_set_up, core_folder_tear_down);
}
