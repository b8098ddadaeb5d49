#include "render/store.h"

#include "render/cache.h"
#include "render/match.h"
#include "render/select.h"

#include <assert.h>
#include <stdlib.h>

enum { LOADER_THREADS = 2, TAKE_MAX = 32 };
enum { RESETS_MAX = 50 }; /* a driver that is reset so often will be again */
#define WAITING_BYTES_MAX (128 * REND_MIB)

struct rend_store {
    const mospt_dataset *dataset;
    rgl *gl;
    rend_loader *loader;
    rend_limits limits; /* as they were asked for */
    rend_loader_wake *wake;
    void *user;
    rend_cache *ram; /* values: owned vertices */
    rend_cache *gpu; /* values: owned rend_place; sizes: whole pages */
    rend_pages *pages;
    uint32_t page_count;
    bool gpu_is_full;      /* an upload has failed for want of graphics memory */
    uint8_t *residency;    /* [node count] on the GPU, owned */
    uint32_t paint_number; /* from 1; 0: nothing was painted yet */
    uint32_t *gpu_paint;   /* [node count], owned: number of the paint of what is on the GPU */
    uint32_t *pinned;      /* [pinned_count] nodes, owned */
    uint32_t pinned_count, pinned_capacity;
    uint32_t *wanted; /* [wanted_count], room for [node count], owned: what to ask the loader for */
    uint32_t wanted_count;
    rend_figures figures;   /* those of the caches */
    uint64_t loaded_before; /* by loaders of generations before */
    double waited_before_s;
};

static void evict_vertices(void *user, uint32_t node, void *value)
{
    (void)user, (void)node;
    free(value);
}

static void evict_place(void *user, uint32_t node, void *value)
{
    rend_store *s = user;
    rend_pages_release(s->pages, value);
    free(value);
    s->residency[node] = REND_ABSENT;
}

/* ---- how large ---- */

static uint32_t pages_in(const mospt_dataset *dataset, uint32_t node)
{
    return (uint32_t)(((uint64_t)dataset->hierarchy.nodes[node].count + REND_PAGE_POINTS - 1) /
                      REND_PAGE_POINTS);
}

uint32_t rend_store_pages_of(const rend_store *store, uint32_t node)
{
    return pages_in(store->dataset, node);
}

uint32_t rend_store_page_count(const rend_store *store)
{
    return store->page_count;
}

static uint64_t or_default(uint64_t value, uint64_t otherwise)
{
    return value > 0 ? value : otherwise;
}

/* Pages of the largest node. */
static uint32_t fewest_pages(const mospt_dataset *dataset)
{
    uint32_t largest = 1;
    for (uint32_t n = 0; n < dataset->hierarchy.count; n++)
        if (pages_in(dataset, n) > largest) largest = pages_in(dataset, n);
    return largest;
}

/* As many pages as the limit allows, as the dataset needs, and as the largest node needs at least.
 * What is still being built will have more points, and half of a page more for each node. */
static uint32_t count_pages(const rend_store *s)
{
    const mospt_unfinished *u = &s->dataset->metadata.unfinished;
    uint64_t limit = or_default(s->limits.gpu_cache_bytes, REND_GPU_CACHE_DEFAULT) /
                     (REND_PAGE_POINTS * sizeof(mospt_vertex));
    uint64_t all = u->commit > 0 ? u->points / REND_PAGE_POINTS * 5 / 4 : 0, now = 0;
    uint32_t fewest = fewest_pages(s->dataset);
    for (uint32_t n = 0; n < s->dataset->hierarchy.count; n++)
        now += rend_store_pages_of(s, n);
    if (now > all) all = now;
    if (limit > INT32_MAX / REND_PAGE_POINTS) limit = INT32_MAX / REND_PAGE_POINTS;
    uint64_t count = all < limit ? all : limit;
    return count > fewest ? (uint32_t)count : fewest;
}

static uint64_t ram_limit(const rend_store *s, const mospt_dataset *dataset)
{
    uint64_t ram = or_default(s->limits.ram_cache_bytes, REND_RAM_CACHE_DEFAULT);
    uint64_t largest = (uint64_t)fewest_pages(dataset) * REND_PAGE_POINTS * sizeof(mospt_vertex);
    return ram > largest ? ram : largest;
}

