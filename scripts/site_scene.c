#include "scripts/site_scene.h"

#include <string.h>

static const float pi = 3.14159265f;

typedef struct {
    site_scene *scene;
    uint32_t random;
} builder;

uint32_t site_random(uint32_t *state)
{
    uint32_t x = (*state += 0x9e3779b9u);
    x = (x ^ (x >> 16)) * 0x21f0aaadu;
    x = (x ^ (x >> 15)) * 0x735a2d97u;
    return x ^ (x >> 15);
}

static float uniform(builder *b, float low, float high)
{
    return low + (high - low) * (float)(site_random(&b->random) >> 8) * 0x1p-24f;
}

/* Roughly normal, never beyond 2. */
static float bell(builder *b)
{
    return uniform(b, -1, 1) + uniform(b, -0.5f, 0.5f) + uniform(b, -0.5f, 0.5f);
}

/* --- placing solids --- */

static site_frame level(float x, float y, float z, float yaw)
{
    return (site_frame){site_v(x, y, z), site_v(cosf(yaw), sinf(yaw), 0),
                        site_v(-sinf(yaw), cosf(yaw), 0), site_v(0, 0, 1)};
}

/* A frame whose z points along `up`, turned about it in an arbitrary but fixed way. */
static site_frame along(site_vec origin, site_vec up)
{
    site_vec z = site_unit(up), side = fabsf(z.z) < 0.9f ? site_v(0, 0, 1) : site_v(1, 0, 0);
    site_vec x = site_unit(site_sub(side, site_mul(z, site_dot(side, z))));
    site_vec y = {z.y * x.z - z.z * x.y, z.z * x.x - z.x * x.z, z.x * x.y - z.y * x.x};
    return (site_frame){origin, x, y, z};
}

static void add_box(builder *b, site_material material, site_frame frame, site_vec half)
{
    site_solid s = {.shape = SITE_BOX, .material = material, .frame = frame, .half = half};
    site_scene_add(b->scene, &s, NULL, 0);
}

/* A level box from its middle in plan, its bottom and its full size. */
static void add_block(builder *b, site_material material, float x, float y, float bottom,
                      site_vec size)
{
    site_solid s = {.shape = SITE_BOX, .material = material, .half = site_mul(size, 0.5f)};
    s.frame = level(x, y, bottom + s.half.z, 0);
    s.texture = s.frame.origin;
    site_scene_add(b->scene, &s, NULL, 0);
}

static void add_frustum(builder *b, site_material material, site_vec from, site_vec to,
                        float radius_from, float radius_to)
{
    site_vec way = site_sub(to, from);
    site_solid s = {.shape = SITE_FRUSTUM, .material = material};
    s.frame = along(site_mul(site_add(from, to), 0.5f), way);
    s.half = site_v(radius_from, radius_to, 0.5f * sqrtf(site_dot(way, way)));
    site_scene_add(b->scene, &s, NULL, 0);
}

static void add_leaf(builder *b, site_vec at, site_vec facing, float radius)
{
    site_solid s = {.shape = SITE_DISC, .material = SITE_LEAF, .half = site_v(radius, 0, 0)};
    s.frame = along(at, facing);
    site_scene_add(b->scene, &s, NULL, 0);
}

static site_vec any_direction(builder *b)
{
    for (;;) {
        site_vec v = {uniform(b, -1, 1), uniform(b, -1, 1), uniform(b, -1, 1)};
        float square = site_dot(v, v);
        if (square > 0.01f && square < 1) return site_unit(v);
    }
}

/* --- walls --- */

typedef struct {
    float along, top; /* metres from the wall's start, and above its base */
} crest;

typedef struct {
    float x0, y0, x1, y1, base, thickness;
    bool follows_ground; /* base counts from the ground below */
    float decay;         /* how deep stones are missing from the crest, metres */
    const crest *crests; /* [crest_count], along rising */
    size_t crest_count;
    const site_opening *openings; /* centre from the wall's start, heights absolute */
    size_t opening_count;
} wall;

static float crest_at(const wall *w, float at)
{
    size_t i = 1;
    while (i + 1 < w->crest_count && w->crests[i].along < at)
        i++;
    const crest *a = &w->crests[i - 1], *c = &w->crests[i];
    float part = (at - a->along) / (c->along - a->along);
    return a->top + (c->top - a->top) * site_min(site_max(part, 0), 1);
}

