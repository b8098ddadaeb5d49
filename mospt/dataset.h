/* mospt/dataset.h - a dataset folder, opened for reading.
 *
 * metadata.json names and checks all other files; docs/format.md has every byte. A dataset that
 * opens is consistent: its hierarchy is valid and every payload lies inside its file. Payloads
 * themselves are checked as they are read. */
#pragma once
#include "mospt/hierarchy.h"
#include "mospt/point.h"
#include "mospt/schema.h"

enum {
    MOSPT_DATASET_VERSION = 4,     /* of the format, as docs/format.md has it */
    MOSPT_DATASET_VERSION_OLD = 2, /* is read, too */
};

typedef struct {
    char *name;           /* owned, relative to the folder that was built from */
    char *scan;           /* owned, name of the scan inside a file that holds several, else "" */
    char *format;         /* owned, for people */
    char *crs;            /* owned; NULL: that of the dataset, or the scan says nothing */
    uint64_t points;      /* in the dataset */
    uint64_t dropped;     /* the sum of the reasons */
    char *drop_reason[8]; /* [reason_count], owned */
    uint64_t drop_count[8];
    uint32_t reason_count;
    char *damage; /* owned, what was wrong with the file; NULL: nothing */
    bool has_rgb, has_intensity;
    bool has_pose;
    double pose[16];        /* scanner to world, row-major; already applied */
    double low[3], high[3]; /* of the points kept, metres */
} mospt_source;

typedef struct {
    char *name;    /* owned, inside the folder */
    uint64_t size; /* bytes that belong to this generation */
} mospt_payload_file;

/* What is said of a dataset whose build is still running, or was interrupted. */
typedef struct {
    uint64_t commit; /* counts, from 1; 0: the dataset is finished, and the rest means nothing */
    uint64_t points, points_hash; /* of all points, once it is finished */
    uint64_t build; /* hash of what it is built from, and how: what a build must have to go on */
} mospt_unfinished;

typedef struct {
    uint64_t generation; /* counts finished states, from 1; that which an unfinished one becomes */
    mospt_unfinished unfinished;
    mospt_grid grid;
    mospt_schema schema;
    uint32_t inner_depth; /* of every MOSPT */
    uint32_t
        add_threshold; /* a child octant exists only if it would get at least this many points */
    uint64_t point_count;
    uint64_t points_hash;  /* sum modulo 2^64 of the hash of every record: conservation of points */
    double position_error; /* largest distance along an axis between a point and its grid position,
                              metres */
    double low[3], high[3]; /* of all points, metres */
    char *crs;              /* owned, "" if unknown */
    mospt_source *sources;  /* [source_count], owned */
    uint32_t source_count;
    mospt_payload_file *files; /* [file_count], owned */
    uint32_t file_count;
    char hierarchy_name[64];
    uint64_t hierarchy_size, hierarchy_hash;
} mospt_metadata;

void mospt_metadata_fini(mospt_metadata *metadata);

/* Reads metadata.json of a dataset folder. errors: MOSPT_EIO, MOSPT_ENOMEM, MOSPT_EFORMAT */
bool mospt_metadata_read(const char *dataset_path, mospt_metadata *out, mospt_err *err);

/* Writes it beside the old one, on disk, then renames: the commit of a generation. */
bool mospt_metadata_write(const mospt_metadata *metadata, const char *dataset_path, mospt_err *err);

typedef struct {
    char *path; /* owned */
    mospt_metadata metadata;
    mospt_hierarchy hierarchy;
    int *fd; /* [metadata.file_count], owned, open for reading */
} mospt_dataset;

/* True if there is a folder with a metadata.json at `path`. */
bool mospt_dataset_exists(const char *path);

/* True if there is a dataset that a build has left unfinished, or is still writing. */
bool mospt_dataset_is_unfinished(const char *path);

/* Opens a dataset; nothing but the outer octree is read. Closed by mospt_dataset_close(). What is
 * being built is seen as of the last commit, and goes on being readable after the next ones.
 * errors   MOSPT_EIO (a file is missing), MOSPT_EFORMAT, MOSPT_ENOMEM */
bool mospt_dataset_open(const char *path, mospt_dataset **out, mospt_err *err);
void mospt_dataset_close(mospt_dataset *dataset);

/* Bytes of the vertices of a node. */
static inline size_t mospt_dataset_vertices_size(const mospt_dataset *dataset, uint32_t node)
{
    return (size_t)dataset->hierarchy.nodes[node].count * sizeof(mospt_vertex);
}

/* Reads the vertices of one node and checks their hash.
 * out      [nodes[node].count], in the order of the inner levels
 * errors   MOSPT_EIO, MOSPT_EFORMAT with file and byte
 * threads  any */
bool mospt_dataset_read_vertices(const mospt_dataset *dataset, uint32_t node, mospt_vertex *out,
                                 mospt_err *err);

/* Bytes of the attribute planes of a node, as they are stored. */
static inline size_t mospt_dataset_planes_size(const mospt_dataset *dataset, uint32_t node)
{
    return (size_t)dataset->hierarchy.nodes[node].payload_size -
           mospt_dataset_vertices_size(dataset, node);
}

/* Reads the attributes of one node that are stored and checks their hash.
 * out      [mospt_dataset_planes_size()] bytes: plane after plane */
bool mospt_dataset_read_planes(const mospt_dataset *dataset, uint32_t node, uint8_t *out,
                               mospt_err *err);

/* The same, and those that are not stored.
 * vertices [nodes[node].count], as they were read: some attributes are the colour
 * out      [nodes[node].count * schema.row_size] bytes: plane after plane, in the order of the
 *          schema, also of what is not stored
 * threads  any */
bool mospt_dataset_read_attributes(const mospt_dataset *dataset, uint32_t node,
                                   const mospt_vertex *vertices, uint8_t *out, mospt_err *err);