static uint64_t gpu_limit(const rend_store *s)
{
    return (uint64_t)s->page_count * REND_PAGE_POINTS * sizeof(mospt_vertex);
}

/* ---- making the caches ---- */

/* An arena of so many pages, or of half as many, and so on, as the graphics memory has room for. */
static bool make_arena(rend_store *s, uint32_t page_count, mospt_err *err)
{
    uint32_t fewest = fewest_pages(s->dataset);
    mospt_err why = {0};
    s->page_count = page_count;
    while (!rgl_arena_create(s->gl, (uint64_t)s->page_count * REND_PAGE_POINTS, &why)) {
        if (why.code != MOSPT_ENOMEM || s->page_count == fewest) {
            if (err != NULL) *err = why;
            return false;
        }
        s->page_count = s->page_count / 2 > fewest ? s->page_count / 2 : fewest;
        s->figures.gpu_halved++;
    }
    return true;
}

/* Makes the GPU cache, or makes it anew, with nothing in it. */
static bool make_gpu(rend_store *s, uint32_t page_count, mospt_err *err)
{
    rend_cache_destroy(s->gpu);
    rend_pages_destroy(s->pages);
    s->gpu = NULL, s->pages = NULL;
    if (!make_arena(s, page_count, err)) return false;
    s->pages = rend_pages_create(s->page_count);
    s->gpu = rend_cache_create(s->dataset->hierarchy.count, gpu_limit(s), evict_place, s);
    return (s->pages != NULL && s->gpu != NULL) || mospt_err_nomem(err, s->page_count);
}

static bool make_loader(rend_store *s, mospt_err *err)
{
    uint64_t ram = ram_limit(s, s->dataset),
             waiting = ram < WAITING_BYTES_MAX ? ram : WAITING_BYTES_MAX;
    rend_loader_destroy(s->loader);
    s->loader = NULL;
    return rend_loader_create(s->dataset, LOADER_THREADS, waiting, s->wake, s->user, &s->loader,
                              err);
}

static bool make_caches(rend_store *s, mospt_err *err)
{
    uint32_t nodes = s->dataset->hierarchy.count;
    s->residency = calloc((size_t)nodes + 1, 1);
    s->wanted = calloc((size_t)nodes + 1, sizeof *s->wanted);
    s->gpu_paint = calloc((size_t)nodes + 1, sizeof *s->gpu_paint);
    s->ram = rend_cache_create(nodes, ram_limit(s, s->dataset), evict_vertices, s);
    if (s->residency == NULL || s->wanted == NULL || s->gpu_paint == NULL || s->ram == NULL)
        return mospt_err_nomem(err, (size_t)nodes * 64);
    return make_gpu(s, count_pages(s), err) && make_loader(s, err);
}

bool rend_store_create(const mospt_dataset *dataset, rgl *gl, const rend_limits *limits,
                       rend_loader_wake *wake, void *user, rend_store **out, mospt_err *err)
{
    rend_store *s = calloc(1, sizeof *s);
    if (s == NULL) return mospt_err_nomem(err, sizeof *s);
    s->dataset = dataset, s->gl = gl, s->limits = *limits, s->wake = wake, s->user = user;
    if (!make_caches(s, err)) {
        rend_store_destroy(s);
        return false;
    }
    *out = s;
    return true;
}

void rend_store_destroy(rend_store *store)
{
    if (store == NULL) return;
    rend_loader_destroy(store->loader);
    rend_cache_destroy(store->ram);
    rend_cache_destroy(store->gpu);
    rend_pages_destroy(store->pages);
    free(store->gpu_paint);
    free(store->residency);
    free(store->wanted);
    free(store->pinned);
    free(store);
}

/* ---- what is where ---- */

const uint8_t *rend_store_residency(const rend_store *store)
{
    return store->residency;
}

bool rend_store_is_resident(const rend_store *store, uint32_t node)
{
    return store->residency[node] == REND_RESIDENT;
}

