/* preprocess/pages.h - large pieces of fresh memory from the system, in huge pages where it has
 * such: the builder touches each page about once, and entering them one small page at a time takes
 * as long as the work that is done there. */
#pragma once
#include <stddef.h>

/* Takes at least `size` bytes, all zero, aligned for any type; NULL if there are none. They take
 * room only from when they are first touched.
 * threads  any */
void *prep_pages_take(size_t size);

/* Has the system clear what lies in [memory, memory + size) now, if it has not yet, and leaves what
 * is written there.
 * threads  any */
void prep_pages_touch(void *memory, size_t size);

/* Gives them back; NULL is fine. */
void prep_pages_give(void *memory, size_t size);
