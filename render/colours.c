#include "render/colours.h"

#include <string.h>

bool rend_colours_init(rend_colours *colours, const mospt_dataset *dataset, mospt_err *err)
{
    *colours = (rend_colours){.scheme = rend_scheme_create(dataset)};
    return colours->scheme != NULL || mospt_err_nomem(err, 0);
}

void rend_colours_fini(rend_colours *colours)
{
    rend_scheme_destroy(colours->scheme);
    *colours = (rend_colours){0};
}

bool rend_colours_swap(rend_colours *colours, const mospt_dataset *dataset, mospt_err *err)
{
    rend_scheme *scheme = rend_scheme_create(dataset);
    if (scheme == NULL) return mospt_err_nomem(err, 0);
    rend_scheme_destroy(colours->scheme);
    colours->scheme = scheme;
    colours->again = true;
    return true;
}

/* A node's level may have changed without a byte of it; all else that a paint looks at is its own.
 */
static bool is_same_paint(const rend_paint *a, const rend_paint *b)
{
    return a->source == b->source && a->source != REND_PAINT_LEVEL &&
           a->source != REND_PAINT_DISTANCE && a->attribute == b->attribute &&
           a->component == b->component && a->zero_is_none == b->zero_is_none &&
           a->classes == b->classes && a->low == b->low && a->high == b->high &&
           memcmp(&a->ramp, &b->ramp, sizeof a->ramp) == 0;
}

bool rend_colours_use(rend_colours *colours, const rend_look *look, rend_paint_change *change,
                      mospt_err *err)
{
    rend_colours *c = colours;
    rend_paint paint;
    bool same = c->begun && rend_scheme_same(look, &c->look);
    *change = REND_PAINT_KEPT;
    if (same && !c->again) return true;
    if (!rend_scheme_make(c->scheme, look, &paint, &c->legend, err)) return false;
    c->look = *look;
    *change = same && is_same_paint(&paint, &c->paint) ? REND_PAINT_EQUAL : REND_PAINT_OTHER;
    c->paint = paint;
    c->begun = true;
    c->again = false;
    return true;
}
