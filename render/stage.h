/* render/stage.h - one frame: select, fetch, upload, draw.
 *
 * Owns the caches, the loader and the selection of one dataset on one GL context. In a window a
 * frame takes what is resident and asks for the rest (rend_stage_frame); a picture waits for all of
 * it and is the same, byte for byte, however small the caches are (rend_stage_still). Neither knows
 * a clock. When a look asks for other colours, nodes are fetched again to be painted anew; until
 * they arrive, a window shows them as they were.
 * threads  the one that has the context */
#pragma once
#include "render/colours.h"
#include "render/live.h"

typedef struct rend_stage rend_stage;

/* dataset  borrowed
 * gl       borrowed
 * limits   cache sizes; smaller than the largest node, they are raised to that. Where the graphics
 *          memory has less room, now or later, the GPU cache is halved until it fits
 * wake     from a loader thread, when a frame would now show more; NULL: nobody needs to know
 * errors   MOSPT_ENOMEM, MOSPT_EIO */
bool rend_stage_create(const mospt_dataset *dataset, rgl *gl, const rend_limits *limits,
                       rend_loader_wake *wake, void *user, rend_stage **out, mospt_err *err);
void rend_stage_destroy(rend_stage *stage);

/* Goes on with another generation of the dataset; what is the same in both stays where it is.
 * dataset  borrowed; the one before may be closed afterwards
 * errors   MOSPT_ENOMEM, MOSPT_EIO: the stage is good for nothing but rend_stage_destroy() */
bool rend_stage_swap(rend_stage *stage, const mospt_dataset *dataset, mospt_err *err);

/* Both fail with MOSPT_EINVAL for colours that the dataset cannot show, see rend_scheme_fits(). */

/* Draws what is resident and asks for what is not; never waits. A picture that takes several frames
 * is of what was resident at the first of them, and goes on as long as the view is the same, to the
 * last byte of it; until then the one before can stay on the screen.
 *
 * What is hidden is asked of the picture before, which was perhaps another view: what was hidden
 * from there may be missing in one picture, and is in the next one, which is then promised by
 * REND_AGAIN. allowed  NULL: no limits */
bool rend_stage_frame(rend_stage *stage, const rend_view_of *view, const rend_allowance *allowed,
                      rend_progress *progress, mospt_err *err);

/* Says which picture is wanted next: has the loader read what it will probably miss while the one
 * before is being drawn. Figures are those of a guess at it from now on. */
bool rend_stage_expect(rend_stage *stage, const rend_view_of *view, mospt_err *err);

/* Draws all that the budget allows, reading it through the caches in as many parts as they need. */
bool rend_stage_still(rend_stage *stage, const rend_view_of *view, mospt_err *err);

/* After a call to the graphics back end has failed, by whoever reads back what the stage has drawn:
 * true if that was a reset of the driver, which is got over: the picture has to be drawn again. The
 * stage's own calls do that by themselves. */
bool rend_stage_recover(rend_stage *stage, mospt_err *err);

void rend_stage_figures(rend_stage *stage, rend_figures *out);

/* What the colours that were drawn last mean. */
const rend_legend *rend_stage_legend(const rend_stage *stage);

/* The frame that was drawn last: to find out what is under the cursor. */
const rend_frame *rend_stage_last_frame(const rend_stage *stage);

/* What it drew. */
const rend_selection *rend_stage_last_selection(const rend_stage *stage);
