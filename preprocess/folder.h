/* preprocess/folder.h - from what a person names on the command line to the list of files to read.
 */
#pragma once
#include "mospt/err.h"

typedef struct {
    char *path; /* owned, as it can be opened */
    char *name; /* owned, relative to the folder that was named, and with more folders where files
                   would be called the same; what sources are called in a dataset */
} prep_folder_file;

typedef struct {
    prep_folder_file
        *files; /* [count], owned: scans to read, in the order of their names, each file once */
    size_t count;
    prep_folder_file
        *unknown; /* [unknown_count], owned: files in the folders whose content is no scan format */
    size_t unknown_count;
} prep_folder_list;

/* Lists the given files, and recursively those below the given folders, that prep_scan_open() would
 * take. Hidden files and datasets (*.ipts) are passed over. A file that is named itself is always
 * in `files`, whatever it holds. errors   MOSPT_EIO: a path that does not exist, or a folder that
 * cannot be read */
bool prep_folder_list_make(const char *const *paths, size_t path_count, prep_folder_list *out,
                           mospt_err *err);
void prep_folder_list_fini(prep_folder_list *list);
