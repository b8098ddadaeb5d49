#include "scripts/site_cast.h"

#include <stdlib.h>
#include <string.h>

/* Fall of the ground per square metre of distance from the middle: a knoll, 2 to 3 m high at 45 m.
 */
static const float ground_top = -0.55f, ground_fall_x = 0.0011f, ground_fall_y = 0.0016f;
static const float ground_radius = 52.0f;

struct site_node {
    float low[3], high[3];
    uint32_t first; /* inner node: left child, the right one follows; leaf: first solid */
    uint32_t count; /* solids of a leaf; 0: inner node */
};

typedef struct {
    site_vec origin, direction;
} ray;

typedef struct {
    float enter, leave; /* empty if enter > leave */
} interval;

void site_scene_fini(site_scene *scene)
{
    free(scene->solids);
    free(scene->openings);
    free(scene->nodes);
    *scene = (site_scene){0};
}

static bool reserve(void **items, size_t *capacity, size_t need, size_t size)
{
    if (need <= *capacity) return true;
    size_t more = need * 2 + 64;
    void *grown = realloc(*items, more * size);
    if (grown == NULL) return false;
    *items = grown;
    *capacity = more;
    return true;
}

void site_scene_add(site_scene *scene, const site_solid *solid, const site_opening *openings,
                    size_t count)
{
    void *solids = scene->solids, *cuts = scene->openings;
    bool ok = reserve(&solids, &scene->solid_capacity, scene->solid_count + 1, sizeof *solid);
    ok = reserve(&cuts, &scene->opening_capacity, scene->opening_count + count, sizeof *openings) &&
         ok;
    scene->solids = solids;
    scene->openings = cuts;
    if (!ok) {
        scene->failed = true;
        return;
    }
    site_solid *added = &scene->solids[scene->solid_count];
    *added = *solid;
    added->id = (uint32_t)scene->solid_count++;
    added->opening_first = (uint32_t)scene->opening_count;
    added->opening_count = (uint32_t)count;
    if (count != 0)
        memcpy(&scene->openings[scene->opening_count], openings, count * sizeof *openings);
    scene->opening_count += count;
}

/* --- the tree: binned surface-area heuristic, 16 bins along the widest axis of the centres --- */

enum { BINS = 16, LEAF_MAX = 4, DEPTH_MAX = 64 };

typedef struct {
    float low[3], high[3];
} bounds;

