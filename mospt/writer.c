#include "mospt/writer.h"

#include "mospt/file.h"
#include "mospt/hash.h"
#include "mospt/point.h"
#include "mospt/sink.h"

#include <assert.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

/* Levels from here on share the last file: only piles of identical positions get so deep. */
enum { FILES_MAX = MOSPT_SINK_FILES_MAX, PIECE_SIZE = 1 << 18 };

/* A disk that is flushed takes nothing else. Past the page cache, writers wait for that: there it
 * is flushed when so much was written. */
enum { FLUSH_SIZE_PAST_CACHE = 16 << 20 };

#define PAYLOAD_NAME "points-%02u.bin"
#define UNFINISHED_NAME "unfinished-%06" PRIu64 ".bin"

/* A node that has its place. */
typedef struct {
    mospt_node node; /* its child_mask names all children, whether they are there or not */
    uint64_t points_hash;
    bool is_complete;
} placed;

struct mospt_writer {
    char *path; /* owned */
    uint32_t inner_depth;
    bool found; /* an unfinished dataset was in the folder, and has not been touched yet */
    bool keeps; /* and is to be gone on from */
    bool finished;
    mospt_sink *sink;              /* owned; NULL: payloads are written through the page cache */
    uint64_t kept_size[FILES_MAX]; /* bytes of payloads that stay as they are */
    uint64_t commit, committed_points; /* of the last unfinished state; 0: none */

    pthread_mutex_t lock;
    /* Under the lock: */
    placed *nodes; /* [capacity], owned */
    uint32_t count, capacity;
    uint32_t leading; /* so many nodes are complete before the first that is not */
    mospt_written of_leading, of_all;
    uint64_t bytes;
    uint32_t file_count;
    int fd[FILES_MAX];
    uint64_t size[FILES_MAX];
    uint64_t unflushed[FILES_MAX]; /* bytes that were written since the last flush began */
    bool unstarted[FILES_MAX];     /* some of these since the disk was last asked to take them */
};

static bool is_unfinished(const char *name)
{
    unsigned number;
    char same[64];
    if (sscanf(name, "unfinished-%u", &number) != 1) return false;
    int length = snprintf(same, sizeof same, UNFINISHED_NAME, (uint64_t)number);
    return strncmp(name, same, (size_t)length) == 0 &&
           (name[length] == '\0' || strcmp(name + length, ".new") == 0);
}

/* Names that a build gives its files, and no others that only look like them. */
static bool is_ours(const char *name)
{
    unsigned number;
    char same[64];
    if (strncmp(name, "metadata.json", 13) == 0 &&
        (name[13] == '\0' || strcmp(name + 13, ".new") == 0))
        return true;
    if (is_unfinished(name)) return true;
    if (sscanf(name, "points-%u", &number) == 1) {
        snprintf(same, sizeof same, PAYLOAD_NAME, number);
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

static bool remove_unfinished(int folder, const char *path, const char *name, mospt_err *err)
{
    (void)path, (void)err;
    if (is_unfinished(name)) unlinkat(folder, name, 0);
    return true;
}

static bool remove_ours(int folder, const char *path, const char *name, mospt_err *err)
{
    if (!is_ours(name) || unlinkat(folder, name, 0) == 0) return true;
    return mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "%s cannot be removed", name);
}

bool mospt_writer_create(const char *path, uint32_t inner_depth, mospt_writer **out, mospt_err *err)
{
    bool found = mospt_dataset_is_unfinished(path);
    if (mospt_dataset_exists(path) && !found)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(path), "is a dataset already");
    if (mkdir(path, 0777) != 0) {
        if (errno != EEXIST)
            return mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be created");
        /* Nothing is removed before all has been looked at. */
        if (!each_entry(path, refuse_others, err)) return false;
        if (!found && !each_entry(path, remove_ours, err)) return false;
    }
    mospt_writer *w = calloc(1, sizeof *w);
    if (w == NULL) return mospt_err_nomem(err, sizeof *w);
    *w = (mospt_writer){.path = strdup(path), .inner_depth = inner_depth, .found = found};
    if (w->path == NULL) {
        free(w);
        return mospt_err_nomem(err, strlen(path));
    }
    pthread_mutex_init(&w->lock, NULL);
    *out = w;
    return true;
}

void mospt_writer_keep(mospt_writer *w, const mospt_metadata *kept)
{
    assert(w->found && w->count == 0);
    w->keeps = true;
    w->commit = kept->unfinished.commit;
    w->committed_points = kept->point_count;
    for (uint32_t i = 0; i < kept->file_count && i < FILES_MAX; i++)
        w->kept_size[i] = kept->files[i].size;
}

