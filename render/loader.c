#include "render/loader.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum { THREADS_MAX = 16, BEHIND_DRAWING = 5 /* nice */ };

typedef struct finished {
    rend_loaded loaded;
    uint64_t size;       /* of the vertices */
    uint64_t bytes_read; /* with attributes */
    struct finished *next;
} finished;

struct rend_loader {
    const mospt_dataset *dataset;
    uint64_t waiting_limit;
    rend_loader_wake *wake;
    void *user;
    pthread_t threads[THREADS_MAX];
    uint32_t thread_count;
    double waited_s; /* the owner's */

    /* Guarded by `lock`: all that follows. A node is in at most one of `wanted`, being read, and
     * the finished list: `busy` says of the last two with which paint, by its number from 1, or 0.
     * A thread touches a node's vertices only between beginning to read it and appending the
     * result. */
    pthread_mutex_t lock;
    pthread_cond_t work; /* there may be something to read, or room to put it, or `quit` */
    pthread_cond_t done; /* something was finished */
    uint32_t *wanted;    /* [wanted_count], owned; next_wanted is the most urgent one left */
    uint32_t wanted_count, wanted_capacity, next_wanted;
    uint32_t *busy; /* [node count], owned */
    /* Nodes taken since the last request: still busy, or a list made before they were would have
     * them read again. */
    uint32_t *taken; /* [node count], owned */
    uint32_t taken_count;
    rend_paint paint;
    uint32_t paint_number;
    uint32_t reading;
    finished *first, **last;
    uint32_t finished_count;
    uint64_t waiting_bytes; /* finished, or being read */
    uint64_t bytes;
    bool quit;
};

/* The most urgent node that nobody reads yet; false if there is none, or no room for it. */
static bool begin(rend_loader *l, uint32_t *node)
{
    while (l->next_wanted < l->wanted_count &&
           l->busy[l->wanted[l->next_wanted]] == l->paint_number)
        l->next_wanted++;
    if (l->next_wanted == l->wanted_count) return false;
    uint64_t size = mospt_dataset_vertices_size(l->dataset, l->wanted[l->next_wanted]);
    if (l->waiting_bytes > 0 && l->waiting_bytes + size > l->waiting_limit) return false;
    *node = l->wanted[l->next_wanted++];
    l->busy[*node] = l->paint_number;
    l->reading++;
    l->waiting_bytes += size;
    return true;
}

/* Reads what the paint asks for. */
static bool read_painted(const mospt_dataset *dataset, const rend_paint *paint, uint32_t node,
                         finished *f, mospt_err *err)
{
    uint8_t *planes = NULL;
    f->bytes_read = f->size;
    bool ok = mospt_dataset_read_vertices(dataset, node, f->loaded.vertices, err);
    if (ok && rend_paint_needs_attributes(paint)) {
        size_t size = dataset->hierarchy.nodes[node].count * dataset->metadata.schema.row_size;
        planes = malloc(size + 1);
        ok = planes != NULL
                 ? mospt_dataset_read_attributes(dataset, node, f->loaded.vertices, planes, err)
                 : mospt_err_nomem(err, size);
        f->bytes_read += mospt_dataset_planes_size(dataset, node);
    }
    if (ok) rend_paint_apply(paint, node, planes, f->loaded.vertices);
    free(planes);
    return ok;
}

static finished *read_node(const mospt_dataset *dataset, const rend_paint *paint, uint32_t node)
{
    finished *f = calloc(1, sizeof *f);
    if (f == NULL) return NULL;
    f->size = mospt_dataset_vertices_size(dataset, node);
    f->loaded.node = node;
    f->loaded.vertices = malloc(f->size > 0 ? f->size : 1);
    if (f->loaded.vertices == NULL) {
        mospt_err_nomem(&f->loaded.err, f->size);
    } else if (!read_painted(dataset, paint, node, f, &f->loaded.err)) {
        free(f->loaded.vertices);
        f->loaded.vertices = NULL;
    }
    return f;
}

