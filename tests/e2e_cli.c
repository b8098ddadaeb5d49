/* The program as people and scripts meet it: exit codes, what goes to which stream, and what is
 * left when it is stopped. argv[1] is the program. */
#include "tests/core_scans.h"
#include "tests/core_tools.h"

#include <fcntl.h>
#include <jansson.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { DONE = 0, FAILED = 1, WRONG_USE = 2, LEFT_OUT = 3, ARGUMENTS_MAX = 16 };

static const char *program;
static char out[1 << 16], said[1 << 16]; /* of the last run */

static void read_text(const char *name, char *text, size_t size)
{
    char *path = core_path(core_folder, "%s", name);
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    text[fread(text, 1, size - 1, f)] = '\0';
    fclose(f);
    unlink(path);
    free(path);
}

static void remove_file(const char *name)
{
    char *path = core_path(core_folder, "%s", name);
    unlink(path);
    free(path);
}

/* Starts the program in the test's folder with its streams in files.
 * arguments   separated by blanks
 * file_limit  bytes that a file may have; 0: any number */
static pid_t start(const char *arguments, size_t file_limit)
{
    pid_t child = fork();
    if (child != 0) return child;
    static char copy[1024];
    char *argv[ARGUMENTS_MAX + 2] = {(char *)(uintptr_t)program};
    snprintf(copy, sizeof copy, "%s", arguments);
    int count = 1;
    for (char *word = strtok(copy, " "); word != NULL && count <= ARGUMENTS_MAX;
         word = strtok(NULL, " "))
        argv[count++] = word;
    if (chdir(core_folder) != 0 || freopen("stdout", "wb", stdout) == NULL ||
        freopen("stderr", "wb", stderr) == NULL)
        _exit(98);
    if (file_limit > 0) setrlimit(RLIMIT_FSIZE, &(struct rlimit){file_limit, file_limit});
    execv(program, argv);
    _exit(99);
}

static int finish(pid_t child)
{
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    read_text("stdout", out, sizeof out);
    read_text("stderr", said, sizeof said);
    if (!WIFEXITED(status)) fail_msg("ended by signal %d; it said: %s", WTERMSIG(status), said);
    return WEXITSTATUS(status);
}

static int run(const char *arguments)
{
    return finish(start(arguments, 0));
}

static void expect(const char *arguments, int code)
{
    int got = run(arguments);
    if (got != code)
        fail_msg("`instantpoints %s` ended with %d instead of %d; it said: %s", arguments, got,
                 code, said);
}

static uint32_t lines_of(const char *text)
{
    uint32_t lines = 0;
    for (; *text != '\0'; text++)
        lines += *text == '\n';
    return lines;
}

static json_t *parse_output(void)
{
    json_error_t at;
    json_t *json = json_loads(out, JSON_REJECT_DUPLICATES, &at);
    if (json == NULL) fail_msg("line %d: %s in: %s", at.line, at.text, out);
    return json;
}

static json_int_t integer_at(json_t *object, const char *key)
{
    json_t *value = json_object_get(object, key);
    if (!json_is_integer(value)) fail_msg("no whole number \"%s\" in: %s", key, out);
    return json_integer_value(value);
}

static void make_las_in(const char *name, uint32_t count, uint16_t epsg)
{
    int32_t(*xyz)[3] = malloc(count * sizeof *xyz);
    uint64_t random = count;
    char *path = core_path(core_folder, "%s", name);
    assert_non_null(xyz);
    for (uint32_t i = 0; i < count; i++)
        for (int a = 0; a < 3; a++)
            xyz[i][a] = (int32_t)core_below(&random, 1000000);
    core_las las = {.scale = {0.001, 0.001, 0.001},
                    .offset = {500000, 5000000, 0},
                    .xyz = (const int32_t(*)[3])xyz,
                    .count = count,
                    .epsg = epsg};
    core_las_write(path, &las);
    free(path), free(xyz);
}

static void make_las(const char *name, uint32_t count)
{
    make_las_in(name, count, 0);
}

