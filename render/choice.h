/* render/choice.h - what colours can show, of any dataset and of a given one. */
#pragma once
#include "mospt/dataset.h"
#include "render/options.h"

/* One way of colouring that a dataset offers. */
typedef struct {
    rend_colour colour;
    char attribute[MOSPT_ATTRIBUTE_NAME_MAX]; /* of REND_COLOUR_ATTRIBUTE */
} rend_choice;

enum { REND_CHOICES_MAX = REND_COLOUR_COUNT + MOSPT_ATTRIBUTES_MAX };

/* "rgb" ..., as on the command line; NULL for REND_COLOUR_ATTRIBUTE. */
const char *rend_choice_name(rend_colour colour);

/* Reads such a name, or takes it for that of an attribute. */
void rend_choice_read(const char *name, rend_look *look);

/* Index of the attribute that a colouring shows, -1 if it is not there or shows none. */
int rend_choice_attribute(const mospt_schema *schema, rend_colour colour);

/* True if there is something to show. colour: not REND_COLOUR_ATTRIBUTE */
bool rend_choice_is_offered(const mospt_metadata *metadata, rend_colour colour);

/* All that a dataset offers: the named ones first, then every attribute that none of them shows.
 * out      [REND_CHOICES_MAX]; returns how many */
uint32_t rend_choice_list(const mospt_metadata *metadata, rend_choice *out);

/* The name of one, whichever kind it is; borrowed from it. */
const char *rend_choice_text(const rend_choice *choice);

/* Has a look show it, with its usual range and map. */
void rend_choice_use(const rend_choice *choice, rend_look *look);

/* Has a look show what a keyframe names, as rend_choice_read(). A range and a map are for the
 * colours that they were given with: others have their usual ones.
 * given    the look that the window or the recording started with */
void rend_choice_recall(const char *name, const rend_look *given, rend_look *look);

/* What a look's colours show, by its name; borrowed from the look, or there for good. */
const char *rend_choice_shown(const rend_look *look);

/* True if the colours of two looks show the same, whatever their ranges and maps. */
bool rend_choice_same(const rend_look *a, const rend_look *b);

/* Changes a look to the next one of a list (step 1) or the one before (step -1). */
void rend_choice_step(const rend_choice *choices, uint32_t count, int step, rend_look *look);

/* The colour map that a look uses for values: its own, or the usual one. */
rend_map rend_choice_map(const rend_look *look);
