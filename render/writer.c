#include "render/writer.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { SLOTS = 8 }; /* encoders work in bursts */

struct rend_writer {
    rend_reel *reel;
    pthread_t thread;
    bool started, joined;
    struct {
        void *picture; /* owned */
        char note[REND_NOTE_SIZE];
    } slots[SLOTS];
    double busy_s; /* the thread's */

    /* Guarded by `lock`. Slot `taken % SLOTS` is the thread's, up to `put % SLOTS`; the others are
     * the owner's. */
    pthread_mutex_t lock;
    pthread_cond_t changed;
    uint64_t put, taken;
    bool quit, failed;
    mospt_err err;
};

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void *write_all(void *user)
{
    rend_writer *w = user;
    mospt_err err = {0};
    pthread_mutex_lock(&w->lock);
    while (!w->failed) {
        while (w->taken == w->put && !w->quit)
            pthread_cond_wait(&w->changed, &w->lock);
        if (w->taken == w->put) break;
        uint64_t slot = w->taken % SLOTS;
        pthread_mutex_unlock(&w->lock);
        double start = now_s();
        bool ok = rend_reel_add(w->reel, w->slots[slot].picture, w->slots[slot].note, &err);
        w->busy_s += now_s() - start;
        pthread_mutex_lock(&w->lock);
        w->taken++;
        if (!ok) w->failed = true, w->err = err;
        pthread_cond_broadcast(&w->changed);
    }
    pthread_mutex_unlock(&w->lock);
    return NULL;
}

bool rend_writer_start(rend_reel *reel, size_t picture_size, rend_writer **out, mospt_err *err)
{
    rend_writer *w = calloc(1, sizeof *w);
    if (w == NULL) return mospt_err_nomem(err, sizeof *w);
    w->reel = reel;
    pthread_mutex_init(&w->lock, NULL);
    pthread_cond_init(&w->changed, NULL);
    bool ok = true;
    for (int i = 0; ok && i < SLOTS; i++)
        ok = (w->slots[i].picture = malloc(picture_size)) != NULL ||
             mospt_err_nomem(err, picture_size);
    if (ok) {
        w->started = pthread_create(&w->thread, NULL, write_all, w) == 0;
        ok = w->started ||
             mospt_err_set(err, MOSPT_EIO, mospt_nowhere(), "no thread could be started");
    }
    if (!ok) rend_writer_destroy(w);
    else *out = w;
    return ok;
}

void *rend_writer_slot(rend_writer *writer)
{
    pthread_mutex_lock(&writer->lock);
    while (writer->put - writer->taken == SLOTS && !writer->failed)
        pthread_cond_wait(&writer->changed, &writer->lock);
    void *picture = writer->failed ? NULL : writer->slots[writer->put % SLOTS].picture;
    pthread_mutex_unlock(&writer->lock);
    return picture;
}

void rend_writer_put(rend_writer *writer, const char *note)
{
    char *to = writer->slots[writer->put % SLOTS].note;
    strncpy(to, note, REND_NOTE_SIZE - 1);
    pthread_mutex_lock(&writer->lock);
    writer->put++;
    pthread_cond_broadcast(&writer->changed);
    pthread_mutex_unlock(&writer->lock);
}

bool rend_writer_finish(rend_writer *writer, mospt_err *err)
{
    pthread_mutex_lock(&writer->lock);
    writer->quit = true;
    pthread_cond_broadcast(&writer->changed);
    pthread_mutex_unlock(&writer->lock);
    pthread_join(writer->thread, NULL);
    writer->joined = true;
    if (writer->failed && err != NULL) *err = writer->err;
    return !writer->failed;
}

void rend_writer_destroy(rend_writer *writer)
{
    if (writer == NULL) return;
    if (writer->started && !writer->joined) rend_writer_finish(writer, NULL);
    for (int i = 0; i < SLOTS; i++)
        free(writer->slots[i].picture);
    pthread_cond_destroy(&writer->changed);
    pthread_mutex_destroy(&writer->lock);
    free(writer);
}

double rend_writer_busy_s(const rend_writer *writer)
{
    return writer->busy_s;
}
