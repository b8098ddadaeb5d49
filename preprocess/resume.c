#include "preprocess/resume.h"

#include "mospt/payload.h"

#include <stdatomic.h>
#include <stdlib.h>

/* What is known of a node that is in the dataset. */
typedef struct {
    bool is_there; /* its payload is undamaged */
    bool is_whole; /* and so are all nodes that there will be below it */
    uint64_t points_hash;
    uint64_t points_below; /* its own included */
} kept;

struct prep_resume {
    mospt_dataset *dataset;
    kept *kept; /* [node count], owned */
};

/* All nodes, by whichever thread has nothing to do. */
typedef struct {
    prep_resume *resume;
    size_t largest; /* bytes of the records of a node */
    atomic_uint next;
} reading;

static void read_node(prep_resume *r, uint32_t i, uint8_t *payload)
{
    const mospt_dataset *d = r->dataset;
    const mospt_node *n = &d->hierarchy.nodes[i];
    uint8_t *planes = payload + mospt_dataset_vertices_size(d, i);
    if (!mospt_dataset_read_vertices(d, i, (mospt_vertex *)(void *)payload, NULL) ||
        !mospt_dataset_read_planes(d, i, planes, NULL))
        return;
    r->kept[i].is_there = true;
    r->kept[i].points_hash =
        mospt_payload_points_hash(&d->metadata.schema, payload, planes, n->count);
}

/* Job: a thread's share, into memory that it uses again and again. Without any, nothing is there.
 */
static void read_nodes(void *context, uint32_t thread)
{
    reading *r = context;
    uint32_t count = r->resume->dataset->hierarchy.count;
    uint8_t *payload = malloc(r->largest);
    (void)thread;
    for (uint32_t i; payload != NULL && (i = atomic_fetch_add(&r->next, 1)) < count;)
        read_node(r->resume, i, payload);
    free(payload);
}

static void read_all(prep_resume *resume, prep_workers *workers)
{
    const mospt_hierarchy *h = &resume->dataset->hierarchy;
    size_t record_size = mospt_record_size(&resume->dataset->metadata.schema);
    reading r = {.resume = resume, .largest = 1};
    for (uint32_t i = 0; i < h->count; i++)
        if (h->nodes[i].count * record_size > r.largest)
            r.largest = h->nodes[i].count * record_size;
    prep_workers_run(workers, prep_workers_count(workers), read_nodes, &r);
}

/* Sums up from the leaves: children stand after their parents. */
static void sum_up(prep_resume *r)
{
    const mospt_hierarchy *h = &r->dataset->hierarchy;
    for (uint32_t i = 0; i < h->count; i++) {
        r->kept[i].is_whole = r->kept[i].is_there && h->nodes[i].pending_mask == 0;
        r->kept[i].points_below = h->nodes[i].count;
    }
    for (uint32_t i = h->count; i-- > 1;) {
        kept *parent = &r->kept[h->nodes[i].parent];
        parent->is_whole = parent->is_whole && r->kept[i].is_whole;
        parent->points_below += r->kept[i].points_below;
    }
}

bool prep_resume_open(const char *path, uint64_t build, prep_workers *workers, prep_resume **out,
                      mospt_err *err)
{
    mospt_dataset *dataset = NULL;
    *out = NULL;
    if (!mospt_dataset_is_unfinished(path) || !mospt_dataset_open(path, &dataset, NULL))
        return true;
    if (dataset->metadata.unfinished.build != build) {
        mospt_dataset_close(dataset);
        return true;
    }
    uint32_t count = dataset->hierarchy.count;
    prep_resume *r = calloc(1, sizeof *r);
    if (r != NULL) *r = (prep_resume){dataset, calloc(count, sizeof *r->kept)};
    if (r == NULL || r->kept == NULL) {
        mospt_dataset_close(dataset);
        free(r);
        return mospt_err_nomem(err, count * sizeof *r->kept);
    }
    read_all(r, workers);
    sum_up(r);
    *out = r;
    return true;
}

void prep_resume_close(prep_resume *resume)
{
    if (resume == NULL) return;
    mospt_dataset_close(resume->dataset);
    free(resume->kept);
    free(resume);
}

const mospt_metadata *prep_resume_metadata(const prep_resume *resume)
{
    return &resume->dataset->metadata;
}

uint32_t prep_resume_find(const prep_resume *resume, const uint32_t corner[3], uint32_t level)
{
    if (resume == NULL) return MOSPT_NO_NODE;
    const mospt_hierarchy *h = &resume->dataset->hierarchy;
    const mospt_grid *grid = &resume->dataset->metadata.grid;
    uint32_t node = 0;
    for (uint32_t l = 0; l < level && node != MOSPT_NO_NODE; l++) {
        uint32_t bits = mospt_cell_bits(grid, l), octant = 0;
        for (int a = 0; a < 3 && bits > 0; a++)
            octant |= (corner[a] >> (bits - 1) & 1) << a;
        node = mospt_hierarchy_child(h, node, octant);
    }
    return node != MOSPT_NO_NODE && resume->kept[node].is_there ? node : MOSPT_NO_NODE;
}

static uint8_t all_children(const mospt_node *node)
{
    return node->child_mask | node->pending_mask;
}

bool prep_resume_has_child(const prep_resume *resume, uint32_t node, uint32_t octant)
{
    return all_children(&resume->dataset->hierarchy.nodes[node]) >> octant & 1;
}

bool prep_resume_is_whole(const prep_resume *resume, uint32_t node)
{
    return resume->kept[node].is_whole;
}

uint64_t prep_resume_points(const prep_resume *resume, uint32_t node, bool and_below)
{
    return and_below ? resume->kept[node].points_below
                     : resume->dataset->hierarchy.nodes[node].count;
}

uint64_t prep_resume_points_hash(const prep_resume *resume, uint32_t node)
{
    return resume->kept[node].points_hash;
}

static uint32_t count_nodes(const mospt_hierarchy *h, uint32_t node, bool and_below)
{
    uint32_t sum = 1;
    for (uint32_t c = 0; and_below && c < h->nodes[node].child_count; c++)
        sum += count_nodes(h, h->nodes[node].first_child + c, true);
    return sum;
}

static void list_nodes(const mospt_hierarchy *h, uint32_t node, bool and_below, prep_subtree *to)
{
    prep_solved *solved = &to->nodes[to->node_count++];
    *solved = (prep_solved){.node = h->nodes[node], .first = node};
    solved->node.child_mask = all_children(&h->nodes[node]);
    solved->node.pending_mask = 0;
    for (uint32_t c = 0; and_below && c < h->nodes[node].child_count; c++)
        list_nodes(h, h->nodes[node].first_child + c, true, to);
}

bool prep_resume_list(const prep_resume *resume, uint32_t node, bool and_below, prep_subtree *out,
                      mospt_err *err)
{
    const mospt_hierarchy *h = &resume->dataset->hierarchy;
    prep_subtree made = {.node_capacity = count_nodes(h, node, and_below)};
    made.nodes = malloc(made.node_capacity * sizeof *made.nodes);
    if (made.nodes == NULL) return mospt_err_nomem(err, made.node_capacity * sizeof *made.nodes);
    list_nodes(h, node, and_below, &made);
    *out = made;
    return true;
}
