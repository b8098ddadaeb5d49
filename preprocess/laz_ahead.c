#include "preprocess/laz_ahead.h"

#include <pthread.h>
#include <stdlib.h>

/* The bytes belong to the thread that fills them while the slot is not ready, and to the reader
 * while it is. */
typedef struct {
    uint8_t *bytes; /* [capacity], owned */
    size_t capacity;
    /* Under the lock: */
    bool is_ready, is_last; /* holds a part; the last one of its chunk */
    bool has_failed;
    prep_laz_part part;
    mospt_err err;
} slot;

struct prep_laz_ahead {
    prep_input *input;
    prep_laz_format format;
    const prep_laz_table *table;
    uint32_t thread_count, slot_count;
    pthread_t *threads; /* [thread_count] */
    slot *slots;        /* [slot_count] */
    bool holds_part;    /* the reader looks at the part in its slot */

    pthread_mutex_t lock;
    pthread_cond_t work, ready; /* for the threads, for the reader */
    /* Under the lock: */
    uint32_t taken; /* chunks that threads have begun with */
    uint32_t read;  /* chunks that the reader has done with */
    bool stop;
};

static slot *slot_of(prep_laz_ahead *a, uint32_t place)
{
    return &a->slots[place % a->slot_count];
}

static bool make_room(slot *s, size_t size, mospt_err *err)
{
    if (s->capacity >= size) return true;
    free(s->bytes);
    s->bytes = malloc(size);
    s->capacity = s->bytes != NULL ? size : 0;
    return s->bytes != NULL || mospt_err_nomem(err, size);
}

/* Hands a part to the reader, and waits until the slot is free again unless that was the last one.
 * returns  false if there is nothing more to do for this chunk */
static bool hand_over(prep_laz_ahead *a, slot *s, prep_laz_part part, bool is_last,
                      const mospt_err *failure)
{
    pthread_mutex_lock(&a->lock);
    s->part = part;
    s->is_last = is_last;
    s->has_failed = failure != NULL;
    if (failure != NULL) s->err = *failure;
    s->is_ready = true;
    pthread_cond_signal(&a->ready);
    while (!is_last && s->is_ready && !a->stop)
        pthread_cond_wait(&a->work, &a->lock);
    bool goes_on = !is_last && !a->stop;
    pthread_mutex_unlock(&a->lock);
    return goes_on;
}

static void decode_place(prep_laz_ahead *a, prep_laz_chunk *chunk, uint32_t place)
{
    const prep_laz_place *p = &a->table->places[place];
    slot *s = slot_of(a, place);
    size_t length = a->format.record_length, most = PREP_LAZ_PART_SIZE / length;
    if (p->points < most) most = (size_t)p->points;
    mospt_err err = {0};
    bool ok = make_room(s, most * length, &err) &&
              prep_laz_chunk_begin(chunk, a->input, p->offset, p->size, p->points, false, &err);
    uint64_t done = 0;
    bool goes_on = true;
    while (goes_on) {
        size_t got = 0;
        prep_laz_part part = {.records = s->bytes, .place = place};
        ok = ok && prep_laz_chunk_read(chunk, s->bytes, most, &got, &err);
        done += got;
        bool is_last = !ok || got < most || done == p->points;
        part.count = got;
        if (is_last && ok) part.damage = prep_laz_chunk_damage(chunk, &part.damage_byte);
        goes_on = hand_over(a, s, part, is_last, ok ? NULL : &err);
    }
}

/* Takes the next chunk, once its slot is free. */
static bool take_place(prep_laz_ahead *a, uint32_t *place)
{
    pthread_mutex_lock(&a->lock);
    while (!a->stop && a->taken < a->table->count && a->taken - a->read >= a->slot_count)
        pthread_cond_wait(&a->work, &a->lock);
    bool ok = !a->stop && a->taken < a->table->count;
    if (ok) *place = a->taken++;
    pthread_mutex_unlock(&a->lock);
    return ok;
}

static void *work(void *argument)
{
    prep_laz_ahead *a = argument;
    prep_laz_chunk *chunk = NULL;
    mospt_err err;
    uint32_t place;
    bool ok = prep_laz_chunk_create(&a->format, &chunk, &err);
    while (take_place(a, &place)) {
        if (ok) decode_place(a, chunk, place);
        else hand_over(a, slot_of(a, place), (prep_laz_part){.place = place}, true, &err);
    }
    prep_laz_chunk_destroy(chunk);
    return NULL;
}

bool prep_laz_ahead_create(prep_input *input, const prep_laz_format *format,
                           const prep_laz_table *table, uint32_t thread_count, prep_laz_ahead **out,
                           mospt_err *err)
{
    prep_laz_ahead *a = calloc(1, sizeof *a);
    if (a == NULL) return mospt_err_nomem(err, sizeof *a);
    if (thread_count > table->count) thread_count = table->count;
    a->input = input;
    a->format = *format;
    a->table = table;
    a->slot_count = thread_count + 1;
    a->threads = calloc(thread_count, sizeof *a->threads);
    a->slots = calloc(a->slot_count, sizeof *a->slots);
    pthread_mutex_init(&a->lock, NULL);
    pthread_cond_init(&a->work, NULL);
    pthread_cond_init(&a->ready, NULL);
    if (a->threads == NULL || a->slots == NULL) {
        prep_laz_ahead_destroy(a);
        return mospt_err_nomem(err, a->slot_count * sizeof(slot));
    }
    /* Fewer threads than asked for are no reason to fail. */
    while (a->thread_count < thread_count &&
           pthread_create(&a->threads[a->thread_count], NULL, work, a) == 0)
        a->thread_count++;
    if (a->thread_count == 0) {
        prep_laz_ahead_destroy(a);
        a = NULL;
    }
    *out = a;
    return true;
}

void prep_laz_ahead_destroy(prep_laz_ahead *a)
{
    if (a == NULL) return;
    pthread_mutex_lock(&a->lock);
    a->stop = true;
    pthread_cond_broadcast(&a->work);
    pthread_mutex_unlock(&a->lock);
    for (uint32_t i = 0; i < a->thread_count; i++)
        pthread_join(a->threads[i], NULL);
    pthread_mutex_destroy(&a->lock);
    pthread_cond_destroy(&a->work);
    pthread_cond_destroy(&a->ready);
    for (uint32_t i = 0; a->slots != NULL && i < a->slot_count; i++)
        free(a->slots[i].bytes);
    free(a->slots);
    free(a->threads);
    free(a);
}

/* Gives the part that was looked at back to its thread, or its slot to the next chunk. Under the
 * lock. */
static void release_part(prep_laz_ahead *a)
{
    slot *s = slot_of(a, a->read);
    s->is_ready = false;
    a->read += s->is_last;
    a->holds_part = false;
    pthread_cond_broadcast(&a->work);
}

bool prep_laz_ahead_next(prep_laz_ahead *a, prep_laz_part *out, mospt_err *err)
{
    bool ok = true;
    *out = (prep_laz_part){0};
    pthread_mutex_lock(&a->lock);
    do {
        if (a->holds_part) release_part(a);
        if (a->read == a->table->count) break;
        slot *s = slot_of(a, a->read);
        while (!s->is_ready)
            pthread_cond_wait(&a->ready, &a->lock);
        a->holds_part = true;
        *out = s->part;
        ok = !s->has_failed;
        if (!ok && err != NULL) *err = s->err;
    } while (ok && out->count == 0 && out->damage == NULL);
    pthread_mutex_unlock(&a->lock);
    return ok;
}
