/* main.c - the front door: subcommands, options, exit codes. */
#include "cli_options.h"
#include "cli_progress.h"
#include "cli_record.h"
#include "cli_report.h"

#include "mospt/check.h"
#include "mospt/file.h"
#include "render/scheme.h"
#include "render/shot.h"
#include "render/view.h"

#include <jansson.h>
#include <malloc.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { EXIT_DONE = 0, EXIT_FAILED = 1, EXIT_WRONG_USE = 2, EXIT_LEFT_OUT = 3 };

/* Datasets up to this size are read whole by a plain `info`: about a second. */
static const uint64_t INFO_READS_POINTS = 8000000;

static volatile sig_atomic_t stop_asked; /* set by the signal handler, read by whoever can stop */

static void ask_to_stop(int number)
{
    (void)number;
    stop_asked = 1;
}

static bool should_stop(void)
{
    return stop_asked != 0;
}

static int fail(const mospt_err *err)
{
    char text[2048];
    mospt_err_text(err, text, sizeof text);
    fprintf(stderr, "instantpoints: %s\n", text);
    return EXIT_FAILED;
}

static int misuse(cli_command command, const char *what)
{
    fprintf(stderr, "instantpoints %s: %s (`instantpoints help %s`)\n", cli_command_name(command),
            what, cli_command_name(command));
    return EXIT_WRONG_USE;
}

static bool on_build_progress(void *context, const prep_progress *now)
{
    cli_progress_build(context, now);
    return !stop_asked;
}

static void on_build_announce(void *context, uint64_t points, uint64_t scratch_bytes,
                              uint64_t output_bytes, bool again)
{
    const cli_progress *progress = context;
    if (!progress->quiet) cli_report_announcement(points, scratch_bytes, output_bytes, again);
}

static prep_build_options build_options(const cli_options *o, const char *output,
                                        cli_progress *progress)
{
    return (prep_build_options){
        .inputs = o->paths,
        .input_count = o->path_count,
        .output = output,
        .temp_dir = o->temp_dir,
        .compress_scratch = o->compress_scratch,
        .force = o->force,
        .dedupe = o->dedupe,
        .attributes = o->attributes,
        .threads = o->threads,
        .memory = o->memory,
        .inner_depth = o->inner_depth,
        .crs = o->crs,
        .progress = on_build_progress,
        .context = progress,
    };
}

/* Columns, poses and crop. The list of poses is the caller's to release. */
static bool read_scan_options(const cli_options *o, prep_pose_list *poses, prep_scan_options *out,
                              mospt_err *err)
{
    *poses = (prep_pose_list){0};
    *out = (prep_scan_options){.columns = o->columns, .poses = poses, .has_crop = o->has_crop};
    for (int a = 0; a < 3; a++)
        out->crop_low[a] = o->crop[a], out->crop_high[a] = o->crop[a + 3];
    return o->poses == NULL || prep_pose_list_read(o->poses, poses, err);
}

static int build_to(const cli_options *o, const char *output, bool words, mospt_err *err)
{
    prep_build_result result;
    cli_progress progress;
    cli_progress_start(&progress, o->quiet);
    prep_pose_list poses;
    prep_build_options options = build_options(o, output, &progress);
    options.announce = on_build_announce;
    if (!read_scan_options(o, &poses, &options.scans, err)) return EXIT_FAILED;
    /* While a build runs, buffers go back to the system as soon as they are freed: the memory limit
     * is that of the process. A renderer is better served by the allocator's own ways. */
    mallopt(M_MMAP_THRESHOLD, 256 << 10);
    bool ok = prep_build(&options, &result, err);
    mallopt(M_MMAP_THRESHOLD, 32 << 20);
    prep_pose_list_fini(&poses);
    cli_progress_end(&progress);
    if (ok || result.source.left_out_count > 1) cli_report_losses(&result);
    if (ok && o->json && words) cli_report_build_json(stdout, output, &result);
    else if (ok && words) cli_report_build(stdout, output, &result);
    int code = !ok                                      ? EXIT_FAILED
               : prep_build_left_something_out(&result) ? EXIT_LEFT_OUT
                                                        : EXIT_DONE;
    prep_build_result_fini(&result);
    return code;
}

