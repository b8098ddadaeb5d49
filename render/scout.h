/* render/scout.h - reading ahead along a path that is known.
 *
 * A thread selects for the frames to come, as the frame in hand will be selected for when its turn
 * comes, and has the system read what appears in them from the disk into its page cache. It stays a
 * fixed number of frames ahead, and knows nothing of caches or pictures: without it a recording is
 * the same, only slower where the disk is. */
#pragma once
#include "render/curve.h"
#include "render/take.h"

typedef struct rend_scout rend_scout;

/* All borrowed until rend_scout_destroy().
 * first, end   frames; frame n is at n * seconds_per_frame
 * errors       MOSPT_ENOMEM, MOSPT_EIO: no thread could be started */
bool rend_scout_start(const mospt_dataset *dataset, const rend_take *take, const rend_curve *curve,
                      double seconds_per_frame, uint64_t first, uint64_t end, rend_scout **out,
                      mospt_err *err);
void rend_scout_destroy(rend_scout *scout);

/* Tells how far the recording is. */
void rend_scout_reached(rend_scout *scout, uint64_t frame);
