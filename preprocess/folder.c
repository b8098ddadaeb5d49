#include "preprocess/folder.h"

#include "preprocess/pose.h"
#include "preprocess/scan.h"
#include "preprocess/scan_format.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

typedef struct {
    prep_folder_file file;
    char *real; /* owned, canonical path: what makes two files the same */
    bool is_named, is_link;
    bool is_ambiguous; /* another file has the same name */
} found_file;

typedef struct {
    found_file *at; /* [count], owned */
    size_t count, capacity;
    char **folders; /* [folder_count], owned, canonical: a link that leads back is not followed */
    size_t folder_count;
} finder;

static void finder_fini(finder *f)
{
    for (size_t i = 0; i < f->count; i++) {
        free(f->at[i].file.path);
        free(f->at[i].file.name);
        free(f->at[i].real);
    }
    for (size_t i = 0; i < f->folder_count; i++)
        free(f->folders[i]);
    free(f->folders);
    free(f->at);
}

static bool has_extension(const char *path, const char *extension)
{
    size_t n = strlen(path), m = strlen(extension);
    return n > m && path[n - m - 1] == '.' && strcasecmp(path + n - m, extension) == 0;
}

static bool add_file(finder *f, const char *path, const char *name, bool is_named, mospt_err *err)
{
    if (f->count == f->capacity) {
        size_t capacity = f->capacity > 0 ? 2 * f->capacity : 64;
        found_file *at = realloc(f->at, capacity * sizeof *at);
        if (at == NULL) return mospt_err_nomem(err, capacity * sizeof *at);
        f->at = at;
        f->capacity = capacity;
    }
    struct stat st;
    bool is_link = lstat(path, &st) == 0 && S_ISLNK(st.st_mode);
    found_file file = {
        {strdup(path), strdup(name)}, realpath(path, NULL), is_named, is_link, false};
    if (file.real == NULL) file.real = strdup(path);
    f->at[f->count++] = file;
    return (file.file.path != NULL && file.file.name != NULL && file.real != NULL) ||
           mospt_err_nomem(err, strlen(path) + 1);
}

/* False if the folder was visited before; *ok is false if there is no memory. */
static bool enter(finder *f, const char *path, bool *ok, mospt_err *err)
{
    char *real = realpath(path, NULL);
    *ok = true;
    for (size_t i = 0; i < f->folder_count && real != NULL; i++) {
        if (strcmp(f->folders[i], real) != 0) continue;
        free(real);
        return false;
    }
    char **folders =
        real != NULL ? realloc(f->folders, (f->folder_count + 1) * sizeof *folders) : NULL;
    if (folders == NULL) {
        free(real);
        *ok = mospt_err_nomem(err, strlen(path) + 1);
        return false;
    }
    f->folders = folders;
    f->folders[f->folder_count++] = real;
    return true;
}

static bool walk(finder *f, const char *folder, const char *prefix, mospt_err *err);

static bool take_entry(finder *f, const char *folder, const char *prefix, const char *entry,
                       mospt_err *err)
{
    char *path = NULL, *name = NULL;
    bool ok = false;
    if (asprintf(&path, "%s%s%s", folder, folder[strlen(folder) - 1] == '/' ? "" : "/", entry) < 0)
        path = NULL;
    if (asprintf(&name, "%s%s%s", prefix, prefix[0] != '\0' ? "/" : "", entry) < 0) name = NULL;
    if (path == NULL || name == NULL) {
        mospt_err_nomem(err, strlen(folder) + strlen(entry) + 2);
        goto done;
    }
    struct stat st;
    ok = true;
    if (stat(path, &st) != 0)
        goto done; /* a link that leads nowhere, or a file that has just gone */
    if (S_ISDIR(st.st_mode) && !has_extension(entry, "ipts")) ok = walk(f, path, name, err);
    else if (S_ISREG(st.st_mode) && !prep_pose_is_sidecar(entry))
        ok = add_file(f, path, name, false, err);
done:
    free(path);
    free(name);
    return ok;
}

