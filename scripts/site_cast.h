/* scripts/site_cast.h - solids of the sample site, and the rays that a simulated scanner sends at
 * them.
 *
 * A solid is a box, a frustum, a ball or a disc in a frame of its own. A box may have openings
 * (doors, windows): prisms with a convex outline, cut through it along its local y, so that a ray's
 * way through wall and openings is a few intervals and jambs, sills and arches are exact. Below all
 * solids lies the ground, a paraboloid. Lengths are metres in float: the site is 100 m wide, which
 * leaves 0.01 mm. Right-handed, z up. */
#pragma once
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "mospt/err.h"

typedef struct {
    float x, y, z;
} site_vec;

static inline site_vec site_v(float x, float y, float z)
{
    return (site_vec){x, y, z};
}
static inline site_vec site_add(site_vec a, site_vec b)
{
    return (site_vec){a.x + b.x, a.y + b.y, a.z + b.z};
}
static inline site_vec site_sub(site_vec a, site_vec b)
{
    return (site_vec){a.x - b.x, a.y - b.y, a.z - b.z};
}
static inline site_vec site_mul(site_vec a, float s)
{
    return (site_vec){a.x * s, a.y * s, a.z * s};
}
static inline float site_dot(site_vec a, site_vec b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
/* fminf and fmaxf would be calls, because they must treat NaN in their own way. */
static inline float site_min(float a, float b)
{
    return a < b ? a : b;
}
static inline float site_max(float a, float b)
{
    return a > b ? a : b;
}
static inline site_vec site_unit(site_vec a)
{
    return site_mul(a, 1.0f / sqrtf(site_dot(a, a)));
}

typedef enum {
    SITE_GRASS, /* the ground */
    SITE_MASONRY,
    SITE_ASHLAR, /* dressed stone: columns, steps, tombs */
    SITE_PAVING,
    SITE_TILES,
    SITE_TIMBER,
    SITE_BARK,
    SITE_LEAF,
    SITE_TARGET, /* the white balls that scans are registered with */
} site_material;

typedef enum { SITE_BOX, SITE_FRUSTUM, SITE_BALL, SITE_DISC } site_shape;

/* Columns are unit vectors, orthogonal. */
typedef struct {
    site_vec origin, x, y, z;
} site_frame;

/* The outline of an opening in the local x and z of its box. */
typedef struct {
    enum { SITE_ROUND_HEAD, SITE_POINTED_HEAD } head;
    float centre, half_width; /* along x */
    float sill,
        spring; /* along z: where it begins, and where its arch begins; equal: half a circle */
} site_opening;

typedef struct {
    site_shape shape;
    site_material material;
    site_frame frame; /* origin in the middle of the solid */
    site_vec half; /* box: half extents; frustum along z: radius below, radius above, half height;
                      ball, disc: radius in x */
    site_vec
        texture; /* added to local coordinates before painting, so that the parts of a wall match */
    uint32_t opening_first, opening_count;
    uint32_t id; /* decides its shade */
} site_solid;

typedef struct {
    float t;                      /* metres along the ray */
    site_vec point, normal;       /* of the site */
    site_vec local, local_normal; /* of the solid's frame, with its texture offset */
    const site_solid *solid;      /* NULL: the ground */
} site_hit;

typedef struct site_node site_node;

typedef struct {
    site_solid *solids; /* [solid_count], owned */
    size_t solid_count, solid_capacity;
    site_opening *openings; /* [opening_count], owned */
    size_t opening_count, opening_capacity;
    site_node *nodes; /* owned; made by site_scene_index() */
    uint32_t node_count;
    bool failed; /* memory ran out while adding; site_scene_index() reports it */
} site_scene;

void site_scene_fini(site_scene *scene);

/* Adds a solid, with `count` openings of its own. */
void site_scene_add(site_scene *scene, const site_solid *solid, const site_opening *openings,
                    size_t count);

/* Makes the tree that rays walk; after the last solid was added. Reorders the solids. */
bool site_scene_index(site_scene *scene, mospt_err *err);

/* Height of the ground. */
float site_ground(float x, float y);

/* The first thing that the ray meets within `reach` metres.
 * direction  unit length
 * hint       in and out: a solid to try first, the one that the ray before met; may point to NULL
 * threads    any; the scene is not changed */
bool site_cast(const site_scene *scene, site_vec origin, site_vec direction, float reach,
               const site_solid **hint, site_hit *out);

/* True if any solid, the ground left aside, stands in the way. Parameters as above. */
bool site_is_hidden(const site_scene *scene, site_vec origin, site_vec direction, float reach,
                    const site_solid **hint);
