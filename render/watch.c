#include "render/watch.h"

#include "mospt/file.h"

#include <stdlib.h>
#include <string.h>

bool rend_watch_init(rend_watch *watch, const char *dataset_path, mospt_err *err)
{
    *watch = (rend_watch){.file = mospt_file_join(dataset_path, "metadata.json")};
    return watch->file != NULL || mospt_err_nomem(err, strlen(dataset_path));
}

void rend_watch_fini(rend_watch *watch)
{
    free(watch->file);
    *watch = (rend_watch){0};
}

static bool is_same_file(const struct stat *a, const struct stat *b)
{
    return a->st_ino == b->st_ino && a->st_size == b->st_size &&
           a->st_mtim.tv_sec == b->st_mtim.tv_sec && a->st_mtim.tv_nsec == b->st_mtim.tv_nsec;
}

rend_watch_news rend_watch_look(rend_watch *watch)
{
    struct stat now = {0};
    bool was_gone = watch->gone;
    watch->gone = stat(watch->file, &now) != 0;
    if (watch->gone) {
        watch->seen = (struct stat){0};
        return was_gone ? REND_WATCH_SAME : REND_WATCH_GONE;
    }
    if (is_same_file(&now, &watch->seen)) return REND_WATCH_SAME;
    watch->seen = now;
    return REND_WATCH_CHANGED;
}

bool rend_watch_is_same(const mospt_dataset *a, const mospt_dataset *b)
{
    const mospt_metadata *x = &a->metadata, *y = &b->metadata;
    return x->generation == y->generation && x->unfinished.commit == y->unfinished.commit &&
           x->hierarchy_hash == y->hierarchy_hash && x->points_hash == y->points_hash;
}
