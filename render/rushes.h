/* render/rushes.h - the frames that have been drawn since the last whole segment of a film, as they
 * are, so that a recording that is killed goes on at the frame it had reached.
 *
 * A file of frames of one size, each followed by the hash of its bytes; what is behind the first
 * frame that is not whole does not count.
 * threads  one at a time */
#pragma once
#include "mospt/err.h"

typedef struct rend_rushes rend_rushes;

/* Opens the file, or makes it, and counts the whole frames in it; the rest is cut off.
 * frame_size   bytes */
bool rend_rushes_open(const char *path, size_t frame_size, rend_rushes **out, mospt_err *err);
void rend_rushes_close(rend_rushes *rushes);

uint32_t rend_rushes_count(const rend_rushes *rushes);
bool rend_rushes_read(const rend_rushes *rushes, uint32_t index, void *frame, mospt_err *err);
bool rend_rushes_add(rend_rushes *rushes, const void *frame, mospt_err *err);
