/* render/store.h - the vertices of one dataset: which of them are in main memory, which on the GPU.
 *
 * Wimmer & Scheiblauer 2006, section 5.3: a node is read by the loader's threads into the cache in
 * main memory, and uploaded from there to the one in graphics memory. When nodes are to be painted
 * otherwise, what is on the GPU stays there, stale, to be drawn until it has been replaced.
 * threads  the one that has the context */
#pragma once
#include "mospt/dataset.h"
#include "render/figures.h"
#include "render/gl/rgl.h"
#include "render/loader.h"
#include "render/options.h"
#include "render/pages.h"

/* 16 KiB: half a page is lost per node, 5 % of one that holds ten thousand points. */
enum { REND_PAGE_POINTS = 1024 };

typedef struct rend_store rend_store;

/* dataset  borrowed
 * gl       borrowed
 * limits   cache sizes; smaller than the largest node, they are raised to that. Where the graphics
 *          memory has less room, now or later, the GPU cache is halved until it fits
 * wake     from a loader thread, when something has been read; NULL: nobody needs to know
 * errors   MOSPT_ENOMEM, MOSPT_EIO */
bool rend_store_create(const mospt_dataset *dataset, rgl *gl, const rend_limits *limits,
                       rend_loader_wake *wake, void *user, rend_store **out, mospt_err *err);
void rend_store_destroy(rend_store *store);

/* Goes on with another generation of the dataset; what is the same in both stays where it is.
 * dataset  borrowed; the one before may be closed afterwards
 * errors   MOSPT_ENOMEM, MOSPT_EIO: the store is good for nothing but rend_store_destroy() */
bool rend_store_swap(rend_store *store, const mospt_dataset *dataset, mospt_err *err);

/* Nodes are painted so from now on. same: and look as they did */
void rend_store_paint(rend_store *store, const rend_paint *paint, bool same);

/* [node count] of rend_residency: on the GPU, or not. Valid until rend_store_swap(). */
const uint8_t *rend_store_residency(const rend_store *store);
bool rend_store_is_resident(const rend_store *store, uint32_t node);
bool rend_store_is_stale(const rend_store *store, uint32_t node); /* resident, painted otherwise */

/* In pages, what a node takes on the GPU, and what is there for all of them. */
uint32_t rend_store_pages_of(const rend_store *store, uint32_t node);
uint32_t rend_store_page_count(const rend_store *store);

/* ---- on the GPU ---- */

/* Where a node is that is resident; it becomes the most recently used one. */
const rend_place *rend_store_place(rend_store *store, uint32_t node);

/* A resident node is not evicted until all are unpinned. */
bool rend_store_pin(rend_store *store, uint32_t node, mospt_err *err);
void rend_store_unpin_all(rend_store *store);

/* Puts a node on the GPU and pins it, or puts new colours over its old ones, where it is. Together
 * with all that are pinned it must fit.
 * vertices [count of the node]
 * errors   MOSPT_ENOMEM: rend_store_halve() may help */
bool rend_store_put(rend_store *store, uint32_t node, const mospt_vertex *vertices, mospt_err *err);
bool rend_store_replace(rend_store *store, uint32_t node, const mospt_vertex *vertices,
                        mospt_err *err);

void rend_store_drop(rend_store *store, uint32_t node); /* pinned or not, if it is there */

/* After an upload that failed: true if half of the GPU cache, empty, is left to try. False without
 * an error if it was not for want of graphics memory, or if nothing can be halved. */
bool rend_store_halve(rend_store *store, mospt_err *err);

/* After a reset of the graphics driver: true if it was got over, with an empty GPU cache. False
 * without an error if there have been too many. */
bool rend_store_recover(rend_store *store, mospt_err *err);

/* ---- in main memory ---- */

/* The vertices of a node, which becomes the most recently used one; NULL: they are not there. */
const mospt_vertex *rend_store_vertices(rend_store *store, uint32_t node);
bool rend_store_has_vertices(const rend_store *store, uint32_t node);
uint64_t rend_store_memory(const rend_store *store); /* bytes, at most */

/* Takes over what has been read so far. */
void rend_store_take_loaded(rend_store *store);

/* A list of what to read, most urgent first; each node once. Nothing is read before it is asked
 * for, which withdraws what was asked for before and nobody has begun to read. */
void rend_store_want_nothing(rend_store *store);
void rend_store_want(rend_store *store, uint32_t node);
uint32_t rend_store_wanted(const rend_store *store); /* length of the list */
bool rend_store_ask(rend_store *store, mospt_err *err);

/* Asks for the list, and waits until all of it that can be read is on the GPU, and pinned. */
bool rend_store_bring(rend_store *store, mospt_err *err);

/* Writes the figures of the caches, and no other. */
void rend_store_figures(rend_store *store, rend_figures *out);