bool mospt_writer_bypass_cache(mospt_writer *w, size_t chunk_size, mospt_err *err)
{
    assert(w->count == 0 && w->sink == NULL);
    return mospt_sink_create(chunk_size, &w->sink, err);
}

static bool add_file(mospt_writer *w, mospt_err *err)
{
    char name[32];
    snprintf(name, sizeof name, PAYLOAD_NAME, w->file_count);
    char *path = mospt_file_join(w->path, name);
    if (path == NULL) return mospt_err_nomem(err, strlen(w->path));
    int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    bool ok = fd >= 0 || mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be created");
    if (ok && w->sink != NULL)
        ok = mospt_sink_add_file(w->sink, path, w->kept_size[w->file_count], err);
    if (fd >= 0) w->fd[w->file_count++] = fd;
    free(path);
    return ok;
}

/* Before the first node has its place: what is not gone on from is removed, its root first. */
static bool take_folder(mospt_writer *w, mospt_err *err)
{
    bool removes = w->found && !w->keeps;
    char *root = mospt_file_join(w->path, "metadata.json");
    if (root == NULL) return mospt_err_nomem(err, strlen(w->path));
    w->found = false;
    if (removes) unlink(root);
    free(root);
    return !removes || each_entry(w->path, remove_ours, err);
}

/* Under the lock. */
static bool place(mospt_writer *w, mospt_node *node, uint32_t *index, mospt_err *err)
{
    uint32_t file = node->level < FILES_MAX ? node->level : FILES_MAX - 1;
    if (w->count == 0 && !take_folder(w, err)) return false;
    while (w->file_count <= file)
        if (!add_file(w, err)) return false;
    if (w->count == w->capacity) {
        uint32_t capacity = w->capacity > 0 ? 2 * w->capacity : 1024;
        placed *nodes = realloc(w->nodes, capacity * sizeof *nodes);
        if (nodes == NULL) return mospt_err_nomem(err, capacity * sizeof *nodes);
        w->nodes = nodes;
        w->capacity = capacity;
    }
    node->payload_file = (uint16_t)file;
    node->payload_offset = w->size[file];
    w->size[file] += node->payload_size;
    w->bytes += node->payload_size;
    *index = w->count++;
    w->nodes[*index] = (placed){.node = *node};
    return true;
}

bool mospt_writer_place(mospt_writer *w, mospt_node *node, uint32_t *index, mospt_err *err)
{
    pthread_mutex_lock(&w->lock);
    bool ok = place(w, node, index, err);
    pthread_mutex_unlock(&w->lock);
    return ok;
}

void mospt_writer_complete(mospt_writer *w, uint32_t index, const mospt_node *node,
                           uint64_t points_hash)
{
    pthread_mutex_lock(&w->lock);
    w->nodes[index] = (placed){.node = *node, .points_hash = points_hash, .is_complete = true};
    w->of_all.points += node->count;
    w->of_all.points_hash += points_hash;
    for (; w->leading < w->count && w->nodes[w->leading].is_complete; w->leading++) {
        w->of_leading.points += w->nodes[w->leading].node.count;
        w->of_leading.points_hash += w->nodes[w->leading].points_hash;
    }
    pthread_mutex_unlock(&w->lock);
}

bool mospt_writer_write(mospt_writer *w, const mospt_node *node, const uint8_t *payload,
                        mospt_err *err)
{
    return mospt_writer_write_part(w, node, 0, payload, (size_t)node->payload_size, err);
}

bool mospt_writer_write_part(mospt_writer *w, const mospt_node *node, uint64_t skip,
                             const uint8_t *bytes, size_t size, mospt_err *err)
{
    uint64_t offset = node->payload_offset + skip;
    uint32_t file = node->payload_file;
    bool ok = w->sink != NULL ? mospt_sink_write(w->sink, file, offset, bytes, size, err)
                              : mospt_file_write_at(w->fd[file], w->path, offset, bytes, size, err);
    pthread_mutex_lock(&w->lock);
    w->unflushed[file] += size;
    w->unstarted[file] = true;
    pthread_mutex_unlock(&w->lock);
    return ok;
}

static bool flush_file(mospt_writer *w, uint32_t file, mospt_err *err)
{
    pthread_mutex_lock(&w->lock);
    w->unflushed[file] = 0;
    pthread_mutex_unlock(&w->lock);
    return fsync(w->fd[file]) == 0 ||
           mospt_err_set(err, MOSPT_EIO, mospt_at_file(w->path),
                         PAYLOAD_NAME " cannot be flushed to the disk", file);
}

/* Lets the disk begin with all that waits for it. */
static void start_flush(mospt_writer *w)
{
    for (uint32_t i = 0; w->sink == NULL && i < FILES_MAX; i++) {
        pthread_mutex_lock(&w->lock);
        bool is_new = w->unstarted[i];
        w->unstarted[i] = false;
        pthread_mutex_unlock(&w->lock);
        if (is_new) mospt_file_start_flush(w->fd[i]);
    }
}

