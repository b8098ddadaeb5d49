/* tests/test_real_scans.c - the readers against real files and what a manifest says is in them.
 *
 * The files are no part of this repository: they lie in $IPTS_SHARED/scans or ../shared/scans.
 * Without them the test is skipped, and says so. */
#include "tests/scan_points.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { COLUMNS_MAX = 64, LINE_SIZE = 8192, SKIPPED = 77 };

static char root[1024];

typedef struct {
    char line[LINE_SIZE];
    char *field[COLUMNS_MAX];
    int count;
} row;

typedef struct {
    FILE *file;
    row names, now;
} manifest;

static bool read_row(FILE *f, row *out)
{
    if (fgets(out->line, sizeof out->line, f) == NULL) return false;
    out->line[strcspn(out->line, "\r\n")] = '\0';
    out->count = 0;
    char *rest = out->line;
    while (rest != NULL && out->count < COLUMNS_MAX)
        out->field[out->count++] = strsep(&rest, "\t");
    return true;
}

static const char *get(const manifest *m, const char *name)
{
    for (int i = 0; i < m->names.count && i < m->now.count; i++) {
        if (strcmp(m->names.field[i], name) == 0) return m->now.field[i];
    }
    return "";
}

static bool starts_with(const char *text, const char *start)
{
    return strncmp(text, start, strlen(start)) == 0;
}

static bool has_ending(const char *text, const char *end)
{
    size_t n = strlen(text), m = strlen(end);
    return n >= m && strcmp(text + n - m, end) == 0;
}

static bool is_ours(const manifest *m)
{
    const char *file = get(m, "file");
    if (starts_with(file, "las/") || starts_with(file, "ply/") || starts_with(file, "text/") ||
        starts_with(file, "pts/") || starts_with(file, "laz/") || starts_with(file, "copc/"))
        return true;
    if (starts_with(file, "derived/"))
        return has_ending(file, ".csv") || has_ending(file, ".ply") || has_ending(file, ".pts") ||
               has_ending(file, ".las") || has_ending(file, ".laz");
    return starts_with(file, "mutated/") &&
           (has_ending(file, ".las") || has_ending(file, ".ply") || has_ending(file, ".pts") ||
            has_ending(file, ".txt") || has_ending(file, ".xyz") || has_ending(file, ".laz"));
}

/* Rows that cannot be compared as they stand, with the reason, and what is expected instead. */
static const struct {
    const char *file, *reason;
    mospt_code code; /* MOSPT_OK: it loads */
    uint64_t count;  /* 0: do not compare */
    bool skip_positions;
} special[] = {
    {"text/pdal__ilvis2__ILVIS2_TEST_FILE.TXT",
     "the manifest took the first three columns; the comment line names longitude, latitude and "
     "elevation",
     MOSPT_OK, 3, true},
    {"text/libpointmatcher__2D_oneBox.csv", "two columns: a point needs three", MOSPT_EFORMAT, 0,
     true},
    {"text/libpointmatcher__carCloudList.csv", "file names and matrices", MOSPT_EFORMAT, 0, true},
    {"text/pcl__rops_indices.txt", "one column of indices", MOSPT_EFORMAT, 0, true},
    {"ply/displaz__displaz_ply_points.ply", "parallel elements; the manifest has no count",
     MOSPT_OK, 20, true},
    {"ply/heseler__cube-ply-1.0_ascii-comment_renamed_to_remark-invalid.ply",
     "unknown keyword, read leniently", MOSPT_OK, 8, false},
    {"mutated/A_las_count_4e9.las", "the records that are there", MOSPT_OK, 3000, true},
    {"mutated/A_las_truncated.las", "the records that are there", MOSPT_OK, 2097, true},
    {"mutated/A_ply_truncated.ply", "the vertices that are there", MOSPT_OK, 312, true},
    {"mutated/A_ply_count_1e12.ply", "a count far beyond the file", MOSPT_EFORMAT, 0, true},
    {"mutated/A_pts_count_mismatch.pts", "announces 1000000", MOSPT_OK, 19, true},
};