bool rend_store_is_stale(const rend_store *store, uint32_t node)
{
    return store->residency[node] == REND_RESIDENT && store->gpu_paint[node] != store->paint_number;
}

const rend_place *rend_store_place(rend_store *store, uint32_t node)
{
    return rend_cache_use(store->gpu, node);
}

const mospt_vertex *rend_store_vertices(rend_store *store, uint32_t node)
{
    return rend_cache_use(store->ram, node);
}

bool rend_store_has_vertices(const rend_store *store, uint32_t node)
{
    return rend_cache_has(store->ram, node);
}

uint64_t rend_store_memory(const rend_store *store)
{
    return rend_cache_limit(store->ram);
}

void rend_store_figures(rend_store *store, rend_figures *out)
{
    rend_store *s = store;
    out->ram_used = rend_cache_used(s->ram), out->ram_limit = rend_cache_limit(s->ram);
    out->gpu_used = rend_cache_used(s->gpu), out->gpu_limit = rend_cache_limit(s->gpu);
    out->gpu_halved = s->figures.gpu_halved, out->resets = s->figures.resets;
    out->loaded_bytes = s->loaded_before + rend_loader_bytes(s->loader);
    out->uploaded_bytes = s->figures.uploaded_bytes;
    out->waited_s = s->waited_before_s + rend_loader_waited_s(s->loader);
    out->damaged_nodes = s->figures.damaged_nodes;
    out->damaged_points = s->figures.damaged_points;
    out->damage = s->figures.damage;
}

/* ---- to the GPU ---- */

static bool upload_runs(rend_store *s, uint32_t node, const rend_place *place,
                        const mospt_vertex *vertices, mospt_err *err)
{
    uint32_t count = s->dataset->hierarchy.nodes[node].count, done = 0;
    for (uint32_t r = 0; r < place->run_count; r++) {
        uint32_t part = place->runs[r].count * REND_PAGE_POINTS;
        if (part > count - done) part = count - done;
        mospt_err why = {0};
        if (!rgl_arena_upload(s->gl, (uint64_t)place->runs[r].first * REND_PAGE_POINTS,
                              vertices + done, part, &why)) {
            s->gpu_is_full = why.code == MOSPT_ENOMEM;
            if (err != NULL) *err = why;
            return false;
        }
        done += part;
    }
    s->figures.uploaded_bytes += count * sizeof *vertices;
    return true;
}

static bool upload(rend_store *s, uint32_t node, const mospt_vertex *vertices, mospt_err *err)
{
    uint32_t pages = rend_store_pages_of(s, node);
    uint64_t size = (uint64_t)pages * REND_PAGE_POINTS * sizeof *vertices;
    bool fits = rend_cache_reserve(s->gpu, size);
    assert(fits); /* the caller asks for no more than that */
    rend_place *place = fits ? calloc(1, sizeof *place) : NULL;
    if (place == NULL) return mospt_err_nomem(err, sizeof *place);
    if (!rend_pages_take(s->pages, pages, place, err)) return free(place), false;
    if (!upload_runs(s, node, place, vertices, err)) {
        rend_pages_release(s->pages, place);
        return free(place), false;
    }
    bool put = rend_cache_put(s->gpu, node, size, place);
    assert(put);
    (void)put;
    s->residency[node] = REND_RESIDENT;
    s->gpu_paint[node] = s->paint_number;
    return true;
}

bool rend_store_pin(rend_store *store, uint32_t node, mospt_err *err)
{
    rend_store *s = store;
    if (s->pinned_count == s->pinned_capacity) {
        uint32_t capacity = s->pinned_capacity > 0 ? 2 * s->pinned_capacity : 1024;
        uint32_t *larger = realloc(s->pinned, capacity * sizeof *larger);
        if (larger == NULL) return mospt_err_nomem(err, capacity * sizeof *larger);
        s->pinned = larger, s->pinned_capacity = capacity;
    }
    rend_cache_use(s->gpu, node);
    rend_cache_pin(s->gpu, node);
    s->pinned[s->pinned_count++] = node;
    return true;
}

void rend_store_unpin_all(rend_store *store)
{
    while (store->pinned_count > 0)
        rend_cache_unpin(store->gpu, store->pinned[--store->pinned_count]);
}