bool mospt_writer_flush(mospt_writer *w, mospt_err *err)
{
    uint32_t most = 0;
    start_flush(w);
    pthread_mutex_lock(&w->lock);
    for (uint32_t i = 1; i < w->file_count; i++)
        if (w->unflushed[i] > w->unflushed[most]) most = i;
    uint64_t bytes = w->unflushed[most];
    pthread_mutex_unlock(&w->lock);
    return bytes < (w->sink != NULL ? FLUSH_SIZE_PAST_CACHE : 1) || flush_file(w, most, err);
}

static bool hash_range(const mospt_writer *w, const mospt_node *node, uint64_t skip, uint64_t size,
                       uint64_t *hash, mospt_err *err)
{
    mospt_hasher *hasher = mospt_hasher_create();
    uint8_t *bytes = malloc(PIECE_SIZE);
    bool ok = (hasher != NULL && bytes != NULL) || mospt_err_nomem(err, PIECE_SIZE);
    ok = ok && (w->sink == NULL || mospt_sink_flush(w->sink, err));
    for (uint64_t done = 0; ok && done < size; done += PIECE_SIZE) {
        size_t piece = size - done < PIECE_SIZE ? (size_t)(size - done) : PIECE_SIZE;
        ok = mospt_file_read_at(w->fd[node->payload_file], w->path,
                                node->payload_offset + skip + done, bytes, piece, err);
        if (ok) mospt_hasher_add(hasher, bytes, piece);
    }
    if (ok) *hash = mospt_hasher_hash(hasher);
    mospt_hasher_destroy(hasher);
    free(bytes);
    return ok;
}

bool mospt_writer_hash(mospt_writer *w, mospt_node *node, mospt_err *err)
{
    uint64_t vertices = (uint64_t)node->count * sizeof(mospt_vertex);
    return hash_range(w, node, 0, vertices, &node->vertices_hash, err) &&
           hash_range(w, node, vertices, node->payload_size - vertices, &node->attributes_hash,
                      err);
}

uint64_t mospt_writer_bytes(const mospt_writer *writer)
{
    return writer->bytes;
}

uint32_t mospt_writer_nodes(const mospt_writer *writer)
{
    return writer->count;
}

mospt_written mospt_writer_written(mospt_writer *w)
{
    pthread_mutex_lock(&w->lock);
    mospt_written written = w->of_all;
    pthread_mutex_unlock(&w->lock);
    return written;
}

/* What a commit is about: the leading nodes, and as much of each file as they take. */
typedef struct {
    mospt_hierarchy hierarchy; /* owned */
    mospt_written written;
    uint32_t file_count;
    uint64_t size[FILES_MAX];
} state;

static bool take_state(mospt_writer *w, state *out, mospt_err *err)
{
    pthread_mutex_lock(&w->lock);
    *out = (state){.hierarchy = {.nodes = malloc((w->leading + 1) * sizeof(mospt_node)),
                                 .count = w->leading,
                                 .inner_depth = w->inner_depth,
                                 .refinement = MOSPT_REFINE_ADD},
                   .written = w->of_leading};
    for (uint32_t i = 0; out->hierarchy.nodes != NULL && i < w->leading; i++) {
        const mospt_node *n = &w->nodes[i].node;
        out->hierarchy.nodes[i] = *n;
        out->size[n->payload_file] = n->payload_offset + n->payload_size;
        if (out->file_count <= n->payload_file) out->file_count = n->payload_file + 1;
    }
    pthread_mutex_unlock(&w->lock);
    return out->hierarchy.nodes != NULL || mospt_err_nomem(err, w->leading * sizeof(mospt_node));
}

static bool list_files(const state *s, mospt_metadata *m, mospt_err *err)
{
    m->files = calloc(s->file_count + 1, sizeof *m->files);
    if (m->files == NULL) return mospt_err_nomem(err, s->file_count * sizeof *m->files);
    for (m->file_count = 0; m->file_count < s->file_count; m->file_count++) {
        mospt_payload_file *file = &m->files[m->file_count];
        file->size = s->size[m->file_count];
        if (asprintf(&file->name, PAYLOAD_NAME, m->file_count) < 0) {
            file->name = NULL;
            return mospt_err_nomem(err, sizeof PAYLOAD_NAME);
        }
    }
    return true;
}

/* Of a file that nothing was written to since it was flushed, nothing is left to be flushed, unless
 * it comes from the sink. */
