/* render/match.h - which nodes of one generation of a dataset are still there in the next.
 *
 * A build that goes on, or was done again with a scan more, keeps most nodes as they were; what was
 * read of them need not be read again. */
#pragma once
#include "mospt/dataset.h"

/* Pairs nodes of the same cell and the same bytes, if bytes mean the same in both.
 * to       out: [before->hierarchy.count] index in `after`, or MOSPT_NO_NODE */
void rend_match_nodes(const mospt_dataset *before, const mospt_dataset *after, uint32_t *to);