bool rend_store_put(rend_store *store, uint32_t node, const mospt_vertex *vertices, mospt_err *err)
{
    return upload(store, node, vertices, err) && rend_store_pin(store, node, err);
}

bool rend_store_replace(rend_store *store, uint32_t node, const mospt_vertex *vertices,
                        mospt_err *err)
{
    if (!upload_runs(store, node, rend_cache_use(store->gpu, node), vertices, err)) return false;
    store->gpu_paint[node] = store->paint_number;
    return true;
}

void rend_store_drop(rend_store *store, uint32_t node)
{
    rend_cache_drop(store->gpu, node);
}

bool rend_store_halve(rend_store *store, mospt_err *err)
{
    rend_store *s = store;
    uint32_t fewest = fewest_pages(s->dataset);
    uint32_t half = s->page_count / 2 > fewest ? s->page_count / 2 : fewest;
    if (!s->gpu_is_full || half == s->page_count) return false;
    s->gpu_is_full = false;
    s->figures.gpu_halved++;
    rend_store_unpin_all(s);
    return make_gpu(s, half, err);
}

bool rend_store_recover(rend_store *store, mospt_err *err)
{
    if (store->figures.resets == RESETS_MAX) return false;
    store->figures.resets++;
    rend_store_unpin_all(store);
    return rgl_recover(store->gl, err) && make_gpu(store, store->page_count, err);
}

/* ---- from the loader ---- */

/* A node that cannot be read is remembered, and named once. Too little memory is no damage: it may
 * be there later. */
static void note_damage(rend_store *s, const rend_loaded *loaded)
{
    if (loaded->err.code == MOSPT_ENOMEM || s->residency[loaded->node] == REND_DAMAGED) return;
    rend_cache_drop(s->gpu, loaded->node); /* it may be there in other colours */
    s->residency[loaded->node] = REND_DAMAGED;
    s->figures.damaged_points += s->dataset->hierarchy.nodes[loaded->node].count;
    if (s->figures.damaged_nodes++ == 0) s->figures.damage = loaded->err;
}

/* Takes over what the loader has read. What the RAM cache refuses is dropped: its pins are none, so
 * that never happens to a node that fits, and every node fits. */
static void keep(rend_store *s, const rend_loaded *loaded)
{
    if (loaded->vertices == NULL) {
        note_damage(s, loaded);
        return;
    }
    uint64_t size = mospt_dataset_vertices_size(s->dataset, loaded->node);
    if (rend_cache_has(s->ram, loaded->node) ||
        !rend_cache_put(s->ram, loaded->node, size, loaded->vertices))
        free(loaded->vertices);
}

void rend_store_take_loaded(rend_store *store)
{
    rend_loaded loaded[TAKE_MAX];
    for (uint32_t count; (count = rend_loader_take(store->loader, loaded, TAKE_MAX)) > 0;)
        for (uint32_t i = 0; i < count; i++)
            keep(store, &loaded[i]);
}

void rend_store_want_nothing(rend_store *store)
{
    store->wanted_count = 0;
}

void rend_store_want(rend_store *store, uint32_t node)
{
    assert(store->wanted_count < store->dataset->hierarchy.count);
    store->wanted[store->wanted_count++] = node;
}

uint32_t rend_store_wanted(const rend_store *store)
{
    return store->wanted_count;
}

bool rend_store_ask(rend_store *store, mospt_err *err)
{
    return rend_loader_request(store->loader, store->wanted, store->wanted_count, err);
}

/* Uploads what has been read, if it is wanted, before it goes to the RAM cache: a small one would
 * evict it at once. */
static bool receive(rend_store *s, const rend_loaded *loaded, bool wanted, mospt_err *err)
{
    if (loaded->vertices == NULL && loaded->err.code == MOSPT_ENOMEM) {
        if (err != NULL) *err = loaded->err;
        return false;
    }
    bool ok = !wanted || loaded->vertices == NULL || rend_store_is_resident(s, loaded->node) ||
              rend_store_put(s, loaded->node, loaded->vertices, err);
    keep(s, loaded);
    return ok;
}