static bool on_each(void *context, size_t index, size_t count, const char *name)
{
    cli_progress *progress = context;
    cli_progress_end(progress);
    if (!progress->quiet) fprintf(stderr, "%zu of %zu: %s\n", index + 1, count, name);
    cli_progress_start(progress, progress->quiet);
    return !stop_asked;
}

static int build_each(const cli_options *o)
{
    mospt_err err = {0};
    cli_each_report report;
    cli_progress progress;
    size_t failed = 0, lacking = 0;
    cli_progress_start(&progress, o->quiet);
    prep_pose_list poses;
    prep_build_options options = build_options(o, o->output, &progress);
    if (!read_scan_options(o, &poses, &options.scans, &err)) return fail(&err);
    mallopt(M_MMAP_THRESHOLD, 256 << 10);
    bool ok = cli_each(&options, on_each, &report, &err);
    prep_pose_list_fini(&poses);
    cli_progress_end(&progress);
    if (ok && o->json) cli_report_each_json(stdout, o->output, &report);
    else if (ok) cli_report_each(stdout, &report);
    for (size_t i = 0; i < report.count; i++) {
        failed += report.items[i].status == CLI_EACH_FAILED;
        lacking +=
            report.items[i].status == CLI_EACH_FAILED || report.items[i].status == CLI_EACH_IN_PART;
    }
    bool none = failed == report.count;
    cli_each_fini(&report);
    if (!ok) return fail(&err);
    return none ? EXIT_FAILED : lacking > 0 ? EXIT_LEFT_OUT : EXIT_DONE;
}

static int command_build(const cli_options *o)
{
    mospt_err err = {0};
    if (o->path_count == 0) return misuse(o->command, "which scans?");
    if (o->output == NULL)
        return misuse(o->command,
                      o->each ? "where to? -o FOLDER says it" : "where to? -o NAME.ipts says it");
    if (o->each) return build_each(o);
    int code = build_to(o, o->output, true, &err);
    return code == EXIT_FAILED ? fail(&err) : code;
}

static bool is_dataset_name(const char *path)
{
    size_t n = strlen(path);
    while (n > 1 && path[n - 1] == '/')
        n--;
    return mospt_dataset_exists(path) || (n > 5 && strncmp(path + n - 5, ".ipts", 5) == 0);
}

static bool inspect_scans(const cli_options *o, const prep_scan_options *options,
                          prep_inspection **scans, uint32_t *count, mospt_err *err)
{
    *count = 1;
    for (uint32_t i = 0; i < *count; i++) {
        if (!prep_inspect(o->paths[0], i, options, o->stats, &(*scans)[i], err)) return false;
        if (i > 0 || (*scans)[0].info.scan_count <= 1) continue;
        *count = (*scans)[0].info.scan_count;
        prep_inspection *all = realloc(*scans, *count * sizeof *all);
        if (all == NULL) return mospt_err_nomem(err, *count * sizeof *all);
        *scans = all;
    }
    return true;
}

static int info_of_scans(const cli_options *o)
{
    mospt_err err = {0};
    prep_pose_list poses;
    prep_scan_options options;
    prep_inspection *scans = malloc(sizeof *scans);
    uint32_t count = 1;
    bool ok = read_scan_options(o, &poses, &options, &err) &&
              prep_scan_memory_create(&options.memory, &err) &&
              (scans != NULL || mospt_err_nomem(&err, sizeof *scans)) &&
              inspect_scans(o, &options, &scans, &count, &err);
    bool damaged = false;
    for (uint32_t i = 0; ok && i < count; i++)
        damaged = damaged || scans[i].damage.code != MOSPT_OK;
    if (ok && o->json) cli_report_scans_json(stdout, o->paths[0], scans, count);
    else if (ok) cli_report_scans(stdout, o->paths[0], scans, count);
    free(scans);
    prep_scan_memory_destroy(options.memory);
    prep_pose_list_fini(&poses);
    return !ok ? fail(&err) : damaged ? EXIT_LEFT_OUT : EXIT_DONE;
}