static void discard(rend_loader *l, finished *f)
{
    l->waiting_bytes -= f->size;
    free(f->loaded.vertices);
    free(f);
}

/* Without memory even for the result, or painted as nobody wants it any more, the node is as if
 * nobody had asked; the next frame asks again. */
static void finish(rend_loader *l, uint32_t node, uint32_t paint_number, finished *f)
{
    bool forgotten = f == NULL || paint_number != l->paint_number;
    l->reading--;
    if (forgotten && l->busy[node] == paint_number) l->busy[node] = 0;
    if (f == NULL) {
        l->waiting_bytes -= mospt_dataset_vertices_size(l->dataset, node);
    } else if (forgotten) {
        discard(l, f);
    } else {
        if (f->loaded.vertices != NULL) l->bytes += f->bytes_read;
        *l->last = f, l->last = &f->next;
        l->finished_count++;
    }
    pthread_cond_broadcast(&l->done);
}

/* Where there are no processors to spare, drawing comes first. */
static void give_way(void)
{
    setpriority(PRIO_PROCESS, (id_t)syscall(SYS_gettid), BEHIND_DRAWING);
}

static void *work(void *argument)
{
    rend_loader *l = argument;
    give_way();
    pthread_mutex_lock(&l->lock);
    while (!l->quit) {
        uint32_t node;
        if (!begin(l, &node)) {
            pthread_cond_wait(&l->work, &l->lock);
            continue;
        }
        rend_paint paint = l->paint;
        uint32_t paint_number = l->paint_number;
        pthread_mutex_unlock(&l->lock);
        finished *f = read_node(l->dataset, &paint, node);
        pthread_mutex_lock(&l->lock);
        finish(l, node, paint_number, f);
        pthread_mutex_unlock(&l->lock);
        if (l->wake != NULL) l->wake(l->user);
        pthread_mutex_lock(&l->lock);
    }
    pthread_mutex_unlock(&l->lock);
    return NULL;
}

bool rend_loader_create(const mospt_dataset *dataset, uint32_t thread_count, uint64_t waiting_bytes,
                        rend_loader_wake *wake, void *user, rend_loader **out, mospt_err *err)
{
    rend_loader *l = calloc(1, sizeof *l);
    if (l == NULL) return mospt_err_nomem(err, sizeof *l);
    l->dataset = dataset, l->waiting_limit = waiting_bytes, l->wake = wake, l->user = user;
    l->last = &l->first;
    l->paint = (rend_paint){.source = REND_PAINT_STORED, .attribute = -1}, l->paint_number = 1;
    pthread_mutex_init(&l->lock, NULL);
    pthread_cond_init(&l->work, NULL);
    pthread_cond_init(&l->done, NULL);
    l->busy = calloc((size_t)dataset->hierarchy.count + 1, sizeof *l->busy);
    l->taken = calloc((size_t)dataset->hierarchy.count + 1, sizeof *l->taken);
    bool ok =
        (l->busy != NULL && l->taken != NULL) || mospt_err_nomem(err, dataset->hierarchy.count);
    if (thread_count > THREADS_MAX) thread_count = THREADS_MAX;
    while (ok && l->thread_count < thread_count) {
        ok = pthread_create(&l->threads[l->thread_count], NULL, work, l) == 0;
        if (ok) l->thread_count++;
        else if (l->thread_count > 0) ok = true, thread_count = l->thread_count; /* fewer will do */
        else
            mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                          "no thread could be started to load points");
    }
    if (!ok) {
        rend_loader_destroy(l);
        return false;
    }
    *out = l;
    return true;
}

