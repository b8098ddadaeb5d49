/* render/colours.h - the colours that nodes are painted in, from look to look and from one
 * generation of a dataset to the next. */
#pragma once
#include "render/scheme.h"

typedef struct {
    rend_scheme *scheme; /* owned, of the dataset in hand */
    rend_look look;      /* that the paint was made for */
    rend_paint paint;
    rend_legend legend;
    bool begun; /* there is a paint */
    bool again; /* it was made for another dataset: is the same one for this? */
} rend_colours;

typedef enum {
    REND_PAINT_KEPT,  /* nothing has changed */
    REND_PAINT_EQUAL, /* another paint, but nodes look as they did */
    REND_PAINT_OTHER,
} rend_paint_change;

/* dataset  borrowed */
bool rend_colours_init(rend_colours *colours, const mospt_dataset *dataset, mospt_err *err);
void rend_colours_fini(rend_colours *colours); /* {0} is fine */

/* Goes on with another dataset. errors  MOSPT_ENOMEM: nothing has changed */
bool rend_colours_swap(rend_colours *colours, const mospt_dataset *dataset, mospt_err *err);

/* Sees to it that the paint is the one for `look`.
 * change   out: what that did
 * errors   as rend_scheme_make() */
bool rend_colours_use(rend_colours *colours, const rend_look *look, rend_paint_change *change,
                      mospt_err *err);
