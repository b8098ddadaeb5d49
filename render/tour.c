#include "render/tour.h"

#include "render/outline.h"
#include "render/space.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ORBIT_KEYS = 36, PLACES_MAX = 7, DENSE_LEVELS = 1, PART_LEVELS = 2 };
#define PI 3.14159265358979323846
#define FOV_RAD (60 * PI / 180)
#define ORBIT_S 30.0
#define EYE_M 1.65
#define WALK_M_PER_S 1.4
#define LONGEST_S 300.0
#define SAME_PLACE_M 0.5 /* scans of one setup */
#define SMOOTH_M 1.5     /* corners are cut this much */
#define KEY_M 2.5        /* between two keyframes */
#define LOOK_AHEAD_M 5.0
#define PLACES_APART_M 4.0
#define AROUND_M 12.0 /* of the places: ways around */

static double distance3(const double a[3], const double b[3])
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

/* ---- around ---- */

/* A circle that the eye moves on, looking at its target from a fixed height. */
typedef struct {
    double centre[3]; /* the target, metres from the middle of the outline */
    double eye_m;     /* from the target */
    double tx, ty;    /* tangents of half the field of view, less a margin */
} circle;

enum { AROUND_STEPS = 19, ROUNDS = 8, OUTLINE_MOST = 1 << 14, OUTSIDE = 1000 };
#define PITCH_RAD (34 * PI / 180)

/* The centre of the smallest circle around the site (Badoiu and Clarkson 2003). */
static void find_axis(const rend_outline *site, circle *c)
{
    enum { STEPS = 200 };
    for (int i = 1; i <= STEPS; i++) {
        const double *farthest = site->at[0];
        double most = -1;
        for (uint32_t p = 0; p < site->count; p++) {
            double x = site->at[p][0] - c->centre[0], y = site->at[p][1] - c->centre[1];
            if (x * x + y * y > most) most = x * x + y * y, farthest = site->at[p];
        }
        c->centre[0] += (farthest[0] - c->centre[0]) / (i + 1);
        c->centre[1] += (farthest[1] - c->centre[1]) / (i + 1);
    }
}

/* How far away the eye must be for a point to stay in the picture all the way around, and how far
 * up and down in the picture it comes, as tangents. */
static void follow(const circle *c, const double p[3], double *eye_m, double *top, double *bottom)
{
    double r = hypot(p[0] - c->centre[0], p[1] - c->centre[1]), h = p[2] - c->centre[2];
    *eye_m = *top = *bottom = -INFINITY;
    for (int i = 0; i < AROUND_STEPS; i++) {
        double turn = PI * i / (AROUND_STEPS - 1), along = r * cos(turn), x = r * sin(turn);
        double y = h * cos(PITCH_RAD) - along * sin(PITCH_RAD),
               z = h * sin(PITCH_RAD) + along * cos(PITCH_RAD);
        double tangent = y / fmax(c->eye_m - z, 1e-3 * c->eye_m);
        *eye_m = fmax(*eye_m, z + fmax(x / c->tx, fabs(y) / c->ty));
        *top = fmax(*top, tangent);
        *bottom = fmax(*bottom, -tangent);
    }
}

static int compare_reals(const void *a, const void *b)
{
    double m = *(const double *)a, n = *(const double *)b;
    return m < n ? -1 : m > n;
}

/* Moves the eye as near as it can be, and the circle up or down until the site is in the middle of
 * the picture. One point in a thousand may fall outside.
 * room     [3 * OUTLINE_MOST] */
static void fit_circle(const rend_outline *site, double *room, circle *c)
{
    uint32_t stride = (site->count + OUTLINE_MOST - 1) / OUTLINE_MOST, n = 0;
    double *eye_m = room, *top = room + OUTLINE_MOST, *bottom = top + OUTLINE_MOST;
    for (uint32_t p = 0; p < site->count; p += stride, n++)
        follow(c, site->at[p], &eye_m[n], &top[n], &bottom[n]);
    for (int i = 0; i < 3; i++)
        qsort(room + (size_t)i * OUTLINE_MOST, n, sizeof *room, compare_reals);
    uint32_t last = n - 1 - n / OUTSIDE;
    bool first = c->eye_m == 0;
    if (!first) c->centre[2] += 0.5 * (top[last] - bottom[last]) * c->eye_m / cos(PITCH_RAD);
    c->eye_m = eye_m[last];
}

