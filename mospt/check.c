#include "mospt/check.h"

#include "mospt/deal.h"
#include "mospt/file.h"
#include "mospt/hash.h"
#include "mospt/payload.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

typedef struct {
    const mospt_dataset *dataset;
    const mospt_check_options *options;
    mospt_check_result *result;
    uint8_t *payload; /* of the largest node */
    uint32_t *codes;  /* of its points, finest cells */
    uint8_t *cells;   /* one bit for each finest cell, all zero between uses */
    uint64_t points_hash;
    uint32_t low[3], high[3];
    uint64_t *of_source; /* [source_count] points */
} checker;

/* What is still to come may be in the files already, and is not in the sums. */
static bool is_unfinished(const mospt_dataset *dataset)
{
    return dataset->metadata.unfinished.commit > 0;
}

static void report(checker *c, const mospt_err *err)
{
    c->result->findings++;
    c->options->found(c->options->context, err);
}

/* A finding about a node, at its place in the payload file. */
static void report_node(checker *c, uint32_t node, uint32_t point, const char *what)
{
    const mospt_node *n = &c->dataset->hierarchy.nodes[node];
    char *path =
        mospt_file_join(c->dataset->path, c->dataset->metadata.files[n->payload_file].name);
    mospt_err err;
    mospt_err_set(&err, MOSPT_EFORMAT,
                  mospt_at_byte(path, n->payload_offset + point * sizeof(mospt_vertex)),
                  "node %" PRIu32 ": %s", node, what);
    free(path);
    report(c, &err);
}

static void check_places(checker *c, uint32_t node, const mospt_vertex *v)
{
    const mospt_node *n = &c->dataset->hierarchy.nodes[node];
    for (uint32_t i = 0; i < n->count; i++) {
        if (!mospt_cell_contains(&c->dataset->metadata.grid, n->corner, n->level, v[i].x, v[i].y,
                                 v[i].z)) {
            report_node(c, node, i, "a point lies outside the cube of its node");
            return;
        }
    }
}

static bool bit_is_set(const uint8_t *cells, uint32_t cell)
{
    return cells[cell >> 3] >> (cell & 7) & 1;
}

/* What a level adds is in Morton order, dealt. `at` is the point that is not. */
static bool is_in_order(const uint32_t *codes, uint32_t begin, uint32_t end, uint32_t *at)
{
    mospt_deal deal = mospt_deal_of(end - begin);
    for (uint32_t k = 1; k < end - begin; k++) {
        *at = begin + mospt_deal_place(&deal, k);
        if (codes[*at] < codes[begin + mospt_deal_place(&deal, k - 1)]) return false;
    }
    return true;
}

/* The first level_end[i] points lie one in each occupied cell of depth i, in the order of its level
 * within what that adds. */
static void check_levels(checker *c, uint32_t node)
{
    const mospt_node *n = &c->dataset->hierarchy.nodes[node];
    uint32_t depth = c->dataset->hierarchy.inner_depth;
    const char *wrong = NULL;
    uint32_t at = 0;
    for (uint32_t level = 0; level <= depth && wrong == NULL; level++) {
        uint32_t shift = 3 * (depth - level), end = n->level_end[level];
        for (at = 0; at < end && wrong == NULL; at++) {
            uint32_t cell = c->codes[at] >> shift;
            if (bit_is_set(c->cells, cell))
                wrong = "two points of a level share a cell of its depth";
            c->cells[cell >> 3] |= (uint8_t)(1u << (cell & 7));
        }
        for (; at < n->count && wrong == NULL; at++)
            if (!bit_is_set(c->cells, c->codes[at] >> shift))
                wrong = "an occupied cell has no point in its level";
        for (uint32_t i = 0; i < end; i++)
            c->cells[c->codes[i] >> shift >> 3] = 0;
    }
    if (wrong != NULL) {
        report_node(c, node, at > 0 ? at - 1 : 0, wrong);
        return;
    }
    for (uint32_t level = 0, begin = 0; level <= depth + 1; begin = n->level_end[level++])
        if (!is_in_order(c->codes, begin, n->level_end[level], &at)) {
            report_node(c, node, at, "points of a level are not in its order");
            return;
        }
}

/* Octants with a child reject: no two of their points share a finest cell. The others add, but no
 * more than the threshold. */
static void check_strategy(checker *c, uint32_t node)
{
    const mospt_node *n = &c->dataset->hierarchy.nodes[node];
    const mospt_metadata *m = &c->dataset->metadata;
    uint32_t depth = m->inner_depth, added[MOSPT_CHILDREN_MAX] = {0};
    if (mospt_cell_bits(&m->grid, n->level) == 0)
        return; /* a pile: all points are at one position */
    for (uint32_t i = n->level_end[depth]; i < n->count; i++) {
        uint32_t octant = c->codes[i] >> 3 * (depth - 1);
        if ((n->child_mask | n->pending_mask) >> octant & 1) {
            report_node(c, node, i, "two points share a finest cell of an octant that rejects");
            return;
        }
        if (++added[octant] == m->add_threshold) {
            report_node(c, node, i,
                        "an octant holds so many points beside others that it should have a child");
            return;
        }
    }
}

