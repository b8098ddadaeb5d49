#include "preprocess/output.h"

#include "mospt/dataset.h"
#include "mospt/file.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* What a dataset is called that will take another one's place. */
static const char BESIDE[] = ".building";

void prep_output_fini(prep_output *output)
{
    free(output->target), free(output->replaced);
    *output = (prep_output){0};
}

char *prep_output_folder(const char *path)
{
    char *folder = strdup(path);
    if (folder == NULL) return NULL;
    size_t n = strlen(folder);
    while (n > 1 && folder[n - 1] == '/')
        folder[--n] = '\0';
    char *slash = strrchr(folder, '/');
    if (slash == folder) folder[1] = '\0';
    else if (slash != NULL) *slash = '\0';
    else strcpy(folder, n > 0 ? "." : "");
    if (n == 1 && slash == NULL) strcpy(folder, ".");
    return folder;
}

static bool is_finished(const char *path)
{
    return mospt_dataset_exists(path) && !mospt_dataset_is_unfinished(path);
}

bool prep_output_choose(const char *path, bool force, prep_output *out, mospt_err *err)
{
    size_t n = strlen(path);
    bool replaces = is_finished(path);
    while (n > 1 && path[n - 1] == '/')
        n--;
    if (replaces && !force)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(path),
                             "is a dataset already; --force replaces it");
    prep_output chosen = {.target = malloc(n + sizeof BESIDE),
                          .replaced = replaces ? strndup(path, n) : NULL};
    if (chosen.target == NULL || (replaces && chosen.replaced == NULL)) {
        prep_output_fini(&chosen);
        return mospt_err_nomem(err, n);
    }
    memcpy(chosen.target, path, n);
    strcpy(chosen.target + n, replaces ? BESIDE : "");
    *out = chosen;
    /* Killed after it was finished and before it took the place: nobody else has such a name. */
    return !replaces || !is_finished(chosen.target) || mospt_file_remove_tree(chosen.target, err);
}

/* Where a file system cannot exchange two folders, the old one waits under a name that nobody has
 * until the new one stands. */
static bool exchange_in_steps(const char *fresh, const char *old, mospt_err *err)
{
    char aside[4096];
    if (snprintf(aside, sizeof aside, "%s.old-XXXXXX", old) >= (int)sizeof aside ||
        mkdtemp(aside) == NULL || rename(old, aside) != 0)
        return mospt_err_set(err, MOSPT_EIO, mospt_at_file(old), "cannot be moved aside");
    if (rename(fresh, old) == 0 && rename(aside, fresh) == 0) return true;
    return mospt_err_set(err, MOSPT_EIO, mospt_at_file(fresh),
                         "cannot be put in place; the old dataset is %s", aside);
}

bool prep_output_take_place(const prep_output *output, mospt_err *err)
{
    if (output->replaced == NULL) return true;
    if (renameat2(AT_FDCWD, output->target, AT_FDCWD, output->replaced, RENAME_EXCHANGE) != 0 &&
        !exchange_in_steps(output->target, output->replaced, err))
        return false;
    return mospt_file_remove_tree(output->target, err);
}
