/* render/space.h - where one can walk: which parts of a site are free, and how far below the floor
 * is.
 *
 * A coarse grid of cubic cells over the site, filled from the upper levels of the tree: points of a
 * few decimetres' spacing tell walls from doors. Made once for a tour, not for drawing. */
#pragma once
#include "mospt/dataset.h"

enum { REND_NO_FLOOR = 255 };

typedef struct {
    double low[3];    /* world, corner of cell 0 */
    double cell_m;    /* width of a cell */
    uint32_t size[3]; /* cells along each axis, x running fastest */
    uint8_t *floor;   /* [cells], owned: 0 filled, else cells down to the next filled one; at most
                         REND_NO_FLOOR, which also stands for none */
    uint8_t *narrow;  /* [cells], owned: 1 where a neighbour is filled */
} rend_space;

/* out      rend_space_fini()
 * errors   MOSPT_ENOMEM, MOSPT_EIO, MOSPT_EFORMAT: the tree cannot be read */
bool rend_space_make(const mospt_dataset *dataset, rend_space *out, mospt_err *err);

/* The same from a list of filled cells, for which `floor` has 0 and anything else elsewhere. */
void rend_space_derive(rend_space *space);
void rend_space_fini(rend_space *space);

size_t rend_space_cells(const rend_space *space);

/* The cell of a position; positions outside belong to the nearest one. */
size_t rend_space_cell(const rend_space *space, const double world[3]);
void rend_space_middle(const rend_space *space, size_t cell, double world[3]);

/* How much an eye at `eye_m` above the floor dislikes a cell: 1 in the open, more beside a wall or
 * too high or low, most inside of something. */
float rend_space_cost(const rend_space *space, size_t cell, double eye_m);

/* The cheapest way from cell to cell, through something solid only where there is no other.
 * cells    out: owned, from start to end, both included
 * errors   MOSPT_ENOMEM */
bool rend_space_route(const rend_space *space, size_t from, size_t to, double eye_m, size_t **cells,
                      size_t *count, mospt_err *err);