enum { WALL_OPENINGS_MAX = 8 };

/* One stone's length of wall from top to bottom. */
static void add_wall_part(builder *b, const wall *w, float from, float to, float length)
{
    float yaw = atan2f(w->y1 - w->y0, w->x1 - w->x0), middle = 0.5f * (from + to);
    float x = w->x0 + (w->x1 - w->x0) * middle / length,
          y = w->y0 + (w->y1 - w->y0) * middle / length;
    float floor = w->follows_ground ? site_ground(x, y) : 0;
    float missing = w->decay * uniform(b, 0, 1) * uniform(b, 0, 1);
    float top = w->base + floor + crest_at(w, middle) - missing, bottom = w->base + floor - 0.5f;
    if (top - bottom < 0.55f) return;

    site_solid s = {.shape = SITE_BOX, .material = SITE_MASONRY};
    s.half = site_v(0.5f * (to - from), 0.5f * w->thickness, 0.5f * (top - bottom));
    s.frame = level(x, y, bottom + s.half.z, yaw);
    /* Texture runs along the wall and starts anew with each, or corners would show the same joints.
     */
    s.texture = site_v(middle + 17.3f * w->x0, w->y0, s.frame.origin.z);
    site_opening openings[WALL_OPENINGS_MAX];
    size_t count = 0;
    for (size_t i = 0; i < w->opening_count && count < WALL_OPENINGS_MAX; i++) {
        site_opening o = w->openings[i];
        if (o.centre + o.half_width < from || o.centre - o.half_width > to) continue;
        o.centre -= middle;
        o.sill -= s.frame.origin.z;
        o.spring -= s.frame.origin.z;
        openings[count++] = o;
    }
    site_scene_add(b->scene, &s, openings, count);
}

static void add_wall(builder *b, const wall *w)
{
    float length = hypotf(w->x1 - w->x0, w->y1 - w->y0);
    int parts = (int)ceilf(length / 0.32f);
    for (int i = 0; i < parts; i++)
        add_wall_part(b, w, length * (float)i / (float)parts,
                      length * (float)(i + 1) / (float)parts, length);
}

#define COUNT(array) (sizeof(array) / sizeof *(array))

/* --- the chapel --- */

static void add_west_front(builder *b)
{
    const crest crests[] = {{0, 5.2f}, {4.4f, 8.6f}, {6.3f, 7.0f}, {7.2f, 5.9f}, {8.8f, 5.2f}};
    const site_opening openings[] = {
        {SITE_ROUND_HEAD, 4.4f, 1.05f, 0.0f, 2.3f},
        {SITE_ROUND_HEAD, 4.4f, 0.75f, 5.5f, 5.9f},
        {SITE_POINTED_HEAD, 1.9f, 0.3f, 1.6f, 2.9f},
        {SITE_POINTED_HEAD, 6.9f, 0.3f, 1.6f, 2.9f},
    };
    add_wall(b, &(wall){-9.4f, 4.4f, -9.4f, -4.4f, 0, 0.8f, false, 0.5f, crests, COUNT(crests),
                        openings, COUNT(openings)});
    for (int i = 0; i < 4; i++)
        add_block(b, SITE_ASHLAR, -10.0f - 0.18f * (float)i, 0, -1.2f,
                  site_v(0.5f + 0.36f * (float)i, 3.2f + 0.5f * (float)i, 1.2f - 0.16f * (float)i));
    for (float side = -1; side < 2; side += 2) /* buttresses */
        for (int step = 0; step < 3; step++)
            add_block(b, SITE_ASHLAR, -10.1f + 0.12f * (float)step, 3.9f * side, -1.2f,
                      site_v(0.9f - 0.24f * (float)step, 0.8f, 3.0f + 1.5f * (float)step));
}