bool rend_store_bring(rend_store *store, mospt_err *err)
{
    rend_store *s = store;
    if (!rend_store_ask(s, err)) return false;
    while (s->wanted_count > 0) {
        rend_loaded loaded;
        if (!rend_loader_wait(s->loader)) return mospt_err_nomem(err, 0);
        if (rend_loader_take(s->loader, &loaded, 1) == 0) continue;
        /* Something asked for by an earlier frame is welcome, but not waited for. */
        uint32_t i = 0;
        while (i < s->wanted_count && s->wanted[i] != loaded.node)
            i++;
        bool wanted = i < s->wanted_count;
        if (wanted) s->wanted[i] = s->wanted[--s->wanted_count];
        if (!receive(s, &loaded, wanted, err)) return false;
    }
    return true;
}

/* ---- other colours ---- */

/* What was damaged to the old paint, which may have read more, may be fine to the new one. */
static void forget_damage(rend_store *s)
{
    for (uint32_t n = 0; n < s->dataset->hierarchy.count; n++)
        if (s->residency[n] == REND_DAMAGED) s->residency[n] = REND_ABSENT;
    s->figures.damaged_nodes = 0, s->figures.damaged_points = 0;
    s->figures.damage = (mospt_err){0};
}

void rend_store_paint(rend_store *store, const rend_paint *paint, bool same)
{
    rend_loader_set_paint(store->loader, paint);
    if (same) return;
    store->paint_number++;
    rend_cache_clear(store->ram);
    forget_damage(store);
}

/* ---- another dataset ---- */

/* Arrays by node, and what was on the GPU, under their new numbers. */
static bool renumber(rend_store *s, const uint32_t *to, const mospt_dataset *dataset,
                     mospt_err *err)
{
    uint32_t before = s->dataset->hierarchy.count, nodes = dataset->hierarchy.count;
    uint8_t *residency = calloc((size_t)nodes + 1, 1);
    uint32_t *gpu_paint = calloc((size_t)nodes + 1, sizeof *gpu_paint);
    uint32_t *wanted = calloc((size_t)nodes + 1, sizeof *wanted);
    bool ok = (residency != NULL && gpu_paint != NULL && wanted != NULL) ||
              mospt_err_nomem(err, (size_t)nodes * 9);
    ok = ok && rend_cache_renumber(s->ram, to, nodes, ram_limit(s, dataset), err) &&
         rend_cache_renumber(s->gpu, to, nodes, rend_cache_limit(s->gpu), err);
    if (!ok) {
        free(residency), free(gpu_paint), free(wanted);
        return false;
    }
    for (uint32_t n = 0; n < before; n++) {
        if (to[n] == MOSPT_NO_NODE || s->residency[n] != REND_RESIDENT) continue;
        residency[to[n]] = REND_RESIDENT;
        gpu_paint[to[n]] = s->gpu_paint[n];
    }
    free(s->residency), free(s->gpu_paint), free(s->wanted);
    s->residency = residency, s->gpu_paint = gpu_paint, s->wanted = wanted;
    s->wanted_count = 0;
    s->dataset = dataset;
    return true;
}

bool rend_store_swap(rend_store *store, const mospt_dataset *dataset, mospt_err *err)
{
    rend_store *s = store;
    uint32_t *to = calloc((size_t)s->dataset->hierarchy.count + 1, sizeof *to);
    if (to == NULL) return mospt_err_nomem(err, (size_t)s->dataset->hierarchy.count * sizeof *to);
    rend_store_unpin_all(s);
    s->loaded_before += rend_loader_bytes(s->loader);
    s->waited_before_s += rend_loader_waited_s(s->loader);
    rend_loader_destroy(s->loader); /* it reads the dataset of before */
    s->loader = NULL;
    rend_match_nodes(s->dataset, dataset, to);
    bool ok = renumber(s, to, dataset, err);
    free(to);
    if (!ok) return false;
    forget_damage(s);
    bool fits = s->page_count >= fewest_pages(s->dataset) &&
                (s->figures.gpu_halved > 0 || s->page_count >= count_pages(s));
    return make_loader(s, err) && (fits || make_gpu(s, count_pages(s), err));
}
