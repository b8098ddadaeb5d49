/* render/cpu/memory.h - large arrays, in large pages where the system has them: a frame is touched
 * at random places, and thousands of small pages would be looked up for each. */
#pragma once
#include <stddef.h>

/* Zeroed; NULL without memory. */
void *rcpu_memory_take(size_t size);
void rcpu_memory_release(void *memory, size_t size);

/* Has the system give all pages of a part now, where it can; what is in them stays. */
void rcpu_memory_touch(void *memory, size_t size);