static bool add_circle(const rend_outline *site, const circle *c, rend_path *path, mospt_err *err)
{
    bool is_long = site->high[1] - site->low[1] > 1.3 * (site->high[0] - site->low[0]);
    for (int i = 0; i <= ORBIT_KEYS; i++) {
        double turn = (is_long ? -160 : -110) * PI / 180 + 2 * PI * i / ORBIT_KEYS;
        const double back[3] = {cos(turn) * cos(PITCH_RAD), sin(turn) * cos(PITCH_RAD),
                                sin(PITCH_RAD)};
        rend_key key = {.time_s = ORBIT_S * i / ORBIT_KEYS,
                        .camera = {.up = {0, 0, 1}, .fov_rad = FOV_RAD}};
        for (int a = 0; a < 3; a++) {
            key.camera.target[a] = site->middle[a] + c->centre[a];
            key.camera.eye[a] = key.camera.target[a] + c->eye_m * back[a];
        }
        if (!rend_path_add(path, &key, NULL, err)) return false;
    }
    return true;
}

bool rend_tour_orbit(const mospt_dataset *dataset, double aspect, rend_path *out, mospt_err *err)
{
    enum { MARGIN_PERCENT = 8 };
    rend_outline site;
    rend_path path = {0};
    circle c = {.ty = tan(0.5 * FOV_RAD) * (1 - 0.01 * MARGIN_PERCENT)};
    c.tx = c.ty * aspect;
    double *room = malloc(3 * OUTLINE_MOST * sizeof *room);
    if (room == NULL) return mospt_err_nomem(err, 3 * OUTLINE_MOST * sizeof *room);
    if (!rend_outline_make(dataset, &site, err)) return free(room), false;
    find_axis(&site, &c);
    for (int i = 0; i < ROUNDS; i++)
        fit_circle(&site, room, &c);
    c.eye_m = fmax(c.eye_m, 16 * dataset->metadata.grid.step);
    bool ok = add_circle(&site, &c, &path, err);
    rend_outline_fini(&site);
    free(room);
    if (ok) *out = path;
    else rend_path_fini(&path);
    return ok;
}

/* ---- places to walk to ---- */

typedef struct {
    double (*at)[3]; /* [count], owned */
    size_t count, capacity;
} places;

static bool add_place(places *p, const double at[3], mospt_err *err)
{
    if (p->count == p->capacity) {
        size_t capacity = p->capacity > 0 ? 2 * p->capacity : 256;
        void *larger = realloc(p->at, capacity * sizeof *p->at);
        if (larger == NULL) return mospt_err_nomem(err, capacity * sizeof *p->at);
        p->at = larger, p->capacity = capacity;
    }
    memcpy(p->at[p->count++], at, sizeof *p->at);
    return true;
}

/* Where the scanner stood, in the order of the scans. */
static bool find_scan_positions(const mospt_dataset *dataset, places *out, mospt_err *err)
{
    const mospt_metadata *m = &dataset->metadata;
    for (uint32_t i = 0; i < m->source_count; i++) {
        const double *pose = m->sources[i].pose;
        const double at[3] = {pose[3], pose[7], pose[11]};
        bool inside = m->sources[i].has_pose;
        for (int a = 0; a < 3; a++)
            inside = inside && at[a] >= m->low[a] && at[a] <= m->high[a];
        for (size_t j = 0; inside && j < out->count; j++)
            inside = distance3(out->at[j], at) > SAME_PLACE_M;
        if (inside && !add_place(out, at, err)) return false;
    }
    return true;
}

/* Level of the finest node around a place: where a scanner stood, points are dense and nodes small.
 */
static uint32_t level_at(const mospt_dataset *dataset, const double world[3])
{
    const mospt_hierarchy *h = &dataset->hierarchy;
    uint32_t g[3], node = 0;
    if (!mospt_grid_from_world(&dataset->metadata.grid, world, g)) return 0;
    for (uint32_t c = 0; c < h->nodes[node].child_count;) {
        const mospt_node *child = &h->nodes[h->nodes[node].first_child + c];
        bool inside = mospt_cell_contains(&dataset->metadata.grid, child->corner, child->level,
                                          g[0], g[1], g[2]);
        if (inside) node = h->nodes[node].first_child + c;
        c = inside ? 0 : c + 1;
    }
    return h->nodes[node].level;
}

/* Where one can walk and the floor is as densely scanned as almost nowhere else. */
static bool find_dense_places(const mospt_dataset *dataset, const rend_space *space, places *out,
                              mospt_err *err)
{
    uint8_t *on_foot = NULL;
    uint32_t deepest = 0;
    bool ok = rend_space_walkable(space, EYE_M, &on_foot, err);
    for (size_t c = 0; ok && c < rend_space_cells(space); c++) {
        double at[3], floor[3];
        if (!on_foot[c]) continue;
        rend_space_middle(space, c, at);
        memcpy(floor, at, sizeof floor);
        floor[2] -= space->floor[c] * space->cell_m;
        uint32_t level = level_at(dataset, floor);
        if (level > deepest + DENSE_LEVELS) out->count = 0;
        if (level > deepest) deepest = level;
        if (level + DENSE_LEVELS >= deepest) ok = add_place(out, at, err);
    }
    free(on_foot);
    return ok;
}

