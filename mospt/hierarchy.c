#include "mospt/hierarchy.h"

#include "mospt/file.h"
#include "mospt/hash.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Bytes of the file: docs/format.md. All numbers are little-endian. */
enum { HEADER_SIZE = 64, RECORD_FIXED_SIZE = 64, VERSION = 2, NODES_MAX = 1 << 28 };
static const char MAGIC[8] = "IPTSHIER";

typedef struct {
    char magic[8];
    uint32_t version, header_size, record_size, node_count;
    uint8_t refinement, children_max, inner_depth,
        boxes; /* boxes 0: cubes given by corner and level */
    uint32_t reserved_1;
    uint64_t point_count;
    uint64_t reserved_2[3];
} file_header;

typedef struct {
    uint32_t corner[3];
    uint16_t level, payload_file;
    uint8_t child_mask, child_count, codec, pending_mask;
    uint32_t first_child, count, reserved_1;
    uint64_t payload_offset, payload_size, vertices_hash, attributes_hash;
} file_record;

_Static_assert(sizeof(file_header) == HEADER_SIZE, "the header is stored as it stands in memory");
_Static_assert(sizeof(file_record) == RECORD_FIXED_SIZE,
               "and so is a record, before its level ends");
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "files are written as the numbers stand in memory, which must be little-endian"
#endif

static uint32_t record_size_of(uint32_t inner_depth)
{
    return RECORD_FIXED_SIZE + 4 * (inner_depth + 2);
}

void mospt_hierarchy_fini(mospt_hierarchy *hierarchy)
{
    free(hierarchy->nodes);
    *hierarchy = (mospt_hierarchy){0};
}

static bool header_is_valid(const file_header *h, uint64_t file_size, const char *path,
                            mospt_err *err)
{
    static const uint64_t zero[3];
    if (memcmp(h->magic, MAGIC, sizeof MAGIC) != 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(path, 0), "is not a hierarchy file");
    if (h->version != VERSION)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(path, 8),
                             "has version %" PRIu32 ", this program reads version %d", h->version,
                             VERSION);
    if (h->header_size != HEADER_SIZE || h->inner_depth < MOSPT_DEPTH_MIN ||
        h->inner_depth > MOSPT_DEPTH_MAX || h->record_size != record_size_of(h->inner_depth))
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(path, 12),
                             "header of %" PRIu32 " bytes, records of %" PRIu32
                             " and inner depth %u do not agree",
                             h->header_size, h->record_size, h->inner_depth);
    if (h->refinement != MOSPT_REFINE_ADD || h->children_max != MOSPT_CHILDREN_MAX || h->boxes != 0)
        return mospt_err_set(
            err, MOSPT_EFORMAT, mospt_at_byte(path, 24),
            "refinement %u, %u children and boxes %u are not what this program draws",
            h->refinement, h->children_max, h->boxes);
    if (h->reserved_1 != 0 || memcmp(h->reserved_2, zero, sizeof zero) != 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(path, 28),
                             "reserved bytes are not zero");
    if (h->node_count < 1 || h->node_count > NODES_MAX ||
        file_size != HEADER_SIZE + (uint64_t)h->node_count * h->record_size)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(path, 20),
                             "%" PRIu32 " nodes do not fill a file of %" PRIu64 " bytes",
                             h->node_count, file_size);
    return true;
}

/* Returns false if bytes that mean nothing yet are not zero. */
static bool node_from_record(const uint8_t *bytes, uint32_t levels, mospt_node *node)
{
    file_record r;
    memcpy(&r, bytes, RECORD_FIXED_SIZE);
    *node = (mospt_node){
        .corner = {r.corner[0], r.corner[1], r.corner[2]},
        .level = r.level,
        .child_mask = r.child_mask,
        .child_count = r.child_count,
        .pending_mask = r.pending_mask,
        .first_child = r.first_child,
        .parent = MOSPT_NO_NODE,
        .count = r.count,
        .vertices_hash = r.vertices_hash,
        .attributes_hash = r.attributes_hash,
        .payload_offset = r.payload_offset,
        .payload_size = r.payload_size,
        .payload_file = r.payload_file,
        .codec = r.codec,
    };
    memcpy(node->level_end, bytes + RECORD_FIXED_SIZE, levels * sizeof(uint32_t));
    return r.reserved_1 == 0;
}

static void node_to_record(const mospt_node *node, uint32_t levels, uint8_t *bytes)
{
    file_record r = {
        .corner = {node->corner[0], node->corner[1], node->corner[2]},
        .level = node->level,
        .payload_file = node->payload_file,
        .child_mask = node->child_mask,
        .child_count = node->child_count,
        .pending_mask = node->pending_mask,
        .codec = node->codec,
        .first_child = node->first_child,
        .count = node->count,
        .payload_offset = node->payload_offset,
        .payload_size = node->payload_size,
        .vertices_hash = node->vertices_hash,
        .attributes_hash = node->attributes_hash,
    };
    memcpy(bytes, &r, RECORD_FIXED_SIZE);
    memcpy(bytes + RECORD_FIXED_SIZE, node->level_end, levels * sizeof(uint32_t));
}