static bool flush_files(mospt_writer *w, const state *s, mospt_err *err)
{
    if (w->sink != NULL && !mospt_sink_flush(w->sink, err)) return false;
    for (uint32_t i = 0; i < s->file_count; i++) {
        pthread_mutex_lock(&w->lock);
        bool is_clean = w->sink == NULL && w->unflushed[i] == 0;
        pthread_mutex_unlock(&w->lock);
        if (!is_clean && !flush_file(w, i, err)) return false;
    }
    return true;
}

/* metadata  out: files, which it owns, and hierarchy; its hierarchy_name is given */
static bool commit(mospt_writer *w, state *s, mospt_metadata *m, mospt_err *err)
{
    if (!list_files(s, m, err) || !flush_files(w, s, err) ||
        !mospt_hierarchy_link(&s->hierarchy, &m->grid, err))
        return false;
    if (m->unfinished.commit == 0 && !mospt_hierarchy_is_finished(&s->hierarchy))
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(w->path),
                             "nodes wait for children that were never written");
    m->generation = 1;
    m->inner_depth = w->inner_depth;
    m->point_count = s->hierarchy.point_count;
    char *path = mospt_file_join(w->path, m->hierarchy_name);
    if (path == NULL) return mospt_err_nomem(err, strlen(w->path));
    bool ok =
        mospt_hierarchy_write(&s->hierarchy, path, &m->hierarchy_size, &m->hierarchy_hash, err) &&
        mospt_metadata_write(m, w->path, err);
    free(path);
    return ok;
}

/* Removes the hierarchy of an unfinished state that is no longer named. */
static void remove_state(const mospt_writer *w, uint64_t number)
{
    char name[64];
    snprintf(name, sizeof name, UNFINISHED_NAME, number);
    char *path = mospt_file_join(w->path, name);
    if (path != NULL) unlink(path);
    free(path);
}

bool mospt_writer_commit_part(mospt_writer *w, const mospt_metadata *metadata, uint64_t build,
                              mospt_err *err)
{
    state s;
    mospt_metadata m = *metadata; /* a loan, but for its files */
    m.files = NULL, m.file_count = 0;
    if (!take_state(w, &s, err)) return false;
    bool ok = true;
    if (s.written.points > w->committed_points) {
        m.unfinished = (mospt_unfinished){.commit = w->commit + 1,
                                          .points = metadata->point_count,
                                          .points_hash = metadata->points_hash,
                                          .build = build};
        m.points_hash = s.written.points_hash;
        snprintf(m.hierarchy_name, sizeof m.hierarchy_name, UNFINISHED_NAME, w->commit + 1);
        ok = commit(w, &s, &m, err);
        if (ok) {
            remove_state(w, w->commit++);
            w->committed_points = s.written.points;
        }
    }
    for (uint32_t i = 0; i < m.file_count; i++)
        free(m.files[i].name);
    free(m.files);
    mospt_hierarchy_fini(&s.hierarchy);
    return ok;
}

/* An unfinished build may have left more than the dataset has, and so may the sink. */
static bool cut_files(mospt_writer *w, const state *s, mospt_err *err)
{
    struct stat status;
    if (w->sink != NULL && !mospt_sink_flush(w->sink, err)) return false;
    for (uint32_t i = 0; i < s->file_count; i++) {
        if (fstat(w->fd[i], &status) == 0 && (uint64_t)status.st_size == s->size[i]) continue;
        if (ftruncate(w->fd[i], (off_t)s->size[i]) != 0)
            return mospt_err_set(err, MOSPT_EIO, mospt_at_file(w->path),
                                 PAYLOAD_NAME " cannot be cut", i);
        w->unflushed[i]++;
    }
    return true;
}

bool mospt_writer_commit(mospt_writer *w, mospt_metadata *metadata, mospt_err *err)
{
    state s;
    assert(w->leading == w->count);
    metadata->unfinished = (mospt_unfinished){0};
    snprintf(metadata->hierarchy_name, sizeof metadata->hierarchy_name, "hierarchy-%06u.bin", 1u);
    if (!take_state(w, &s, err)) return false;
    w->finished = cut_files(w, &s, err) && commit(w, &s, metadata, err);
    if (w->finished && w->commit > 0) each_entry(w->path, remove_unfinished, NULL);
    mospt_hierarchy_fini(&s.hierarchy);
    return w->finished;
}

void mospt_writer_destroy(mospt_writer *w)
{
    if (w == NULL) return;
    for (uint32_t i = 0; i < w->file_count; i++)
        close(w->fd[i]);
    mospt_sink_destroy(w->sink);
    bool leaves = w->finished || w->found || w->commit > 0;
    if (!leaves && each_entry(w->path, remove_ours, NULL)) rmdir(w->path);
    pthread_mutex_destroy(&w->lock);
    free(w->nodes);
    free(w->path);
    free(w);
}