/* Keeps a few places far from each other: each the farthest from those before. */
static void thin_out(places *p)
{
    size_t kept = 1, middle = p->count / 2;
    if (p->count == 0) return;
    for (int a = 0; a < 3; a++) {
        double swapped = p->at[0][a];
        p->at[0][a] = p->at[middle][a], p->at[middle][a] = swapped;
    }
    while (kept < PLACES_MAX) {
        size_t farthest = 0;
        double most = PLACES_APART_M;
        for (size_t i = kept; i < p->count; i++) {
            double nearest = INFINITY;
            for (size_t k = 0; k < kept; k++)
                nearest = fmin(nearest, distance3(p->at[i], p->at[k]));
            if (nearest > most) most = nearest, farthest = i;
        }
        if (farthest == 0) break;
        for (int a = 0; a < 3; a++) {
            double swapped = p->at[kept][a];
            p->at[kept][a] = p->at[farthest][a], p->at[farthest][a] = swapped;
        }
        kept++;
    }
    p->count = kept;
}

/* From each place on to the nearest that is left. */
static void order(places *p)
{
    for (size_t i = 0; i + 2 < p->count; i++) {
        size_t nearest = i + 1;
        for (size_t j = i + 2; j < p->count; j++)
            if (distance3(p->at[i], p->at[j]) < distance3(p->at[i], p->at[nearest])) nearest = j;
        for (int a = 0; a < 3; a++) {
            double swapped = p->at[i + 1][a];
            p->at[i + 1][a] = p->at[nearest][a], p->at[nearest][a] = swapped;
        }
    }
}

/* ---- the walk ---- */

/* Appends the way from place to place, cell by cell. */
static bool walk(const rend_space *space, const places *stops, places *way, mospt_err *err)
{
    for (size_t i = 0; i + 1 < stops->count; i++) {
        size_t *cells = NULL, count = 0, from = rend_space_cell(space, stops->at[i]),
               to = rend_space_cell(space, stops->at[i + 1]);
        bool ok = rend_space_route(space, from, to, EYE_M, &cells, &count, err);
        for (size_t c = i > 0; ok && c < count; c++) {
            double at[3];
            rend_space_middle(space, cells[c], at);
            ok = add_place(way, at, err);
        }
        free(cells);
        if (!ok) return false;
    }
    return true;
}

static float cost_at(const rend_space *space, const double at[3])
{
    return rend_space_cost(space, rend_space_cell(space, at), EYE_M);
}

/* The mean of the points around one. */
static void mean_of(const places *way, size_t from, size_t to, double out[3])
{
    for (int a = 0; a < 3; a++) {
        out[a] = 0;
        for (size_t j = from; j <= to; j++)
            out[a] += way->at[j][a] / (double)(to + 1 - from);
    }
}

/* Cells make a zigzag: each point becomes the mean of those around it, of fewer towards the ends
 * and where the mean would lie beside the free space. */
static bool smooth(const rend_space *space, places *way, mospt_err *err)
{
    size_t reach = (size_t)(SMOOTH_M / space->cell_m) + 1;
    double(*means)[3] = calloc(way->count, sizeof *means);
    if (means == NULL) return mospt_err_nomem(err, way->count * sizeof *means);
    for (size_t i = 0; i < way->count; i++) {
        size_t r = reach;
        float cost = cost_at(space, way->at[i]);
        if (i < r) r = i;
        if (way->count - 1 - i < r) r = way->count - 1 - i;
        do
            mean_of(way, i - r, i + r, means[i]);
        while (cost_at(space, means[i]) > cost + 1 && r-- > 0);
    }
    free(way->at);
    way->at = means;
    way->capacity = way->count;
    return true;
}

/* The point so many metres further on, or the last one. */
static size_t ahead(const places *way, size_t from, double metres)
{
    double gone = 0;
    size_t i = from;
    for (; i + 1 < way->count && gone < metres; i++)
        gone += distance3(way->at[i], way->at[i + 1]);
    return i;
}

/* True if the straight line from point to point is as free as the way between them. */
static bool is_as_free(const rend_space *space, const places *way, size_t from, size_t to)
{
    const double *a = way->at[from], *b = way->at[to];
    float most = 0;
    for (size_t i = from; i <= to; i++)
        most = fmaxf(most, cost_at(space, way->at[i]));
    uint32_t steps = (uint32_t)(2 * distance3(a, b) / space->cell_m) + 1;
    for (uint32_t s = 1; s < steps; s++) {
        double at[3];
        for (int x = 0; x < 3; x++)
            at[x] = a[x] + (b[x] - a[x]) * s / steps;
        if (cost_at(space, at) > most + 1) return false;
    }
    return true;
}

