/* render/cpu/walk.h - the width of the cell at a place: the walk of RGL_POINTS_VERTEX from the root
 * down, remembered. The next place is mostly nearby, and its walk starts where the two part; often
 * that is below the cell found last. */
#pragma once
#include "render/cpu/kernel.h"

typedef struct {
    const uint32_t *octants;
    uint32_t used_bits; /* of a place, as a mask */
    uint32_t place[3];  /* the last one */
    int leaf;           /* the bit of it that ended the walk; -1: none did */
    float cell;
    uint32_t node[33]; /* [bit] whose octant that bit chooses, from the leaf up */
} rcpu_walk;

static inline void rcpu_walk_down(rcpu_walk *w, const uint32_t place[3], int bit)
{
    uint32_t node = w->node[bit];
    w->cell = 1;
    for (; bit >= 0; bit--) {
        w->node[bit] = node;
        uint32_t octant =
            (place[0] >> bit & 1) | (place[1] >> bit & 1) << 1 | (place[2] >> bit & 1) << 2;
        uint32_t found = w->octants[8 * (size_t)node + octant];
        if (found >= 0x80000000u) {
            found &= 0x7fffffffu; /* the sign only marks it */
            memcpy(&w->cell, &found, sizeof w->cell);
            break;
        }
        node = found;
    }
    w->leaf = bit;
    memcpy(w->place, place, sizeof w->place);
}

/* octants  of at least one node; NULL: there will be no walk */
static inline void rcpu_walk_start(rcpu_walk *w, const uint32_t *octants, uint32_t grid_bits)
{
    static const uint32_t anywhere[3] = {0, 0, 0};
    *w = (rcpu_walk){.octants = octants, .cell = 1};
    if (octants == NULL) return;
    w->used_bits = grid_bits < 32 ? (UINT32_C(1) << grid_bits) - 1 : UINT32_MAX;
    w->node[grid_bits - 1] = 0;
    rcpu_walk_down(w, anywhere, (int)grid_bits - 1);
}

static inline float rcpu_walk_to(rcpu_walk *w, const uint32_t place[3])
{
    uint32_t differ =
        ((place[0] ^ w->place[0]) | (place[1] ^ w->place[1]) | (place[2] ^ w->place[2])) &
        w->used_bits;
    int bit = differ != 0 ? 31 - __builtin_clz(differ) : -1;
    if (bit >= w->leaf && bit >= 0) rcpu_walk_down(w, place, bit);
    return w->cell;
}