static int command_info(const cli_options *o)
{
    mospt_err err = {0};
    mospt_dataset *dataset = NULL;
    mospt_tree_figures tree;
    mospt_point_figures *points = NULL;
    mospt_spt_figures spt;
    int code = EXIT_FAILED;
    if (o->path_count != 1) return misuse(o->command, "one dataset or scan file is wanted");
    if (!is_dataset_name(o->paths[0])) return info_of_scans(o);
    if (!mospt_dataset_open(o->paths[0], &dataset, &err)) return fail(&err);
    bool read = o->stats || dataset->metadata.point_count <= INFO_READS_POINTS;
    if (o->stats && (points = malloc(sizeof *points)) == NULL) {
        mospt_err_nomem(&err, sizeof *points);
    } else if (mospt_survey_tree(dataset, &tree, &err) &&
               (!read || mospt_survey_points(dataset, points, &spt, &err))) {
        if (o->json) cli_report_info_json(stdout, dataset, &tree, points, read ? &spt : NULL);
        else cli_report_info(stdout, dataset, &tree, points, read ? &spt : NULL);
        code = EXIT_DONE;
    }
    if (code != EXIT_DONE) fail(&err);
    free(points);
    mospt_dataset_close(dataset);
    return code;
}

/* What `view` and `shot` look at: a dataset that was named, or one that is built of the scans that
 * were. */
typedef struct {
    mospt_dataset *dataset;
    char folder[4096]; /* of a temporary dataset, "" otherwise */
    int code;          /* exit code so far */
} place;

static bool make_temporary_folder(const cli_options *o, char folder[4096], mospt_err *err)
{
    const char *below = o->temp_dir != NULL ? o->temp_dir : getenv("TMPDIR");
    snprintf(folder, 4096, "%s/instantpoints-XXXXXX", below != NULL ? below : "/tmp");
    if (mkdtemp(folder) != NULL) return true;
    mospt_err_set(err, MOSPT_EIO, mospt_at_file(folder), "cannot be created");
    folder[0] = '\0';
    return false;
}

static bool place_open(const cli_options *o, const char *output, place *p, mospt_err *err)
{
    *p = (place){0};
    if (o->path_count == 1 && is_dataset_name(o->paths[0]))
        return mospt_dataset_open(o->paths[0], &p->dataset, err);
    char path[4200];
    snprintf(path, sizeof path, "%s", output != NULL ? output : "");
    if (output == NULL) {
        if (!make_temporary_folder(o, p->folder, err)) return false;
        snprintf(path, sizeof path, "%s/scans.ipts", p->folder);
    }
    p->code = build_to(o, path, false, err);
    return p->code != EXIT_FAILED && mospt_dataset_open(path, &p->dataset, err);
}

static void place_close(place *p)
{
    mospt_dataset_close(p->dataset);
    if (p->folder[0] != '\0') mospt_file_remove_tree(p->folder, NULL);
}

/* Colours that the dataset cannot show are a wrong use, and known before anything is drawn. */
static bool has_colours(const cli_options *o, place *p)
{
    mospt_err err = {0};
    if (rend_scheme_fits(p->dataset, &o->look, &err)) return true;
    p->code = misuse(o->command, err.message);
    return false;
}

static void warn_of_damage(uint32_t nodes, const mospt_err *first)
{
    char text[2048];
    if (nodes == 0) return;
    mospt_err_text(first, text, sizeof text);
    fprintf(stderr, "instantpoints: %u damaged node%s not shown: %s\n", nodes,
            nodes == 1 ? " is" : "s are", text);
}

static void warn_of_resets(uint32_t resets)
{
    if (resets > 0)
        fprintf(stderr,
                "instantpoints: the graphics driver was reset; what it was drawing was drawn "
                "again, and nothing is missing\n");
}

