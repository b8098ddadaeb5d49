/* render/outline.h - where a site is: the positions of some of its points, spread evenly over it,
 * without what strays.
 *
 * Scanners see through windows and measure birds, dust and reflections. Whoever looks at a site as
 * a whole wants to see what was scanned, and not how far the last point flew. */
#pragma once
#include "mospt/dataset.h"

typedef struct {
    double low[3], high[3]; /* world, the box of rend_outline_bounds(), never empty */
    double middle[3];       /* of that box */
    double (*at)[3];        /* [count], owned, metres from the middle along the axes of the world */
    uint32_t count;         /* at least 8: the corners of the box, if there are too few points */
} rend_outline;

/* What strays: islands apart from all others with little of the site's surface and few of its
 * points; but if a fifth of the surface would be that, the site is one of islands. A root that
 * cannot be read leaves the corners of the box. out      rend_outline_fini() errors   MOSPT_ENOMEM
 */
bool rend_outline_make(const mospt_dataset *dataset, rend_outline *out, mospt_err *err);
void rend_outline_fini(rend_outline *outline);

/* Bounds of a dataset without the few points that lie far away from all others, from the counts of
 * its nodes alone. */
void rend_outline_bounds(const mospt_dataset *dataset, double low[3], double high[3]);
