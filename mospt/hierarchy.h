/* mospt/hierarchy.h - the outer octree: one record per node, all of it in memory.
 *
 * Wimmer & Scheiblauer 2006, section 5.1. Each node holds one MOSPT; its points refine those of its
 * ancestors. Nodes are stored level by level, in Morton order within a level, so the children of a
 * node stand side by side and after it. */
#pragma once
#include "mospt/cell.h"

enum {
    MOSPT_CHILDREN_MAX = 8,
    /* Levels of one MOSPT: depths 0 to d, and one more for points that share a finest cell with
       another one. */
    MOSPT_LEVELS_MAX = MOSPT_DEPTH_MAX + 2,
    MOSPT_NO_NODE = 0xffffffff,
};

typedef enum { MOSPT_REFINE_ADD = 1, MOSPT_REFINE_REPLACE = 2 } mospt_refinement;
typedef enum { MOSPT_CODEC_RAW = 0 } mospt_codec;

typedef struct {
    uint32_t corner[3]; /* grid coordinates of the low corner */
    uint16_t level;     /* of the outer octree; 0 is the root */
    uint8_t child_mask; /* bit o: child in octant o. Octants with a child reject, those without add
                           (section 4.6) */
    uint8_t pending_mask; /* octants that reject, too, but whose child an unfinished build has not
                             come to */
    uint8_t child_count;
    uint32_t first_child; /* index; children follow each other in octant order; MOSPT_NO_NODE
                             without any */
    uint32_t parent;      /* index; MOSPT_NO_NODE for the root; not stored in the file */
    uint32_t count;       /* points of this node */
    uint32_t level_end[MOSPT_LEVELS_MAX]; /* [inner_depth + 2] points in inner levels 0..i: draw
                                             that many for level i */
    uint64_t vertices_hash, attributes_hash;
    uint64_t payload_offset,
        payload_size; /* bytes in the payload file; vertices first, then one plane per attribute */
    uint16_t payload_file; /* index into the dataset's payload files */
    uint8_t codec;         /* mospt_codec */
} mospt_node;

typedef struct {
    mospt_node *nodes; /* [count], owned; the root is node 0 */
    uint32_t count;
    uint32_t inner_depth; /* d: finest cells of a node are its width / 2^d */
    mospt_refinement refinement;
    uint64_t point_count;
} mospt_hierarchy;

/* Reads a hierarchy file and checks every field against every other.
 * expected_size, expected_hash   of the file, from metadata.json
 * errors   MOSPT_EIO, MOSPT_ENOMEM, MOSPT_EFORMAT with the byte place */
bool mospt_hierarchy_read(const char *path, const mospt_grid *grid, uint64_t expected_size,
                          uint64_t expected_hash, mospt_hierarchy *out, mospt_err *err);
void mospt_hierarchy_fini(mospt_hierarchy *hierarchy);

/* Writes it, and tells the size and the hash of the file. The file is on disk when this returns. */
bool mospt_hierarchy_write(const mospt_hierarchy *hierarchy, const char *path, uint64_t *size,
                           uint64_t *hash, mospt_err *err);

/* True if the nodes form one octree over the grid's root cube and every count agrees; else says
 * what does not. */
bool mospt_hierarchy_is_valid(const mospt_hierarchy *hierarchy, const mospt_grid *grid,
                              mospt_err *err);

/* Sorts nodes that were made in any order (parents unset) by level and Morton order, and links
 * them. Octants of `child_mask` without a node are pending. */
bool mospt_hierarchy_link(mospt_hierarchy *hierarchy, const mospt_grid *grid, mospt_err *err);

/* True if no node waits for a child. */
bool mospt_hierarchy_is_finished(const mospt_hierarchy *hierarchy);

/* Child of a node in `octant`; MOSPT_NO_NODE if there is none. */
uint32_t mospt_hierarchy_child(const mospt_hierarchy *hierarchy, uint32_t node, uint32_t octant);
