/* preprocess/arena.h - a fixed amount of memory, taken in pieces and given back.
 *
 * Pieces come from the lowest gap that is wide enough, so pages that were touched once are used
 * again and the process never holds more than the arena. */
#pragma once
#include "mospt/err.h"

typedef struct prep_arena prep_arena;

/* size     bytes; 0 is an arena from which nothing can be taken */
bool prep_arena_create(size_t size, prep_arena **out, mospt_err *err);
void prep_arena_destroy(prep_arena *arena);

/* Takes `size` bytes, aligned for any type, holding anything; NULL if no gap is that wide. threads:
 * any */
void *prep_arena_take(prep_arena *arena, size_t size);

/* Gives the pages back to the system; nothing of the arena is taken now. */
void prep_arena_clear(prep_arena *arena);

/* Gives a piece back; NULL is fine. threads: any */
void prep_arena_give(prep_arena *arena, void *piece);
