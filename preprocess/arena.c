#include "preprocess/arena.h"

#include "preprocess/pages.h"

#include <assert.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

enum { ALIGNMENT = 64 };

typedef struct {
    size_t begin, end; /* bytes from the start of the arena */
} piece;

struct prep_arena {
    uint8_t *memory; /* [size], of prep_pages_take() */
    size_t size;

    pthread_mutex_t lock;
    /* Under the lock: */
    piece *pieces; /* [count], owned: what is taken, in rising order */
    uint32_t count, capacity;
};

bool prep_arena_create(size_t size, prep_arena **out, mospt_err *err)
{
    prep_arena *a = calloc(1, sizeof *a);
    if (a == NULL) return mospt_err_nomem(err, sizeof *a);
    a->size = size;
    if (size > 0) {
        a->memory = prep_pages_take(size);
        if (a->memory == NULL) {
            free(a);
            return mospt_err_nomem(err, size);
        }
    }
    pthread_mutex_init(&a->lock, NULL);
    *out = a;
    return true;
}

void prep_arena_destroy(prep_arena *a)
{
    if (a == NULL) return;
    prep_pages_give(a->memory, a->size);
    pthread_mutex_destroy(&a->lock);
    free(a->pieces);
    free(a);
}

static bool reserve(prep_arena *a)
{
    if (a->count < a->capacity) return true;
    uint32_t capacity = a->capacity > 0 ? 2 * a->capacity : 64;
    piece *pieces = realloc(a->pieces, capacity * sizeof *pieces);
    if (pieces == NULL) return false;
    a->pieces = pieces;
    a->capacity = capacity;
    return true;
}

/* The first gap of `size` bytes: the piece goes before pieces[*index]. */
static bool find_gap(const prep_arena *a, size_t size, uint32_t *index, size_t *begin)
{
    size_t free_from = 0;
    for (uint32_t i = 0; i <= a->count; i++) {
        size_t free_to = i < a->count ? a->pieces[i].begin : a->size;
        if (free_to - free_from >= size) {
            *index = i;
            *begin = free_from;
            return true;
        }
        free_from = i < a->count ? a->pieces[i].end : a->size;
    }
    return false;
}

void prep_arena_clear(prep_arena *arena)
{
    assert(arena->count == 0);
    if (arena->memory != NULL) madvise(arena->memory, arena->size, MADV_DONTNEED);
}

void *prep_arena_take(prep_arena *a, size_t size)
{
    void *memory = NULL;
    uint32_t at;
    size_t begin;
    size = (size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    if (size == 0) size = ALIGNMENT;
    pthread_mutex_lock(&a->lock);
    if (size <= a->size && reserve(a) && find_gap(a, size, &at, &begin)) {
        memmove(a->pieces + at + 1, a->pieces + at, (a->count - at) * sizeof *a->pieces);
        a->pieces[at] = (piece){.begin = begin, .end = begin + size};
        a->count++;
        memory = a->memory + begin;
    }
    pthread_mutex_unlock(&a->lock);
    return memory;
}

void prep_arena_give(prep_arena *a, void *memory)
{
    if (memory == NULL) return;
    size_t begin = (size_t)((uint8_t *)memory - a->memory);
    pthread_mutex_lock(&a->lock);
    for (uint32_t i = 0; i < a->count; i++) {
        if (a->pieces[i].begin != begin) continue;
        memmove(a->pieces + i, a->pieces + i + 1, (a->count - i - 1) * sizeof *a->pieces);
        a->count--;
        break;
    }
    pthread_mutex_unlock(&a->lock);
}