static bool walk(finder *f, const char *folder, const char *prefix, mospt_err *err)
{
    bool ok;
    if (!enter(f, folder, &ok, err)) return ok;
    DIR *dir = opendir(folder);
    if (dir == NULL)
        return mospt_err_set(err, MOSPT_EIO, mospt_at_file(folder), "cannot read the folder");
    while (ok) {
        errno = 0;
        struct dirent *entry = readdir(dir);
        if (entry == NULL) {
            if (errno != 0)
                ok = mospt_err_set(err, MOSPT_EIO, mospt_at_file(folder), "cannot read the folder");
            break;
        }
        if (entry->d_name[0] != '.') ok = take_entry(f, folder, prefix, entry->d_name, err);
    }
    closedir(dir);
    return ok;
}

static bool find_path(finder *f, const char *path, mospt_err *err)
{
    struct stat st;
    if (path[0] == '\0' || stat(path, &st) != 0) {
        if (path[0] == '\0') errno = ENOENT;
        return mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot find");
    }
    if (S_ISDIR(st.st_mode)) return walk(f, path, "", err);
    const char *slash = strrchr(path, '/');
    return add_file(f, path, slash != NULL ? slash + 1 : path, true, err);
}

static int compare_names(const void *a, const void *b)
{
    const found_file *x = a, *y = b;
    int order = strcmp(x->file.name, y->file.name);
    return order != 0 ? order : strcmp(x->file.path, y->file.path);
}

/* Of several names of one file, what was asked for comes first, and the file itself before a link
 * to it. */
static int compare_real(const void *a, const void *b)
{
    const found_file *x = a, *y = b;
    int order = strcmp(x->real, y->real);
    if (order != 0) return order;
    if (x->is_named != y->is_named) return x->is_named ? -1 : 1;
    if (x->is_link != y->is_link) return x->is_link ? 1 : -1;
    return compare_names(a, b);
}

static void drop_duplicates(finder *f)
{
    size_t n = 0;
    if (f->count > 0) qsort(f->at, f->count, sizeof *f->at, compare_real);
    for (size_t i = 0; i < f->count; i++) {
        if (n == 0 || strcmp(f->at[n - 1].real, f->at[i].real) != 0) {
            f->at[n++] = f->at[i];
            continue;
        }
        free(f->at[i].file.path);
        free(f->at[i].file.name);
        free(f->at[i].real);
    }
    f->count = n;
    if (n > 0) qsort(f->at, n, sizeof *f->at, compare_names);
}

/* The name with one more of the file's folders in front, where there is one. */
static char *lengthen(const found_file *file)
{
    const char *start = file->real + strlen(file->real);
    size_t parts = 2;
    for (const char *p = file->file.name; *p != '\0'; p++)
        parts += *p == '/';
    for (; start > file->real && parts > 0; start--)
        parts -= start[-1] == '/';
    return strdup(*start == '/' ? start + 1 : start);
}

/* Of files in different places that were named one by one, several may have the same name: a
 * dataset should tell them apart, and one for each of them needs a place of its own. */
static bool tell_apart(finder *f, mospt_err *err)
{
    for (bool again = true; again;) {
        again = false;
        for (size_t i = 0; i < f->count; i++) {
            const char *name = f->at[i].file.name;
            f->at[i].is_ambiguous = (i > 0 && strcmp(f->at[i - 1].file.name, name) == 0) ||
                                    (i + 1 < f->count && strcmp(f->at[i + 1].file.name, name) == 0);
        }
        for (size_t i = 0; i < f->count; i++) {
            if (!f->at[i].is_ambiguous) continue;
            char *name = lengthen(&f->at[i]);
            if (name == NULL) return mospt_err_nomem(err, strlen(f->at[i].real));
            again = again || strcmp(name, f->at[i].file.name) != 0;
            free(f->at[i].file.name);
            f->at[i].file.name = name;
        }
        if (f->count > 0) qsort(f->at, f->count, sizeof *f->at, compare_names);
    }
    return true;
}