bool mospt_hierarchy_read(const char *path, const mospt_grid *grid, uint64_t expected_size,
                          uint64_t expected_hash, mospt_hierarchy *out, mospt_err *err)
{
    bool ok = false;
    char *bytes = NULL;
    size_t size = 0;
    mospt_hierarchy h = {0};
    file_header header;

    if (!mospt_file_read_whole(path,
                               HEADER_SIZE + (size_t)NODES_MAX * record_size_of(MOSPT_DEPTH_MAX),
                               &bytes, &size, err))
        return false;
    if (size != expected_size || size < HEADER_SIZE) {
        mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(path),
                      "has %zu bytes, metadata.json says %" PRIu64, size, expected_size);
        goto done;
    }
    if (mospt_hash(bytes, size) != expected_hash) {
        mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(path), "is damaged: its checksum is wrong");
        goto done;
    }
    memcpy(&header, bytes, sizeof header);
    if (!header_is_valid(&header, size, path, err)) goto done;

    h = (mospt_hierarchy){.count = header.node_count,
                          .inner_depth = header.inner_depth,
                          .refinement = (mospt_refinement)header.refinement,
                          .point_count = header.point_count};
    h.nodes = malloc(h.count * sizeof *h.nodes);
    if (h.nodes == NULL) {
        mospt_err_nomem(err, h.count * sizeof *h.nodes);
        goto done;
    }
    for (uint32_t i = 0; i < h.count; i++) {
        size_t at = HEADER_SIZE + (size_t)i * header.record_size;
        if (node_from_record((const uint8_t *)bytes + at, h.inner_depth + 2, &h.nodes[i])) continue;
        mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(path, at),
                      "reserved bytes of node %" PRIu32 " are not zero", i);
        goto done;
    }
    for (uint32_t i = 0; i < h.count; i++) {
        const mospt_node *n = &h.nodes[i];
        for (uint32_t c = 0;
             n->first_child < h.count && c < n->child_count && n->first_child + c < h.count; c++)
            h.nodes[n->first_child + c].parent = i;
    }
    if (!mospt_hierarchy_is_valid(&h, grid, err)) {
        if (err != NULL && err->file[0] == '\0') snprintf(err->file, sizeof err->file, "%s", path);
        goto done;
    }
    *out = h;
    ok = true;
done:
    if (!ok) mospt_hierarchy_fini(&h);
    free(bytes);
    return ok;
}

bool mospt_hierarchy_write(const mospt_hierarchy *hierarchy, const char *path, uint64_t *size,
                           uint64_t *hash, mospt_err *err)
{
    uint32_t record_size = record_size_of(hierarchy->inner_depth);
    size_t file_size = HEADER_SIZE + (size_t)hierarchy->count * record_size;
    uint8_t *bytes = malloc(file_size);
    if (bytes == NULL) return mospt_err_nomem(err, file_size);

    file_header header = {
        .version = VERSION,
        .header_size = HEADER_SIZE,
        .record_size = record_size,
        .node_count = hierarchy->count,
        .refinement = (uint8_t)hierarchy->refinement,
        .children_max = MOSPT_CHILDREN_MAX,
        .inner_depth = (uint8_t)hierarchy->inner_depth,
        .point_count = hierarchy->point_count,
    };
    memcpy(header.magic, MAGIC, sizeof MAGIC);
    memcpy(bytes, &header, sizeof header);
    for (uint32_t i = 0; i < hierarchy->count; i++)
        node_to_record(&hierarchy->nodes[i], hierarchy->inner_depth + 2,
                       bytes + HEADER_SIZE + (size_t)i * record_size);
    *size = file_size;
    *hash = mospt_hash(bytes, file_size);
    bool ok = mospt_file_replace(path, bytes, file_size, err);
    free(bytes);
    return ok;
}

static bool node_fails(mospt_err *err, uint32_t node, const char *what)
{
    return mospt_err_set(err, MOSPT_EFORMAT, mospt_nowhere(), "node %" PRIu32 ": %s", node, what);
}

static bool levels_are_valid(const mospt_node *n, uint32_t inner_depth)
{
    /* A cell has at most eight children, which holds for every level but that of the added points.
     */
    if (n->count < 1 || n->level_end[0] != 1 || n->level_end[inner_depth + 1] != n->count)
        return false;
    for (uint32_t l = 1; l <= inner_depth + 1; l++)
        if (n->level_end[l] < n->level_end[l - 1]) return false;
    for (uint32_t l = 1; l <= inner_depth; l++)
        if (n->level_end[l] > (uint64_t)n->level_end[l - 1] * MOSPT_CHILDREN_MAX) return false;
    return true;
}