static void add_long_walls(builder *b)
{
    const crest south[] = {{0, 5.2f},     {8.6f, 5.2f},  {9.8f, 4.4f},
                           {11.0f, 4.2f}, {12.4f, 2.9f}, {14.4f, 3.6f}};
    const crest north[] = {{0, 5.2f},    {3.4f, 5.2f},  {4.6f, 3.9f},  {5.6f, 1.6f}, {8.4f, 0.6f},
                           {9.6f, 1.3f}, {10.6f, 3.1f}, {12.0f, 4.5f}, {14.4f, 5.0f}};
    const site_opening windows[] = {
        {SITE_POINTED_HEAD, 2.4f, 0.55f, 1.3f, 3.1f},
        {SITE_POINTED_HEAD, 5.6f, 0.55f, 1.3f, 3.1f},
        {SITE_POINTED_HEAD, 8.8f, 0.55f, 1.3f, 3.1f},
        {SITE_POINTED_HEAD, 12.0f, 0.55f, 1.3f, 3.1f},
    };
    add_wall(b, &(wall){-9.0f, -4.0f, 5.4f, -4.0f, 0, 0.8f, false, 0.6f, south, COUNT(south),
                        windows, COUNT(windows)});
    add_wall(b, &(wall){-9.0f, 4.0f, 5.4f, 4.0f, 0, 0.8f, false, 0.8f, north, COUNT(north), windows,
                        COUNT(windows)});
    for (int i = 0; i < 4; i++) { /* buttresses between the southern windows */
        float x = -8.2f + 3.2f * (float)(i + 1);
        add_block(b, SITE_ASHLAR, x, -4.75f, -1.2f, site_v(0.6f, 0.9f, i < 2 ? 4.2f : 3.1f));
        add_block(b, SITE_ASHLAR, x, -4.6f, -1.2f, site_v(0.6f, 0.5f, i < 2 ? 5.4f : 3.7f));
    }
    add_block(b, SITE_ASHLAR, -2.0f, 0, -1.4f, site_v(15.4f, 9.2f, 1.25f)); /* plinth */
    add_block(b, SITE_PAVING, -1.8f, 0, -0.6f, site_v(14.6f, 7.4f, 0.6f));
}

static void add_choir(builder *b)
{
    const crest crests[] = {{0, 5.0f},    {1.4f, 6.4f}, {4.4f, 8.1f},
                            {5.6f, 7.4f}, {6.6f, 6.9f}, {8.8f, 4.6f}};
    const site_opening arch[] = {{SITE_ROUND_HEAD, 4.4f, 2.4f, 0.0f, 3.0f}};
    add_wall(b, &(wall){5.8f, -4.4f, 5.8f, 4.4f, 0, 0.8f, false, 0.7f, crests, COUNT(crests), arch,
                        COUNT(arch)});
    enum { CHORDS = 11 };
    for (int i = 0; i < CHORDS; i++) {
        float a = pi * ((float)i / CHORDS - 0.5f), c = pi * ((float)(i + 1) / CHORDS - 0.5f);
        float high = i < 4 ? 3.9f - 0.3f * (float)i : i < 7 ? 1.6f + 0.2f * (float)i : 4.4f;
        float length = hypotf(3.4f * (cosf(c) - cosf(a)), 3.4f * (sinf(c) - sinf(a)));
        const crest flat[] = {{0, high}, {length, high}};
        const site_opening window[] = {{SITE_ROUND_HEAD, 0.5f * length, 0.28f, 1.3f, 2.5f}};
        add_wall(b, &(wall){6.1f + 3.4f * cosf(a), 3.4f * sinf(a), 6.1f + 3.4f * cosf(c),
                            3.4f * sinf(c), -0.6f, 0.7f, false, 0.7f, flat, 2, window,
                            i % 3 == 1 ? 1 : 0});
    }
    for (int i = 0; i < 3; i++)
        add_block(b, SITE_PAVING, 6.6f + 0.2f * (float)i, 0, -0.8f,
                  site_v(3.4f - 0.4f * (float)i, 5.4f - 0.5f * (float)i, 0.95f + 0.15f * (float)i));
    add_block(b, SITE_ASHLAR, 7.4f, 0, 0.4f, site_v(0.8f, 1.7f, 0.9f)); /* altar */
    add_block(b, SITE_ASHLAR, 7.4f, 0, 1.3f, site_v(1.0f, 2.0f, 0.14f));
}