static void make_text(const char *name, const char *bytes)
{
    char *path = core_path(core_folder, "%s", name);
    core_file_write(path, bytes, strlen(bytes));
    free(path);
}

static bool is_there(const char *name)
{
    char *path = core_path(core_folder, "%s", name);
    bool there = core_exists(path);
    free(path);
    return there;
}

static void wrong_use_is_exit_code_2_and_one_sentence(void **state)
{
    static const char *const wrong[] = {
        "nonsense",
        "build",
        "build a.las",
        "build -o",
        "build a.las -o x.ipts --nonsense",
        "build a.las -o x.ipts --threads 0",
        "build a.las -o x.ipts --threads many",
        "build a.las -o x.ipts --memory -5",
        "build a.las -o x.ipts --inner-depth 10",
        "build a.las -o x.ipts --inner-depth 7x",
        "info",
        "info a b",
        "info --force x",
        "check",
        "check a b",
        "record",
        "record a.las",
        "record a.las -o a.mp4 --frames 5-3",
        "record a.las -o a.mp4 --frames 5",
        "record a.las -o a.mp4 --fps 0",
        "record a.las -o a.mp4 --fps 30/0",
        "record a.las -o a.mp4 --fps -1/-1",
        "record a.las -o a.mp4 --fps 3000000000/3000000000",
        "shot a.las -o a.png --size -1x-1",
        "shot a.las -o a.png --size 4294968576x720",
        "record a.las -o a.mp4 --samples 9",
        "record a.las -o a.mp4 --depth 12",
        "record a.las -o a.mp4 --preset best",
        "record a.las -o a.mp4 --shutter 2",
        "join a.mp4",
        "join -o a.mp4",
        "shot a.las -o a.png --frames 0-3",
        "help nonsense",
        "check --memory 1G x",
        "-x",
        "--nonsense",
    };
    (void)state;
    make_las("a.las", 10);
    for (size_t k = 0; k < sizeof wrong / sizeof wrong[0]; k++) {
        expect(wrong[k], WRONG_USE);
        assert_string_equal(out, "");
        if (lines_of(said) != 1 || strncmp(said, "instantpoints", 13) != 0)
            fail_msg("%s: %s", wrong[k], said);
        assert_false(is_there("x.ipts"));
    }
    expect("", WRONG_USE); /* the page of all commands */
    assert_string_equal(out, "");
    assert_non_null(strstr(said, "usage:"));
}

/* Known before anything is drawn, so no graphics driver is needed to find out. */
static void colours_that_are_not_there_are_wrong_use(void **state)
{
    static const char *const wrong[] = {
        "shot a.las -q -o x.png --color time",
        "shot a.las -q -o x.png --color reflectance",
        "shot a.las -q -o x.png --color distance",
        "shot a.las -q -o x.png --color scan --color-range 0,1",
        "shot a.las -q -o x.png --color scan --color-map turbo",
        "shot a.las -q -o x.png --color elevation --color-range 2,1",
        "shot a.las -q -o x.png --color elevation --color-map rainbow",
        "shot a.las -q -o x.png --brightness 0",
        "shot a.las -q -o x.png --gamma x",
        "shot a.las -q -o x.png --shape cube",
        "shot a.las -q -o x.png --blend 2",
        "shot a.las -q -o x.png --fill 9",
        "shot a.las -q -o x.png --edl-strength -1",
        "shot a.las -q -o x.png --edl-radius 0",
        "shot a.las -q -o x.png --point-min 0",
        "shot a.las -q -o x.png --background puce",
        "shot a.las -q -o x.png --background 12345",
        "shot a.las -q -o x.png --background white,",
        "view a.las -q --color time",
    };
    (void)state;
    make_las("a.las", 10);
    for (size_t k = 0; k < sizeof wrong / sizeof wrong[0]; k++) {
        expect(wrong[k], WRONG_USE);
        assert_string_equal(out, "");
        assert_int_equal(lines_of(said), 1);
        assert_false(is_there("x.png"));
    }
    expect("shot a.las -q -o x.png --color reflectance", WRONG_USE);
    assert_non_null(strstr(said, "no reflectance; colours can show rgb, intensity, elevation, "
                                 "classification, return, scan, density, number_of_returns"));
}

