#include "scripts/site_rooms.h"

#include "scripts/site_scene.h"

enum { FLOORS = 2 };
static const float room = 5.0f, storey = 3.2f, thick = 0.2f;

static float uniform(uint32_t *random, float low, float high)
{
    return low + (high - low) * (float)(site_random(random) >> 8) * 0x1p-24f;
}

/* A box along x, or turned so that its x runs north. */
static void add_box(site_scene *scene, site_material material, site_vec middle, site_vec half,
                    bool north, const site_opening *opening)
{
    site_solid s = {.shape = SITE_BOX, .material = material, .half = half};
    s.frame = (site_frame){middle, site_v(!north, north, 0), site_v(north ? -1 : 0, !north, 0),
                           site_v(0, 0, 1)};
    s.texture = middle;
    s.id = (uint32_t)scene->solid_count;
    site_scene_add(scene, &s, opening, opening != NULL);
}

/* One room's length of wall: a door where there is a room behind it, else a window. */
static void add_wall(site_scene *scene, site_vec middle, bool north, bool outer)
{
    float half = 0.5f * storey;
    const site_opening door = {SITE_ROUND_HEAD, 0.8f, 0.5f, -half, 1.8f - half},
                       window = {SITE_ROUND_HEAD, 0, 0.5f, 1 - half, 1.8f - half};
    add_box(scene, SITE_MASONRY, middle, site_v(0.5f * (room + thick), 0.5f * thick, half), north,
            outer ? &window : &door);
}

/* Cupboards along two walls, a table with something on it. */
static void add_furniture(site_scene *scene, site_vec floor, uint32_t *random)
{
    float x = uniform(random, -1.2f, 0), y = uniform(random, -1.6f, -0.4f);
    float tall = uniform(random, 0.9f, 2.2f), wide = uniform(random, 0.4f, 1);
    add_box(scene, SITE_TIMBER, site_add(floor, site_v(-1.9f, -1.2f, 0.5f * tall)),
            site_v(0.3f, wide, 0.5f * tall), false, NULL);
    add_box(scene, SITE_ASHLAR, site_add(floor, site_v(-0.9f, 2.1f, 0.45f)),
            site_v(0.8f, 0.25f, 0.45f), false, NULL);
    add_box(scene, SITE_TIMBER, site_add(floor, site_v(x, y, 0.73f)), site_v(0.7f, 0.4f, 0.03f),
            false, NULL);
    add_box(scene, SITE_TIMBER, site_add(floor, site_v(x, y, 0.35f)), site_v(0.1f, 0.1f, 0.35f),
            false, NULL);
    add_box(scene, SITE_TILES, site_add(floor, site_v(x + 0.2f, y, 0.86f)),
            site_v(0.15f, 0.1f, 0.1f), false, NULL);
}

static site_vec floor_of(uint32_t across, uint32_t i, uint32_t j, uint32_t k)
{
    float first = -0.5f * room * (float)(across - 1);
    return site_v(first + room * (float)i, first + room * (float)j, storey * (float)k);
}

static void add_room(site_scene *scene, uint32_t across, site_vec floor, uint32_t *random)
{
    float far = 0.5f * room * (float)across - 0.01f, to = 0.5f * room, up = 0.5f * storey;
    const site_vec slab = {to, to, 0.5f * thick};
    add_box(scene, SITE_PAVING, site_add(floor, site_v(0, 0, -0.5f * thick)), slab, false, NULL);
    add_wall(scene, site_add(floor, site_v(to, 0, up)), true, floor.x + to > far);
    add_wall(scene, site_add(floor, site_v(0, to, up)), false, floor.y + to > far);
    if (floor.x - to < -far) add_wall(scene, site_add(floor, site_v(-to, 0, up)), true, true);
    if (floor.y - to < -far) add_wall(scene, site_add(floor, site_v(0, -to, up)), false, true);
    if (floor.z > storey * (FLOORS - 1.5f))
        add_box(scene, SITE_TIMBER, site_add(floor, site_v(0, 0, storey - 0.5f * thick)), slab,
                false, NULL);
    add_furniture(scene, floor, random);
}

bool site_rooms_init(site_scene *scene, uint32_t across, uint32_t seed, mospt_err *err)
{
    uint32_t random = seed;
    *scene = (site_scene){0};
    for (uint32_t k = 0; k < FLOORS; k++)
        for (uint32_t j = 0; j < across; j++)
            for (uint32_t i = 0; i < across; i++)
                add_room(scene, across, floor_of(across, i, j, k), &random);
    if (site_scene_index(scene, err)) return true;
    site_scene_fini(scene);
    return false;
}

site_vec site_rooms_position(uint32_t across, uint32_t index, float tripod)
{
    uint32_t rooms = across * across * FLOORS, r = index % rooms, round = index / rooms;
    site_vec at = floor_of(across, r % across, r / across % across, r / (across * across));
    uint32_t random = index * 31 + round;
    float away = round > 0 ? 1 : 0;
    return site_add(at, site_v(0.9f + away * uniform(&random, -0.5f, 0.5f),
                               0.7f + away * uniform(&random, -0.5f, 0.5f), tripod));
}