static void check_attributes(checker *c, uint32_t node, const uint8_t *planes)
{
    const mospt_metadata *m = &c->dataset->metadata;
    uint32_t count = c->dataset->hierarchy.nodes[node].count;
    int k = mospt_schema_find(&m->schema, "scan");
    if (k < 0) return;
    const mospt_attribute *a = &m->schema.at[k];
    size_t size = mospt_type_size(a->type);
    for (uint32_t i = 0; i < count; i++) {
        double scan = mospt_type_read(a->type, planes + (size_t)count * a->offset + i * size);
        if (scan >= m->source_count) {
            report_node(c, node, i, "a point belongs to a scan that is not there");
            return;
        }
        c->of_source[(uint32_t)scan]++;
    }
}

static void check_node(checker *c, uint32_t node)
{
    const mospt_dataset *d = c->dataset;
    const mospt_node *n = &d->hierarchy.nodes[node];
    size_t vertices_size = mospt_dataset_vertices_size(d, node);
    uint8_t *planes = c->payload + vertices_size;
    mospt_vertex *v = (mospt_vertex *)(void *)c->payload;
    uint32_t bits = mospt_cell_bits(&d->metadata.grid, n->level);
    mospt_err err;
    bool whole = true;
    if (!mospt_dataset_read_vertices(d, node, v, &err)) report(c, &err), whole = false;
    if (!mospt_dataset_read_planes(d, node, planes, &err)) report(c, &err), whole = false;
    if (!whole) return;
    c->points_hash += mospt_payload_points_hash(&d->metadata.schema, c->payload, planes, n->count);
    mospt_payload_complete(&d->metadata.schema, v, n->count, planes);
    for (uint32_t i = 0; i < n->count; i++) {
        const uint32_t g[3] = {v[i].x, v[i].y, v[i].z};
        c->codes[i] = (uint32_t)mospt_cell_code(g[0], g[1], g[2], bits, d->hierarchy.inner_depth);
        for (int a = 0; a < 3; a++) {
            if (g[a] < c->low[a]) c->low[a] = g[a];
            if (g[a] > c->high[a]) c->high[a] = g[a];
        }
    }
    check_places(c, node, v);
    check_levels(c, node);
    check_strategy(c, node);
    check_attributes(c, node, planes);
    c->result->points += n->count;
    c->result->bytes += n->payload_size;
}

/* A node exists because its parent rejected at least `add_threshold` points into its octant, unless
 * some of them are still to come. */
static bool check_subtrees(checker *c, mospt_err *err)
{
    const mospt_hierarchy *h = &c->dataset->hierarchy;
    uint64_t *below = malloc(h->count * sizeof *below);
    if (below == NULL) return mospt_err_nomem(err, h->count * sizeof *below);
    for (uint32_t i = 0; i < h->count; i++)
        below[i] = h->nodes[i].count +
                   (h->nodes[i].pending_mask != 0 ? c->dataset->metadata.add_threshold : 0);
    for (uint32_t i = h->count; i-- > 1;) {
        below[h->nodes[i].parent] += below[i];
        if (below[i] < c->dataset->metadata.add_threshold)
            report_node(c, i, 0, "has fewer points with all below it than a node must have");
    }
    free(below);
    return true;
}

typedef struct {
    uint64_t offset, size;
    uint32_t file, node;
} range;

static int compare_ranges(const void *a, const void *b)
{
    const range *r = a, *s = b;
    if (r->file != s->file) return r->file < s->file ? -1 : 1;
    return r->offset < s->offset ? -1 : r->offset > s->offset;
}

