#include "render/pages.h"
#include "tests/core_tools.h"

#include <stdlib.h>
#include <string.h>

enum { PAGES = 64, PLACES = 24 };

static uint32_t size_of(const rend_place *p)
{
    uint32_t sum = 0;
    for (uint32_t r = 0; r < p->run_count; r++)
        sum += p->runs[r].count;
    return sum;
}

static void claim(bool taken[PAGES], const rend_place *p)
{
    for (uint32_t r = 0; r < p->run_count; r++)
        for (uint32_t i = 0; i < p->runs[r].count; i++) {
            assert_true(p->runs[r].first + i < PAGES);
            assert_false(taken[p->runs[r].first + i]);
            taken[p->runs[r].first + i] = true;
        }
}

static void places_never_overlap_and_nothing_is_lost(void **unused)
{
    (void)unused;
    uint64_t state = 1;
    rend_pages *pages = rend_pages_create(PAGES);
    rend_place places[PLACES] = {0};
    mospt_err err = {0};
    for (int i = 0; i < 20000; i++) {
        rend_place *p = &places[core_below(&state, PLACES)];
        uint32_t wanted = core_below(&state, 12), held = 0;
        if (p->run_count > 0) {
            rend_pages_release(pages, p);
        } else if (wanted <= rend_pages_free_count(pages)) {
            CORE_NEED(rend_pages_take(pages, wanted, p, &err)); /* whatever the holes are */
            assert_int_equal(size_of(p), wanted);
        }
        bool taken[PAGES] = {false};
        for (int n = 0; n < PLACES; n++)
            claim(taken, &places[n]), held += size_of(&places[n]);
        assert_int_equal(rend_pages_free_count(pages), PAGES - held);
    }
    for (int n = 0; n < PLACES; n++)
        rend_pages_release(pages, &places[n]);
    rend_pages_destroy(pages);
}

static void one_run_is_taken_where_there_is_one(void **unused)
{
    (void)unused;
    rend_pages *pages = rend_pages_create(PAGES);
    rend_place a, b, c;
    mospt_err err = {0};
    CORE_NEED(rend_pages_take(pages, 2, &a, &err));
    CORE_NEED(rend_pages_take(pages, 3, &b, &err));
    rend_pages_release(pages, &a); /* a hole of two */
    CORE_NEED(rend_pages_take(pages, 4, &c, &err));
    assert_int_equal(c.run_count, 1);
    assert_int_equal(c.runs[0].first, 5);
    CORE_NEED(rend_pages_take(pages, 2, &a, &err));
    assert_int_equal(a.runs[0].first, 0);
    rend_pages_release(pages, &a);
    rend_pages_release(pages, &b);
    rend_pages_release(pages, &c);
    rend_pages_destroy(pages);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_never_overlap_and_nothing_is_lost),
        cmocka_unit_test(one_run_is_taken_where_there_is_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