/* Extensions that promise a scan, so that a damaged file is named rather than passed over. */
static bool promises_scan(const char *path)
{
    static const char *const sure[] = {"las", "laz", "ply", "e57", "pcd",   "ptx",
                                       "pts", "xyz", "3d",  "asc", "ply.gz"};
    for (size_t i = 0; i < sizeof sure / sizeof sure[0]; i++) {
        if (has_extension(path, sure[i])) return true;
    }
    const char *dot = strrchr(path, '.');
    if (dot != NULL && strcasecmp(dot, ".gz") == 0) {
        while (dot > path && dot[-1] != '.' && dot[-1] != '/')
            dot--;
        return strncasecmp(dot, "xyz", 3) == 0;
    }
    return dot != NULL && strncasecmp(dot, ".xyz", 4) == 0;
}

/* Extensions under which numbers may be points, or anything else: only a look inside tells. */
static bool may_be_text_scan(const char *path)
{
    static const char *const maybe[] = {"txt",    "csv",    "txt.gz", "csv.gz",
                                        "pts.gz", "asc.gz", "dat",    "tsv"};
    for (size_t i = 0; i < sizeof maybe / sizeof maybe[0]; i++) {
        if (has_extension(path, maybe[i])) return true;
    }
    return false;
}

static bool can_be_opened(const char *path)
{
    prep_scan *scan;
    mospt_err err;
    if (prep_scan_open(path, 0, NULL, &scan, &err)) {
        prep_scan_close(scan);
        return true;
    }
    return err.code == MOSPT_EEMPTY;
}

static bool is_scan(const found_file *file)
{
    const char *path = file->file.path;
    if (file->is_named || promises_scan(path)) return true;
    prep_input *input;
    uint8_t head[PREP_HEAD_SIZE];
    size_t got = 0;
    if (!prep_input_open(path, &input, NULL)) return false;
    bool is_read = prep_input_read(input, head, sizeof head, &got, NULL);
    prep_input_close(input);
    if (!is_read || got == 0) return false;
    prep_file_kind kind = prep_scan_recognise(path, head, got);
    if (kind == PREP_FILE_TEXT) return may_be_text_scan(path) && can_be_opened(path);
    return kind != PREP_FILE_BINARY;
}

/* Hands the files over, scans and others each in order; nothing can fail any more. */
static void share_out(finder *f, prep_folder_list *list)
{
    for (size_t i = 0; i < f->count; i++) {
        if (is_scan(&f->at[i])) list->files[list->count++] = f->at[i].file;
        else list->unknown[list->unknown_count++] = f->at[i].file;
        f->at[i].file = (prep_folder_file){0};
    }
}

bool prep_folder_list_make(const char *const *paths, size_t path_count, prep_folder_list *out,
                           mospt_err *err)
{
    finder f = {0};
    prep_folder_list list = {0};
    bool ok = true;
    for (size_t i = 0; i < path_count && ok; i++)
        ok = find_path(&f, paths[i], err);
    if (!ok) goto done;
    drop_duplicates(&f);
    ok = tell_apart(&f, err);
    if (!ok) goto done;
    list.files = calloc(f.count + 1, sizeof *list.files);
    list.unknown = calloc(f.count + 1, sizeof *list.unknown);
    ok = list.files != NULL && list.unknown != NULL;
    if (!ok) {
        mospt_err_nomem(err, 2 * (f.count + 1) * sizeof *list.files);
        prep_folder_list_fini(&list);
        goto done;
    }
    share_out(&f, &list);
    *out = list;
done:
    finder_fini(&f);
    return ok;
}

static void free_files(prep_folder_file *files, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        free(files[i].path);
        free(files[i].name);
    }
    free(files);
}

void prep_folder_list_fini(prep_folder_list *list)
{
    free_files(list->files, list->count);
    free_files(list->unknown, list->unknown_count);
    *list = (prep_folder_list){0};
}