static int find_special(const char *file)
{
    for (size_t i = 0; i < sizeof special / sizeof special[0]; i++) {
        if (strcmp(special[i].file, file) == 0) return (int)i;
    }
    return -1;
}

static int fail_row(const manifest *m, const char *what, double ours, double theirs)
{
    printf("FAILED %s: %s is %.12g, the manifest says %.12g\n", get(m, "file"), what, ours, theirs);
    return 1;
}

/* The digits that the manifest writes are its precision; sums are taken in another order than ours.
 */
static bool is_close(double ours, const char *theirs_text, double scale)
{
    double theirs = strtod(theirs_text, NULL);
    const char *dot = strchr(theirs_text, '.');
    double step = pow(10, dot != NULL ? -(double)strlen(dot + 1) : 0);
    return fabs(ours - theirs) <=
           0.51 * step + 4e-7 * fabs(theirs) * (scale > 0 ? scale : 0) + 1e-12 * fabs(theirs);
}

static int check_positions(const manifest *m, const scan_points *p)
{
    static const char *const names[3][3] = {
        {"min_x", "min_y", "min_z"}, {"max_x", "max_y", "max_z"}, {"mean_x", "mean_y", "mean_z"}};
    int failures = 0;
    bool is_ascii_ply =
        strcmp(p->info.format, "PLY ascii") == 0; /* floats there, doubles in the manifest */
    for (int a = 0; a < 3; a++) {
        double value[3] = {INFINITY, -INFINITY, 0};
        for (uint64_t i = 0; i < p->count; i++) {
            double v = p->xyz[3 * i + (uint64_t)a];
            value[0] = fmin(value[0], v);
            value[1] = fmax(value[1], v);
            value[2] += v / (double)p->count;
        }
        for (int k = 0; k < 3; k++) {
            const char *text = get(m, names[k][a]);
            if (text[0] != '\0' && !is_close(value[k], text, is_ascii_ply ? 1 : 0))
                failures += fail_row(m, names[k][a], value[k], strtod(text, NULL));
        }
    }
    return failures;
}

/* Mean of a raw colour: the attribute if there is one, else the display colour, which is then the
 * raw one. */
static double mean_colour(const scan_points *p, uint32_t channel)
{
    double sum = 0;
    const char *name = mospt_schema_find(&p->info.attributes, "rgb") >= 0         ? "rgb"
                       : mospt_schema_find(&p->info.attributes, "rgb_float") >= 0 ? "rgb_float"
                                                                                  : NULL;
    for (uint64_t i = 0; i < p->count; i++)
        sum += name != NULL ? scan_points_value(p, name, i, channel) : p->rgbi[4 * i + channel];
    return sum / (double)p->count;
}

static int check_colours(const manifest *m, const scan_points *p)
{
    static const char *const names[3] = {"mean_r", "mean_g", "mean_b"};
    int failures = 0;
    double total = 0;
    for (int c = 0; c < 3; c++)
        total += strtod(get(m, names[c]), NULL);
    if (p->info.has_rgb != (total > 0) && get(m, "mean_r")[0] != '\0')
        failures += fail_row(m, "has_rgb", p->info.has_rgb, total > 0);
    for (uint32_t c = 0; c < 3 && total > 0; c++) {
        if (!is_close(mean_colour(p, c), get(m, names[c]), 1))
            failures += fail_row(m, names[c], mean_colour(p, c), strtod(get(m, names[c]), NULL));
    }
    return failures;
}

static int check_intensity(const manifest *m, const scan_points *p)
{
    const char *text = get(m, "mean_intensity");
    /* a `quality` that the manifest counts as intensity is none for us */
    if (text[0] == '\0' || mospt_schema_find(&p->info.attributes, "intensity") < 0) return 0;
    double sum = 0;
    for (uint64_t i = 0; i < p->count; i++)
        sum += scan_points_value(p, "intensity", i, 0);
    double mean = sum / (double)p->count;
    return is_close(mean, text, 1) ? 0 : fail_row(m, "mean_intensity", mean, strtod(text, NULL));
}