/* Where the next keyframe is: nearer where the curve would cut a corner. */
static size_t next_key(const rend_space *space, const places *way, size_t from)
{
    size_t next = ahead(way, from, KEY_M);
    while (next > from + 1 && !is_as_free(space, way, from, next))
        next = from + (next - from) / 2;
    return next;
}

static bool make_keys(const rend_space *space, const places *way, rend_path *path, mospt_err *err)
{
    double gone = 0, towards[3] = {1, 0, 0};
    for (size_t i = 0, next; i < way->count; i = next) {
        rend_key key = {.time_s = gone / WALK_M_PER_S,
                        .camera = {.up = {0, 0, 1}, .fov_rad = FOV_RAD}};
        size_t look = ahead(way, i, LOOK_AHEAD_M);
        for (int a = 0; a < 3; a++)
            key.camera.eye[a] = way->at[i][a];
        /* Towards the end there is nothing ahead: keep looking that way. The gaze is level enough
         * to see where the way goes on. */
        if (distance3(way->at[i], way->at[look]) > LOOK_AHEAD_M / 2)
            for (int a = 0; a < 3; a++)
                towards[a] = (way->at[look][a] - way->at[i][a]) * (a == 2 ? 0.5 : 1);
        for (int a = 0; a < 3; a++)
            key.camera.target[a] = key.camera.eye[a] + towards[a];
        if (!rend_path_add(path, &key, NULL, err)) return false;
        next = next_key(space, way, i);
        if (next == i) break;
        for (size_t j = i; j < next; j++)
            gone += distance3(way->at[j], way->at[j + 1]);
    }
    if (rend_path_duration(path) > LONGEST_S) rend_path_fit(path, LONGEST_S);
    return true;
}

/* ---- the part of the site to walk through ---- */

static void include(rend_box *box, const double at[3])
{
    for (int a = 0; a < 3; a++) {
        box->low[a] = fmin(box->low[a], at[a]);
        box->high[a] = fmax(box->high[a], at[a]);
    }
}

/* Around the places, or around all that is densely scanned. */
static rend_box part_around(const mospt_dataset *dataset, const places *stops)
{
    const mospt_hierarchy *h = &dataset->hierarchy;
    const mospt_grid *grid = &dataset->metadata.grid;
    rend_box part = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}}, all;
    uint32_t deepest = 0;
    for (uint32_t n = 0; n < h->count; n++)
        if (h->nodes[n].level > deepest) deepest = h->nodes[n].level;
    for (size_t i = 0; stops->count >= 2 && i < stops->count; i++)
        include(&part, stops->at[i]);
    for (uint32_t n = 0; stops->count < 2 && n < h->count; n++) {
        double low[3], high[3], width;
        if (deepest - h->nodes[n].level > PART_LEVELS) continue;
        width = (double)mospt_cell_width(grid, h->nodes[n].level) * grid->step;
        mospt_grid_to_world(grid, h->nodes[n].corner, low);
        for (int a = 0; a < 3; a++)
            high[a] = low[a] + width;
        include(&part, low), include(&part, high);
    }
    rend_outline_bounds(dataset, all.low, all.high);
    for (int a = 0; a < 3; a++) {
        part.low[a] = fmax(part.low[a] - AROUND_M, all.low[a]);
        part.high[a] = fmax(fmin(part.high[a] + AROUND_M, all.high[a]), part.low[a]);
    }
    return part;
}

static bool make_walk(const mospt_dataset *dataset, rend_path *path, mospt_err *err)
{
    places stops = {0}, way = {0};
    rend_space space = {0};
    bool ok = find_scan_positions(dataset, &stops, err);
    const rend_box part = part_around(dataset, &stops);
    ok = ok && rend_space_make(dataset, &part, &space, err);
    if (ok && stops.count < 2) {
        stops.count = 0;
        ok = find_dense_places(dataset, &space, &stops, err);
        if (ok) thin_out(&stops), order(&stops);
    }
    if (ok && stops.count < 2)
        ok = mospt_err_set(
            err, MOSPT_EINVAL, mospt_nowhere(),
            "there is no free way to walk through this site; --orbit turns around it");
    ok = ok && walk(&space, &stops, &way, err) && smooth(&space, &way, err) &&
         make_keys(&space, &way, path, err);
    free(stops.at), free(way.at);
    rend_space_fini(&space);
    return ok;
}

bool rend_tour_walk(const mospt_dataset *dataset, rend_path *out, mospt_err *err)
{
    rend_path path = {0};
    bool ok = make_walk(dataset, &path, err);
    if (ok) *out = path;
    else rend_path_fini(&path);
    return ok;
}
