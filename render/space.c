#include "render/space.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { CELLS_MAX = 16 << 20, FILLED_POINTS = 2 };
#define CELL_MIN_M 0.25
#define POINTS_MAX UINT64_C(40000000)
#define COST_SOLID 10000.0f /* more than any way around */
#define COST_NO_FLOOR 20.0f
#define COST_NARROW 3.0f
#define COST_PER_M 10.0f /* up or down: a way around is better than a jump */

size_t rend_space_cells(const rend_space *space)
{
    return (size_t)space->size[0] * space->size[1] * space->size[2];
}

size_t rend_space_cell(const rend_space *space, const double world[3])
{
    size_t at[3];
    for (int a = 0; a < 3; a++) {
        double c = floor((world[a] - space->low[a]) / space->cell_m);
        at[a] = (size_t)fmin(fmax(c, 0), space->size[a] - 1);
    }
    return (at[2] * space->size[1] + at[1]) * space->size[0] + at[0];
}

static void split(const rend_space *s, size_t cell, size_t at[3])
{
    at[0] = cell % s->size[0];
    at[1] = cell / s->size[0] % s->size[1];
    at[2] = cell / s->size[0] / s->size[1];
}

void rend_space_middle(const rend_space *space, size_t cell, double world[3])
{
    size_t at[3];
    split(space, cell, at);
    for (int a = 0; a < 3; a++)
        world[a] = space->low[a] + ((double)at[a] + 0.5) * space->cell_m;
}

/* ---- making one ---- */

static bool lay_out(const rend_box *part, rend_space *s, mospt_err *err)
{
    double volume = 1;
    for (int a = 0; a < 3; a++) {
        s->low[a] = part->low[a];
        volume *= fmax(part->high[a] - part->low[a], CELL_MIN_M);
    }
    s->cell_m = fmax(CELL_MIN_M, cbrt(volume / CELLS_MAX));
    for (int a = 0; a < 3; a++)
        s->size[a] = (uint32_t)fmin(ceil((part->high[a] - s->low[a]) / s->cell_m) + 2, CELLS_MAX);
    s->floor = calloc(rend_space_cells(s), 1);
    s->narrow = calloc(rend_space_cells(s), 1);
    return (s->floor != NULL && s->narrow != NULL) || mospt_err_nomem(err, 2 * rend_space_cells(s));
}

/* Counts the points of a node in the cells, up to what a byte holds. */
static bool add_node(const mospt_dataset *dataset, uint32_t node, rend_space *s, mospt_err *err)
{
    size_t size = mospt_dataset_vertices_size(dataset, node);
    mospt_vertex *v = malloc(size);
    if (v == NULL) return mospt_err_nomem(err, size);
    bool ok = mospt_dataset_read_vertices(dataset, node, v, err);
    for (uint32_t i = 0; ok && i < dataset->hierarchy.nodes[node].count; i++) {
        const uint32_t g[3] = {v[i].x, v[i].y, v[i].z};
        double world[3];
        bool inside = true;
        mospt_grid_to_world(&dataset->metadata.grid, g, world);
        for (int a = 0; a < 3; a++)
            inside =
                inside && world[a] >= s->low[a] && world[a] < s->low[a] + s->size[a] * s->cell_m;
        uint8_t *count = &s->floor[rend_space_cell(s, world)];
        if (inside && *count < UINT8_MAX) ++*count;
    }
    free(v);
    return ok;
}

/* Nodes are stored coarsest first: those whose finest cells are no larger than half of ours end it.
 */
static bool fill(const mospt_dataset *dataset, rend_space *s, mospt_err *err)
{
    const mospt_hierarchy *h = &dataset->hierarchy;
    const mospt_grid *grid = &dataset->metadata.grid;
    uint64_t points = 0;
    for (uint32_t n = 0; n < h->count && points < POINTS_MAX; n++) {
        double parent_cell =
            ldexp(2 * grid->step, (int)grid->bits - h->nodes[n].level - (int)h->inner_depth);
        if (n > 0 && parent_cell < s->cell_m / 2) break;
        if (!add_node(dataset, n, s, err)) return false;
        points += h->nodes[n].count;
    }
    for (size_t c = 0; c < rend_space_cells(s); c++)
        s->floor[c] = s->floor[c] < FILLED_POINTS;
    return true;
}

/* Marks what has something within `reach` cells of it along one axis of its layer. */
static void widen(uint8_t *out, const uint8_t *in, size_t count, size_t stride, size_t reach)
{
    for (size_t i = 0; i < count; i++) {
        size_t from = i > reach ? i - reach : 0, to = i + reach < count ? i + reach : count - 1;
        uint8_t any = 0;
        for (size_t j = from; j <= to; j++)
            any |= in[j * stride];
        out[i * stride] = any;
    }
}

