/* preprocess/batch.h - a few thousand points on their way from a scan reader to the builder. */
#pragma once
#include "mospt/schema.h"

enum { PREP_BATCH_CAPACITY = 65536 };

typedef struct {
    uint32_t capacity, count;
    double *xyz;   /* [capacity][3], owned, metres, world coordinates */
    uint8_t *rgbi; /* [capacity][4], owned, display colour and intensity; without colour r = g = b =
                      i, without both 255 */
    uint8_t *plane[MOSPT_ATTRIBUTES_MAX];    /* owned, one per attribute of the scan:
                                                [capacity][components] of its type */
    size_t plane_size[MOSPT_ATTRIBUTES_MAX]; /* bytes of one point in that plane */
    uint32_t plane_count;
} prep_batch;

/* Allocates a batch for points with the attributes of `schema`. */
bool prep_batch_init(prep_batch *batch, const mospt_schema *schema, uint32_t capacity,
                     mospt_err *err);
void prep_batch_fini(prep_batch *batch);

/* True if points with these attributes fit the planes of the batch. */
bool prep_batch_suits(const prep_batch *batch, const mospt_schema *schema);

/* Removes the points for which keep[i] is 0, in place; the others keep their order. */
void prep_batch_compact(prep_batch *batch, const uint8_t *keep);
