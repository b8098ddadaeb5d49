/* preprocess/implied.h - attributes that need no bytes of their own: all points have the same, or
 * it is their colour.
 *
 * A scan without classification says 0 ten million times, and most scanners' 16-bit colours are 8
 * bits twice. Such a thing is written once, into metadata.json; what is read from the dataset has
 * it again. It is guessed from some points of each scan, so that not even the builder has to carry
 * it, and holds if no point differs. */
#pragma once
#include "mospt/schema.h"

/* Attributes in which some point is not as its schema says: bit k is attribute k. */
typedef struct {
    uint64_t in_value;    /* from the constant */
    uint64_t from_colour; /* from its colour */
} prep_differing;

/* Says that attributes are constant, as far as they can be: each as the first point has it.
 * planes   [schema->count], of points with these attributes, at least one */
void prep_implied_begin(mospt_schema *schema, const uint8_t *const *planes);

/* Looks at an attribute that is said to be constant or the colour.
 * index    of the attribute
 * plane    [count] values
 * rgbi     [count][4]
 * differs  what is found is added; what is there is not looked for again */
void prep_implied_look(const mospt_attribute *attribute, uint32_t index, const uint8_t *plane,
                       const uint8_t *rgbi, uint32_t count, prep_differing *differs);

/* True if what the schema says holds. */
bool prep_implied_holds(const mospt_schema *schema, const prep_differing *differs);

/* Makes it say what holds. */
void prep_implied_correct(mospt_schema *schema, const prep_differing *differs);