static void add_column(builder *b, float x, float y, float height)
{
    bool whole = height >= 2.8f;
    add_block(b, SITE_ASHLAR, x, y, -0.1f, site_v(0.72f, 0.72f, 0.28f));
    add_frustum(b, SITE_ASHLAR, site_v(x, y, 0.18f), site_v(x, y, 0.34f), 0.35f, 0.28f);
    float top = whole ? 2.55f : height;
    add_frustum(b, SITE_ASHLAR, site_v(x, y, 0.34f), site_v(x, y, top), 0.27f, 0.27f - 0.02f * top);
    if (!whole) return;
    add_frustum(b, SITE_ASHLAR, site_v(x, y, 2.55f), site_v(x, y, 2.85f), 0.23f, 0.4f);
    add_block(b, SITE_ASHLAR, x, y, 2.85f, site_v(0.76f, 0.76f, 0.17f));
}

static void add_arcades(builder *b)
{
    enum { COLUMNS = 4 };
    const float north_heights[COLUMNS] = {3, 1.9f, 0.9f, 2.3f};
    site_opening arches[COLUMNS + 1];
    for (int i = 0; i <= COLUMNS; i++)
        arches[i] = (site_opening){SITE_ROUND_HEAD, 1.4f + 2.8f * (float)i, 1.12f, 2.0f, 3.02f};
    const crest crests[] = {{0, 1.85f}, {8.6f, 1.75f}, {9.8f, 1.35f}, {10.4f, 0.6f}, {14.0f, 0.2f}};
    add_wall(b, &(wall){-9.0f, -1.9f, 2.6f, -1.9f, 3.02f + 0.5f, 0.5f, false, 0.3f, crests,
                        COUNT(crests), arches, COLUMNS + 1});
    for (int i = 0; i < COLUMNS; i++) {
        float x = -6.2f + 2.8f * (float)i;
        add_column(b, x, -1.9f, 3);
        add_column(b, x, 1.9f, north_heights[i]);
    }
    for (int i = 0; i < 6; i++) { /* fallen drums */
        site_vec at = {uniform(b, -3.5f, 3.5f), uniform(b, 0.2f, 3.0f), 0.26f};
        float yaw = uniform(b, 0, 2 * pi);
        site_vec half = {0.33f * cosf(yaw), 0.33f * sinf(yaw), 0};
        add_frustum(b, SITE_ASHLAR, site_sub(at, half), site_add(at, half), 0.26f, 0.25f);
    }
}

/* What is left of the roof: tiles over the western bay, and bare rafters. */
static void add_roof(builder *b)
{
    const float eaves = 5.25f, ridge = 8.5f, reach = 4.75f;
    const float rise = atan2f(ridge - eaves, reach), slope = hypotf(reach, ridge - eaves);
    for (float side = -1; side < 2; side += 2) {
        site_vec down = {0, side * cosf(rise), -sinf(rise)},
                 out = {0, side * sinf(rise), cosf(rise)};
        for (int i = 0; i < 13; i++) {
            float x = -9.0f + 0.3f * (float)i, worn = (float)i / 13;
            float length = slope * (1 - worn * worn * uniform(b, 0.1f, 0.6f));
            float start = i > 7 ? uniform(b, 0, 0.5f) : 0;
            site_vec middle = site_add(site_v(x, 0, ridge), site_mul(down, start + 0.5f * length));
            site_frame frame = {middle, site_v(1, 0, 0), site_mul(down, -1), out};
            site_solid s = {.shape = SITE_BOX, .material = SITE_TILES, .frame = frame};
            s.half = site_v(0.15f, 0.5f * length, 0.05f);
            s.texture = site_v(x, -(start + 0.5f * length), side);
            site_scene_add(b->scene, &s, NULL, 0);
        }
        for (int i = 0; i < 9; i++) {
            if (i == 6 && side > 0) continue;
            float x = -8.6f + 0.85f * (float)i,
                  length = i > 6 ? slope * uniform(b, 0.4f, 0.7f) : slope;
            site_vec top = site_add(site_v(x, 0, ridge), site_mul(out, -0.14f));
            site_vec end = site_add(top, site_mul(down, length));
            site_frame frame = along(site_mul(site_add(top, end), 0.5f), down);
            add_box(b, SITE_TIMBER, frame, site_v(0.08f, 0.06f, 0.5f * length));
        }
    }
    add_block(b, SITE_TIMBER, -5.4f, 0, ridge - 0.25f, site_v(7.4f, 0.14f, 0.2f));
    for (int i = 0; i < 3; i++)
        add_block(b, SITE_TIMBER, -7.8f + 2.6f * (float)i, 0, 5.05f, site_v(0.22f, 8.6f, 0.24f));
    for (int i = 0; i < 4; i++) { /* fallen rafters */
        site_vec low = {uniform(b, -4, 3), uniform(b, 0.5f, 3), 0.15f};
        site_vec high = site_add(
            low, site_v(uniform(b, -2.5f, 2.5f), uniform(b, 0.4f, 1.5f), uniform(b, 0.3f, 1.8f)));
        site_vec way = site_sub(high, low);
        add_box(b, SITE_TIMBER, along(site_mul(site_add(low, high), 0.5f), way),
                site_v(0.08f, 0.06f, 0.5f * sqrtf(site_dot(way, way))));
    }
}