static bounds no_bounds(void)
{
    return (bounds){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
}

static void bounds_add(bounds *b, const bounds *other)
{
    for (int i = 0; i < 3; i++) {
        b->low[i] = site_min(b->low[i], other->low[i]);
        b->high[i] = site_max(b->high[i], other->high[i]);
    }
}

static float bounds_area(const bounds *b)
{
    float x = b->high[0] - b->low[0], y = b->high[1] - b->low[1], z = b->high[2] - b->low[2];
    return x < 0 ? 0 : x * y + y * z + z * x;
}

static bounds solid_bounds(const site_solid *solid)
{
    site_vec h = solid->half;
    if (solid->shape == SITE_FRUSTUM) h.x = h.y = site_max(solid->half.x, solid->half.y);
    if (solid->shape == SITE_BALL) h = site_v(h.x, h.x, h.x);
    if (solid->shape == SITE_DISC) h = site_v(h.x, h.x, 0);
    const site_frame *f = &solid->frame;
    const float o[3] = {f->origin.x, f->origin.y, f->origin.z};
    const float e[3] = {
        fabsf(f->x.x) * h.x + fabsf(f->y.x) * h.y + fabsf(f->z.x) * h.z,
        fabsf(f->x.y) * h.x + fabsf(f->y.y) * h.y + fabsf(f->z.y) * h.z,
        fabsf(f->x.z) * h.x + fabsf(f->y.z) * h.y + fabsf(f->z.z) * h.z,
    };
    bounds b;
    for (int i = 0; i < 3; i++) {
        b.low[i] = o[i] - e[i] - 1e-4f;
        b.high[i] = o[i] + e[i] + 1e-4f;
    }
    return b;
}

static float centre_of(const site_solid *solid, int axis)
{
    const float o[3] = {solid->frame.origin.x, solid->frame.origin.y, solid->frame.origin.z};
    return o[axis];
}

static int bin_of(float centre, float low, float per_metre)
{
    int bin = (int)((centre - low) * per_metre);
    return bin < 0 ? 0 : bin >= BINS ? BINS - 1 : bin;
}

/* Bin after which to split, or -1 where no split pays. */
static int best_split(const bounds *bin, const uint32_t *count, uint32_t total)
{
    float right_cost[BINS];
    bounds b = no_bounds();
    uint32_t n = 0;
    for (int i = BINS - 1; i > 0; i--) {
        bounds_add(&b, &bin[i]);
        n += count[i];
        right_cost[i - 1] = n == 0 ? INFINITY : bounds_area(&b) * (float)n;
    }
    b = no_bounds();
    n = 0;
    int best = -1;
    float best_cost = INFINITY;
    for (int i = 0; i < BINS - 1; i++) {
        bounds_add(&b, &bin[i]);
        n += count[i];
        float cost = bounds_area(&b) * (float)n + right_cost[i];
        if (n != 0 && n != total && cost < best_cost) {
            best_cost = cost;
            best = i;
        }
    }
    return best;
}

/* Puts the solids of the left child first and returns their number; 0: keep them together. */
static uint32_t split(site_solid *solids, uint32_t count)
{
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++) {
            low[a] = site_min(low[a], centre_of(&solids[i], a));
            high[a] = site_max(high[a], centre_of(&solids[i], a));
        }
    }
    int axis = 0;
    for (int a = 1; a < 3; a++)
        if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
    if (!(high[axis] > low[axis])) return 0;

    float per_metre = (float)BINS / (high[axis] - low[axis]);
    bounds bin[BINS];
    uint32_t in_bin[BINS] = {0};
    for (int i = 0; i < BINS; i++)
        bin[i] = no_bounds();
    for (uint32_t i = 0; i < count; i++) {
        int b = bin_of(centre_of(&solids[i], axis), low[axis], per_metre);
        bounds s = solid_bounds(&solids[i]);
        bounds_add(&bin[b], &s);
        in_bin[b]++;
    }
    int at = best_split(bin, in_bin, count);
    if (at < 0) return 0;
    uint32_t left = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (bin_of(centre_of(&solids[i], axis), low[axis], per_metre) > at) continue;
        site_solid swap = solids[left];
        solids[left++] = solids[i];
        solids[i] = swap;
    }
    return left;
}

static void build_node(site_scene *scene, uint32_t index, uint32_t first, uint32_t count, int depth)
{
    bounds b = no_bounds();
    for (uint32_t i = first; i < first + count; i++) {
        bounds s = solid_bounds(&scene->solids[i]);
        bounds_add(&b, &s);
    }
    site_node *node = &scene->nodes[index];
    memcpy(node->low, b.low, sizeof node->low);
    memcpy(node->high, b.high, sizeof node->high);
    node->first = first;
    node->count = count;
    uint32_t left =
        count <= LEAF_MAX || depth == DEPTH_MAX - 2 ? 0 : split(&scene->solids[first], count);
    if (left == 0) return;
    node->first = scene->node_count;
    node->count = 0;
    scene->node_count += 2;
    build_node(scene, node->first, first, left, depth + 1);
    build_node(scene, node->first + 1, first + left, count - left, depth + 1);
}

bool site_scene_index(site_scene *scene, mospt_err *err)
{
    size_t nodes_max = 2 * scene->solid_count + 1;
    if (scene->failed) return mospt_err_nomem(err, scene->solid_count * sizeof *scene->solids);
    scene->nodes = calloc(nodes_max, sizeof *scene->nodes);
    if (scene->nodes == NULL) return mospt_err_nomem(err, nodes_max * sizeof *scene->nodes);
    scene->node_count = 1;
    build_node(scene, 0, 0, (uint32_t)scene->solid_count, 0);
    return true;
}

/* --- one ray against one solid, in the solid's frame --- */

static site_vec to_local(const site_frame *frame, site_vec v)
{
    return site_v(site_dot(v, frame->x), site_dot(v, frame->y), site_dot(v, frame->z));
}

static site_vec from_local(const site_frame *f, site_vec v)
{
    return site_add(site_add(site_mul(f->x, v.x), site_mul(f->y, v.y)), site_mul(f->z, v.z));
}

