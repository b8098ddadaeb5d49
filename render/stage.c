#include "render/stage.h"

#include "render/cache.h"
#include "render/match.h"
#include "render/order.h"
#include "render/pages.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    PAGE_POINTS =
        1024, /* 16 KiB: half a page is lost per node, 5 % of one that holds ten thousand points */
    LOADER_THREADS = 2,
    TAKE_MAX = 32,
};
/* 64 MiB cross any bus in a few milliseconds; more in one frame would be felt as a stutter. */
#define UPLOAD_BYTES_PER_FRAME (64 * REND_MIB)
/* While less than this share of the points is hidden, depths are read back now and then only. */
#define HIDDEN_SHARE_MIN 0.05
enum { LOOK_EVERY = 8, LOOKS_AT_REST = 6 };
/* Fewer points than that are not worth a look at what they hide. */
#define OCCLUSION_POINTS_MIN 200000
#define OCCLUDER_SHARE 2  /* of the budget, for what hides */
enum { RESETS_MAX = 50 }; /* a driver that is reset so often will be again */
#define WAITING_BYTES_MAX (128 * REND_MIB)

struct rend_stage {
    const mospt_dataset *dataset;
    rgl *gl;
    rend_selector *selector, *ahead; /* ahead: for what will be seen shortly */
    rend_loader *loader;
    rend_limits limits; /* as they were asked for */
    rend_loader_wake *wake;
    void *user;
    rend_cache *ram; /* values: owned vertices */
    rend_cache *gpu; /* values: owned rend_place; sizes: whole pages */
    rend_pages *pages;
    uint32_t page_count;
    bool gpu_is_full;   /* an upload has failed for want of graphics memory */
    uint8_t *residency; /* [node count] on the GPU, owned */

    rend_scheme *scheme;
    rend_look painted; /* whose colours the loader and the RAM cache have */
    char *attribute;   /* owned: the look's, whose owner may be gone */
    rend_paint paint;
    bool repaint; /* by another dataset: in the same colours, if they still mean the same */
    uint32_t paint_number; /* from 1; 0: nothing was painted yet */
    uint32_t *gpu_paint;   /* [node count], owned: number of the paint of what is on the GPU */
    rend_legend legend;

    uint32_t bounds_low[3], bounds_high[3];

    const rend_selection *selection;
    uint32_t *pinned; /* [pinned_count] nodes of the frame in hand, owned */
    uint32_t pinned_count, pinned_capacity;
    rend_order order;
    uint32_t *wanted; /* [node count], owned: what to ask the loader for */

    rend_frame frame;
    rend_clip clip; /* of the selection, if the view has one */
    rend_figures figures;
    uint64_t loaded_before; /* by loaders of generations before */
    double waited_before_s;
    rend_occlusion *occlusion;

    /* A picture in a window, drawn over several frames. */
    struct {
        bool begun, again; /* again: in the second round, of blending */
        bool is_guess;     /* what is hidden was asked of another view */
        uint32_t next;     /* in the order */
        rend_view_of view;
    } hand;
    uint32_t hidden_before; /* nodes, in the picture before; and points drawn in it */
    uint64_t points_before;
    uint32_t looks, guesses; /* behind pictures since the camera rests; pictures of guesses */
};

static void evict_vertices(void *user, uint32_t node, void *value)
{
    (void)user, (void)node;
    free(value);
}

static void evict_place(void *user, uint32_t node, void *value)
{
    rend_stage *s = user;
    rend_pages_release(s->pages, value);
    free(value);
    s->residency[node] = REND_ABSENT;
}

static uint32_t pages_in(const mospt_dataset *dataset, uint32_t node)
{
    return (uint32_t)(((uint64_t)dataset->hierarchy.nodes[node].count + PAGE_POINTS - 1) /
                      PAGE_POINTS);
}

