/* render/scheme.h - from what the user wants to see to a paint, and the legend that explains it.
 *
 * Ranges come from a sample: the points of the coarsest nodes, whole levels of the outer octree,
 * which are spread evenly over the site. So they are the same for the same dataset, whatever is in
 * the caches. The sample is read once, when a range is first needed.
 * threads  one */
#pragma once
#include "render/choice.h"
#include "render/legend.h"
#include "render/paint.h"

/* True if `look` can be shown; reads nothing.
 * errors   MOSPT_EINVAL: a sentence that names what there is instead */
bool rend_scheme_fits(const mospt_dataset *dataset, const rend_look *look, mospt_err *err);

/* True if both looks paint alike. */
bool rend_scheme_same(const rend_look *a, const rend_look *b);

typedef struct rend_scheme rend_scheme;

rend_scheme *rend_scheme_create(const mospt_dataset *dataset); /* borrowed; NULL without memory */
void rend_scheme_destroy(rend_scheme *scheme);

/* errors   MOSPT_EINVAL as rend_scheme_fits(), MOSPT_ENOMEM */
bool rend_scheme_make(rend_scheme *scheme, const rend_look *look, rend_paint *paint,
                      rend_legend *legend, mospt_err *err);
