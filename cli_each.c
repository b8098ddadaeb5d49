#include "cli_each.h"

#include "mospt/file.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

void cli_each_fini(cli_each_report *report)
{
    for (size_t i = 0; i < report->count; i++) {
        cli_each_item *item = &report->items[i];
        free(item->name), free(item->dataset), free(item->reason);
    }
    free(report->items);
    *report = (cli_each_report){0};
}

/* FOLDER/a/b.las becomes OUTPUT/a/b.las.ipts: the extension stays, since b.las and b.ply may stand
 * side by side. */
static char *dataset_path(const char *output, const char *name)
{
    size_t size = strlen(name) + sizeof ".ipts";
    char *file = malloc(size), *path = NULL;
    if (file != NULL && snprintf(file, size, "%s.ipts", name) > 0)
        path = mospt_file_join(output, file);
    free(file);
    return path;
}

/* Makes the folders above a path that are not there yet. */
static bool make_folders(const char *path, mospt_err *err)
{
    char *folder = strdup(path);
    bool ok = folder != NULL || mospt_err_nomem(err, strlen(path));
    for (char *slash = folder; ok && (slash = strchr(slash + 1, '/')) != NULL; *slash = '/') {
        *slash = '\0';
        if (mkdir(folder, 0777) != 0 && errno != EEXIST)
            ok = mospt_err_set(err, MOSPT_EIO, mospt_at_file(folder), "cannot be created");
    }
    free(folder);
    return ok;
}

static bool is_newer(const struct stat *a, const struct stat *b)
{
    if (a->st_mtim.tv_sec != b->st_mtim.tv_sec) return a->st_mtim.tv_sec > b->st_mtim.tv_sec;
    return a->st_mtim.tv_nsec > b->st_mtim.tv_nsec;
}

/* A dataset is as good as new if it was made after its file was last written, and as it would be
 * made now. */
static bool is_up_to_date(const prep_build_options *o, const char *file, const char *dataset,
                          uint64_t *points)
{
    struct stat input, output;
    mospt_metadata metadata;
    char *root = mospt_file_join(dataset, "metadata.json");
    bool ok = root != NULL && stat(file, &input) == 0 && stat(root, &output) == 0 &&
              is_newer(&output, &input) && mospt_metadata_read(dataset, &metadata, NULL);
    free(root);
    if (!ok) return false;
    ok = metadata.inner_depth == (o->inner_depth > 0 ? o->inner_depth : PREP_INNER_DEPTH_DEFAULT);
    *points = metadata.point_count;
    mospt_metadata_fini(&metadata);
    return ok;
}

static char *err_text(const mospt_err *err)
{
    char text[2048];
    mospt_err_text(err, text, sizeof text);
    return strdup(text);
}

/* Returns false only where going on makes no sense. */
static bool build_one(const prep_build_options *o, const prep_folder_file *file,
                      cli_each_item *item, mospt_err *err)
{
    prep_build_result result;
    mospt_err why = {0};
    item->name = strdup(file->name);
    item->dataset = dataset_path(o->output, file->name);
    if (item->name == NULL || item->dataset == NULL)
        return mospt_err_nomem(err, strlen(file->name));
    item->status = CLI_EACH_UP_TO_DATE;
    if (is_up_to_date(o, file->path, item->dataset, &item->points)) return true;
    if (!make_folders(item->dataset, err)) return false;

    const char *inputs[1] = {file->path};
    prep_build_options one = *o;
    one.inputs = inputs;
    one.input_count = 1;
    one.output = item->dataset;
    one.force = true;
    bool ok = prep_build(&one, &result, &why);
    item->status = !ok                                      ? CLI_EACH_FAILED
                   : prep_build_left_something_out(&result) ? CLI_EACH_IN_PART
                                                            : CLI_EACH_BUILT;
    item->seconds = result.total_seconds;
    item->points = ok ? result.metadata.point_count : 0;
    for (uint32_t i = 0; why.code == MOSPT_OK && i < result.source.scan_count; i++)
        why = result.source.scans[i].damage;
    if (why.code != MOSPT_OK) item->reason = err_text(&why);
    prep_build_result_fini(&result);
    if (why.code == MOSPT_ECANCELLED && err != NULL) *err = why;
    return why.code != MOSPT_ECANCELLED;
}

bool cli_each(const prep_build_options *options, cli_each_next next, cli_each_report *out,
              mospt_err *err)
{
    prep_folder_list list = {0};
    *out = (cli_each_report){0};
    if (!prep_folder_list_make(options->inputs, options->input_count, &list, err)) return false;
    out->items = calloc(list.count + 1, sizeof *out->items);
    bool ok = out->items != NULL || mospt_err_nomem(err, list.count * sizeof *out->items);
    for (size_t i = 0; ok && i < list.count; i++) {
        if (!next(options->context, i, list.count, list.files[i].name))
            ok = mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
        else ok = build_one(options, &list.files[i], &out->items[out->count++], err);
    }
    prep_folder_list_fini(&list);
    return ok;
}