static void help_goes_to_standard_output(void **state)
{
    static const char *const pages[] = {"help",         "--help",     "-h",          "help build",
                                        "build --help", "build -h",   "info --help", "check --help",
                                        "help info",    "help check", "help shot",   "help view",
                                        "help record",  "help join",  "--version"};
    (void)state;
    for (size_t k = 0; k < sizeof pages / sizeof pages[0]; k++) {
        expect(pages[k], DONE);
        assert_string_equal(said, "");
        assert_true(strlen(out) > 10 && out[strlen(out) - 1] == '\n');
    }
    static char page[sizeof out];
    expect("help build", DONE);
    strcpy(page, out);
    expect("build --help", DONE);
    assert_string_equal(page, out);
    assert_non_null(strstr(out, "--memory"));
    assert_non_null(strstr(out, "--threads"));
    assert_null(strstr(out, "--fov"));
    /* Options of building are named, and explained where they belong. */
    expect("help record", DONE);
    assert_non_null(strstr(out, "--columns"));
    assert_null(strstr(out, "\n      --columns "));
    assert_non_null(strstr(out, "\n      --threads "));
}

static void a_site_is_built_told_and_checked(void **state)
{
    (void)state;
    make_las("a.las", 50000);
    make_text("b.xyz", "500000 5000000 1\n500001 5000001 2\n500002.5 5000002 3\n");
    expect("build a.las b.xyz -o site.ipts --threads 2", DONE);
    assert_non_null(strstr(out, "50,003"));
    expect("info site.ipts", DONE);
    assert_string_equal(said, "");
    assert_non_null(strstr(out, "50,003"));
    assert_non_null(strstr(out, "a.las"));
    expect("info site.ipts --stats", DONE);
    expect("check site.ipts", DONE);
    assert_int_equal(lines_of(out), 1);
    assert_non_null(strstr(out, "50003"));
}

static void json_is_all_there_is_on_standard_output(void **state)
{
    json_t *json;
    (void)state;
    make_las("a.las", 50000);
    make_text("b.xyz", "500000 5000000 1\nnan 1 1\n500002.5 5000002 3\n");
    expect("build a.las b.xyz -o site.ipts --json", DONE);
    json = parse_output();
    assert_int_equal(integer_at(json, "points"), 50002);
    assert_int_equal(integer_at(json, "dropped"), 1);
    assert_int_equal(json_array_size(json_object_get(json, "sources")), 2);
    assert_int_equal(json_array_size(json_object_get(json, "left_out")), 0);
    json_decref(json);
    for (int stats = 0; stats < 2; stats++) {
        expect(stats ? "info site.ipts --json --stats" : "info --json site.ipts", DONE);
        assert_string_equal(said, "");
        json = parse_output();
        assert_int_equal(integer_at(json, "points"), 50002);
        assert_true(json_is_object(json_object_get(json, "stats")) == (stats == 1));
        json_t *min = json_object_get(json_object_get(json, "bounds"), "min");
        assert_true(json_number_value(json_array_get(min, 0)) == 500000);
        json_decref(json);
    }
    expect("check site.ipts --json", DONE);
    json = parse_output();
    assert_true(json_is_true(json_object_get(json, "ok")));
    assert_int_equal(integer_at(json, "points"), 50002);
    assert_int_equal(json_array_size(json_object_get(json, "findings")), 0);
    json_decref(json);
}

static void json_of_names_that_are_no_text_parses(void **state)
{
    (void)state;
    make_las("caf\xe9\"\\\x01.las", 100);
    expect("build caf\xe9\"\\\x01.las -o si\xfft\x02\".ipts --json", DONE);
    json_decref(parse_output());
    expect("info si\xfft\x02\".ipts --json", DONE);
    json_decref(parse_output());
    expect("check si\xfft\x02\".ipts --json", DONE);
    json_decref(parse_output());
    make_text("bad\xe9.las", "LASF");
    expect("build caf\xe9\"\\\x01.las bad\xe9.las -o two.ipts --json", LEFT_OUT);
    json_t *json = parse_output();
    assert_int_equal(json_array_size(json_object_get(json, "left_out")), 1);
    json_decref(json);
}

