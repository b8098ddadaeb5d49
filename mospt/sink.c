#include "mospt/sink.h"

#include "mospt/file.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* What disks and file systems ask of direct writing; chunks that wait for the thread. */
enum { ALIGNMENT = 4096, WAITING_MAX = 32 };

typedef struct chunk {
    struct chunk *next;
    uint32_t file;
    uint64_t index;  /* chunk_size times that is where it begins in the file */
    size_t filled;   /* bytes that are there, which may have gaps between them */
    size_t end;      /* of the last of them */
    uint32_t copies; /* threads that are filling it */
    bool is_dirty;   /* something is not yet in the file */
    bool is_full;    /* it only waits for being written */
    bool is_wanted;  /* by somebody who flushes */
    bool in_write;   /* a thread is writing it, and nobody fills it */
    uint8_t *bytes;  /* [chunk_size], owned */
} chunk;

typedef struct {
    char *path;      /* owned */
    int plain, past; /* the file; the same past the page cache, -1: not possible */
    uint64_t kept;   /* bytes that were there before */
} file;

struct mospt_sink {
    size_t chunk_size;
    pthread_t thread;
    bool has_thread;

    pthread_mutex_t lock;
    pthread_cond_t change;
    /* Under the lock: */
    file files[MOSPT_SINK_FILES_MAX];
    uint32_t file_count;
    chunk *chunks; /* owned, oldest first */
    chunk *spare;  /* owned, without meaning */
    uint32_t waiting;
    bool stop;
    mospt_err err; /* of the first failure */
};

static bool report(const mospt_sink *s, mospt_err *err)
{
    if (s->err.code == MOSPT_OK) return true;
    if (err != NULL) *err = s->err;
    return false;
}

/* Writes past the page cache, or, where that is refused, as usual. */
static bool write_bytes(const file *f, uint64_t offset, const uint8_t *bytes, size_t size,
                        mospt_err *err)
{
    size_t done = 0;
    while (f->past >= 0 && done < size) {
        ssize_t n = pwrite(f->past, bytes + done, size - done, (off_t)(offset + done));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0 || n % ALIGNMENT != 0) break;
        done += (size_t)n;
    }
    return done == size ||
           mospt_file_write_at(f->plain, f->path, offset + done, bytes + done, size - done, err);
}