void rend_loader_destroy(rend_loader *loader)
{
    if (loader == NULL) return;
    pthread_mutex_lock(&loader->lock);
    loader->quit = true;
    pthread_cond_broadcast(&loader->work);
    pthread_mutex_unlock(&loader->lock);
    for (uint32_t i = 0; i < loader->thread_count; i++)
        pthread_join(loader->threads[i], NULL);
    while (loader->first != NULL) {
        finished *f = loader->first;
        loader->first = f->next;
        free(f->loaded.vertices);
        free(f);
    }
    pthread_cond_destroy(&loader->done);
    pthread_cond_destroy(&loader->work);
    pthread_mutex_destroy(&loader->lock);
    free(loader->wanted);
    free(loader->busy);
    free(loader->taken);
    free(loader);
}

bool rend_loader_request(rend_loader *loader, const uint32_t *nodes, uint32_t count, mospt_err *err)
{
    bool ok = true;
    pthread_mutex_lock(&loader->lock);
    if (count > loader->wanted_capacity) {
        uint32_t *larger = realloc(loader->wanted, count * sizeof *larger);
        ok = larger != NULL || mospt_err_nomem(err, count * sizeof *larger);
        if (ok) loader->wanted = larger, loader->wanted_capacity = count;
    }
    if (ok) {
        while (loader->taken_count > 0)
            loader->busy[loader->taken[--loader->taken_count]] = 0;
        if (count > 0) memcpy(loader->wanted, nodes, count * sizeof *nodes);
        loader->wanted_count = count, loader->next_wanted = 0;
        pthread_cond_broadcast(&loader->work);
    }
    pthread_mutex_unlock(&loader->lock);
    return ok;
}

void rend_loader_set_paint(rend_loader *loader, const rend_paint *paint)
{
    pthread_mutex_lock(&loader->lock);
    loader->paint = *paint;
    loader->paint_number++;
    loader->wanted_count = loader->next_wanted = 0;
    while (loader->first != NULL) {
        finished *f = loader->first;
        loader->first = f->next;
        loader->busy[f->loaded.node] = 0;
        discard(loader, f);
    }
    loader->last = &loader->first;
    loader->finished_count = 0;
    pthread_cond_broadcast(&loader->work);
    pthread_mutex_unlock(&loader->lock);
}

uint32_t rend_loader_take(rend_loader *loader, rend_loaded *out, uint32_t max)
{
    uint32_t count = 0;
    pthread_mutex_lock(&loader->lock);
    while (count < max && loader->first != NULL) {
        finished *f = loader->first;
        loader->first = f->next;
        if (loader->first == NULL) loader->last = &loader->first;
        loader->finished_count--;
        loader->waiting_bytes -= f->size;
        loader->taken[loader->taken_count++] = f->loaded.node;
        out[count++] = f->loaded;
        free(f);
    }
    if (count > 0) pthread_cond_broadcast(&loader->work);
    pthread_mutex_unlock(&loader->lock);
    return count;
}

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

bool rend_loader_wait(rend_loader *loader)
{
    double start = now_s();
    pthread_mutex_lock(&loader->lock);
    while (loader->first == NULL &&
           (loader->reading > 0 || loader->next_wanted < loader->wanted_count))
        pthread_cond_wait(&loader->done, &loader->lock);
    bool any = loader->first != NULL;
    pthread_mutex_unlock(&loader->lock);
    loader->waited_s += now_s() - start;
    return any;
}

double rend_loader_waited_s(const rend_loader *loader)
{
    return loader->waited_s;
}

uint32_t rend_loader_pending(rend_loader *loader)
{
    pthread_mutex_lock(&loader->lock);
    uint32_t pending =
        loader->wanted_count - loader->next_wanted + loader->reading + loader->finished_count;
    pthread_mutex_unlock(&loader->lock);
    return pending;
}

uint64_t rend_loader_bytes(rend_loader *loader)
{
    pthread_mutex_lock(&loader->lock);
    uint64_t bytes = loader->bytes;
    pthread_mutex_unlock(&loader->lock);
    return bytes;
}