static void a_scan_file_says_what_is_in_it(void **state)
{
    (void)state;
    make_las("a.las", 1000);
    expect("info a.las --json", DONE);
    json_t *json = parse_output();
    assert_int_equal(integer_at(json, "points"), 1000);
    json_decref(json);
    make_text("b.xyz", "1 2 3\n4 5 6\n7 8 9\n");
    make_text("b.pose.txt", "1 0 0 100  0 1 0 200  0 0 1 300  0 0 0 1\n");
    expect("info b.xyz", DONE);
    assert_non_null(strstr(out, "101.000  202.000  303.000"));
    make_text("b.pose.txt", "1 0 0\n");
    expect("info b.xyz", FAILED);
    assert_non_null(strstr(said, "b.pose.txt: "));
}

static void each_file_becomes_a_dataset_once(void **state)
{
    (void)state;
    make_las("a.las", 1000);
    make_text("b.xyz", "1 2 3\n4 5 6\n");
    make_text("c.las", "LASF");
    for (int round = 0; round < 2; round++) {
        expect("build --each a.las b.xyz c.las -o each --json", LEFT_OUT);
        json_t *json = parse_output(), *files = json_object_get(json, "files");
        assert_int_equal(json_array_size(files), 3);
        const char *wanted[3] = {round == 0 ? "built" : "up to date",
                                 round == 0 ? "built" : "up to date", "failed"};
        for (size_t i = 0; i < 3; i++)
            assert_string_equal(
                json_string_value(json_object_get(json_array_get(files, i), "status")), wanted[i]);
        json_decref(json);
    }
    expect("check each/a.las.ipts", DONE);
    expect("build --each c.las -o each", FAILED);
}

static void what_is_outside_the_crop_is_counted(void **state)
{
    (void)state;
    make_text("b.xyz", "1 2 3\n4 5 6\n7 8 9\n");
    expect("build b.xyz -o site.ipts --crop 0,0,0,5,5,10 --crs EPSG:25832 --json", DONE);
    json_t *json = parse_output();
    assert_int_equal(integer_at(json, "points"), 2);
    assert_int_equal(integer_at(json, "dropped"), 1);
    json_decref(json);
    expect("info site.ipts --json", DONE);
    json = parse_output();
    assert_string_equal(json_string_value(json_object_get(json, "crs")), "EPSG:25832");
    json_decref(json);
    expect("build b.xyz -o none.ipts --crop 50,50,50,60,60,60", FAILED);
    expect("build b.xyz -o none.ipts --crop 5,0,0,1,1,1", WRONG_USE);
}

static void a_stray_point_far_away_is_left_out(void **state)
{
    (void)state;
    char *text = malloc(400000), *at = text;
    assert_non_null(text);
    for (int i = 0; i < 5000; i++)
        at += sprintf(at, i == 2000 ? "1e9 1 2\n" : "%d.5 %d 3\n", i % 100, i / 100);
    make_text("b.xyz", text);
    free(text);
    expect("build b.xyz -o site.ipts --json", DONE);
    json_t *json = parse_output();
    assert_int_equal(integer_at(json, "points"), 4999);
    assert_int_equal(integer_at(json, "dropped"), 1);
    json_decref(json);
    expect("info site.ipts", DONE);
    assert_non_null(strstr(out, "1  dropped: out of range"));
    expect("check site.ipts", DONE);
}

static void only_the_attributes_asked_for_are_kept(void **state)
{
    (void)state;
    make_las("a.las", 100);
    expect("build a.las -o site.ipts --attributes intensity,user_data", DONE);
    expect("info site.ipts", DONE);
    assert_non_null(strstr(out, "attributes scan u16, intensity u16, user_data u8\n"));
    expect("check site.ipts", DONE);
    expect("build a.las -o site.ipts --attributes none --force", DONE);
    expect("info site.ipts", DONE);
    assert_non_null(strstr(out, "attributes scan u16\n"));
    expect("build a.las -o site.ipts --attributes intensity,uesr_data --force", FAILED);
    assert_non_null(strstr(said, "no scan has an attribute \"uesr_data\""));
}

