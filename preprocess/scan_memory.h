/* preprocess/scan_memory.h - what opening one scan taught about its file, kept for the next scan of
 * the same file.
 *
 * A reader has to find its scan in a file of several: by a walk over the whole file (PTX), or by
 * reading all of its XML (E57). Whoever opens scan after scan lends a memory to each, so that this
 * is done once as long as the scans of a file follow one another: a memory holds a single file. */
#pragma once
#include "preprocess/input.h"

typedef struct prep_scan_memory prep_scan_memory; /* opaque; one thread at a time */

/* out      released by prep_scan_memory_destroy(), behind all scans that were opened with it
 * errors   MOSPT_ENOMEM */
bool prep_scan_memory_create(prep_scan_memory **out, mospt_err *err);
void prep_scan_memory_destroy(prep_scan_memory *memory);

/* The rest is for readers. Theirs is what is kept; it is told apart by the function that frees it.
 */
typedef void prep_scan_memory_free(void *index);

/* What is known of the file; borrowed until the next call. NULL: nothing, or the file has changed
 * since, as far as its size and times tell.
 * memory   NULL knows nothing */
const void *prep_scan_memory_recall(const prep_scan_memory *memory, const prep_input *input,
                                    prep_scan_memory_free *free_index);

/* Keeps `index` in place of what was known before. Takes it, and frees it at once where there is no
 * memory. */
void prep_scan_memory_keep(prep_scan_memory *memory, const prep_input *input, void *index,
                           prep_scan_memory_free *free_index);
