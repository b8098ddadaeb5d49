#include "render/pages.h"

#include <assert.h>
#include <stdlib.h>

struct rend_pages {
    bool *taken; /* [count], owned */
    uint32_t count, free_count;
    uint32_t lowest_free; /* no page before it is free */
};

rend_pages *rend_pages_create(uint32_t page_count)
{
    rend_pages *p = calloc(1, sizeof *p);
    if (p == NULL) return NULL;
    *p = (rend_pages){.taken = calloc(page_count + 1, sizeof(bool)),
                      .count = page_count,
                      .free_count = page_count};
    if (p->taken == NULL) return free(p), NULL;
    return p;
}

void rend_pages_destroy(rend_pages *pages)
{
    if (pages == NULL) return;
    free(pages->taken);
    free(pages);
}

uint32_t rend_pages_free_count(const rend_pages *pages)
{
    return pages->free_count;
}

/* The next run of free pages from `from` on, at most `max` long; count 0 if there is none. */
static rend_run next_run(const rend_pages *p, uint32_t from, uint32_t max)
{
    while (from < p->count && p->taken[from])
        from++;
    rend_run run = {.first = from};
    while (run.count < max && from < p->count && !p->taken[from++])
        run.count++;
    return run;
}

static rend_run first_fit(const rend_pages *p, uint32_t count)
{
    rend_run run = next_run(p, p->lowest_free, count);
    while (run.count > 0 && run.count < count)
        run = next_run(p, run.first + run.count, count);
    return run;
}

static void mark(rend_pages *p, rend_run run, bool taken)
{
    for (uint32_t i = 0; i < run.count; i++)
        p->taken[run.first + i] = taken;
    if (taken) {
        p->free_count -= run.count;
        if (run.first == p->lowest_free) p->lowest_free = run.first + run.count;
    } else {
        p->free_count += run.count;
        if (run.first < p->lowest_free) p->lowest_free = run.first;
    }
}

static bool append(rend_place *place, rend_run run, mospt_err *err)
{
    rend_run *runs = realloc(place->runs, (place->run_count + 1) * sizeof *runs);
    if (runs == NULL) return mospt_err_nomem(err, (place->run_count + 1) * sizeof *runs);
    runs[place->run_count] = run;
    place->runs = runs, place->run_count++;
    return true;
}

bool rend_pages_take(rend_pages *pages, uint32_t count, rend_place *out, mospt_err *err)
{
    assert(count <= pages->free_count);
    rend_place place = {0};
    rend_run whole = first_fit(pages, count);
    for (uint32_t left = count; left > 0;) {
        rend_run run = whole.count == count ? whole : next_run(pages, pages->lowest_free, left);
        if (!append(&place, run, err)) {
            rend_pages_release(pages, &place);
            return false;
        }
        mark(pages, run, true);
        left -= run.count;
    }
    *out = place;
    return true;
}

void rend_pages_release(rend_pages *pages, rend_place *place)
{
    for (uint32_t i = 0; i < place->run_count; i++)
        mark(pages, place->runs[i], false);
    free(place->runs);
    *place = (rend_place){0};
}