static void duplicates_are_left_out_when_asked_for(void **state)
{
    (void)state;
    make_text("a.xyz", "1 2 3\n4 5 6\n1 2 3\n");
    make_text("b.xyz", "4 5 6\n7 8 9\n");
    for (int dedupe = 0; dedupe < 2; dedupe++) {
        expect(dedupe ? "build a.xyz b.xyz -o site.ipts --force --dedupe --json"
                      : "build a.xyz b.xyz -o site.ipts --json",
               DONE);
        json_t *json = parse_output();
        assert_int_equal(integer_at(json, "points"), dedupe ? 3 : 5);
        assert_int_equal(integer_at(json, "dropped"), dedupe ? 2 : 0);
        json_decref(json);
        expect("check site.ipts", DONE);
    }
    expect("info site.ipts", DONE);
    assert_non_null(strstr(out, "1  dropped: duplicate"));
    make_text("c.xyz", "4 5 6\n7 8 9\n"); /* all of it is in b.xyz */
    expect("build a.xyz b.xyz c.xyz -o site.ipts --force --dedupe", DONE);
    expect("check site.ipts", DONE);
}

static void scans_in_several_reference_systems_are_named(void **state)
{
    (void)state;
    make_las("a.las", 100);
    make_las_in("b.las", 100, 25832);
    make_las_in("c.las", 100, 25833);
    make_las_in("d.las", 100, 25833);
    expect("build a.las b.las -o one.ipts", DONE);
    assert_null(strstr(out, "crs"));
    expect("build a.las b.las c.las d.las -o site.ipts", DONE);
    static const char line[] =
        "  crs        2 of 4 scans state another one than EPSG:25832: EPSG:25833 (c.las)\n";
    assert_non_null(strstr(out, line));
    expect("info site.ipts", DONE);
    assert_non_null(strstr(out, line));
    expect("info site.ipts --json", DONE);
    json_t *json = parse_output(), *sources = json_object_get(json, "sources");
    assert_string_equal(json_string_value(json_object_get(json, "crs")), "EPSG:25832");
    static const char *const wanted[4] = {NULL, NULL, "EPSG:25833", "EPSG:25833"};
    for (size_t i = 0; i < 4; i++) {
        const char *crs = json_string_value(json_object_get(json_array_get(sources, i), "crs"));
        if (wanted[i] == NULL) assert_null(crs);
        else assert_string_equal(crs, wanted[i]);
    }
    json_decref(json);
    /* WKT goes by the code of the whole, not by those of its parts */
    expect(
        "build b.las c.las -o wkt.ipts --crs "
        "PROJCS[\"x\",GEOGCS[\"y\",AUTHORITY[\"EPSG\",\"25832\"]],AUTHORITY[\"EPSG\",\"25833\"]]",
        DONE);
    assert_non_null(strstr(
        out, "  crs        1 of 2 scans state another one than EPSG:25833: EPSG:25832 (b.las)\n"));
}

static void input_left_out_is_exit_code_3(void **state)
{
    (void)state;
    make_las("a.las", 1000);
    make_text("b.las", "LASF is not enough");
    expect("build a.las b.las -o site.ipts", LEFT_OUT);
    assert_non_null(strstr(said, "b.las"));
    expect("check site.ipts", DONE);
    /* a damaged file, of which a part is read */
    char *path = core_path(core_folder, "a.las");
    assert_int_equal(truncate(path, 227 + 20 * 500 + 3), 0);
    free(path);
    expect("build a.las -o part.ipts --json", LEFT_OUT);
    json_t *json = parse_output();
    assert_int_equal(integer_at(json, "points"), 500);
    json_decref(json);
    assert_non_null(strstr(said, "a.las"));
}

