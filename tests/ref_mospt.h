/* tests/ref_mospt.h - the slow, obvious twin of mospt/linear.c: an octree of pointers.
 *
 * Word for word Wimmer & Scheiblauer 2006, section 4.6: points are inserted one by one, leaves are
 * split, and when all are there, each inner node takes over the point of the child whose colour is
 * nearest to the average of its children. */
#pragma once
#include "mospt/linear.h"

typedef struct ref_mospt ref_mospt;

/* bits   log2 of the width of the node, steps */
ref_mospt *ref_mospt_create(uint32_t depth, uint32_t bits, size_t stride);
void ref_mospt_destroy(ref_mospt *m);

/* record   borrowed, starts with a vertex
 * reject   leaf strategy at the deepest level; false: add
 * returns  false if the record was rejected */
bool ref_mospt_insert(ref_mospt *m, const uint8_t *record, bool reject);

uint32_t ref_mospt_count(const ref_mospt *m);

/* Chooses the representatives and sorts by level.
 * order      out, [count]
 * level_end  out, [depth + 2] */
void ref_mospt_finish(ref_mospt *m, const uint8_t **order, uint32_t *level_end);