/* --- the yard --- */

static void add_yard_walls(builder *b)
{
    const crest low[] = {{0, 1.9f},  {6, 1.8f},  {9, 1.2f},  {13, 2.0f},
                         {20, 1.7f}, {24, 0.9f}, {30, 1.9f}, {40, 1.8f}};
    const crest gate[] = {{0, 3.4f}, {1.2f, 3.9f}, {2.4f, 4.3f}, {3.6f, 3.9f}, {4.8f, 3.4f}};
    const float ground = site_ground(-22, 0);
    const site_opening opening[] = {{SITE_ROUND_HEAD, 2.4f, 1.35f, ground, ground + 1.9f}};
    const float west = -22, east = 17, south = -15, north = 14;
    const float corners[][4] = {{west, north, west, 2.4f},
                                {west, -2.4f, west, south},
                                {west, south, east, south},
                                {east, south, east, north},
                                {east, north, west, north}};
    for (size_t i = 0; i < COUNT(corners); i++)
        add_wall(b, &(wall){corners[i][0], corners[i][1], corners[i][2], corners[i][3], 0, 0.5f,
                            true, 0.5f, low, COUNT(low), NULL, 0});
    add_wall(b,
             &(wall){west, 2.4f, west, -2.4f, 0, 0.9f, true, 0.2f, gate, COUNT(gate), opening, 1});
}

static void add_well(builder *b, float x, float y)
{
    float ground = site_ground(x, y);
    enum { STONES = 14 };
    for (int i = 0; i < STONES; i++) {
        float angle = 2 * pi * (float)i / STONES;
        site_frame frame =
            level(x + cosf(angle), y + sinf(angle), ground + 0.25f, angle + 0.5f * pi);
        site_solid s = {.shape = SITE_BOX, .material = SITE_MASONRY, .frame = frame};
        s.half = site_v(0.25f, 0.16f, 0.65f + uniform(b, -0.02f, 0.02f));
        s.texture = site_v(0.5f * (float)i, y, ground);
        site_scene_add(b->scene, &s, NULL, 0);
    }
    for (float side = -1; side < 2; side += 2)
        add_block(b, SITE_TIMBER, x, y + 1.0f * side, ground + 0.7f, site_v(0.14f, 0.14f, 1.8f));
    add_frustum(b, SITE_TIMBER, site_v(x, y - 1.1f, ground + 1.75f),
                site_v(x, y + 1.1f, ground + 1.75f), 0.09f, 0.09f);
    for (float side = -1; side < 2; side += 2) {
        site_vec out = site_unit(site_v(0.6f * side, 0, 1)),
                 down = site_unit(site_v(side, 0, -0.6f));
        site_frame frame = {site_v(x + 0.42f * side, y, ground + 2.55f), site_v(0, 1, 0),
                            site_mul(down, -1), out};
        site_solid s = {.shape = SITE_BOX,
                        .material = SITE_TILES,
                        .frame = frame,
                        .half = {1.4f, 0.52f, 0.04f}};
        site_scene_add(b->scene, &s, NULL, 0);
    }
}