/* Every byte of every payload file belongs to exactly one node. */
static bool check_files(checker *c, mospt_err *err)
{
    const mospt_dataset *d = c->dataset;
    const mospt_hierarchy *h = &d->hierarchy;
    range *ranges = malloc(h->count * sizeof *ranges);
    if (ranges == NULL) return mospt_err_nomem(err, h->count * sizeof *ranges);
    for (uint32_t i = 0; i < h->count; i++)
        ranges[i] = (range){h->nodes[i].payload_offset, h->nodes[i].payload_size,
                            h->nodes[i].payload_file, i};
    qsort(ranges, h->count, sizeof *ranges, compare_ranges);
    uint32_t i = 0;
    for (uint32_t f = 0; f < d->metadata.file_count; f++) {
        char *path = mospt_file_join(d->path, d->metadata.files[f].name);
        uint64_t end = 0;
        mospt_err what;
        struct stat status;
        for (; i < h->count && ranges[i].file == f; end = ranges[i].offset + ranges[i].size, i++) {
            if (ranges[i].offset == end) continue;
            mospt_err_set(&what, MOSPT_EFORMAT, mospt_at_byte(path, end),
                          "the payload of node %" PRIu32
                          " does not begin where the one before it ends",
                          ranges[i].node);
            report(c, &what);
        }
        if (end != d->metadata.files[f].size) {
            mospt_err_set(&what, MOSPT_EFORMAT, mospt_at_byte(path, end),
                          "bytes that belong to no node");
            report(c, &what);
        }
        if (!is_unfinished(d) && fstat(d->fd[f], &status) == 0 &&
            (uint64_t)status.st_size != d->metadata.files[f].size) {
            mospt_err_set(&what, MOSPT_EFORMAT, mospt_at_byte(path, d->metadata.files[f].size),
                          "the file should end here, and has %" PRIu64 " bytes more",
                          (uint64_t)status.st_size - d->metadata.files[f].size);
            report(c, &what);
        }
        free(path);
    }
    free(ranges);
    return true;
}

static void check_totals(checker *c)
{
    const mospt_metadata *m = &c->dataset->metadata;
    mospt_err what;
    char *path = mospt_file_join(c->dataset->path, "metadata.json");
    if (c->points_hash != m->points_hash) {
        mospt_err_set(&what, MOSPT_EFORMAT, mospt_at_file(path),
                      "points are not those that were read: their checksum is %016" PRIx64
                      ", not %016" PRIx64,
                      c->points_hash, m->points_hash);
        report(c, &what);
    }
    for (int a = 0; a < 3; a++) {
        char axis = (char)('x' + a);
        double low = mospt_grid_axis_to_world(&m->grid, a, c->low[a]);
        double high = mospt_grid_axis_to_world(&m->grid, a, c->high[a]);
        if (low == m->low[a] && high == m->high[a]) continue;
        if (is_unfinished(c->dataset) && low >= m->low[a] && high <= m->high[a]) continue;
        mospt_err_set(&what, MOSPT_EFORMAT, mospt_at_file(path),
                      "%c reaches from %.17g to %.17g, not from %.17g to %.17g", axis, low, high,
                      m->low[a], m->high[a]);
        report(c, &what);
    }
    for (uint32_t i = 0; i < m->source_count; i++) {
        if (c->of_source[i] == m->sources[i].points || mospt_schema_find(&m->schema, "scan") < 0)
            continue;
        if (is_unfinished(c->dataset) && c->of_source[i] < m->sources[i].points) continue;
        mospt_err_set(&what, MOSPT_EFORMAT, mospt_at_file(path),
                      "%s has %" PRIu64 " points, not %" PRIu64, m->sources[i].name,
                      c->of_source[i], m->sources[i].points);
        report(c, &what);
    }
    free(path);
}

bool mospt_check(const mospt_dataset *d, const mospt_check_options *options,
                 mospt_check_result *out, mospt_err *err)
{
    bool ok = false;
    uint32_t largest = 0;
    uint32_t cell_bits = 3 * d->hierarchy.inner_depth;
    *out = (mospt_check_result){0};
    checker c = {.dataset = d,
                 .options = options,
                 .result = out,
                 .low = {UINT32_MAX, UINT32_MAX, UINT32_MAX}};
    for (uint32_t i = 0; i < d->hierarchy.count; i++)
        if (d->hierarchy.nodes[i].count > largest) largest = d->hierarchy.nodes[i].count;
    size_t payload_size = largest * (sizeof(mospt_vertex) + d->metadata.schema.row_size);
    c.payload = malloc(payload_size);
    c.codes = malloc(largest * sizeof *c.codes);
    c.cells = calloc(1, ((size_t)1 << cell_bits) / 8 + 1);
    c.of_source = calloc(d->metadata.source_count + 1, sizeof *c.of_source);
    if (c.payload == NULL || c.codes == NULL || c.cells == NULL || c.of_source == NULL) {
        mospt_err_nomem(err, payload_size);
        goto done;
    }
    if (!check_files(&c, err) || !check_subtrees(&c, err)) goto done;
    for (uint32_t i = 0; i < d->hierarchy.count; i++) {
        check_node(&c, i);
        if (options->progress != NULL &&
            !options->progress(options->context, i + 1, d->hierarchy.count)) {
            mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
            goto done;
        }
    }
    /* Sums over damaged nodes would only repeat what has been said. */
    if (out->points == d->hierarchy.point_count) check_totals(&c);
    ok = true;
done:
    free(c.payload), free(c.codes), free(c.cells), free(c.of_source);
    return ok;
}