static void report_shot(const cli_options *o, const rend_shot_result *r)
{
    if (!o->json) {
        printf("%s: %llu points in %u nodes, %.0f ms on %s\n", o->output,
               (unsigned long long)r->points_drawn, r->nodes_drawn, r->total_ms, r->renderer);
        return;
    }
    json_t *json = json_pack(
        "{s:s, s:I, s:o, s:I, s:I, s:I, s:I, s:b, s:I, s:I, s:f, s:s}", "picture", o->output,
        "points_drawn", (json_int_t)r->points_drawn, "budget",
        r->budget_points == REND_ALL ? json_null() : json_integer((json_int_t)r->budget_points),
        "points_in_view", (json_int_t)r->points_in_view, "nodes_drawn", (json_int_t)r->nodes_drawn,
        "nodes_hidden", (json_int_t)r->nodes_hidden, "points_hidden", (json_int_t)r->points_hidden,
        "budget_spent", (int)r->budget_spent, "loaded_bytes", (json_int_t)r->loaded_bytes,
        "damaged_nodes", (json_int_t)r->damaged_nodes, "ms", r->total_ms, "renderer", r->renderer);
    json_dumpf(json, stdout, JSON_INDENT(2));
    putchar('\n');
    json_decref(json);
}

static int command_shot(const cli_options *o)
{
    mospt_err err = {0};
    place p;
    rend_shot_result result = {0};
    if (o->path_count == 0) return misuse(o->command, "of what?");
    if (o->output == NULL) return misuse(o->command, "where to? -o PICTURE.png says it");
    const rend_shot_options options = {.path = o->output,
                                       .width = o->width,
                                       .height = o->height,
                                       .camera = o->camera,
                                       .look = o->look,
                                       .legend = o->legend,
                                       .limits = o->limits,
                                       .engine = {o->renderer, o->threads}};
    bool opened = place_open(o, NULL, &p, &err), fits = opened && has_colours(o, &p);
    bool ok = fits && rend_shot(p.dataset, &options, &result, &err);
    if (ok) {
        report_shot(o, &result);
        warn_of_resets(result.resets);
        warn_of_damage(result.damaged_nodes, &result.damage);
        if (result.damaged_nodes > 0) p.code = EXIT_LEFT_OUT;
    }
    place_close(&p);
    return ok || (opened && !fits) ? p.code : fail(&err);
}

static int command_record(const cli_options *o)
{
    mospt_err err = {0};
    place p;
    rend_record_result result = {0};
    if (o->path_count == 0) return misuse(o->command, "of what?");
    if (o->output == NULL) return misuse(o->command, "where to? -o FILM.mp4 says it");
    if ((o->camera_path != NULL) + o->film.tour + o->film.orbit > 1)
        return misuse(o->command, "which of --path, --tour and --orbit?");
    bool ok = place_open(o, NULL, &p, &err) && cli_record(o, p.dataset, should_stop, &result, &err);
    if (ok) {
        cli_record_report(o, &result);
        warn_of_resets(result.resets);
        warn_of_damage(result.damaged_nodes, &result.damage);
        if (result.damaged_nodes > 0) p.code = EXIT_LEFT_OUT;
    }
    place_close(&p);
    return ok ? p.code : fail(&err);
}

static int command_join(const cli_options *o)
{
    mospt_err err = {0};
    if (o->path_count == 0) return misuse(o->command, "which films?");
    if (o->output == NULL) return misuse(o->command, "where to? -o FILM.mp4 says it");
    return cli_join(o, should_stop, &err) ? EXIT_DONE : fail(&err);
}

static int command_view(const cli_options *o)
{
    mospt_err err = {0};
    place p;
    rend_view_result result = {0};
    if (o->path_count == 0) return misuse(o->command, "of what?");
    const rend_view_options options = {.width = o->width,
                                       .height = o->height,
                                       .camera = o->camera,
                                       .look = o->look,
                                       .limits = o->limits,
                                       .engine = {o->renderer, o->threads},
                                       .fps = o->fps,
                                       .frames = o->frames,
                                       .screenshot = o->screenshot,
                                       .path = o->camera_path,
                                       .should_stop = should_stop};
    bool opened = place_open(o, o->output, &p, &err), fits = opened && has_colours(o, &p);
    bool ok = fits && rend_view(p.dataset, &options, &result, &err);
    if (ok) warn_of_damage(result.damaged_nodes, &result.damage);
    if (ok && result.no_words.code != MOSPT_OK)
        fail(&result.no_words); /* the picture was there all the same */
    if (ok && result.damaged_nodes > 0) p.code = EXIT_LEFT_OUT;
    place_close(&p);
    return ok || (opened && !fits) ? p.code : fail(&err);
}

typedef struct {
    cli_progress progress;
    json_t *findings;
} check_context;

