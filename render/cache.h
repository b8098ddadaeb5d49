/* render/cache.h - which nodes a cache of so many bytes holds, least recently used first out.
 *
 * Wimmer & Scheiblauer 2006, section 5.3: two LRU caches, one in main memory and one in graphics
 * memory. This is the bookkeeping of both; what an entry is made of is the owner's business.
 * Never over its limit: an entry larger than the whole cache is refused, and so is one that only
 * pinned entries could make room for. The same calls give the same evictions.
 * threads  one */
#pragma once
#include "mospt/err.h"

typedef struct rend_cache rend_cache;

/* Called for each entry on its way out; must not call the cache. */
typedef void rend_cache_evict(void *user, uint32_t node, void *value);

/* node_count   entries are numbered 0 to node_count - 1
 * NULL without memory. */
rend_cache *rend_cache_create(uint32_t node_count, uint64_t limit, rend_cache_evict *evict,
                              void *user);
void rend_cache_destroy(rend_cache *cache); /* evicts everything, pinned or not */

/* True if an entry of `size` could be put: makes the room, evicting as far as needed; evicts
 * nothing if it cannot. */
bool rend_cache_reserve(rend_cache *cache, uint64_t size);

/* Puts an entry that is not there yet, as the most recently used; false where rend_cache_reserve()
 * would be. */
bool rend_cache_put(rend_cache *cache, uint32_t node, uint64_t size, void *value);

/* The entry's value, which becomes the most recently used; NULL if it is not there. */
void *rend_cache_use(rend_cache *cache, uint32_t node);

bool rend_cache_has(const rend_cache *cache, uint32_t node);

/* A pinned entry is not evicted until unpinned; pins count. Does nothing if it is not there. */
void rend_cache_pin(rend_cache *cache, uint32_t node);
void rend_cache_unpin(rend_cache *cache, uint32_t node);

/* Gives entries other numbers, and the cache another limit; what has none, or does not fit, is
 * evicted. Nothing may be pinned.
 * to       [node count so far] new numbers, each once, or UINT32_MAX
 * errors   MOSPT_ENOMEM: nothing has changed */
bool rend_cache_renumber(rend_cache *cache, const uint32_t *to, uint32_t node_count, uint64_t limit,
                         mospt_err *err);

/* Evicts one entry, pinned or not, if it is there; or all that are not pinned. */
void rend_cache_drop(rend_cache *cache, uint32_t node);
void rend_cache_clear(rend_cache *cache);

uint64_t rend_cache_used(const rend_cache *cache);
uint64_t rend_cache_limit(const rend_cache *cache);
uint32_t rend_cache_count(const rend_cache *cache);
