/* tests/ref_tree.h - the slow, obvious twin of preprocess/solve.c and pass.c: the nested octree as
 * Wimmer & Scheiblauer 2006, section 5.2, describe it, one node after the other, with lists for
 * rejection files. */
#pragma once
#include "tests/core_tools.h"

typedef struct {
    uint32_t corner[3], level;
    uint8_t child_mask;
    uint32_t count;
    const uint8_t **points; /* [count], owned; the records borrowed */
    uint32_t level_end[MOSPT_LEVELS_MAX];
} ref_node;

typedef struct {
    ref_node *nodes; /* [count], owned, parents first, octants in their order */
    uint32_t count;
} ref_tree;

void ref_tree_build(const prep_shape *shape, const core_site *site, ref_tree *out);
void ref_tree_fini(ref_tree *tree);
