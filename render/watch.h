/* render/watch.h - notices when a dataset is replaced, goes on, or is removed.
 *
 * A dataset changes by one rename of metadata.json, so looking at that file, now and then, is
 * enough, and works on every file system. */
#pragma once
#include "mospt/dataset.h"

#include <sys/stat.h>

typedef struct {
    char *file;       /* owned */
    struct stat seen; /* st_ino 0: nothing yet, or gone */
    bool gone;
} rend_watch;

typedef enum { REND_WATCH_SAME, REND_WATCH_CHANGED, REND_WATCH_GONE } rend_watch_news;

/* Has seen nothing: the first look finds a change. */
bool rend_watch_init(rend_watch *watch, const char *dataset_path, mospt_err *err);
void rend_watch_fini(rend_watch *watch);

/* What happened since the last look; that it is gone is said once. */
rend_watch_news rend_watch_look(rend_watch *watch);

/* True if both were opened of the same state of a dataset. */
bool rend_watch_is_same(const mospt_dataset *a, const mospt_dataset *b);
