/* render/loader.h - threads that read vertices and paint them, so that the render thread never
 * waits for a disk.
 *
 * Wimmer & Scheiblauer 2006, section 5.3: out-of-core requests are handled in a separate thread.
 * Each frame hands over all that it misses, most urgent first, and so withdraws what the frame
 * before wanted and nobody has begun to read. What has been read waits until the render thread
 * takes it; when that is more than a limit, reading waits too. */
#pragma once
#include "render/paint.h"

typedef struct rend_loader rend_loader;

typedef struct {
    uint32_t node;
    mospt_vertex *vertices; /* [nodes[node].count], owned by whoever took it, released by free();
                               NULL: see err */
    mospt_err err;          /* why there are no vertices */
} rend_loaded;

/* Called by a loader thread after each node it has finished, without a lock held. */
typedef void rend_loader_wake(void *user);

/* dataset       borrowed until rend_loader_destroy()
 * waiting_bytes of vertices that may wait to be taken; one node may always
 * wake          NULL: nobody needs to know
 * errors        MOSPT_ENOMEM, MOSPT_EIO: no thread could be started */
bool rend_loader_create(const mospt_dataset *dataset, uint32_t thread_count, uint64_t waiting_bytes,
                        rend_loader_wake *wake, void *user, rend_loader **out, mospt_err *err);

/* Waits for what is being read, and drops it. */
void rend_loader_destroy(rend_loader *loader);

/* Replaces the list of what to read. A node that is being read, or waits to be taken, may be named
 * again at no cost.
 * nodes    [count], most urgent first
 * errors   MOSPT_ENOMEM: the old list stays
 * threads  the owner's, like all that follows */
bool rend_loader_request(rend_loader *loader, const uint32_t *nodes, uint32_t count,
                         mospt_err *err);

/* From now on nodes are painted so; before the first call they stay as they are stored. Drops what
 * has been read and not been taken, and what is being read: nothing painted otherwise arrives any
 * more. What was asked for is forgotten.
 * paint    copied */
void rend_loader_set_paint(rend_loader *loader, const rend_paint *paint);

/* Takes what has been read, in the order in which it was finished; returns how many.
 * out      [max] */
uint32_t rend_loader_take(rend_loader *loader, rend_loaded *out, uint32_t max);

/* Waits until there is something to take; false if nothing is being read, or asked for. */
bool rend_loader_wait(rend_loader *loader);

/* Nodes asked for, being read, or waiting to be taken. */
uint32_t rend_loader_pending(rend_loader *loader);

/* Seconds spent in rend_loader_wait() since the start. */
double rend_loader_waited_s(const rend_loader *loader);

/* Bytes of vertices and attributes read since the start. */
uint64_t rend_loader_bytes(rend_loader *loader);