static bool set_narrow(rend_space *s)
{
    size_t reach = (size_t)ceil(REND_SHOULDER_M / s->cell_m), cells = rend_space_cells(s);
    size_t layer = (size_t)s->size[0] * s->size[1];
    uint8_t *rows = malloc(cells);
    if (rows == NULL) return false;
    for (size_t c = 0; c < cells; c++)
        s->narrow[c] = s->floor[c] == 0;
    for (size_t row = 0; row < cells; row += s->size[0])
        widen(rows + row, s->narrow + row, s->size[0], 1, reach);
    for (size_t z = 0; z < s->size[2]; z++)
        for (size_t x = 0; x < s->size[0]; x++)
            widen(s->narrow + z * layer + x, rows + z * layer + x, s->size[1], s->size[0], reach);
    free(rows);
    return true;
}

bool rend_space_derive(rend_space *space)
{
    size_t layer = (size_t)space->size[0] * space->size[1], cells = rend_space_cells(space);
    for (size_t c = 0; c < cells; c++) {
        if (space->floor[c] == 0) continue;
        uint8_t below = c >= layer ? space->floor[c - layer] : REND_NO_FLOOR;
        space->floor[c] = below == REND_NO_FLOOR ? REND_NO_FLOOR : (uint8_t)(below + 1);
    }
    return set_narrow(space);
}

bool rend_space_make(const mospt_dataset *dataset, const rend_box *part, rend_space *out,
                     mospt_err *err)
{
    rend_space s = {0};
    bool ok = lay_out(part, &s, err) && fill(dataset, &s, err) &&
              (rend_space_derive(&s) || mospt_err_nomem(err, rend_space_cells(&s)));
    if (ok) *out = s;
    else rend_space_fini(&s);
    return ok;
}

void rend_space_fini(rend_space *space)
{
    free(space->floor);
    free(space->narrow);
    *space = (rend_space){0};
}

float rend_space_cost(const rend_space *space, size_t cell, double eye_m)
{
    uint8_t floor_cells = space->floor[cell];
    if (floor_cells == 0) return COST_SOLID;
    float narrow = space->narrow[cell] ? COST_NARROW : 0;
    if (floor_cells == REND_NO_FLOOR) return 1 + COST_NO_FLOOR + narrow;
    double off = fabs((floor_cells - 0.5) * space->cell_m - eye_m) - space->cell_m / 2;
    return 1 + narrow + fminf(COST_PER_M * (float)fmax(off, 0), COST_NO_FLOOR);
}

/* ---- on foot ---- */

/* Cells that hang together, one component after the other; each is marked with its number. */
typedef struct {
    const rend_space *space;
    uint32_t *part; /* [cells], owned: 0 not walkable, 1 not seen yet, else its number */
    uint32_t *open; /* owned: cells whose neighbours are still to be looked at */
    size_t count, capacity;
} flood;

static bool add_open(flood *f, size_t cell, uint32_t number)
{
    if (f->count == f->capacity) {
        size_t capacity = f->capacity > 0 ? 2 * f->capacity : 1 << 12;
        void *larger = realloc(f->open, capacity * sizeof *f->open);
        if (larger == NULL) return false;
        f->open = larger, f->capacity = capacity;
    }
    f->part[cell] = number;
    f->open[f->count++] = (uint32_t)cell;
    return true;
}

/* The neighbour number n of 27; false if there is none. */
static bool neighbour_at(const rend_space *s, size_t cell, int n, size_t *out)
{
    size_t at[3], to[3];
    split(s, cell, at);
    const int d[3] = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
    for (int a = 0; a < 3; a++) {
        to[a] = at[a] + (size_t)d[a]; /* wraps below zero */
        if (to[a] >= s->size[a]) return false;
    }
    *out = (to[2] * s->size[1] + to[1]) * s->size[0] + to[0];
    return *out != cell;
}

static bool flood_from(flood *f, size_t cell, uint32_t number, size_t *size)
{
    bool ok = add_open(f, cell, number);
    for (*size = 0; ok && f->count > 0; ++*size) {
        size_t here = f->open[--f->count], next;
        for (int n = 0; ok && n < 27; n++)
            if (neighbour_at(f->space, here, n, &next) && f->part[next] == 1)
                ok = add_open(f, next, number);
    }
    return ok;
}

bool rend_space_walkable(const rend_space *space, double eye_m, uint8_t **on_foot, mospt_err *err)
{
    size_t cells = rend_space_cells(space), largest = 0;
    uint32_t number = 1, found = 0;
    flood f = {.space = space, .part = malloc(cells * sizeof *f.part)};
    uint8_t *result = malloc(cells);
    bool ok = f.part != NULL && result != NULL;
    for (size_t c = 0; ok && c < cells; c++)
        f.part[c] = rend_space_cost(space, c, eye_m) <= 1;
    for (size_t c = 0; ok && c < cells; c++) {
        size_t size;
        if (f.part[c] != 1) continue;
        ok = flood_from(&f, c, ++number, &size);
        if (ok && size > largest) largest = size, found = number;
    }
    for (size_t c = 0; ok && c < cells; c++)
        result[c] = largest > 0 && f.part[c] == found;
    free(f.part), free(f.open);
    if (ok) *on_foot = result;
    else free(result);
    return ok || mospt_err_nomem(err, 5 * cells);
}