static void failures_are_exit_code_1_and_one_sentence(void **state)
{
    static const char *const failing[] = {
        "build missing.las -o x.ipts",
        "build b.las -o x.ipts",
        "build a.las -o nowhere/x.ipts",
        "build a.las -o x.ipts --temp-dir nowhere",
        "build a.las -o x.ipts --memory 1M",
        "build a.las -o full",
        "build a.las -o full --force",
        "info missing.ipts",
        "info full",
        "check full -q",
        "info b.las",
    };
    (void)state;
    make_las("a.las", 10);
    make_text("b.las", "LASF");
    char *full = core_path(core_folder, "full");
    assert_int_equal(mkdir(full, 0777), 0);
    free(full);
    make_text("full/note.txt", "mine");
    for (size_t k = 0; k < sizeof failing / sizeof failing[0]; k++) {
        expect(failing[k], FAILED);
        if (lines_of(said) != 1 || strncmp(said, "instantpoints: ", 15) != 0)
            fail_msg("%s: %s", failing[k], said);
        assert_false(is_there("x.ipts"));
        assert_true(is_there("full/note.txt"));
    }
    expect("build a.las -o site.ipts", DONE);
    expect("build a.las -o site.ipts", FAILED);
    assert_non_null(strstr(said, "--force"));
    expect("build a.las -o site.ipts --force", DONE);
}

static void check_names_what_is_damaged(void **state)
{
    (void)state;
    make_las("a.las", 20000);
    expect("build a.las -o site.ipts", DONE);
    char *path = core_path(core_folder, "site.ipts/points-00.bin");
    size_t size;
    uint8_t *bytes = core_file_read(path, &size);
    bytes[size / 2] ^= 4;
    core_file_write(path, bytes, size);
    expect("check site.ipts", FAILED);
    assert_non_null(strstr(said, "site.ipts/points-00.bin: byte "));
    expect("check site.ipts --json", FAILED);
    json_t *json = parse_output();
    assert_true(json_is_false(json_object_get(json, "ok")));
    assert_int_equal(json_array_size(json_object_get(json, "findings")), 1);
    json_decref(json);
    unlink(path);
    expect("check site.ipts --json", FAILED);
    json_decref(parse_output());
    free(bytes), free(path);
}

/* Removes an unfinished dataset, which must be undamaged. */
static void remove_unfinished(void)
{
    if (!is_there("site.ipts/metadata.json")) return;
    assert_int_equal(run("check site.ipts"), DONE);
    char *left = core_path(core_folder, "site.ipts");
    assert_true(mospt_dataset_is_unfinished(left));
    core_folder_remove(left);
}

static void a_signal_stops_a_build_and_leaves_nothing_half_done(void **state)
{
    static const int signals[] = {SIGINT, SIGTERM};
    uint32_t stopped = 0;
    (void)state;
    make_las("a.las", 600000);
    /* a machine that is busy may take seconds to start the program */
    for (int k = 0; k < 6 || (stopped == 0 && k < 11); k++) {
        pid_t child = start("build a.las -o site.ipts --threads 2", 0);
        const long wait_ms = 10L << k;
        nanosleep(&(struct timespec){wait_ms / 1000, wait_ms % 1000 * 1000000}, NULL);
        kill(child, signals[k % 2]);
        int status, code;
        assert_int_equal(waitpid(child, &status, 0), child);
        if (WIFSIGNALED(status)) { /* before the program listens to signals */
            assert_int_equal(WTERMSIG(status), signals[k % 2]);
            remove_file("stdout"); /* which it may not have had yet */
            remove_file("stderr");
            assert_int_equal(core_entries(core_folder), 1);
            continue;
        }
        read_text("stdout", out, sizeof out);
        read_text("stderr", said, sizeof said);
        code = WEXITSTATUS(status);
        if (code == DONE) {
            assert_int_equal(run("check site.ipts"), DONE);
            char *path = core_path(core_folder, "site.ipts");
            core_folder_remove(path);
            continue;
        }
        assert_int_equal(code, FAILED);
        assert_string_equal(out, "");
        assert_non_null(strstr(said, "stopped"));
        if (is_there("site.ipts/metadata.json")) {
            assert_non_null(strstr(said, "goes on from there"));
            remove_unfinished();
        }
        assert_int_equal(core_entries(core_folder), 1); /* the scan */
        stopped++;
    }
    assert_true(stopped > 0);
}

