#include "render/match.h"

#include <string.h>

static bool is_same_grid(const mospt_grid *a, const mospt_grid *b)
{
    bool same = a->step == b->step && a->bits == b->bits;
    for (int i = 0; i < 3; i++)
        same = same && a->offset[i] == b->offset[i] && a->base[i] == b->base[i] &&
               a->root[i] == b->root[i];
    return same;
}

static bool is_same_schema(const mospt_schema *a, const mospt_schema *b)
{
    bool same = a->count == b->count;
    for (uint32_t i = 0; same && i < a->count; i++)
        same = strcmp(a->at[i].name, b->at[i].name) == 0 && a->at[i].type == b->at[i].type &&
               a->at[i].components == b->at[i].components;
    return same;
}

static bool is_same_payload(const mospt_node *a, const mospt_node *b)
{
    return a->count == b->count && a->vertices_hash == b->vertices_hash &&
           a->attributes_hash == b->attributes_hash;
}

/* Children stand after their parents, so a parent has been paired when its children are looked at.
 */
static void pair_cells(const mospt_hierarchy *before, const mospt_hierarchy *after, uint32_t *to)
{
    for (uint32_t n = 0; n < before->count; n++)
        to[n] = MOSPT_NO_NODE;
    if (before->count > 0 && after->count > 0) to[0] = 0;
    for (uint32_t n = 0; n < before->count; n++)
        for (uint32_t octant = 0; octant < 8 && to[n] != MOSPT_NO_NODE; octant++) {
            uint32_t child = mospt_hierarchy_child(before, n, octant);
            if (child != MOSPT_NO_NODE) to[child] = mospt_hierarchy_child(after, to[n], octant);
        }
}

void rend_match_nodes(const mospt_dataset *before, const mospt_dataset *after, uint32_t *to)
{
    bool comparable = is_same_grid(&before->metadata.grid, &after->metadata.grid) &&
                      is_same_schema(&before->metadata.schema, &after->metadata.schema) &&
                      before->hierarchy.inner_depth == after->hierarchy.inner_depth;
    pair_cells(&before->hierarchy, &after->hierarchy, to);
    for (uint32_t n = 0; n < before->hierarchy.count; n++)
        if (!comparable ||
            (to[n] != MOSPT_NO_NODE &&
             !is_same_payload(&before->hierarchy.nodes[n], &after->hierarchy.nodes[to[n]])))
            to[n] = MOSPT_NO_NODE;
}