static void add_graves(builder *b)
{
    for (int i = 0; i < 12; i++) {
        float x = -7.0f + 2.3f * (float)(i % 6) + uniform(b, -0.3f, 0.3f),
              y = i < 6 ? -8.3f : -11.2f;
        site_vec up = {0.16f * bell(b), 0.12f * bell(b), 1},
                 foot = {x, y + uniform(b, -0.2f, 0.2f), 0};
        foot.z = site_ground(foot.x, foot.y);
        site_frame frame = along(foot, up);
        float high = uniform(b, 0.7f, 1.15f);
        frame.origin = site_add(foot, site_mul(frame.z, 0.5f * high - 0.1f));
        /* `along` turns x towards the east for a nearly vertical z: a stone is thin that way. */
        if (i % 5 != 3) {
            add_box(b, SITE_ASHLAR, frame, site_v(0.07f, 0.3f, 0.5f * high));
        } else {
            add_box(b, SITE_ASHLAR, frame, site_v(0.07f, 0.09f, 0.9f * high));
            frame.origin = site_add(frame.origin, site_mul(frame.z, 0.45f * high));
            add_box(b, SITE_ASHLAR, frame, site_v(0.065f, 0.38f, 0.09f));
        }
        add_block(b, SITE_ASHLAR, foot.x + 0.95f, foot.y, foot.z - 0.2f,
                  site_v(1.6f, 0.75f, 0.27f));
    }
}

/* Fallen stones, thickest below the breach of the northern wall. */
static void add_rubble(builder *b)
{
    for (int i = 0; i < 420; i++) {
        float x = -1.8f + 2.0f * bell(b), y = 4.6f + 1.25f * bell(b),
              size = uniform(b, 0.08f, 0.26f);
        float heap = 0.9f * expf(-0.18f * (x + 1.8f) * (x + 1.8f) - 0.5f * (y - 4.6f) * (y - 4.6f));
        float floor = fabsf(y) < 3.6f ? 0 : site_ground(x, y);
        site_frame frame =
            along(site_v(x, y, floor + heap * uniform(b, 0.3f, 1) + 0.3f * size), any_direction(b));
        add_box(b, SITE_MASONRY, frame,
                site_v(size * uniform(b, 0.6f, 1.2f), size * uniform(b, 0.5f, 1), 0.8f * size));
    }
    for (int i = 0; i < 90; i++) {
        float angle = uniform(b, 0, 2 * pi), away = uniform(b, 7, 16),
              size = uniform(b, 0.05f, 0.18f);
        float x = away * cosf(angle), y = 0.8f * away * sinf(angle);
        add_box(b, SITE_MASONRY, along(site_v(x, y, site_ground(x, y)), any_direction(b)),
                site_v(size, size, 0.7f * size));
    }
}

/* Balls on poles, as surveyors put them up to join scans. */
static void add_targets(builder *b)
{
    const float at[][2] = {{-13.5f, -3.0f}, {-12.0f, 5.5f}, {-2.0f, -9.8f},
                           {9.5f, -7.0f},   {2.5f, 8.5f},   {0.6f, 0.9f}};
    for (size_t i = 0; i < COUNT(at); i++) {
        float x = at[i][0], y = at[i][1], ground = i == COUNT(at) - 1 ? 0 : site_ground(x, y);
        site_vec top = {x, y, ground + 1.3f};
        site_solid s = {.shape = SITE_BALL, .material = SITE_TARGET, .half = {0.1f, 0, 0}};
        s.frame = level(x, y, top.z, 0);
        site_scene_add(b->scene, &s, NULL, 0);
        for (int leg = 0; leg < 3; leg++) {
            float angle = 2.0944f * (float)leg + x;
            add_frustum(b, SITE_TIMBER,
                        site_v(x + 0.4f * cosf(angle), y + 0.4f * sinf(angle), ground - 0.05f),
                        site_sub(top, site_v(0, 0, 0.08f)), 0.018f, 0.014f);
        }
    }
}

/* --- plants --- */

typedef struct {
    float x, y, trunk, height,
        spread; /* trunk: height of the lowest branches; spread: half the width of the crown */
    int tufts;
} tree;