/* No direction is exactly parallel to a plane: 0/0 would be neither inside nor outside. */
static float not_zero(float d)
{
    return fabsf(d) > 1e-9f ? d : 1e-9f;
}

static interval in_slab(float origin, float direction, float low, float high)
{
    float a = (low - origin) / not_zero(direction), b = (high - origin) / not_zero(direction);
    return (interval){site_min(a, b), site_max(a, b)};
}

static interval in_circle(float x, float z, float dx, float dz, float radius)
{
    float a = not_zero(dx * dx + dz * dz), b = x * dx + z * dz, c = x * x + z * z - radius * radius;
    float d = b * b - a * c;
    if (d <= 0) return (interval){1, 0};
    d = sqrtf(d);
    return (interval){(-b - d) / a, (-b + d) / a};
}

static interval both(interval a, interval b)
{
    return (interval){site_max(a.enter, b.enter), site_min(a.leave, b.leave)};
}

/* Union of two intervals of a convex outline: they touch wherever neither is empty. */
static interval either(interval a, interval b)
{
    if (a.enter > a.leave) return b;
    if (b.enter > b.leave) return a;
    return (interval){site_min(a.enter, b.enter), site_max(a.leave, b.leave)};
}

/* An equilateral pointed arch is where two circles about the springers overlap; a round one is half
 * a circle. */
static interval in_opening(const site_opening *o, const ray *r)
{
    float x = r->origin.x - o->centre, z = r->origin.z, dx = r->direction.x, dz = r->direction.z;
    interval jambs =
        both(in_slab(x, dx, -o->half_width, o->half_width), in_slab(z, dz, o->sill, o->spring));
    interval head = in_slab(z, dz, o->spring, o->spring + 4 * o->half_width);
    if (o->head == SITE_ROUND_HEAD) {
        head = both(head, in_circle(x, z - o->spring, dx, dz, o->half_width));
    } else {
        head = both(head, in_circle(x - o->half_width, z - o->spring, dx, dz, 2 * o->half_width));
        head = both(head, in_circle(x + o->half_width, z - o->spring, dx, dz, 2 * o->half_width));
    }
    return either(jambs, head);
}

/* Normal of the reveal at a point on the outline, pointing into the opening. */
static site_vec reveal_normal(const site_opening *o, site_vec p)
{
    float x = p.x - o->centre, z = p.z - o->spring;
    if (z <= 0) {
        bool on_sill = p.z - o->sill < o->half_width - fabsf(x);
        return on_sill ? site_v(0, 0, 1) : site_v(x > 0 ? -1.0f : 1.0f, 0, 0);
    }
    if (o->head == SITE_ROUND_HEAD) return site_unit(site_v(-x, 0, -z));
    return site_unit(site_v(-x - (x > 0 ? o->half_width : -o->half_width), 0, -z));
}

static bool hit_box(const site_scene *scene, const site_solid *s, const ray *r, float reach,
                    float *t_out, site_vec *normal)
{
    const site_vec o = r->origin, d = r->direction, h = s->half;
    interval x = in_slab(o.x, d.x, -h.x, h.x), y = in_slab(o.y, d.y, -h.y, h.y),
             z = in_slab(o.z, d.z, -h.z, h.z);
    interval in = both(both(x, y), z);
    float t = site_max(in.enter, 0);
    if (t >= in.leave || t >= reach) return false;
    const site_opening *through = NULL, *openings = scene->openings + s->opening_first;
    for (uint32_t i = 0; i < s->opening_count; i++) {
        interval free_way = in_opening(&openings[i], r);
        if (t < free_way.enter || t >= free_way.leave) continue;
        t = free_way.leave;
        through = &openings[i];
        if (t >= in.leave || t >= reach) return false;
        i = UINT32_MAX; /* another opening may begin where this one ends */
    }
    if (t <= 0) return false;
    *t_out = t;
    if (through != NULL) *normal = reveal_normal(through, site_add(o, site_mul(d, t)));
    else if (x.enter >= y.enter && x.enter >= z.enter)
        *normal = site_v(d.x > 0 ? -1.0f : 1.0f, 0, 0);
    else if (y.enter >= z.enter) *normal = site_v(0, d.y > 0 ? -1.0f : 1.0f, 0);
    else *normal = site_v(0, 0, d.z > 0 ? -1.0f : 1.0f);
    return true;
}