static void a_killed_build_goes_on_to_the_same_bytes(void **state)
{
    (void)state;
    make_las("a.las", 2000000);
    expect("build a.las -o whole.ipts", DONE);
    for (int k = 0; k < 8; k++) {
        pid_t child = start(k % 2 ? "build a.las -o site.ipts --threads 1 --memory 64M"
                                  : "build a.las -o site.ipts --threads 2",
                            0);
        nanosleep(&(struct timespec){.tv_sec = k / 7, .tv_nsec = 7000000L << k % 7}, NULL);
        kill(child, SIGKILL);
        waitpid(child, NULL, 0);
        if (is_there("site.ipts/metadata.json")) {
            expect("check site.ipts", DONE);
            expect("info site.ipts", DONE);
        }
    }
    run("build a.las -o site.ipts"); /* refused if it was done */
    char *whole = core_path(core_folder, "whole.ipts"), *path = core_path(core_folder, "site.ipts");
    core_assert_same_folders(whole, path);
    core_folder_remove(whole);
    core_folder_remove(path);
    unlink((path = core_path(core_folder, "stdout"))), free(path);
    unlink((path = core_path(core_folder, "stderr"))), free(path);
    assert_int_equal(core_entries(core_folder), 1);
}

static void a_full_disk_is_one_sentence_and_leaves_nothing_half_done(void **state)
{
    static const size_t limits[] = {5000, 100000, 1500000};
    (void)state;
    make_las("a.las", 200000);
    signal(SIGXFSZ, SIG_IGN); /* inherited: a write beyond the limit fails as on a full disk */
    for (int k = 0; k < 3; k++) {
        assert_int_equal(finish(start("build a.las -o site.ipts -q", limits[k])), FAILED);
        assert_string_equal(out, "");
        if (lines_of(said) != 1 || strncmp(said, "instantpoints: ", 15) != 0) fail_msg("%s", said);
        remove_unfinished();
        assert_int_equal(core_entries(core_folder), 1);
    }
    signal(SIGXFSZ, SIG_DFL);
}

static void a_limit_on_the_size_of_files_is_like_a_full_disk(void **state)
{
    (void)state;
    make_las("a.las", 20000);
    assert_int_equal(finish(start("build a.las -o site.ipts -q", 5000)),
                     FAILED); /* not ended by SIGXFSZ */
    assert_int_equal(core_entries(core_folder), 1);
}

#define CASE(f) cmocka_unit_test_setup_teardown(f, core_folder_set_up, core_folder_tear_down)

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        CASE(wrong_use_is_exit_code_2_and_one_sentence),
        CASE(colours_that_are_not_there_are_wrong_use),
        CASE(help_goes_to_standard_output),
        CASE(a_site_is_built_told_and_checked),
        CASE(json_is_all_there_is_on_standard_output),
        CASE(json_of_names_that_are_no_text_parses),
        CASE(a_scan_file_says_what_is_in_it),
        CASE(each_file_becomes_a_dataset_once),
        CASE(what_is_outside_the_crop_is_counted),
        CASE(a_stray_point_far_away_is_left_out),
        CASE(only_the_attributes_asked_for_are_kept),
        CASE(duplicates_are_left_out_when_asked_for),
        CASE(scans_in_several_reference_systems_are_named),
        CASE(input_left_out_is_exit_code_3),
        CASE(failures_are_exit_code_1_and_one_sentence),
        CASE(check_names_what_is_damaged),
        CASE(a_signal_stops_a_build_and_leaves_nothing_half_done),
        CASE(a_killed_build_goes_on_to_the_same_bytes),
        CASE(a_full_disk_is_one_sentence_and_leaves_nothing_half_done),
        CASE(a_limit_on_the_size_of_files_is_like_a_full_disk),
    };
    if (argc < 2) return 2;
    program = realpath(argv[1], NULL);
    return program == NULL ? 2 : cmocka_run_group_tests(tests, NULL, NULL);
}
