#include "render/cache.h"

#include <assert.h>
#include <stdlib.h>

/* A ring in order of use: the head is a sentinel, its `next` the most recently used entry. */
typedef struct {
    uint32_t previous, next;
    uint32_t pins;
    bool present;
    uint64_t size;
    void *value;
} entry;

struct rend_cache {
    entry *entries; /* [head + 1], owned */
    uint32_t head;  /* the sentinel, also the number of nodes */
    uint32_t count;
    uint64_t used, limit, pinned;
    rend_cache_evict *evict;
    void *user;
};

rend_cache *rend_cache_create(uint32_t node_count, uint64_t limit, rend_cache_evict *evict,
                              void *user)
{
    rend_cache *c = calloc(1, sizeof *c);
    if (c == NULL) return NULL;
    *c = (rend_cache){.head = node_count, .limit = limit, .evict = evict, .user = user};
    c->entries = calloc((size_t)node_count + 1, sizeof *c->entries);
    if (c->entries == NULL) return free(c), NULL;
    c->entries[node_count].previous = c->entries[node_count].next = node_count;
    return c;
}

static void unlink_entry(rend_cache *c, uint32_t node)
{
    entry *e = &c->entries[node];
    c->entries[e->previous].next = e->next;
    c->entries[e->next].previous = e->previous;
}

static void link_first(rend_cache *c, uint32_t node)
{
    entry *e = &c->entries[node], *head = &c->entries[c->head];
    e->previous = c->head, e->next = head->next;
    c->entries[head->next].previous = node;
    head->next = node;
}

static void evict(rend_cache *c, uint32_t node)
{
    entry *e = &c->entries[node];
    unlink_entry(c, node);
    if (e->pins > 0) c->pinned -= e->size;
    c->used -= e->size;
    c->count--;
    void *value = e->value;
    *e = (entry){0};
    if (c->evict != NULL) c->evict(c->user, node, value);
}

void rend_cache_destroy(rend_cache *cache)
{
    if (cache == NULL) return;
    while (cache->entries[cache->head].previous != cache->head)
        evict(cache, cache->entries[cache->head].previous);
    free(cache->entries);
    free(cache);
}

bool rend_cache_reserve(rend_cache *cache, uint64_t size)
{
    if (size > cache->limit || cache->pinned > cache->limit - size) return false;
    uint32_t node = cache->entries[cache->head].previous;
    while (cache->used > cache->limit - size) {
        uint32_t newer = cache->entries[node].previous;
        if (cache->entries[node].pins == 0) evict(cache, node);
        node = newer;
    }
    return true;
}

bool rend_cache_put(rend_cache *cache, uint32_t node, uint64_t size, void *value)
{
    assert(node < cache->head && !cache->entries[node].present);
    if (!rend_cache_reserve(cache, size)) return false;
    cache->entries[node] = (entry){.present = true, .size = size, .value = value};
    cache->used += size;
    cache->count++;
    link_first(cache, node);
    return true;
}

void *rend_cache_use(rend_cache *cache, uint32_t node)
{
    if (!rend_cache_has(cache, node)) return NULL;
    unlink_entry(cache, node);
    link_first(cache, node);
    return cache->entries[node].value;
}

bool rend_cache_has(const rend_cache *cache, uint32_t node)
{
    return node < cache->head && cache->entries[node].present;
}

void rend_cache_pin(rend_cache *cache, uint32_t node)
{
    if (!rend_cache_has(cache, node)) return;
    entry *e = &cache->entries[node];
    if (e->pins++ == 0) cache->pinned += e->size;
}

void rend_cache_unpin(rend_cache *cache, uint32_t node)
{
    if (!rend_cache_has(cache, node)) return;
    entry *e = &cache->entries[node];
    assert(e->pins > 0);
    if (--e->pins == 0) cache->pinned -= e->size;
}

bool rend_cache_renumber(rend_cache *cache, const uint32_t *to, uint32_t node_count, uint64_t limit,
                         mospt_err *err)
{
    assert(cache->pinned == 0);
    rend_cache old = *cache;
    entry *entries = calloc((size_t)node_count + 1, sizeof *entries);
    if (entries == NULL) return mospt_err_nomem(err, node_count * sizeof *entries);
    for (uint32_t node = old.entries[old.head].previous; node != old.head;) {
        uint32_t newer = old.entries[node].previous;
        if (to[node] == UINT32_MAX) evict(cache, node);
        node = newer;
    }
    cache->entries = entries, cache->head = node_count, cache->limit = limit;
    entries[node_count].previous = entries[node_count].next = node_count;
    for (uint32_t node = old.entries[old.head].previous; node != old.head;
         node = old.entries[node].previous) {
        entries[to[node]] = old.entries[node];
        link_first(cache, to[node]);
    }
    free(old.entries);
    while (cache->used > limit)
        evict(cache, cache->entries[cache->head].previous);
    return true;
}

void rend_cache_drop(rend_cache *cache, uint32_t node)
{
    if (rend_cache_has(cache, node)) evict(cache, node);
}

void rend_cache_clear(rend_cache *cache)
{
    for (uint32_t node = cache->entries[cache->head].previous; node != cache->head;) {
        uint32_t newer = cache->entries[node].previous;
        if (cache->entries[node].pins == 0) evict(cache, node);
        node = newer;
    }
}

uint64_t rend_cache_used(const rend_cache *cache)
{
    return cache->used;
}

uint64_t rend_cache_limit(const rend_cache *cache)
{
    return cache->limit;
}

uint32_t rend_cache_count(const rend_cache *cache)
{
    return cache->count;
}
