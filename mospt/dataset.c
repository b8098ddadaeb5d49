#include "mospt/dataset.h"

#include "mospt/file.h"
#include "mospt/hash.h"
#include "mospt/payload.h"

#include <inttypes.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

bool mospt_dataset_exists(const char *path)
{
    struct stat status;
    char *metadata = mospt_file_join(path, "metadata.json");
    bool exists = metadata != NULL && stat(metadata, &status) == 0;
    free(metadata);
    return exists;
}

bool mospt_dataset_is_unfinished(const char *path)
{
    mospt_metadata m;
    if (!mospt_metadata_read(path, &m, NULL)) return false;
    bool is_unfinished = m.unfinished.commit > 0;
    mospt_metadata_fini(&m);
    return is_unfinished;
}

void mospt_dataset_close(mospt_dataset *dataset)
{
    if (dataset == NULL) return;
    for (uint32_t i = 0; dataset->fd != NULL && i < dataset->metadata.file_count; i++)
        if (dataset->fd[i] >= 0) close(dataset->fd[i]);
    free(dataset->fd);
    mospt_hierarchy_fini(&dataset->hierarchy);
    mospt_metadata_fini(&dataset->metadata);
    free(dataset->path);
    free(dataset);
}

static bool open_payloads(mospt_dataset *d, mospt_err *err)
{
    uint32_t count = d->metadata.file_count;
    d->fd = malloc((count + 1) * sizeof *d->fd);
    if (d->fd == NULL) return mospt_err_nomem(err, (count + 1) * sizeof *d->fd);
    for (uint32_t i = 0; i < count; i++)
        d->fd[i] = -1;
    for (uint32_t i = 0; i < count; i++) {
        const mospt_payload_file *file = &d->metadata.files[i];
        uint64_t size = 0;
        char *path = mospt_file_join(d->path, file->name);
        if (path == NULL) return mospt_err_nomem(err, strlen(d->path));
        d->fd[i] = mospt_file_open(path, &size, err);
        bool ok = d->fd[i] >= 0;
        if (ok && size < file->size)
            ok = mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(path, size),
                               "the file ends here, metadata.json says %" PRIu64 " bytes",
                               file->size);
        free(path);
        if (!ok) return false;
    }
    return true;
}

static bool payloads_fit(const mospt_dataset *d, mospt_err *err)
{
    const mospt_schema *schema = &d->metadata.schema;
    for (uint32_t i = 0; i < d->hierarchy.count; i++) {
        const mospt_node *n = &d->hierarchy.nodes[i];
        bool fits = n->payload_file < d->metadata.file_count &&
                    n->payload_size == mospt_payload_size(schema, n->count) &&
                    n->payload_offset <= d->metadata.files[n->payload_file].size &&
                    n->payload_size <= d->metadata.files[n->payload_file].size - n->payload_offset;
        if (!fits)
            return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(d->path),
                                 "node %" PRIu32 ": its payload is not inside its file", i);
    }
    return true;
}

static bool hierarchy_fits(const mospt_dataset *d, const char *path, mospt_err *err)
{
    const mospt_hierarchy *h = &d->hierarchy;
    const mospt_metadata *m = &d->metadata;
    if (h->inner_depth != m->inner_depth || h->point_count != m->point_count)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(path),
                             "holds %" PRIu64 " points at inner depth %" PRIu32
                             ", metadata.json says %" PRIu64 " at %" PRIu32,
                             h->point_count, h->inner_depth, m->point_count, m->inner_depth);
    if (m->unfinished.commit == 0 && !mospt_hierarchy_is_finished(h))
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(path),
                             "has nodes that wait for children, metadata.json says that the "
                             "dataset is finished");
    return true;
}

/* Opens what the metadata names. */
static bool open_named(mospt_dataset *d, mospt_err *err)
{
    char *path = mospt_file_join(d->path, d->metadata.hierarchy_name);
    if (path == NULL) return mospt_err_nomem(err, strlen(d->path));
    bool ok = mospt_hierarchy_read(path, &d->metadata.grid, d->metadata.hierarchy_size,
                                   d->metadata.hierarchy_hash, &d->hierarchy, err) &&
              hierarchy_fits(d, path, err) && open_payloads(d, err) && payloads_fit(d, err);
    free(path);
    return ok;
}

/* True if the dataset has been committed again since its metadata was read. */
static bool has_gone_on(const mospt_dataset *d)
{
    mospt_metadata now;
    if (!mospt_metadata_read(d->path, &now, NULL)) return false;
    bool has = now.generation != d->metadata.generation ||
               now.unfinished.commit != d->metadata.unfinished.commit;
    mospt_metadata_fini(&now);
    return has;
}

bool mospt_dataset_open(const char *path, mospt_dataset **out, mospt_err *err)
{
    for (;;) {
        mospt_dataset *d = calloc(1, sizeof *d);
        if (d == NULL || (d->path = strdup(path)) == NULL) {
            free(d);
            return mospt_err_nomem(err, strlen(path));
        }
        bool is_read = mospt_metadata_read(path, &d->metadata, err);
        if (is_read && open_named(d, err)) {
            *out = d;
            return true;
        }
        /* A build that is running removes what its next commit no longer names. */
        bool again = is_read && has_gone_on(d);
        mospt_dataset_close(d);
        if (!again) return false;
    }
}

static bool read_part(const mospt_dataset *d, uint32_t node, uint64_t skip, void *out, size_t size,
                      uint64_t expected_hash, const char *what, mospt_err *err)
{
    const mospt_node *n = &d->hierarchy.nodes[node];
    char *path = mospt_file_join(d->path, d->metadata.files[n->payload_file].name);
    uint64_t offset = n->payload_offset + skip;
    if (path == NULL) return mospt_err_nomem(err, strlen(d->path));
    bool ok = mospt_file_read_at(d->fd[n->payload_file], path, offset, out, size, err);
    if (ok && mospt_hash(out, size) != expected_hash)
        ok = mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(path, offset),
                           "the %s of node %" PRIu32 " are damaged: their checksum is wrong", what,
                           node);
    free(path);
    return ok;
}

bool mospt_dataset_read_vertices(const mospt_dataset *dataset, uint32_t node, mospt_vertex *out,
                                 mospt_err *err)
{
    return read_part(dataset, node, 0, out, mospt_dataset_vertices_size(dataset, node),
                     dataset->hierarchy.nodes[node].vertices_hash, "vertices", err);
}

bool mospt_dataset_read_planes(const mospt_dataset *dataset, uint32_t node, uint8_t *out,
                               mospt_err *err)
{
    return read_part(dataset, node, mospt_dataset_vertices_size(dataset, node), out,
                     mospt_dataset_planes_size(dataset, node),
                     dataset->hierarchy.nodes[node].attributes_hash, "attributes", err);
}

bool mospt_dataset_read_attributes(const mospt_dataset *dataset, uint32_t node,
                                   const mospt_vertex *vertices, uint8_t *out, mospt_err *err)
{
    if (!mospt_dataset_read_planes(dataset, node, out, err)) return false;
    mospt_payload_complete(&dataset->metadata.schema, vertices,
                           dataset->hierarchy.nodes[node].count, out);
    return true;
}