static uint32_t pages_of(const rend_stage *s, uint32_t node)
{
    return pages_in(s->dataset, node);
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
static uint32_t count_pages(const rend_stage *s)
{
    const mospt_unfinished *u = &s->dataset->metadata.unfinished;
    uint64_t limit = or_default(s->limits.gpu_cache_bytes, REND_GPU_CACHE_DEFAULT) /
                     (PAGE_POINTS * sizeof(mospt_vertex));
    uint64_t all = u->commit > 0 ? u->points / PAGE_POINTS * 5 / 4 : 0, now = 0;
    uint32_t fewest = fewest_pages(s->dataset);
    for (uint32_t n = 0; n < s->dataset->hierarchy.count; n++)
        now += pages_of(s, n);
    if (now > all) all = now;
    if (limit > INT32_MAX / PAGE_POINTS) limit = INT32_MAX / PAGE_POINTS;
    uint64_t count = all < limit ? all : limit;
    return count > fewest ? (uint32_t)count : fewest;
}

static uint64_t ram_limit(const rend_stage *s, const mospt_dataset *dataset)
{
    uint64_t ram = or_default(s->limits.ram_cache_bytes, REND_RAM_CACHE_DEFAULT);
    uint64_t largest = (uint64_t)fewest_pages(dataset) * PAGE_POINTS * sizeof(mospt_vertex);
    return ram > largest ? ram : largest;
}

static uint64_t gpu_limit(const rend_stage *s)
{
    return (uint64_t)s->page_count * PAGE_POINTS * sizeof(mospt_vertex);
}

/* An arena of so many pages, or of half as many, and so on, as the graphics memory has room for. */
static bool make_arena(rend_stage *s, uint32_t page_count, mospt_err *err)
{
    uint32_t fewest = fewest_pages(s->dataset);
    mospt_err why = {0};
    s->page_count = page_count;
    while (!rgl_arena_create(s->gl, (uint64_t)s->page_count * PAGE_POINTS, &why)) {
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
static bool make_gpu(rend_stage *s, uint32_t page_count, mospt_err *err)
{
    rend_cache_destroy(s->gpu);
    rend_pages_destroy(s->pages);
    s->gpu = NULL, s->pages = NULL;
    if (!make_arena(s, page_count, err)) return false;
    s->pages = rend_pages_create(s->page_count);
    s->gpu = rend_cache_create(s->dataset->hierarchy.count, gpu_limit(s), evict_place, s);
    return (s->pages != NULL && s->gpu != NULL) || mospt_err_nomem(err, s->page_count);
}

static bool make_loader(rend_stage *s, mospt_err *err)
{
    uint64_t ram = ram_limit(s, s->dataset),
             waiting = ram < WAITING_BYTES_MAX ? ram : WAITING_BYTES_MAX;
    rend_loader_destroy(s->loader);
    s->loader = NULL;
    return rend_loader_create(s->dataset, LOADER_THREADS, waiting, s->wake, s->user, &s->loader,
                              err);
}

static bool make_caches(rend_stage *s, mospt_err *err)
{
    uint32_t nodes = s->dataset->hierarchy.count;
    s->residency = calloc((size_t)nodes + 1, 1);
    s->wanted = calloc((size_t)nodes + 1, sizeof *s->wanted);
    s->gpu_paint = calloc((size_t)nodes + 1, sizeof *s->gpu_paint);
    s->scheme = rend_scheme_create(s->dataset);
    s->selector = rend_select_create();
    s->ahead = rend_select_create();
    s->occlusion = rend_occlusion_create();
    s->ram = rend_cache_create(nodes, ram_limit(s, s->dataset), evict_vertices, s);
    if (s->residency == NULL || s->wanted == NULL || s->gpu_paint == NULL || s->scheme == NULL ||
        s->selector == NULL || s->ahead == NULL || s->occlusion == NULL || s->ram == NULL)
        return mospt_err_nomem(err, (size_t)nodes * 64);
    return make_gpu(s, count_pages(s), err) && make_loader(s, err);
}

bool rend_stage_create(const mospt_dataset *dataset, rgl *gl, const rend_limits *limits,
                       rend_loader_wake *wake, void *user, rend_stage **out, mospt_err *err)
{
    rend_stage *s = calloc(1, sizeof *s);
    if (s == NULL) return mospt_err_nomem(err, sizeof *s);
    s->dataset = dataset, s->gl = gl, s->limits = *limits, s->wake = wake, s->user = user;
    rend_frame_bounds(dataset, s->bounds_low, s->bounds_high);
    if (!make_caches(s, err)) {
        rend_stage_destroy(s);
        return false;
    }
    *out = s;
    return true;
}

void rend_stage_destroy(rend_stage *stage)
{
    if (stage == NULL) return;
    rend_loader_destroy(stage->loader);
    rend_cache_destroy(stage->ram);
    rend_cache_destroy(stage->gpu);
    rend_pages_destroy(stage->pages);
    rend_select_destroy(stage->selector);
    rend_select_destroy(stage->ahead);
    rend_occlusion_destroy(stage->occlusion);
    rend_scheme_destroy(stage->scheme);
    free(stage->attribute);
    free(stage->gpu_paint);
    free(stage->residency);
    free(stage->wanted);
    free(stage->pinned);
    rend_order_fini(&stage->order);
    free(stage);
}

/* ---- what is where ---- */

static bool upload_runs(rend_stage *s, uint32_t node, const rend_place *place,
                        const mospt_vertex *vertices, mospt_err *err)
{
    uint32_t count = s->dataset->hierarchy.nodes[node].count, done = 0;
    for (uint32_t r = 0; r < place->run_count; r++) {
        uint32_t part = place->runs[r].count * PAGE_POINTS;
        if (part > count - done) part = count - done;
        mospt_err why = {0};
        if (!rgl_arena_upload(s->gl, (uint64_t)place->runs[r].first * PAGE_POINTS, vertices + done,
                              part, &why)) {
            s->gpu_is_full = why.code == MOSPT_ENOMEM;
            if (err != NULL) *err = why;
            return false;
        }
        done += part;
    }
    s->figures.uploaded_bytes += count * sizeof *vertices;
    return true;
}

/* Puts a node on the GPU; false with `*full` if only pinned nodes could make room for it. */
static bool upload(rend_stage *s, uint32_t node, const mospt_vertex *vertices, bool *full,
                   mospt_err *err)
{
    uint64_t size = (uint64_t)pages_of(s, node) * PAGE_POINTS * sizeof *vertices;
    *full = !rend_cache_reserve(s->gpu, size);
    if (*full) return false;
    rend_place *place = calloc(1, sizeof *place);
    if (place == NULL) return mospt_err_nomem(err, sizeof *place);
    if (!rend_pages_take(s->pages, pages_of(s, node), place, err)) return free(place), false;
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

/* A node that cannot be read is remembered, and named once. Too little memory is no damage: it may
 * be there later. */
static void note_damage(rend_stage *s, const rend_loaded *loaded)
{
    if (loaded->err.code == MOSPT_ENOMEM || s->residency[loaded->node] == REND_DAMAGED) return;
    rend_cache_drop(s->gpu, loaded->node); /* it may be there in other colours */
    s->residency[loaded->node] = REND_DAMAGED;
    s->figures.damaged_points += s->dataset->hierarchy.nodes[loaded->node].count;
    if (s->figures.damaged_nodes++ == 0) s->figures.damage = loaded->err;
}

/* Takes over what the loader has read. What the RAM cache refuses is dropped: its pins are none, so
 * that never happens to a node that fits, and every node fits. */
static void store(rend_stage *s, const rend_loaded *loaded)
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

static bool pin(rend_stage *s, uint32_t node, mospt_err *err)
{
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

static void unpin_all(rend_stage *s)
{
    while (s->pinned_count > 0)
        rend_cache_unpin(s->gpu, s->pinned[--s->pinned_count]);
}

static bool put_on_gpu(rend_stage *s, uint32_t node, const mospt_vertex *vertices, mospt_err *err)
{
    bool full;
    if (!upload(s, node, vertices, &full, err)) {
        assert(!full); /* the caller asks for no more than fits */
        return false;
    }
    return pin(s, node, err);
}

/* ---- colours ---- */

static bool is_stale(const rend_stage *s, uint32_t node)
{
    return s->residency[node] == REND_RESIDENT && s->gpu_paint[node] != s->paint_number;
}

/* What was damaged to the old paint, which may have read more, may be fine to the new one. */
static void forget_damage(rend_stage *s)
{
    for (uint32_t n = 0; n < s->dataset->hierarchy.count; n++)
        if (s->residency[n] == REND_DAMAGED) s->residency[n] = REND_ABSENT;
    s->figures.damaged_nodes = 0, s->figures.damaged_points = 0;
    s->figures.damage = (mospt_err){0};
}

/* A node's level may have changed without a byte of it; all else that a paint looks at is its own.
 */
static bool is_same_paint(const rend_paint *a, const rend_paint *b)
{
    return a->source == b->source && a->source != REND_PAINT_LEVEL &&
           a->source != REND_PAINT_DISTANCE && a->attribute == b->attribute &&
           a->component == b->component && a->zero_is_none == b->zero_is_none &&
           a->classes == b->classes && a->low == b->low && a->high == b->high &&
           memcmp(&a->ramp, &b->ramp, sizeof a->ramp) == 0;
}

/* What is on the GPU stays there, to be drawn until it has been replaced. */
static bool use_colours(rend_stage *s, const rend_look *look, mospt_err *err)
{
    rend_paint paint;
    bool same = s->paint_number > 0 && rend_scheme_same(look, &s->painted);
    if (same && !s->repaint) return true;
    char *attribute = look->attribute != NULL ? strdup(look->attribute) : NULL;
    if (look->attribute != NULL && attribute == NULL)
        return mospt_err_nomem(err, strlen(look->attribute));
    if (!rend_scheme_make(s->scheme, look, &paint, &s->legend, err)) return free(attribute), false;
    free(s->attribute);
    s->painted = *look;
    s->painted.attribute = s->attribute = attribute;
    rend_loader_set_paint(s->loader, &paint);
    same = same && is_same_paint(&paint, &s->paint);
    s->paint = paint;
    s->repaint = false;
    if (same) return true;
    s->paint_number++;
    rend_cache_clear(s->ram);
    forget_damage(s);
    return true;
}

/* ---- what to draw ---- */

static const rend_draw *draw_at(const rend_stage *s, uint32_t place_in_order)
{
    return rend_order_at(&s->order, place_in_order);
}

/* Batches of the draws from .. to - 1 of the order that are on the GPU. */
static bool make_batches(rend_stage *s, const rend_look *look, uint32_t from, uint32_t to,
                         mospt_err *err)
{
    rend_order_begin(&s->order);
    for (uint32_t i = from; i < to; i++) {
        const rend_draw *d = draw_at(s, i);
        if (s->residency[d->node] != REND_RESIDENT) continue;
        const rend_place *place = rend_cache_use(s->gpu, d->node);
        if (!rend_order_add(&s->order, look, i, place, PAGE_POINTS, err)) return false;
        s->figures.points_drawn += d->count;
        s->figures.nodes_drawn++;
    }
    rend_order_end(&s->order);
    return true;
}

static rgl_scene make_scene(const rend_stage *s, const rend_view_of *view)
{
    /* A grey that whitewash and shadow both stand out from, a little lighter where the sky is. */
    static const float top[3] = {0.36f, 0.39f, 0.43f}, bottom[3] = {0.20f, 0.21f, 0.23f};
    const rend_look *look = &view->look;
    rgl_scene scene = {
        .frame = s->frame,
        .octants = look->size_mode == REND_SIZE_AUTO ? s->selection->octants : NULL,
        .octant_nodes = s->selection->draw_count,
        .grid_bits = s->dataset->metadata.grid.bits,
        .splat_scale = REND_SPLAT_PER_CELL,
        .splat_size = look->size_mode == REND_SIZE_WORLD
                          ? (float)(look->point_m / s->dataset->metadata.grid.step)
                          : 0,
        .px_min = rend_order_px_min(look),
        .px_max = rend_order_px_max(look),
        .blend_slab = look->blend_slab,
        .fill_px = look->fill_px,
        .edl_strength = look->no_edl ? 0 : (look->edl_strength > 0 ? look->edl_strength : 1) * 24,
        .edl_radius_px =
            look->edl_radius_px > 0 ? look->edl_radius_px : fmaxf(1, (float)view->height / 720),
        .clip = look->has_clip ? &s->clip : NULL,
    };
    for (int c = 0; c < 3; c++) {
        scene.background_top[c] = look->has_background ? look->background_top[c] : top[c];
        scene.background_bottom[c] = look->has_background ? look->background_bottom[c] : bottom[c];
    }
    return scene;
}

/* What a selection starts from, with nothing hidden. */
static rend_select_input input_of(rend_stage *s, const rend_view_of *view)
{
    rend_frame_make(&view->camera, &s->dataset->metadata.grid, s->bounds_low, s->bounds_high,
                    view->width, view->height, &s->frame);
    if (view->look.has_clip) rend_clip_make(&s->dataset->metadata.grid, &view->look.clip, &s->clip);
    return (rend_select_input){.hierarchy = &s->dataset->hierarchy,
                               .grid = &s->dataset->metadata.grid,
                               .frame = &s->frame,
                               .budget_points = view->budget_points,
                               .min_node_px = view->min_node_px,
                               .cell_px = view->cell_px,
                               .page_points = PAGE_POINTS,
                               .clip = view->look.has_clip ? &s->clip : NULL};
}

static bool run_selection(rend_stage *s, const rend_view_of *view, const rend_select_input *input,
                          mospt_err *err)
{
    if (!rend_select_run(s->selector, input, &s->selection, err)) return false;
    s->figures.points_drawn = 0;
    s->figures.nodes_drawn = 0;
    s->figures.points_in_view = s->selection->points_in_view;
    s->figures.nodes_visited = s->selection->visited;
    s->figures.nodes_hidden = s->selection->hidden;
    s->figures.points_hidden = s->selection->points_hidden;
    s->figures.budget_spent = s->selection->stopped;
    return rend_order_sort(&s->order, s->selection, &view->look, err);
}

/* The depths of what has been drawn are what things can be hidden behind. Without memory for them
 * nothing is. */
static bool learn_occlusion(rend_stage *s, const rend_view_of *view, mospt_err *err)
{
    float *depths = rend_occlusion_depths(s->occlusion, s->frame.width, s->frame.height);
    if (depths == NULL) return true;
    if (!rgl_read_depths(s->gl, depths, err)) return false;
    rend_occlusion_learn(s->occlusion, &s->frame, view->look.size_mode != REND_SIZE_AUTO);
    return true;
}

/* ---- a frame in a window ---- */

static void take_loaded(rend_stage *s)
{
    rend_loaded loaded[TAKE_MAX];
    for (uint32_t count; (count = rend_loader_take(s->loader, loaded, TAKE_MAX)) > 0;)
        for (uint32_t i = 0; i < count; i++)
            store(s, &loaded[i]);
}

/* Puts new colours over the old ones: a node keeps its place. */
static bool fetch_stale(rend_stage *s, uint64_t most, uint32_t *wanted, uint64_t *bytes,
                        rend_progress *progress, mospt_err *err)
{
    for (uint32_t i = 0; i < s->selection->draw_count; i++) {
        uint32_t node = s->selection->draws[i].node;
        if (!is_stale(s, node)) continue;
        s->figures.pending++;
        const mospt_vertex *vertices = rend_cache_use(s->ram, node);
        if (vertices == NULL) {
            s->wanted[(*wanted)++] = node;
            continue;
        }
        *progress = REND_AGAIN;
        if (*bytes >= most) break;
        if (!upload_runs(s, node, rend_cache_use(s->gpu, node), vertices, err)) return false;
        s->gpu_paint[node] = s->paint_number;
        *bytes += mospt_dataset_vertices_size(s->dataset, node);
    }
    return true;
}

/* What the selection asked for, as far as it is not there or damaged yet. */
static bool fetch_requested(rend_stage *s, uint64_t most, uint32_t *wanted, uint64_t *bytes,
                            rend_progress *progress, mospt_err *err)
{
    for (uint32_t i = 0; i < s->selection->request_count; i++) {
        uint32_t node = s->selection->requests[i].node;
        if (s->residency[node] != REND_ABSENT) { /* since an earlier part of this picture */
            *progress = REND_AGAIN;
            continue;
        }
        s->figures.pending++;
        const mospt_vertex *vertices = rend_cache_use(s->ram, node);
        if (vertices == NULL) {
            s->wanted[(*wanted)++] = node;
            continue;
        }
        *progress = REND_AGAIN;
        if (*bytes >= most) continue;
        /* The selection asks for no more than fits, and what was just put there must not make room
         * for what comes next. */
        if (!put_on_gpu(s, node, vertices, err)) return false;
        *bytes += mospt_dataset_vertices_size(s->dataset, node);
    }
    return true;
}

/* Asks for what will be missing, into the RAM cache and no further: on the GPU it might push out
 * what is drawn. */
static bool fetch_ahead(rend_stage *s, const rend_camera *camera, uint32_t *wanted, mospt_err *err)
{
    rend_frame frame;
    const rend_selection *selection;
    const rend_view_of *view = &s->hand.view;
    rend_frame_make(camera, &s->dataset->metadata.grid, s->bounds_low, s->bounds_high, view->width,
                    view->height, &frame);
    rend_select_input input = input_of(s, view);
    input.frame = &frame;
    input.residency = s->residency;
    if (!rend_select_run(s->ahead, &input, &selection, err)) return false;
    uint64_t bytes = 0, most = rend_cache_limit(s->ram) / 4;
    for (uint32_t i = 0; i < selection->request_count && bytes < most; i++) {
        uint32_t node = selection->requests[i].node;
        if (rend_cache_has(s->ram, node)) continue;
        s->wanted[(*wanted)++] = node;
        bytes += mospt_dataset_vertices_size(s->dataset, node);
    }
    s->figures.ahead = *wanted;
    return true;
}

/* Uploads what the RAM cache has, and asks the loader for the rest. */
static bool fetch(rend_stage *s, const rend_allowance *allowed, rend_progress *progress,
                  mospt_err *err)
{
    uint64_t most = or_default(allowed->upload_bytes, UPLOAD_BYTES_PER_FRAME);
    uint64_t bytes = 0;
    uint32_t wanted = 0;
    *progress = REND_SETTLED;
    s->figures.pending = 0;
    if (!fetch_stale(s, most, &wanted, &bytes, progress, err) ||
        !fetch_requested(s, most, &wanted, &bytes, progress, err))
        return false;
    if (*progress == REND_SETTLED && wanted > 0) *progress = REND_WAITING;
    s->figures.ahead = 0;
    if (wanted == 0 && allowed->ahead != NULL && !fetch_ahead(s, allowed->ahead, &wanted, err))
        return false;
    return rend_loader_request(s->loader, s->wanted, wanted, err);
}

static bool is_same_shape(const rend_look *a, const rend_look *b)
{
    return a->size_mode == b->size_mode && a->point_px == b->point_px && a->point_m == b->point_m &&
           a->has_clip == b->has_clip && memcmp(&a->clip, &b->clip, sizeof a->clip) == 0;
}

/* What a wall hid that has been cut away, or that is drawn with smaller points, is hidden no more.
 */
static void forget_other_shapes(rend_stage *s, const rend_view_of *view)
{
    if (!view->no_occlusion && is_same_shape(&view->look, &s->hand.view.look)) return;
    rend_occlusion_forget(s->occlusion);
    s->points_before = 0;
}

static bool begin_picture(rend_stage *s, const rend_view_of *view, mospt_err *err)
{
    forget_other_shapes(s, view);
    rend_select_input input = input_of(s, view);
    input.residency = s->residency;
    input.page_limit = s->page_count;
    input.occlusion = s->occlusion;
    bool is_guess = !rend_occlusion_aim(s->occlusion, &s->frame);
    if (!run_selection(s, view, &input, err)) return false;
    unpin_all(s);
    for (uint32_t i = 0; i < s->selection->draw_count; i++)
        if (!pin(s, s->selection->draws[i].node, err)) return false;
    s->hand.begun = true, s->hand.again = false, s->hand.next = 0;
    s->hand.is_guess = is_guess;
    s->hand.view = *view;
    return true;
}

/* How far the order goes in one frame. */
static uint32_t end_of_part(const rend_stage *s, uint64_t most)
{
    uint64_t points = 0;
    uint32_t to = s->hand.next;
    for (; to < s->selection->draw_count; to++) {
        points += draw_at(s, to)->count;
        if (most > 0 && points > most && to > s->hand.next) break;
    }
    return to;
}

/* Draws a part; the hand lets go of the picture with the last one. Blending takes a second round,
 * but for a picture of one part. */
static bool draw_part(rend_stage *s, uint64_t most, mospt_err *err)
{
    const rend_view_of *view = &s->hand.view;
    rgl_scene scene = make_scene(s, view);
    uint32_t from = s->hand.next, to = end_of_part(s, most);
    bool first = from == 0 && !s->hand.again, end = to == s->selection->draw_count;
    bool again = scene.blend_slab > 0 && (s->hand.again || (first && end));
    bool last = end && again == (scene.blend_slab > 0);
    int parts = (first ? RGL_BEGIN : 0) | (again ? RGL_AGAIN : 0) | (last ? RGL_END : 0);
    rend_figures before = s->figures;
    if (!make_batches(s, &view->look, from, to, err)) return false;
    s->figures.points_total += s->figures.points_drawn - before.points_drawn;
    if (s->hand.again)
        s->figures.points_drawn = before.points_drawn, s->figures.nodes_drawn = before.nodes_drawn;
    if (!rgl_draw(s->gl, &scene, s->order.batches, s->order.batch_count, parts | view->parts, err))
        return false;
    s->hand.begun = !last;
    s->hand.again = s->hand.again || end;
    s->hand.next = end ? 0 : to;
    return true;
}

/* After a picture: what it hides, for the next one. At rest pictures follow each other until what
 * is hidden stays the same; while little is, not every picture is looked behind. */
static bool look_behind(rend_stage *s, rend_progress *progress, mospt_err *err)
{
    const rend_selection *r = s->selection;
    uint64_t points = r->points + r->points_hidden;
    bool pays = r->stopped || points > OCCLUSION_POINTS_MIN || r->hidden > 0;
    bool little = (double)r->points_hidden < HIDDEN_SHARE_MIN * (double)points;
    bool same = r->hidden == s->hidden_before && r->points == s->points_before;
    s->hidden_before = r->hidden, s->points_before = r->points;
    if (s->hand.view.no_occlusion || !pays) return true;
    if (!s->hand.is_guess && (same || ++s->looks > LOOKS_AT_REST)) return true;
    if (r->hidden > 0 || r->stopped) *progress = REND_AGAIN;
    if (s->hand.is_guess) s->looks = 0;
    if (s->hand.is_guess && little && ++s->guesses % LOOK_EVERY != 0) return true;
    return learn_occlusion(s, &s->hand.view, err);
}

static bool draw_frame(rend_stage *stage, const rend_view_of *view, const rend_allowance *allowed,
                       rend_progress *progress, mospt_err *err)
{
    if (!use_colours(stage, &view->look, err)) return false;
    take_loaded(stage);
    bool goes_on = stage->hand.begun && memcmp(view, &stage->hand.view, sizeof *view) == 0;
    if (!goes_on && !begin_picture(stage, view, err)) return false;
    if (!draw_part(stage, allowed->points, err) || !fetch(stage, allowed, progress, err))
        return false;
    if (!stage->hand.begun) return look_behind(stage, progress, err);
    *progress = REND_PART;
    return true;
}

/* After an upload that failed: true if half of the GPU cache is left to try. */
static bool halve_gpu(rend_stage *s, mospt_err *err)
{
    uint32_t fewest = fewest_pages(s->dataset);
    uint32_t half = s->page_count / 2 > fewest ? s->page_count / 2 : fewest;
    if (!s->gpu_is_full || half == s->page_count) return false;
    s->gpu_is_full = false;
    s->hand.begun = false;
    s->figures.gpu_halved++;
    unpin_all(s);
    return make_gpu(s, half, err);
}

bool rend_stage_recover(rend_stage *stage, mospt_err *err)
{
    if (!rgl_is_lost(stage->gl) || stage->figures.resets == RESETS_MAX) return false;
    stage->figures.resets++;
    stage->hand.begun = false;
    unpin_all(stage);
    return rgl_recover(stage->gl, err) && make_gpu(stage, stage->page_count, err);
}

/* True if what has failed can be tried again. */
static bool get_over(rend_stage *s, mospt_err *err)
{
    return rend_stage_recover(s, err) || (!rgl_is_lost(s->gl) && halve_gpu(s, err));
}

bool rend_stage_frame(rend_stage *stage, const rend_view_of *view, const rend_allowance *allowed,
                      rend_progress *progress, mospt_err *err)
{
    static const rend_allowance unlimited = {0};
    if (allowed == NULL) allowed = &unlimited;
    while (!draw_frame(stage, view, allowed, progress, err))
        if (!get_over(stage, err)) return false;
    return true;
}

/* ---- a picture ---- */

/* How far the order goes until the GPU cache is full. */
static uint32_t end_of_chunk(const rend_stage *s, uint32_t from)
{
    uint64_t pages = 0;
    uint32_t to = from;
    for (; to < s->selection->draw_count; to++) {
        pages += pages_of(s, draw_at(s, to)->node);
        if (pages > s->page_count && to > from) break;
    }
    return to;
}

/* Uploads what has been read, if it is wanted, before it goes to the RAM cache: a small one would
 * evict it at once. */
static bool receive(rend_stage *s, const rend_loaded *loaded, bool wanted, mospt_err *err)
{
    if (loaded->vertices == NULL && loaded->err.code == MOSPT_ENOMEM) {
        if (err != NULL) *err = loaded->err;
        return false;
    }
    bool ok = !wanted || loaded->vertices == NULL || s->residency[loaded->node] == REND_RESIDENT ||
              put_on_gpu(s, loaded->node, loaded->vertices, err);
    store(s, loaded);
    return ok;
}

static bool wait_for(rend_stage *s, uint32_t count, mospt_err *err)
{
    while (count > 0) {
        rend_loaded loaded;
        if (!rend_loader_wait(s->loader)) return mospt_err_nomem(err, 0);
        if (rend_loader_take(s->loader, &loaded, 1) == 0) continue;
        /* Something asked for by an earlier frame is welcome, but not waited for. */
        uint32_t i = 0;
        while (i < count && s->wanted[i] != loaded.node)
            i++;
        bool wanted = i < count;
        if (wanted) s->wanted[i] = s->wanted[--count];
        if (!receive(s, &loaded, wanted, err)) return false;
    }
    return true;
}

/* Brings the nodes from .. to - 1 of the order to the GPU and keeps them there. */
static bool bring(rend_stage *s, uint32_t from, uint32_t to, mospt_err *err)
{
    uint32_t wanted = 0;
    unpin_all(s);
    for (uint32_t i = from; i < to; i++) {
        uint32_t node = draw_at(s, i)->node;
        if (is_stale(s, node)) rend_cache_drop(s->gpu, node);
        if (s->residency[node] == REND_RESIDENT && !pin(s, node, err)) return false;
    }
    for (uint32_t i = from; i < to; i++) {
        uint32_t node = draw_at(s, i)->node;
        if (s->residency[node] != REND_ABSENT) continue;
        const mospt_vertex *vertices = rend_cache_use(s->ram, node);
        if (vertices == NULL) s->wanted[wanted++] = node;
        else if (!put_on_gpu(s, node, vertices, err)) return false;
    }
    return rend_loader_request(s->loader, s->wanted, wanted, err) && wait_for(s, wanted, err);
}

bool rend_stage_expect(rend_stage *stage, const rend_view_of *view, mospt_err *err)
{
    uint32_t wanted = 0;
    stage->hand.begun = false;
    rend_select_input input = input_of(stage, view);
    input.occlusion = stage->occlusion; /* of the picture before: a guess, good enough to read by */
    rend_occlusion_aim(stage->occlusion, &stage->frame);
    if (!use_colours(stage, &view->look, err) || !run_selection(stage, view, &input, err))
        return false;
    /* What takes several parts has no room for anything that is read early. */
    if (end_of_chunk(stage, 0) < stage->selection->draw_count) return true;
    for (uint32_t i = 0; i < stage->selection->draw_count; i++) {
        uint32_t node = draw_at(stage, i)->node;
        bool missing = stage->residency[node] == REND_ABSENT || is_stale(stage, node);
        if (missing && !rend_cache_has(stage->ram, node)) stage->wanted[wanted++] = node;
    }
    return rend_loader_request(stage->loader, stage->wanted, wanted, err);
}

/* Draws the selection through the GPU cache, in as many parts as that needs.
 * first, last  flags for the first and the last of them, besides those for all */
static bool draw_all(rend_stage *s, const rend_view_of *view, int first, int all, int last,
                     mospt_err *err)
{
    rgl_scene scene = make_scene(s, view);
    uint32_t total = s->selection->draw_count, from = 0;
    s->figures.points_drawn = 0;
    s->figures.nodes_drawn = 0;
    do {
        uint32_t to = end_of_chunk(s, from);
        int parts = all | (from == 0 ? first : 0) | (to == total ? last : 0);
        if (!bring(s, from, to, err) || !make_batches(s, &view->look, from, to, err)) return false;
        if (!rgl_draw(s->gl, &scene, s->order.batches, s->order.batch_count, parts, err))
            return false;
        from = to;
    } while (from < total);
    unpin_all(s);
    return true;
}

/* Few points are drawn sooner than depths are read back. */
static bool may_hide(const rend_stage *s, const rend_view_of *view)
{
    return !view->no_occlusion &&
           (s->selection->stopped || s->selection->points > OCCLUSION_POINTS_MIN);
}

/* What hides others, from a part of the points: with cells nearly twice as wide, and as wide as
 * that where the picture's own points will close a wall. */
static bool draw_occluders(rend_stage *s, const rend_view_of *view, mospt_err *err)
{
    rend_view_of closed = *view;
    rend_select_input input = input_of(s, view);
    if (view->look.size_mode != REND_SIZE_AUTO) {
        rgl_scene own = make_scene(s, view);
        input.own_px = own.px_min, input.own_cell = own.splat_size / own.splat_scale;
        closed.look.size_mode = REND_SIZE_AUTO, closed.look.point_px_min = own.px_min;
        closed.look.point_px_max = fmaxf(own.px_min, rend_order_px_max(&closed.look));
    }
    if (view->budget_points != REND_ALL) input.budget_points /= OCCLUDER_SHARE;
    input.cell_px = 1.4f;
    return run_selection(s, &closed, &input, err) && draw_all(s, &closed, RGL_BEGIN, 0, 0, err) &&
           learn_occlusion(s, view, err);
}

static bool draw_still(rend_stage *stage, const rend_view_of *view, mospt_err *err)
{
    stage->hand.begun = false;
    if (!use_colours(stage, &view->look, err)) return false;
    rend_select_input input = input_of(stage, view);
    if (!run_selection(stage, view, &input, err)) return false;
    if (may_hide(stage, view)) {
        if (!draw_occluders(stage, view, err)) return false;
        input.occlusion = stage->occlusion;
        if (!run_selection(stage, view, &input, err)) return false;
    }
    stage->figures.pending = 0;
    bool blend = view->look.blend_slab > 0;
    if (blend && end_of_chunk(stage, 0) < stage->selection->draw_count)
        return draw_all(stage, view, RGL_BEGIN, view->parts, 0, err) &&
               draw_all(stage, view, 0, view->parts | RGL_AGAIN, RGL_END, err);
    return draw_all(stage, view, RGL_BEGIN | (blend ? RGL_AGAIN : 0), view->parts, RGL_END, err);
}

bool rend_stage_still(rend_stage *stage, const rend_view_of *view, mospt_err *err)
{
    while (!draw_still(stage, view, err))
        if (!get_over(stage, err)) return false;
    return true;
}

/* ---- another dataset ---- */

/* Arrays by node, and what was on the GPU, under their new numbers. */
static bool renumber(rend_stage *s, const uint32_t *to, const mospt_dataset *dataset,
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
    s->dataset = dataset;
    return true;
}

bool rend_stage_swap(rend_stage *stage, const mospt_dataset *dataset, mospt_err *err)
{
    rend_stage *s = stage;
    uint32_t *to = calloc((size_t)s->dataset->hierarchy.count + 1, sizeof *to);
    rend_scheme *scheme = rend_scheme_create(dataset);
    bool ok = (to != NULL && scheme != NULL) || mospt_err_nomem(err, 0);
    s->hand.begun = false;
    unpin_all(s);
    s->loaded_before += rend_loader_bytes(s->loader);
    s->waited_before_s += rend_loader_waited_s(s->loader);
    rend_loader_destroy(s->loader); /* it reads the dataset of before */
    s->loader = NULL;
    if (ok) rend_match_nodes(s->dataset, dataset, to);
    ok = ok && renumber(s, to, dataset, err);
    free(to);
    if (!ok) return rend_scheme_destroy(scheme), false;
    rend_scheme_destroy(s->scheme);
    s->scheme = scheme;
    s->repaint = true;
    forget_damage(s);
    rend_frame_bounds(dataset, s->bounds_low, s->bounds_high);
    bool fits = s->page_count >= fewest_pages(s->dataset) &&
                (s->figures.gpu_halved > 0 || s->page_count >= count_pages(s));
    return make_loader(s, err) && (fits || make_gpu(s, count_pages(s), err));
}

void rend_stage_figures(rend_stage *stage, rend_figures *out)
{
    rend_figures *f = &stage->figures;
    f->ram_used = rend_cache_used(stage->ram), f->ram_limit = rend_cache_limit(stage->ram);
    f->gpu_used = rend_cache_used(stage->gpu), f->gpu_limit = rend_cache_limit(stage->gpu);
    f->loaded_bytes = stage->loaded_before + rend_loader_bytes(stage->loader);
    f->waited_s = stage->waited_before_s + rend_loader_waited_s(stage->loader);
    *out = *f;
}

const rend_legend *rend_stage_legend(const rend_stage *stage)
{
    return &stage->legend;
}

const rend_frame *rend_stage_last_frame(const rend_stage *stage)
{
    return &stage->frame;
}

const rend_selection *rend_stage_last_selection(const rend_stage *stage)
{
    return stage->selection;
}