static void on_finding(void *context, const mospt_err *what)
{
    check_context *c = context;
    char text[2048];
    cli_progress_end(&c->progress);
    fail(what);
    mospt_err_text(what, text, sizeof text);
    json_array_append_new(c->findings, json_string(text));
}

static bool on_check_progress(void *context, uint32_t done, uint32_t total)
{
    check_context *c = context;
    cli_progress_share(&c->progress, "checking", done, total);
    return !stop_asked;
}

static int command_check(const cli_options *o)
{
    mospt_err err = {0};
    mospt_dataset *dataset = NULL;
    mospt_check_result result = {0};
    if (o->path_count != 1) return misuse(o->command, "one dataset is wanted");
    check_context context = {.findings = json_array()};
    const mospt_check_options options = {
        .found = on_finding, .progress = on_check_progress, .context = &context};
    cli_progress_start(&context.progress, o->quiet);
    bool looked = mospt_dataset_open(o->paths[0], &dataset, &err);
    if (!looked) {
        on_finding(&context, &err);
        result.findings = 1;
    } else {
        looked = mospt_check(dataset, &options, &result, &err);
        cli_progress_end(&context.progress);
        if (!looked) fail(&err);
    }
    bool good = looked && result.findings == 0;
    if (o->json) {
        json_t *json = json_pack(
            "{s:b, s:I, s:I, s:O}", "ok", (int)good, "points", (json_int_t)result.points, "nodes",
            (json_int_t)(looked && dataset != NULL ? dataset->hierarchy.count : 0), "findings",
            context.findings);
        json_dumpf(json, stdout, JSON_INDENT(2));
        putchar('\n');
        json_decref(json);
    } else if (good) {
        printf("%s: %llu points in %u nodes are all there and right\n", o->paths[0],
               (unsigned long long)result.points, dataset->hierarchy.count);
    } else if (result.findings > 0) {
        printf("%s: %llu finding%s\n", o->paths[0], (unsigned long long)result.findings,
               result.findings == 1 ? "" : "s");
    }
    json_decref(context.findings);
    mospt_dataset_close(dataset);
    return good ? EXIT_DONE : EXIT_FAILED;
}

static int print_help(char *text, FILE *out)
{
    if (text != NULL) fputs(text, out);
    free(text);
    return out == stdout ? EXIT_DONE : EXIT_WRONG_USE;
}

static int help(int argc, char **argv)
{
    cli_command command;
    if (argc > 2 && cli_command_from_name(argv[2], &command))
        return print_help(cli_command_help(command), stdout);
    if (argc <= 2) return print_help(cli_help(), stdout);
    fprintf(stderr, "instantpoints: there is no command %s\n", argv[2]);
    return EXIT_WRONG_USE;
}

int main(int argc, char **argv)
{
    static int (*const run[CLI_COMMANDS])(const cli_options *) = {
        [CLI_BUILD] = command_build,   [CLI_VIEW] = command_view, [CLI_SHOT] = command_shot,
        [CLI_RECORD] = command_record, [CLI_JOIN] = command_join, [CLI_INFO] = command_info,
        [CLI_CHECK] = command_check,
    };
    cli_command command;
    cli_options options;
    mospt_err err = {0};
    struct sigaction action = {.sa_handler = ask_to_stop, .sa_flags = (int)SA_RESETHAND};

    if (argc < 2) return print_help(cli_help(), stderr);
    if (strcmp(argv[1], "help") == 0 || strcmp(argv[1], "--help") == 0 ||
        strcmp(argv[1], "-h") == 0)
        return help(argc, argv);
    if (strcmp(argv[1], "--version") == 0)
        return printf("instantpoints %s\n", IPTS_VERSION), EXIT_DONE;
    if (!cli_command_from_name(argv[1], &command)) {
        fprintf(stderr, "instantpoints: there is no command %s (`instantpoints help`)\n", argv[1]);
        return EXIT_WRONG_USE;
    }
    if (!cli_options_read(command, argc - 1, argv + 1, &options, &err))
        return misuse(command, err.message);
    if (options.help) return print_help(cli_command_help(command), stdout);
    signal(SIGXFSZ, SIG_IGN); /* a file-size limit is an error of the write that meets it */
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    return run[command](&options);
}
