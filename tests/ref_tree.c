#include "tests/ref_tree.h"

#include "tests/ref_mospt.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    const uint8_t **at;
    uint32_t count;
} list;

static void append(list *l, const uint8_t *record)
{
    if ((l->count & (l->count - 1)) == 0) { /* grows at powers of two */
        l->at = realloc(l->at, (l->count > 0 ? 2 * (size_t)l->count : 1) * sizeof *l->at);
        if (l->at == NULL) abort();
    }
    l->at[l->count++] = record;
}

static uint32_t octant_of(const uint8_t *record, uint32_t bits)
{
    uint32_t g[3];
    memcpy(g, record, sizeof g);
    return bits == 0 ? 0
                     : (g[0] >> (bits - 1) & 1) | (g[1] >> (bits - 1) & 1) << 1 |
                           (g[2] >> (bits - 1) & 1) << 2;
}

static void build_node(const prep_shape *shape, size_t stride, const uint32_t corner[3],
                       uint32_t level, const list *input, ref_tree *tree)
{
    uint32_t bits = level < shape->grid->bits ? shape->grid->bits - level : 0;
    list rejected[8] = {{0}};
    ref_mospt *m = ref_mospt_create(shape->inner_depth, bits, stride);
    tree->nodes = realloc(tree->nodes, (tree->count + 1) * sizeof *tree->nodes);
    if (tree->nodes == NULL) abort();
    ref_node node = {.corner = {corner[0], corner[1], corner[2]}, .level = level};
    uint32_t index = tree->count++;

    for (uint32_t i = 0; i < input->count; i++) {
        /* A node one step wide has only one cell: it takes a pile of points as it comes. */
        bool to_pile = bits == 0 && i < prep_pile_points(stride);
        if (!ref_mospt_insert(m, input->at[i], !to_pile))
            append(&rejected[octant_of(input->at[i], bits)], input->at[i]);
    }
    for (uint32_t o = 0; o < 8; o++) {
        if (rejected[o].count >= shape->add_threshold) node.child_mask |= (uint8_t)(1u << o);
        else
            for (uint32_t i = 0; i < rejected[o].count; i++)
                ref_mospt_insert(m, rejected[o].at[i], false);
    }
    node.count = ref_mospt_count(m);
    node.points = malloc((node.count + 1) * sizeof *node.points);
    if (node.points == NULL) abort();
    ref_mospt_finish(m, node.points, node.level_end);
    ref_mospt_destroy(m);
    tree->nodes[index] = node;
    for (uint32_t o = 0; o < 8; o++) {
        uint32_t child[3];
        for (int a = 0; a < 3; a++)
            child[a] = corner[a] + (bits > 0 && (o >> a & 1) ? UINT32_C(1) << (bits - 1) : 0);
        if (node.child_mask >> o & 1)
            build_node(shape, stride, child, level + 1, &rejected[o], tree);
        free(rejected[o].at);
    }
}

void ref_tree_build(const prep_shape *shape, const core_site *site, ref_tree *out)
{
    list all = {0};
    for (uint32_t i = 0; i < site->count; i++)
        append(&all, site->records + i * site->stride);
    *out = (ref_tree){0};
    build_node(shape, site->stride, site->grid.root, 0, &all, out);
    free(all.at);
}

void ref_tree_fini(ref_tree *tree)
{
    for (uint32_t i = 0; i < tree->count; i++)
        free(tree->nodes[i].points);
    free(tree->nodes);
    *tree = (ref_tree){0};
}
