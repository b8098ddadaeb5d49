/* render/cpu/touch.h - memory that is touched before it is needed.
 *
 * The system clears memory when it is first written to, which can take several milliseconds for a
 * huge page: too long in the middle of a frame. A thread that gives way to all others does that a
 * little ahead of what is filled. */
#pragma once
#include <stddef.h>

typedef struct rcpu_touch rcpu_touch;

/* memory   [size] bytes that nobody has touched, to be filled from its beginning; released only
 *          after rcpu_touch_destroy()
 * returns  NULL without memory or a thread: then it is as slow as it was */
rcpu_touch *rcpu_touch_create(void *memory, size_t size);
void rcpu_touch_destroy(rcpu_touch *touch); /* NULL is nothing */

/* Says how far it is filled by now, bytes. */
void rcpu_touch_filled(rcpu_touch *touch, size_t filled); /* NULL is nothing */