/* ---- ways ---- */

/* A binary heap of cells by what a way through them costs at least. */
typedef struct {
    struct {
        float cost;
        uint32_t cell;
    } * at;
    size_t count, capacity;
} heap;

static bool push(heap *h, float cost, uint32_t cell)
{
    if (h->count == h->capacity) {
        size_t capacity = h->capacity > 0 ? 2 * h->capacity : 1 << 12;
        void *larger = realloc(h->at, capacity * sizeof *h->at);
        if (larger == NULL) return false;
        h->at = larger, h->capacity = capacity;
    }
    size_t i = h->count++;
    for (; i > 0 && h->at[(i - 1) / 2].cost > cost; i = (i - 1) / 2)
        h->at[i] = h->at[(i - 1) / 2];
    h->at[i].cost = cost, h->at[i].cell = cell;
    return true;
}

static uint32_t pop(heap *h)
{
    uint32_t cell = h->at[0].cell;
    size_t last = --h->count, i = 0;
    for (;;) {
        size_t child = 2 * i + 1;
        if (child >= h->count) break;
        if (child + 1 < h->count && h->at[child + 1].cost < h->at[child].cost) child++;
        if (h->at[child].cost >= h->at[last].cost) break;
        h->at[i] = h->at[child];
        i = child;
    }
    h->at[i] = h->at[last];
    return cell;
}

/* A search in hand: A*, with the straight line as the estimate. */
typedef struct {
    const rend_space *space;
    double eye_m;
    size_t goal[3];
    float *cost;    /* [cells], owned: of the best way so far */
    uint32_t *from; /* [cells], owned: the cell before on it */
    bool *closed;   /* [cells], owned */
    heap open;
} search;

static float estimate(const search *s, size_t cell)
{
    size_t at[3];
    float sum = 0;
    split(s->space, cell, at);
    for (int a = 0; a < 3; a++) {
        float d = (float)at[a] - (float)s->goal[a];
        sum += d * d;
    }
    return sqrtf(sum);
}

static bool visit(search *s, size_t cell, size_t neighbour, float step)
{
    float cost = s->cost[cell] + step * rend_space_cost(s->space, neighbour, s->eye_m);
    if (s->closed[neighbour] || cost >= s->cost[neighbour]) return true;
    s->cost[neighbour] = cost;
    s->from[neighbour] = (uint32_t)cell;
    return push(&s->open, cost + estimate(s, neighbour), (uint32_t)neighbour);
}

static bool visit_neighbours(search *s, size_t cell)
{
    for (int n = 0; n < 27; n++) {
        size_t next;
        int axes = (n % 3 != 1) + (n / 3 % 3 != 1) + (n / 9 != 1);
        if (neighbour_at(s->space, cell, n, &next) && !visit(s, cell, next, sqrtf((float)axes)))
            return false;
    }
    return true;
}

static bool search_way(search *s, size_t from, size_t to)
{
    s->cost[from] = 0;
    if (!push(&s->open, 0, (uint32_t)from)) return false;
    while (s->open.count > 0) {
        uint32_t cell = pop(&s->open);
        if (cell == to) return true;
        if (s->closed[cell]) continue;
        s->closed[cell] = true;
        if (!visit_neighbours(s, cell)) return false;
    }
    return true;
}

/* From the end back to the start. */
static bool collect(const search *s, size_t from, size_t to, size_t **cells, size_t *count)
{
    size_t n = 1;
    for (size_t c = to; c != from; c = s->from[c])
        n++;
    *cells = malloc(n * sizeof **cells);
    if (*cells == NULL) return false;
    *count = n;
    for (size_t c = to; n > 0; c = s->from[c])
        (*cells)[--n] = c;
    return true;
}

bool rend_space_route(const rend_space *space, size_t from, size_t to, double eye_m, size_t **cells,
                      size_t *count, mospt_err *err)
{
    size_t all = rend_space_cells(space);
    search s = {.space = space, .eye_m = eye_m};
    split(space, to, s.goal);
    s.cost = malloc(all * sizeof *s.cost);
    s.from = calloc(all, sizeof *s.from);
    s.closed = calloc(all, sizeof *s.closed);
    bool ok = s.cost != NULL && s.from != NULL && s.closed != NULL;
    for (size_t c = 0; ok && c < all; c++)
        s.cost[c] = INFINITY;
    ok = ok && search_way(&s, from, to) && collect(&s, from, to, cells, count);
    free(s.cost), free(s.from), free(s.closed), free(s.open.at);
    return ok || mospt_err_nomem(err, 9 * all);
}
