#include "render/cache.h"
#include "tests/core_tools.h"

#include <stdlib.h>

enum { NODES = 40 };

/* The twin: entries in the order of their use, newest last. */
typedef struct {
    uint32_t node[NODES], pins[NODES], count;
    uint64_t size[NODES], limit;
    uint32_t evicted[64], evicted_count;
} naive;

static uint64_t naive_used(const naive *n, bool pinned_only)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < n->count; i++)
        sum += !pinned_only || n->pins[i] > 0 ? n->size[i] : 0;
    return sum;
}

static int naive_find(const naive *n, uint32_t node)
{
    for (uint32_t i = 0; i < n->count; i++)
        if (n->node[i] == node) return (int)i;
    return -1;
}

static void naive_remove(naive *n, uint32_t at)
{
    n->count--;
    for (uint32_t i = at; i < n->count; i++)
        n->node[i] = n->node[i + 1], n->pins[i] = n->pins[i + 1], n->size[i] = n->size[i + 1];
}

static void naive_append(naive *n, uint32_t node, uint32_t pins, uint64_t size)
{
    n->node[n->count] = node, n->pins[n->count] = pins, n->size[n->count++] = size;
}

static bool naive_put(naive *n, uint32_t node, uint64_t size)
{
    if (size > n->limit || naive_used(n, true) + size > n->limit) return false;
    for (uint32_t i = 0; naive_used(n, false) + size > n->limit;) {
        if (n->pins[i] > 0) i++;
        else n->evicted[n->evicted_count++] = n->node[i], naive_remove(n, i);
    }
    naive_append(n, node, 0, size);
    return true;
}

typedef struct {
    uint32_t node[64], count;
} evictions;

static void on_evict(void *user, uint32_t node, void *value)
{
    evictions *e = user;
    assert_int_equal((uintptr_t)value, node + 1);
    e->node[e->count++] = node;
}

static void step(rend_cache *c, naive *n, evictions *e, uint64_t *state)
{
    uint32_t node = core_below(state, NODES);
    int at = naive_find(n, node);
    e->count = n->evicted_count = 0;
    switch (core_below(state, 6)) {
    case 0:
    case 1:
    case 2:
        if (at < 0) {
            uint64_t size = core_below(state, 500);
            assert_int_equal(rend_cache_put(c, node, size, (void *)(uintptr_t)(node + 1)),
                             naive_put(n, node, size));
            break;
        } /* fall through */
    case 3:
        assert_int_equal(rend_cache_use(c, node) != NULL, at >= 0);
        if (at >= 0) {
            uint32_t pins = n->pins[at];
            uint64_t size = n->size[at];
            naive_remove(n, (uint32_t)at);
            naive_append(n, node, pins, size);
        }
        break;
    case 4:
        rend_cache_pin(c, node);
        if (at >= 0) n->pins[at]++;
        break;
    default:
        if (at < 0 || n->pins[at] > 0) {
            rend_cache_unpin(c, node);
            if (at >= 0) n->pins[at]--;
        }
    }
    assert_int_equal(e->count, n->evicted_count);
    for (uint32_t i = 0; i < e->count; i++)
        assert_int_equal(e->node[i], n->evicted[i]);
}

static void the_twin_agrees(void **unused)
{
    (void)unused;
    for (uint64_t seed = 1; seed <= 50; seed++) {
        uint64_t state = seed;
        naive n = {.limit = 300 + 40 * seed};
        evictions e = {.count = 0};
        rend_cache *c = rend_cache_create(NODES, n.limit, on_evict, &e);
        for (int i = 0; i < 2000; i++) {
            step(c, &n, &e, &state);
            assert_true(rend_cache_used(c) <= n.limit);
            assert_int_equal(rend_cache_used(c), naive_used(&n, false));
            assert_int_equal(rend_cache_count(c), n.count);
        }
        e.count = 0;
        rend_cache_destroy(c);
        assert_int_equal(e.count, n.count);
    }
}

static void an_entry_larger_than_the_cache_is_refused(void **unused)
{
    (void)unused;
    evictions e = {.count = 0};
    rend_cache *c = rend_cache_create(NODES, 100, on_evict, &e);
    assert_true(rend_cache_put(c, 0, 60, (void *)1));
    assert_false(rend_cache_put(c, 1, 101, (void *)2));
    assert_false(rend_cache_put(c, 1, UINT64_MAX, (void *)2));
    assert_int_equal(e.count, 0); /* and nothing had to go for it */
    assert_true(rend_cache_has(c, 0));
    rend_cache_destroy(c);
}

static void a_pinned_entry_stays(void **unused)
{
    (void)unused;
    evictions e = {.count = 0};
    rend_cache *c = rend_cache_create(NODES, 100, on_evict, &e);
    assert_true(rend_cache_put(c, 0, 60, (void *)1));
    rend_cache_pin(c, 0);
    assert_false(rend_cache_put(c, 1, 50, (void *)2));
    rend_cache_clear(c);
    assert_true(rend_cache_has(c, 0));
    rend_cache_unpin(c, 0);
    assert_true(rend_cache_put(c, 1, 50, (void *)2));
    assert_false(rend_cache_has(c, 0));
    rend_cache_drop(c, 1);
    assert_int_equal(rend_cache_used(c), 0);
    rend_cache_destroy(c);
}

static void count_eviction(void *user, uint32_t node, void *value)
{
    (void)node, (void)value;
    ++*(uint32_t *)user;
}

static void other_numbers_keep_the_order_of_use(void **unused)
{
    (void)unused;
    uint32_t evicted = 0, to[10];
    mospt_err err = {0};
    rend_cache *c = rend_cache_create(10, 1000, count_eviction, &evicted);
    for (uint32_t n = 0; n < 10; n++) {
        assert_true(rend_cache_put(c, n, 100, (void *)(uintptr_t)(n + 1)));
        to[n] = n % 2 ? 19 - n : UINT32_MAX;
    }
    rend_cache_use(c, 1); /* the newest now; the oldest with a number is 3 */
    CORE_NEED(rend_cache_renumber(c, to, 20, 400, &err));
    assert_int_equal(evicted, 6); /* five without a number, and one that does not fit */
    assert_false(rend_cache_has(c, 16));
    assert_int_equal(rend_cache_used(c), 400);
    assert_int_equal((uintptr_t)rend_cache_use(c, 18), 2);
    assert_int_equal((uintptr_t)rend_cache_use(c, 14), 6);
    assert_true(rend_cache_put(c, 0, 100, NULL)); /* evicts the oldest: 7, now 12 */
    assert_false(rend_cache_has(c, 12));
    rend_cache_destroy(c);
    assert_int_equal(evicted, 11);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_twin_agrees),
        cmocka_unit_test(an_entry_larger_than_the_cache_is_refused),
        cmocka_unit_test(a_pinned_entry_stays),
        cmocka_unit_test(other_numbers_keep_the_order_of_use),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
