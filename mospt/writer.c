#include "mospt/writer.h"

#include "mospt/file.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

/* Levels from here on share the last file: only piles of identical positions get so deep. */
enum { FILES_MAX = 64 };

struct mospt_writer {
    char *path; /* owned */
    bool committed;
    mospt_hierarchy hierarchy;
    uint32_t capacity; /* of hierarchy.nodes */
    uint32_t file_count;
    int fd[FILES_MAX];
    uint64_t size[FILES_MAX];
    uint64_t bytes;
};

/* Names that a build gives its files, and no others that only look like them. */
static bool is_ours(const char *name)
{
    unsigned number;
    char same[64];
    if (strcmp(name, "metadata.json.new") == 0) return true;
    if (sscanf(name, "points-%u", &number) == 1) {
        snprintf(same, sizeof same, "points-%02u.bin", number);
        return strcmp(name, same) == 0;
    }
    if (sscanf(name, "hierarchy-%u", &number) != 1) return false;
    int length = snprintf(same, sizeof same, "hierarchy-%06u.bin", number);
    return strncmp(name, same, (size_t)length) == 0 &&
           (name[length] == '\0' || strcmp(name + length, ".new") == 0);
}

/* Calls for what a folder holds beside "." and ".."; the first false ends it. */
static bool each_entry(const char *path,
                       bool (*visit)(int folder, const char *path, const char *name,
                                     mospt_err *err),
                       mospt_err *err)
{
    bool ok = true;
    DIR *folder = opendir(path);
    if (folder == NULL)
        return mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be listed");
    for (struct dirent *entry; ok && (entry = readdir(folder)) != NULL;)
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0)
            ok = visit(dirfd(folder), path, entry->d_name, err);
    closedir(folder);
    return ok;
}

static bool refuse_others(int folder, const char *path, const char *name, mospt_err *err)
{
    (void)folder;
    if (is_ours(name)) return true;
    return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(path),
                         "is a folder with other things in it (%s), not a place for a dataset",
                         name);
}

static bool remove_ours(int folder, const char *path, const char *name, mospt_err *err)
{
    if (!is_ours(name) || unlinkat(folder, name, 0) == 0) return true;
    return mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "%s cannot be removed", name);
}

bool mospt_writer_create(const char *path, uint32_t inner_depth, mospt_writer **out, mospt_err *err)
{
    if (mospt_dataset_exists(path))
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(path), "is a dataset already");
    if (mkdir(path, 0777) != 0) {
        if (errno != EEXIST)
            return mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be created");
        /* Nothing is removed before all has been looked at. */
        if (!each_entry(path, refuse_others, err) || !each_entry(path, remove_ours, err))
            return false;
    }
    mospt_writer *w = calloc(1, sizeof *w);
    if (w == NULL) return mospt_err_nomem(err, sizeof *w);
    w->hierarchy.inner_depth = inner_depth;
    w->hierarchy.refinement = MOSPT_REFINE_ADD;
    w->path = strdup(path);
    if (w->path == NULL) {
        free(w);
        return mospt_err_nomem(err, strlen(path));
    }
    *out = w;
    return true;
}

static bool add_file(mospt_writer *w, mospt_err *err)
{
    char name[32];
    snprintf(name, sizeof name, "points-%02u.bin", w->file_count);
    char *path = mospt_file_join(w->path, name);
    if (path == NULL) return mospt_err_nomem(err, strlen(w->path));
    int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (fd < 0) mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be created");
    else w->fd[w->file_count++] = fd;
    free(path);
    return fd >= 0;
}

bool mospt_writer_place(mospt_writer *w, mospt_node *node, uint32_t *index, mospt_err *err)
{
    uint32_t file = node->level < FILES_MAX ? node->level : FILES_MAX - 1;
    while (w->file_count <= file)
        if (!add_file(w, err)) return false;
    if (w->hierarchy.count == w->capacity) {
        uint32_t capacity = w->capacity > 0 ? 2 * w->capacity : 1024;
        mospt_node *nodes = realloc(w->hierarchy.nodes, capacity * sizeof *nodes);
        if (nodes == NULL) return mospt_err_nomem(err, capacity * sizeof *nodes);
        w->hierarchy.nodes = nodes;
        w->capacity = capacity;
    }
    node->payload_file = (uint16_t)file;
    node->payload_offset = w->size[file];
    w->size[file] += node->payload_size;
    w->bytes += node->payload_size;
    *index = w->hierarchy.count++;
    w->hierarchy.nodes[*index] = *node;
    return true;
}

void mospt_writer_complete(mospt_writer *w, uint32_t index, const mospt_node *node)
{
    w->hierarchy.nodes[index] = *node;
}

bool mospt_writer_write(mospt_writer *w, const mospt_node *node, const uint8_t *payload,
                        mospt_err *err)
{
    int fd = w->fd[node->payload_file];
    if (!mospt_file_write_at(fd, w->path, node->payload_offset, payload, (size_t)node->payload_size,
                             err))
        return false;
    mospt_file_start_flush(fd, node->payload_offset, node->payload_size);
    return true;
}

uint64_t mospt_writer_bytes(const mospt_writer *writer)
{
    return writer->bytes;
}

uint32_t mospt_writer_nodes(const mospt_writer *writer)
{
    return writer->hierarchy.count;
}

bool mospt_writer_commit(mospt_writer *w, mospt_metadata *m, mospt_err *err)
{
    m->files = calloc(w->file_count + 1, sizeof *m->files);
    if (m->files == NULL) return mospt_err_nomem(err, w->file_count * sizeof *m->files);
    for (; m->file_count < w->file_count; m->file_count++) {
        char name[32];
        snprintf(name, sizeof name, "points-%02u.bin", m->file_count);
        m->files[m->file_count].size = w->size[m->file_count];
        m->files[m->file_count].name = strdup(name);
        if (m->files[m->file_count].name == NULL) return mospt_err_nomem(err, sizeof name);
        if (fsync(w->fd[m->file_count]) != 0)
            return mospt_err_set(err, MOSPT_EIO, mospt_at_file(w->path),
                                 "%s cannot be flushed to the disk", name);
    }
    if (!mospt_hierarchy_link(&w->hierarchy, &m->grid, err)) return false;
    m->generation = 1;
    m->inner_depth = w->hierarchy.inner_depth;
    m->point_count = w->hierarchy.point_count;
    snprintf(m->hierarchy_name, sizeof m->hierarchy_name, "hierarchy-%06u.bin", 1u);
    char *path = mospt_file_join(w->path, m->hierarchy_name);
    if (path == NULL) return mospt_err_nomem(err, strlen(w->path));
    bool ok =
        mospt_hierarchy_write(&w->hierarchy, path, &m->hierarchy_size, &m->hierarchy_hash, err) &&
        mospt_metadata_write(m, w->path, err);
    free(path);
    w->committed = ok;
    return ok;
}

void mospt_writer_destroy(mospt_writer *w)
{
    if (w == NULL) return;
    for (uint32_t i = 0; i < w->file_count; i++)
        close(w->fd[i]);
    if (!w->committed && each_entry(w->path, remove_ours, NULL)) rmdir(w->path);
    mospt_hierarchy_fini(&w->hierarchy);
    free(w->path);
    free(w);
}
