/* render/space.h - where one can walk: which parts of a site are free, and how far below the floor
 * is.
 *
 * A coarse grid of cubic cells over a part of the site, filled from the upper levels of the tree:
 * points of a few decimetres' spacing tell walls from doors. Made once for a tour, not for drawing.
 */
#pragma once
#include "mospt/dataset.h"
#include "render/options.h"

enum { REND_NO_FLOOR = 255 };

typedef struct {
    double low[3];    /* world, corner of cell 0 */
    double cell_m;    /* width of a cell */
    uint32_t size[3]; /* cells along each axis, x running fastest */
    uint8_t *floor;   /* [cells], owned: 0 filled, else cells down to the next filled one; at most
                         REND_NO_FLOOR, which also stands for none */
    uint8_t *narrow;  /* [cells], owned: 1 where something is within REND_SHOULDER_M beside it */
} rend_space;

#define REND_SHOULDER_M 0.5

/* part     of the site; cells are a quarter of a metre wide, or wider so that 16 million hold it
 * out      rend_space_fini()
 * errors   MOSPT_ENOMEM, MOSPT_EIO, MOSPT_EFORMAT: the tree cannot be read */
bool rend_space_make(const mospt_dataset *dataset, const rend_box *part, rend_space *out,
                     mospt_err *err);

/* The same from a list of filled cells, for which `floor` has 0 and anything else elsewhere. */
bool rend_space_derive(rend_space *space); /* false without memory */
void rend_space_fini(rend_space *space);

size_t rend_space_cells(const rend_space *space);

/* The cell of a position; positions outside belong to the nearest one. */
size_t rend_space_cell(const rend_space *space, const double world[3]);
void rend_space_middle(const rend_space *space, size_t cell, double world[3]);

/* How much an eye at `eye_m` above the floor dislikes a cell: 1 in the open, more beside a wall or
 * too high or low, most inside of something. */
float rend_space_cost(const rend_space *space, size_t cell, double eye_m);

/* Where one can get to on foot: the largest set of cells at eye height in the open that hang
 * together.
 * on_foot  out: owned, [cells] 1 for those
 * errors   MOSPT_ENOMEM */
bool rend_space_walkable(const rend_space *space, double eye_m, uint8_t **on_foot, mospt_err *err);

/* The cheapest way from cell to cell, through something solid only where there is no other.
 * cells    out: owned, from start to end, both included
 * errors   MOSPT_ENOMEM */
bool rend_space_route(const rend_space *space, size_t from, size_t to, double eye_m, size_t **cells,
                      size_t *count, mospt_err *err);