static int check_loaded(const manifest *m, const scan_points *p, int which)
{
    int failures = 0;
    const char *expected = get(m, "expected"), *points = get(m, "points");
    uint64_t count =
        which >= 0 && special[which].count > 0 ? special[which].count : strtoull(points, NULL, 10);
    if ((count > 0 || points[0] != '\0') && p->count != count)
        failures += fail_row(m, "count", (double)p->count, (double)count);
    if (starts_with(expected, "truncated") && !p->is_damaged)
        failures += fail_row(m, "damage", 0, 1);
    if (starts_with(expected, "load all") && which < 0 && p->is_damaged &&
        strcmp(get(m, "file"), "pts/pdal__pts__bunny_8.pts") != 0)
        failures += fail_row(m, "damage", 1, 0);
    if (which >= 0 && special[which].skip_positions) return failures;
    if (points[0] == '\0') return failures;
    return failures + check_positions(m, p) + check_colours(m, p) + check_intensity(m, p);
}

static int check_row(const manifest *m, int *loaded)
{
    char path[2048];
    const char *file = get(m, "file"), *expected = get(m, "expected");
    int which = find_special(file);
    scan_points points;
    mospt_err err = {0};
    snprintf(path, sizeof path, "%s/%s", root, file);
    if (which >= 0) printf("special %s: %s\n", file, special[which].reason);

    bool ok = scan_points_read(path, NULL, 10000, &points, &err);
    if (ok) {
        bool must_fail = starts_with(expected, "refuse") ||
                         starts_with(expected, "accept as empty") ||
                         (which >= 0 && special[which].code != MOSPT_OK);
        int failures = must_fail ? fail_row(m, "points, none expected", (double)points.count, 0)
                                 : check_loaded(m, &points, which);
        ++*loaded;
        scan_points_fini(&points);
        return failures;
    }
    bool is_clean =
        (err.code == MOSPT_EFORMAT || err.code == MOSPT_EEMPTY) && strcmp(err.file, path) == 0;
    bool must_load = which >= 0
                         ? special[which].code == MOSPT_OK
                         : starts_with(expected, "load") || starts_with(expected, "truncated");
    if (is_clean && !must_load) return 0;
    printf("FAILED %s: code %d: %s\n", file, (int)err.code, err.message);
    return 1;
}

static void every_file_is_read_as_the_manifest_says(void **state)
{
    (void)state;
    char path[2048];
    static manifest m;
    int rows = 0, loaded = 0, failures = 0;
    snprintf(path, sizeof path, "%s/MANIFEST.tsv", root);
    m.file = fopen(path, "r");
    assert_non_null(m.file);
    assert_true(read_row(m.file, &m.names));
    while (read_row(m.file, &m.now)) {
        if (!is_ours(&m)) continue;
        rows++;
        failures += check_row(&m, &loaded);
    }
    fclose(m.file);
    printf("%d files, %d with points, %d differences\n", rows, loaded, failures);
    assert_true(rows > 100 && loaded > 80);
    assert_int_equal(failures, 0);
}

static bool find_root(void)
{
    const char *shared = getenv("IPTS_SHARED");
    if (shared != NULL) snprintf(root, sizeof root, "%s/scans", shared);
    else snprintf(root, sizeof root, "%s/../shared/scans", IPTS_SOURCE_DIR);
    char path[2048];
    snprintf(path, sizeof path, "%s/MANIFEST.tsv", root);
    return access(path, R_OK) == 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_file_is_read_as_the_manifest_says)};
    if (!find_root()) {
        printf("SKIPPED: no real scans in %s\n", root);
        return SKIPPED;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