static bool hit_frustum(const site_solid *s, const ray *r, float reach, float *t_out,
                        site_vec *normal)
{
    const site_vec o = r->origin, d = r->direction;
    const float h = s->half.z, mean = 0.5f * (s->half.x + s->half.y),
                slope = 0.5f * (s->half.y - s->half.x) / h;
    float best = reach;
    float a = not_zero(d.x * d.x + d.y * d.y - slope * slope * d.z * d.z);
    float radius = mean + slope * o.z;
    float b = o.x * d.x + o.y * d.y - radius * slope * d.z,
          c = o.x * o.x + o.y * o.y - radius * radius;
    float root = b * b - a * c;
    if (root > 0) {
        float t = (-b - sqrtf(root)) / a, z = o.z + t * d.z;
        if (t > 0 && t < best && fabsf(z) <= h) {
            best = t;
            site_vec p = site_add(o, site_mul(d, t));
            *normal = site_unit(site_v(p.x, p.y, -slope * (mean + slope * z)));
        }
    }
    float cap = (o.z > 0 ? h : -h), t = (cap - o.z) / not_zero(d.z);
    float x = o.x + t * d.x, y = o.y + t * d.y, cap_radius = mean + slope * cap;
    if (t > 0 && t < best && x * x + y * y <= cap_radius * cap_radius) {
        best = t;
        *normal = site_v(0, 0, o.z > 0 ? 1.0f : -1.0f);
    }
    *t_out = best;
    return best < reach;
}

static bool hit_ball(const site_solid *s, const ray *r, float reach, float *t_out, site_vec *normal)
{
    float b = site_dot(r->origin, r->direction);
    float root = b * b - site_dot(r->origin, r->origin) + s->half.x * s->half.x;
    if (root <= 0) return false;
    float t = -b - sqrtf(root);
    if (t <= 0 || t >= reach) return false;
    *t_out = t;
    *normal = site_unit(site_add(r->origin, site_mul(r->direction, t)));
    return true;
}

static bool hit_disc(const site_solid *s, const ray *r, float reach, float *t_out, site_vec *normal)
{
    float t = -r->origin.z / not_zero(r->direction.z);
    if (!(t > 0 && t < reach)) return false;
    float x = r->origin.x + t * r->direction.x, y = r->origin.y + t * r->direction.y;
    if (x * x + y * y > s->half.x * s->half.x) return false;
    *t_out = t;
    *normal = site_v(0, 0, r->direction.z > 0 ? -1.0f : 1.0f);
    return true;
}

/* `hit` may be NULL where only the distance counts. */
static bool hit_solid(const site_scene *scene, const site_solid *s, const ray *world, float reach,
                      site_hit *hit)
{
    ray r = {to_local(&s->frame, site_sub(world->origin, s->frame.origin)),
             to_local(&s->frame, world->direction)};
    float t = 0;
    site_vec normal = {0};
    bool met = s->shape == SITE_BOX       ? hit_box(scene, s, &r, reach, &t, &normal)
               : s->shape == SITE_FRUSTUM ? hit_frustum(s, &r, reach, &t, &normal)
               : s->shape == SITE_BALL    ? hit_ball(s, &r, reach, &t, &normal)
                                          : hit_disc(s, &r, reach, &t, &normal);
    if (!met || hit == NULL) return met;
    hit->t = t;
    hit->solid = s;
    hit->local = site_add(r.origin, site_mul(r.direction, t));
    hit->local_normal = normal;
    return true;
}

/* --- one ray against everything --- */

static inline float enter_node(const site_node *n, site_vec o, site_vec inverse, float reach)
{
    float x0 = (n->low[0] - o.x) * inverse.x, x1 = (n->high[0] - o.x) * inverse.x;
    float y0 = (n->low[1] - o.y) * inverse.y, y1 = (n->high[1] - o.y) * inverse.y;
    float z0 = (n->low[2] - o.z) * inverse.z, z1 = (n->high[2] - o.z) * inverse.z;
    float near_x = site_min(x0, x1), near_y = site_min(y0, y1), near_z = site_min(z0, z1);
    float far_x = site_max(x0, x1), far_y = site_max(y0, y1), far_z = site_max(z0, z1);
    float enter = site_max(site_max(near_x, near_y), site_max(near_z, 0.0f));
    float leave = site_min(site_min(far_x, far_y), site_min(far_z, reach));
    return enter <= leave ? enter : INFINITY;
}