/* Leaves in tufts on the skin of an ellipsoid, each tuft at the end of a branch. */
static void add_tree(builder *b, const tree *t)
{
    float ground = site_ground(t->x, t->y), girth = 0.03f * t->height;
    site_vec foot = {t->x, t->y, ground - 0.2f},
             fork = {t->x + 0.2f * bell(b), t->y + 0.2f * bell(b), ground + t->trunk};
    site_vec crown = {fork.x, fork.y, ground + 0.5f * (t->trunk + t->height)};
    float half_height = 0.5f * (t->height - t->trunk);
    add_frustum(b, SITE_BARK, foot, fork, girth * 1.25f, girth * 0.8f);
    add_frustum(b, SITE_BARK, fork, site_v(crown.x, crown.y, crown.z + 0.5f * half_height),
                girth * 0.8f, 0.04f);
    for (int i = 0; i < t->tufts; i++) {
        site_vec d = any_direction(b);
        float out = uniform(b, 0.55f, 1);
        site_vec tuft = {crown.x + t->spread * out * d.x, crown.y + t->spread * out * d.y,
                         crown.z + half_height * out * d.z};
        if (i % 3 == 0)
            add_frustum(b, SITE_BARK, site_v(fork.x, fork.y, 0.6f * fork.z + 0.4f * tuft.z), tuft,
                        0.055f, 0.015f);
        for (int k = 0; k < 34; k++) {
            site_vec off = {bell(b), bell(b), 0.7f * bell(b)};
            site_vec facing = site_add(any_direction(b), site_v(0, 0, 0.6f));
            add_leaf(b, site_add(tuft, site_mul(off, 0.17f * t->spread + 0.06f)), facing,
                     uniform(b, 0.04f, 0.1f));
        }
    }
}

static void add_ivy(builder *b)
{
    for (int i = 0; i < 1500; i++) {
        float x = 3.6f + 1.1f * bell(b), z = -0.5f + 3.6f * uniform(b, 0, 1) * uniform(b, 0.2f, 1);
        add_leaf(b, site_v(x, -4.43f - uniform(b, 0, 0.1f), z),
                 site_v(bell(b), -2.0f, 0.8f * bell(b) + 0.5f), uniform(b, 0.03f, 0.08f));
    }
}

static void add_plants(builder *b)
{
    static const tree trees[] = {
        {-15.5f, -9.0f, 2.2f, 9.5f, 3.4f, 120}, {11.5f, 8.5f, 2.0f, 8.0f, 2.9f, 95},
        {12.5f, -9.5f, 1.0f, 9.0f, 1.1f, 70},   {14.3f, -5.6f, 0.9f, 7.6f, 1.0f, 60},
        {-29.0f, 9.0f, 2.5f, 10.5f, 3.8f, 110}, {-27.0f, -13.0f, 2.0f, 8.0f, 3.0f, 80},
        {23.0f, 3.0f, 2.4f, 10.0f, 3.5f, 100},  {4.0f, 21.0f, 2.2f, 9.0f, 3.3f, 90},
        {-9.0f, -22.5f, 2.2f, 8.8f, 3.2f, 90},  {20.0f, -20.0f, 2.0f, 9.0f, 3.2f, 80},
        {-17.0f, 20.5f, 2.0f, 8.5f, 3.0f, 80},
    };
    for (size_t i = 0; i < COUNT(trees); i++)
        add_tree(b, &trees[i]);
    for (int i = 0; i < 14; i++) { /* shrubs along the walls */
        float x = uniform(b, -20, 15), y = i % 2 == 0 ? 12.9f : -13.9f;
        add_tree(b, &(tree){x, y, 0.15f, uniform(b, 0.8f, 1.5f), uniform(b, 0.5f, 0.9f), 9});
    }
    add_ivy(b);
}

bool site_scene_init(site_scene *scene, uint32_t seed, mospt_err *err)
{
    *scene = (site_scene){0};
    builder b = {scene, seed};
    add_west_front(&b);
    add_long_walls(&b);
    add_choir(&b);
    add_arcades(&b);
    add_roof(&b);
    add_yard_walls(&b);
    add_well(&b, -14.0f, 7.5f);
    add_graves(&b);
    add_rubble(&b);
    add_targets(&b);
    add_plants(&b);
    if (site_scene_index(scene, err)) return true;
    site_scene_fini(scene);
    return false;
}
