/* preprocess/implied.h - attributes that need no bytes of their own: all points have the same, or
 * it is their colour.
 *
 * A scan without classification says 0 ten million times, and most scanners' 16-bit colours are 8
 * bits twice. Such a thing is written once, into metadata.json; what is read from the dataset has
 * it again. */
#pragma once
#include "mospt/schema.h"

/* What the points that were looked at have in common; begins as {0}. */
typedef struct {
    bool has_points;
    uint64_t varies;     /* bit k: attribute k is not the same in all of them */
    uint64_t off_colour; /* bit k: attribute k is not the colour of each */
    uint8_t value[MOSPT_ATTRIBUTES_MAX][MOSPT_CONSTANT_SIZE_MAX]; /* of all, or of one of them */
} prep_implied;

/* Looks at more points.
 * records  [count][mospt_record_size()] */
void prep_implied_look(prep_implied *implied, const mospt_schema *schema, const uint8_t *records,
                       uint32_t count);

/* Takes in what others have in common. */
void prep_implied_add(prep_implied *implied, const mospt_schema *schema, const prep_implied *more);

/* Says how the attributes of those points are kept. */
void prep_implied_apply(const prep_implied *implied, mospt_schema *schema);
