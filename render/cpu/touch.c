#include "render/cpu/touch.h"

#include "render/cpu/memory.h"

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

/* Ahead of what is filled, and at a time. */
enum { AHEAD_SIZE = 16 << 20, PIECE_SIZE = 2 << 20, BEHIND_ALL = 19 /* nice */ };

struct rcpu_touch {
    uint8_t *memory; /* [size] */
    size_t size;
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t change;
    /* Under the lock: */
    size_t filled, touched; /* bytes from the beginning */
    bool quit;
};

static void *work(void *argument)
{
    rcpu_touch *t = argument;
    setpriority(PRIO_PROCESS, (id_t)syscall(SYS_gettid), BEHIND_ALL);
    pthread_mutex_lock(&t->lock);
    while (!t->quit && t->touched < t->size) {
        if (t->touched < t->filled) t->touched = t->filled;
        if (t->touched >= t->filled + AHEAD_SIZE) {
            pthread_cond_wait(&t->change, &t->lock);
            continue;
        }
        size_t left = t->size - t->touched, size = left < PIECE_SIZE ? left : PIECE_SIZE;
        uint8_t *piece = t->memory + t->touched;
        t->touched += size;
        pthread_mutex_unlock(&t->lock);
        rcpu_memory_touch(piece, size);
        pthread_mutex_lock(&t->lock);
    }
    pthread_mutex_unlock(&t->lock);
    return NULL;
}

rcpu_touch *rcpu_touch_create(void *memory, size_t size)
{
    rcpu_touch *t = calloc(1, sizeof *t);
    if (t == NULL) return NULL;
    t->memory = memory, t->size = size;
    pthread_mutex_init(&t->lock, NULL);
    pthread_cond_init(&t->change, NULL);
    if (pthread_create(&t->thread, NULL, work, t) == 0) return t;
    pthread_cond_destroy(&t->change);
    pthread_mutex_destroy(&t->lock);
    free(t);
    return NULL;
}

void rcpu_touch_destroy(rcpu_touch *t)
{
    if (t == NULL) return;
    pthread_mutex_lock(&t->lock);
    t->quit = true;
    pthread_cond_signal(&t->change);
    pthread_mutex_unlock(&t->lock);
    pthread_join(t->thread, NULL);
    pthread_cond_destroy(&t->change);
    pthread_mutex_destroy(&t->lock);
    free(t);
}

void rcpu_touch_filled(rcpu_touch *t, size_t filled)
{
    if (t == NULL) return;
    pthread_mutex_lock(&t->lock);
    if (filled > t->filled) {
        t->filled = filled;
        pthread_cond_signal(&t->change);
    }
    pthread_mutex_unlock(&t->lock);
}