/* Under the lock, without it while writing. */
static void write_chunk(mospt_sink *s, chunk *c)
{
    mospt_err err = {0};
    file f = s->files[c->file];
    size_t size = (c->end + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    c->in_write = true;
    c->is_dirty = false;
    pthread_mutex_unlock(&s->lock);
    bool ok = write_bytes(&f, c->index * s->chunk_size, c->bytes, size, &err);
    pthread_mutex_lock(&s->lock);
    c->in_write = false;
    if (!ok && s->err.code == MOSPT_OK) s->err = err;
}

/* Under the lock: a chunk that nobody fills any more. */
static void retire(mospt_sink *s, chunk *c)
{
    chunk **at = &s->chunks;
    while (*at != c)
        at = &(*at)->next;
    *at = c->next;
    c->next = s->spare;
    s->spare = c;
    s->waiting--;
}

static chunk *next_full(const mospt_sink *s)
{
    for (chunk *c = s->chunks; c != NULL; c = c->next)
        if (c->is_full && !c->in_write) return c;
    return NULL;
}

static void *write_full(void *argument)
{
    mospt_sink *s = argument;
    pthread_mutex_lock(&s->lock);
    for (;;) {
        chunk *c = next_full(s);
        if (c == NULL && s->stop) break;
        if (c == NULL) {
            pthread_cond_wait(&s->change, &s->lock);
            continue;
        }
        if (s->err.code == MOSPT_OK) write_chunk(s, c);
        retire(s, c);
        pthread_cond_broadcast(&s->change);
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

bool mospt_sink_create(size_t chunk_size, mospt_sink **out, mospt_err *err)
{
    mospt_sink *s = calloc(1, sizeof *s);
    if (s == NULL) return mospt_err_nomem(err, sizeof *s);
    s->chunk_size = chunk_size;
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->change, NULL);
    s->has_thread = pthread_create(&s->thread, NULL, write_full, s) == 0;
    if (!s->has_thread) {
        mospt_sink_destroy(s);
        return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(), "no thread can be started");
    }
    *out = s;
    return true;
}

bool mospt_sink_add_file(mospt_sink *s, const char *path, uint64_t size, mospt_err *err)
{
    file f = {
        .path = strdup(path), .plain = open(path, O_RDWR | O_CLOEXEC), .past = -1, .kept = size};
#ifdef O_DIRECT
    f.past = open(path, O_WRONLY | O_DIRECT | O_CLOEXEC);
#endif
    bool ok = f.path != NULL && f.plain >= 0;
    if (!ok) mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be opened for writing");
    pthread_mutex_lock(&s->lock);
    s->files[s->file_count++] = f;
    pthread_mutex_unlock(&s->lock);
    return ok;
}

/* Under the lock: memory for a chunk; NULL if there is none. */
static chunk *make_chunk(mospt_sink *s)
{
    chunk *c = s->spare;
    if (c != NULL) {
        s->spare = c->next;
        uint8_t *bytes = c->bytes;
        *c = (chunk){.bytes = bytes};
        return c;
    }
    c = calloc(1, sizeof *c);
    if (c != NULL) c->bytes = aligned_alloc(ALIGNMENT, s->chunk_size);
    if (c != NULL && c->bytes != NULL) {
        memset(c->bytes, 0, s->chunk_size);
        return c;
    }
    free(c);
    return NULL;
}

/* Under the lock. */
static chunk *find_chunk(mospt_sink *s, uint32_t number, uint64_t index, mospt_err *err)
{
    const file *f = &s->files[number];
    uint64_t begin = index * s->chunk_size;
    chunk **at = &s->chunks;
    for (; *at != NULL; at = &(*at)->next)
        if ((*at)->file == number && (*at)->index == index) return *at;
    chunk *c = make_chunk(s);
    if (c == NULL) return mospt_err_nomem(err, s->chunk_size), NULL;
    c->file = number;
    c->index = index;
    if (f->kept > begin) {
        c->filled = c->end = (size_t)(f->kept - begin);
        if (!mospt_file_read_at(f->plain, f->path, begin, c->bytes, c->end, err)) {
            c->next = s->spare;
            s->spare = c;
            return NULL;
        }
    }
    return *at = c;
}

/* Under the lock, without it while copying: as much as goes into one chunk. Returns how much; 0
 * after a failure. */
static size_t write_some(mospt_sink *s, uint32_t number, uint64_t offset, const void *bytes,
                         size_t size, mospt_err *err)
{
    while (s->waiting >= WAITING_MAX && s->err.code == MOSPT_OK)
        pthread_cond_wait(&s->change, &s->lock);
    chunk *c = NULL;
    while (report(s, err) && (c = find_chunk(s, number, offset / s->chunk_size, err)) != NULL &&
           c->in_write)
        pthread_cond_wait(&s->change, &s->lock);
    if (c == NULL || s->err.code != MOSPT_OK) return 0;
    size_t at = (size_t)(offset % s->chunk_size), room = s->chunk_size - at;
    size_t n = size < room ? size : room;
    c->copies++;
    pthread_mutex_unlock(&s->lock);
    memcpy(c->bytes + at, bytes, n);
    pthread_mutex_lock(&s->lock);
    c->copies--;
    c->filled += n;
    if (c->end < at + n) c->end = at + n;
    c->is_dirty = true;
    c->is_full = c->filled == s->chunk_size;
    s->waiting += c->is_full;
    if (c->is_full || c->is_wanted) pthread_cond_broadcast(&s->change);
    return n;
}

bool mospt_sink_write(mospt_sink *s, uint32_t number, uint64_t offset, const void *bytes,
                      size_t size, mospt_err *err)
{
    const uint8_t *from = bytes;
    size_t n = 1;
    pthread_mutex_lock(&s->lock);
    uint64_t kept = s->files[number].kept, skip = kept > offset ? kept - offset : 0;
    if (skip > size) skip = size;
    from += skip, offset += skip, size -= (size_t)skip;
    for (; size > 0 && n > 0; from += n, offset += n, size -= n)
        n = write_some(s, number, offset, from, size, err);
    pthread_mutex_unlock(&s->lock);
    return size == 0;
}

/* Under the lock: does one step of a flush. Returns false when there is none left. */
static bool flush_some(mospt_sink *s)
{
    bool waits = false;
    if (s->err.code != MOSPT_OK) return false;
    for (chunk *c = s->chunks; c != NULL; c = c->next) {
        if (!c->is_wanted) continue;
        waits = true;
        if (c->is_full || c->in_write || c->copies > 0) continue;
        if (c->is_dirty) write_chunk(s, c);
        c->is_wanted = false;
        pthread_cond_broadcast(&s->change);
        return true;
    }
    if (waits) pthread_cond_wait(&s->change, &s->lock);
    return waits;
}

bool mospt_sink_flush(mospt_sink *s, mospt_err *err)
{
    pthread_mutex_lock(&s->lock);
    for (chunk *c = s->chunks; c != NULL; c = c->next)
        c->is_wanted = true;
    while (flush_some(s))
        ;
    bool ok = report(s, err);
    pthread_mutex_unlock(&s->lock);
    return ok;
}

static void free_chunks(chunk *c)
{
    while (c != NULL) {
        chunk *next = c->next;
        free(c->bytes);
        free(c);
        c = next;
    }
}

void mospt_sink_destroy(mospt_sink *s)
{
    if (s == NULL) return;
    pthread_mutex_lock(&s->lock);
    s->stop = true;
    pthread_cond_broadcast(&s->change);
    pthread_mutex_unlock(&s->lock);
    if (s->has_thread) pthread_join(s->thread, NULL);
    for (uint32_t i = 0; i < s->file_count; i++) {
        if (s->files[i].plain >= 0) close(s->files[i].plain);
        if (s->files[i].past >= 0) close(s->files[i].past);
        free(s->files[i].path);
    }
    free_chunks(s->chunks), free_chunks(s->spare);
    pthread_cond_destroy(&s->change);
    pthread_mutex_destroy(&s->lock);
    free(s);
}
