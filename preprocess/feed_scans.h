/* preprocess/feed_scans.h - the points of all scans, packed, into the first pass. */
#pragma once
#include "preprocess/pack.h"
#include "preprocess/pass.h"
#include "preprocess/source.h"

typedef enum {
    PREP_FEED_DONE,
    PREP_FEED_OUTSIDE, /* a point was outside the root cube, which header bounds have promised not
                          to happen: start again with measured ones */
    PREP_FEED_DIFFERS, /* points have less in common than those looked at: start again, with a
                          schema that now says what all have */
} prep_feed_outcome;

/* Told after each batch with the points read so far, and whether these go nowhere any more, since
 * points differ. Returns false to stop. */
typedef bool (*prep_feed_report)(void *context, uint64_t points, bool only_looks);

/* Feeds all points to a pass, which is abandoned as soon as points differ; the others are then only
 * looked at.
 * pass     in: as begun; out: NULL if points differ
 * schema   that of env->shape, corrected where points differ
 * of_scan  out, [source->scan_count], added to
 * errors   MOSPT_EIO, MOSPT_ENOMEM, MOSPT_ECANCELLED */
bool prep_feed_scans(const prep_pass_env *env, prep_source *source, mospt_schema *schema,
                     prep_feed_report report, void *context, prep_pass **pass,
                     prep_pack_sums *of_scan, prep_feed_outcome *out, mospt_err *err);