static bool children_are_valid(const mospt_hierarchy *h, const mospt_grid *grid, uint32_t i,
                               mospt_err *err)
{
    const mospt_node *n = &h->nodes[i];
    uint32_t c = n->first_child;
    for (uint32_t octant = 0; octant < MOSPT_CHILDREN_MAX; octant++) {
        if (!(n->child_mask >> octant & 1)) continue;
        uint32_t corner[3];
        if (mospt_cell_bits(grid, n->level) == 0 && octant > 0)
            return node_fails(err, i, "is one step wide and has a child beside its only octant");
        mospt_cell_child(grid, n->corner, n->level, octant, corner);
        if (memcmp(h->nodes[c].corner, corner, sizeof corner) != 0 ||
            h->nodes[c].level != n->level + 1)
            return node_fails(err, c, "does not lie in its octant of the node above");
        c++;
    }
    return true;
}

bool mospt_hierarchy_is_valid(const mospt_hierarchy *h, const mospt_grid *grid, mospt_err *err)
{
    uint64_t points = 0;
    uint32_t next = 1;
    const mospt_node *root = h->nodes;
    if (h->count == 0 || root->level != 0 ||
        memcmp(root->corner, grid->root, sizeof grid->root) != 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_nowhere(),
                             "the root is not the root of the grid");
    for (uint32_t i = 0; i < h->count; i++) {
        const mospt_node *n = &h->nodes[i];
        if (n->child_count != __builtin_popcount(n->child_mask))
            return node_fails(err, i, "its children and their octants differ in number");
        if ((n->child_mask & n->pending_mask) != 0)
            return node_fails(err, i, "waits for a child that it has");
        if (n->child_count == 0 ? n->first_child != MOSPT_NO_NODE
                                : n->first_child != next || h->count - next < n->child_count)
            return node_fails(err, i, "its children do not follow those of the node before");
        if (n->codec != MOSPT_CODEC_RAW)
            return node_fails(err, i, "has a codec that this program cannot read");
        if (!levels_are_valid(n, h->inner_depth))
            return node_fails(err, i, "the ends of its levels are wrong");
        if (!children_are_valid(h, grid, i, err)) return false;
        next += n->child_count;
        points += n->count;
    }
    if (next != h->count) return node_fails(err, next, "belongs to no node above");
    if (points != h->point_count)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_nowhere(),
                             "nodes hold %" PRIu64 " points, the header says %" PRIu64, points,
                             h->point_count);
    return true;
}

static int compare_nodes(const void *a, const void *b)
{
    const mospt_node *m = a, *n = b;
    if (m->level != n->level) return m->level < n->level ? -1 : 1;
    /* The first bit in which the corners differ decides, z before y before x: Morton order on any
     * number of bits. */
    uint32_t worst = 0;
    int axis = 0;
    for (int k = 2; k >= 0; k--) {
        uint32_t differ = m->corner[k] ^ n->corner[k];
        if (differ > worst && (differ ^ worst) > worst) worst = differ, axis = k;
    }
    if (worst == 0) return 0;
    return m->corner[axis] < n->corner[axis] ? -1 : 1;
}

/* Links a node to its children, of which the first that is there is node `next`. Returns where
 * those of the following node begin. */
static uint32_t link_children(mospt_hierarchy *h, const mospt_grid *grid, uint32_t i, uint32_t next)
{
    mospt_node *n = &h->nodes[i];
    uint8_t mask = n->child_mask | n->pending_mask;
    uint32_t first = next;
    n->child_mask = 0;
    for (uint32_t octant = 0; octant < MOSPT_CHILDREN_MAX && next < h->count; octant++) {
        mospt_node *child = &h->nodes[next];
        uint32_t corner[3];
        if (!(mask >> octant & 1)) continue;
        mospt_cell_child(grid, n->corner, n->level, octant, corner);
        if (child->level != n->level + 1 || memcmp(child->corner, corner, sizeof corner) != 0)
            continue;
        n->child_mask |= (uint8_t)(1u << octant);
        child->parent = i;
        next++;
    }
    n->pending_mask = mask & (uint8_t)~n->child_mask;
    n->child_count = (uint8_t)(next - first);
    n->first_child = next > first ? first : MOSPT_NO_NODE;
    return next;
}

bool mospt_hierarchy_link(mospt_hierarchy *h, const mospt_grid *grid, mospt_err *err)
{
    qsort(h->nodes, h->count, sizeof *h->nodes, compare_nodes);
    uint32_t next = 1;
    h->point_count = 0;
    for (uint32_t i = 0; i < h->count; i++) {
        if (i == 0) h->nodes[i].parent = MOSPT_NO_NODE;
        next = link_children(h, grid, i, next);
        h->point_count += h->nodes[i].count;
    }
    return mospt_hierarchy_is_valid(h, grid, err);
}

bool mospt_hierarchy_is_finished(const mospt_hierarchy *hierarchy)
{
    for (uint32_t i = 0; i < hierarchy->count; i++)
        if (hierarchy->nodes[i].pending_mask != 0) return false;
    return true;
}

uint32_t mospt_hierarchy_child(const mospt_hierarchy *hierarchy, uint32_t node, uint32_t octant)
{
    const mospt_node *n = &hierarchy->nodes[node];
    if (!(n->child_mask >> octant & 1)) return MOSPT_NO_NODE;
    uint32_t before = n->child_mask & ((1u << octant) - 1);
    return n->first_child + (uint32_t)__builtin_popcount(before);
}