/* Walks the tree, nearer child first. `hit` NULL: stop at the first solid met, which goes to
 * `*met`. */
static bool walk(const site_scene *scene, const ray *r, float reach, site_hit *hit,
                 const site_solid **met)
{
    struct {
        uint32_t node;
        float enter;
    } stack[DEPTH_MAX];
    const site_vec inverse = {1 / not_zero(r->direction.x), 1 / not_zero(r->direction.y),
                              1 / not_zero(r->direction.z)};
    bool found = false;
    int top = 0;
    stack[0].node = 0;
    stack[0].enter = enter_node(&scene->nodes[0], r->origin, inverse, reach);
    while (top >= 0) {
        uint32_t index = stack[top].node;
        if (stack[top--].enter >= reach) continue;
        const site_node *node = &scene->nodes[index];
        for (uint32_t i = 0; i < node->count; i++) {
            const site_solid *s = &scene->solids[node->first + i];
            if (!hit_solid(scene, s, r, reach, hit)) continue;
            found = true;
            *met = s;
            if (hit == NULL) return true;
            reach = hit->t;
        }
        if (node->count != 0) continue;
        float left = enter_node(node + (node->first - index), r->origin, inverse, reach);
        float right = enter_node(node + (node->first - index) + 1, r->origin, inverse, reach);
        bool left_first = left <= right;
        float farther = left_first ? right : left, nearer = left_first ? left : right;
        if (farther < reach) {
            stack[++top].node = node->first + (left_first ? 1 : 0);
            stack[top].enter = farther;
        }
        if (nearer < reach) {
            stack[++top].node = node->first + (left_first ? 0 : 1);
            stack[top].enter = nearer;
        }
    }
    return found;
}

float site_ground(float x, float y)
{
    return ground_top - ground_fall_x * x * x - ground_fall_y * y * y;
}

static bool hit_ground(const ray *r, float reach, float *t_out)
{
    const site_vec o = r->origin, d = r->direction;
    float a = ground_fall_x * d.x * d.x + ground_fall_y * d.y * d.y;
    float b = 0.5f * d.z + ground_fall_x * o.x * d.x + ground_fall_y * o.y * d.y;
    float c = o.z - site_ground(o.x, o.y), root = b * b - a * c;
    if (root < 0) return false;
    /* The form that does not cancel: b < 0 for every ray that comes down on the ground from above.
     */
    float t = c / (-b + sqrtf(root));
    if (!(t > 0 && t < reach)) return false;
    float x = o.x + t * d.x, y = o.y + t * d.y;
    *t_out = t;
    return x * x + y * y < ground_radius * ground_radius;
}

bool site_cast(const site_scene *scene, site_vec origin, site_vec direction, float reach,
               const site_solid **hint, site_hit *out)
{
    ray r = {origin, direction};
    bool found = hit_ground(&r, reach, &out->t);
    out->solid = NULL;
    if (found) reach = out->t;
    if (*hint != NULL && hit_solid(scene, *hint, &r, reach, out)) {
        found = true;
        reach = out->t;
    }
    const site_solid *met = NULL;
    if (walk(scene, &r, reach, out, &met)) found = true;
    *hint = out->solid;
    if (!found) return false;
    out->point = site_add(origin, site_mul(direction, out->t));
    if (out->solid != NULL) {
        out->normal = from_local(&out->solid->frame, out->local_normal);
        out->local = site_add(out->local, out->solid->texture);
    } else {
        site_vec up = {2 * ground_fall_x * out->point.x, 2 * ground_fall_y * out->point.y, 1};
        out->normal = out->local_normal = site_unit(up);
        out->local = out->point;
    }
    return true;
}

bool site_is_hidden(const site_scene *scene, site_vec origin, site_vec direction, float reach,
                    const site_solid **hint)
{
    ray r = {origin, direction};
    if (*hint != NULL && hit_solid(scene, *hint, &r, reach, NULL)) return true;
    return walk(scene, &r, reach, NULL, hint);
}
