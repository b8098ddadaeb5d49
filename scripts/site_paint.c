#include "scripts/site_paint.h"

static uint32_t hash3(int32_t x, int32_t y, int32_t z)
{
    uint32_t h = (uint32_t)x * 0x8da6b343u ^ (uint32_t)y * 0xd8163841u ^ (uint32_t)z * 0xcb1ab31fu;
    h = (h ^ (h >> 15)) * 0x2c1b3c6du;
    h = (h ^ (h >> 13)) * 0x297a2d39u;
    return h ^ (h >> 16);
}

static float shade(uint32_t hash)
{
    return (float)(hash >> 8) * 0x1p-24f;
}

static int32_t floor_int(float v)
{
    int32_t i = (int32_t)v;
    return i - (v < (float)i);
}

static float mix(float a, float b, float part)
{
    return a + (b - a) * part;
}

static site_vec mix_colour(site_vec a, site_vec b, float part)
{
    part = part < 0 ? 0 : part > 1 ? 1 : part;
    return site_v(mix(a.x, b.x, part), mix(a.y, b.y, part), mix(a.z, b.z, part));
}

/* Value noise, 0 to 1, one lump per unit of length. */
static float lumps(float x, float y, float z)
{
    int32_t ix = floor_int(x), iy = floor_int(y), iz = floor_int(z);
    float fx = x - (float)ix, fy = y - (float)iy, fz = z - (float)iz;
    fx *= fx * (3 - 2 * fx);
    fy *= fy * (3 - 2 * fy);
    fz *= fz * (3 - 2 * fz);
    float layer[2];
    for (int32_t k = 0; k < 2; k++) {
        float near = mix(shade(hash3(ix, iy, iz + k)), shade(hash3(ix + 1, iy, iz + k)), fx);
        float far = mix(shade(hash3(ix, iy + 1, iz + k)), shade(hash3(ix + 1, iy + 1, iz + k)), fx);
        layer[k] = mix(near, far, fy);
    }
    return mix(layer[0], layer[1], fz);
}

static float lumps_at(site_vec p, float per_metre)
{
    return lumps(p.x * per_metre, p.y * per_metre, p.z * per_metre);
}

/* Stones of one course follow each other; the next course is shifted. */
typedef struct {
    uint32_t stone;
    float joint; /* metres to the nearest joint */
} bond;

static bond bond_at(float along, float up, float length, float height)
{
    int32_t course = floor_int(up / height);
    float shifted = along / length + shade(hash3(course, 7, 3));
    int32_t stone = floor_int(shifted);
    float x = (shifted - (float)stone) * length, z = up - (float)course * height;
    float joint = site_min(site_min(x, length - x), site_min(z, height - z));
    return (bond){hash3(course, stone, 11), joint};
}

/* Lichen and moss where stone stays damp: near the ground, on top, and in patches. */
static site_vec weather(const site_hit *hit, site_vec colour, float damp_below)
{
    float patch = lumps_at(hit->point, 1.3f), fine = lumps_at(hit->point, 9);
    float moss = (damp_below - hit->point.z) * 0.9f + 1.4f * patch + 0.5f * fine - 1.45f;
    if (hit->normal.z > 0.7f) moss += 0.55f;
    colour = mix_colour(colour, site_v(0.085f, 0.1f, 0.035f), site_min(moss, 0.75f));
    float lichen = 3.0f * lumps_at(hit->point, 3.1f) + fine - 2.95f;
    return mix_colour(colour, site_v(0.52f, 0.42f, 0.2f), lichen * 0.8f);
}

static site_paint paint_masonry(const site_hit *hit, bool dressed)
{
    const site_vec p = hit->local, n = hit->local_normal;
    bool end = fabsf(n.x) > fabsf(n.y), flat = fabsf(n.z) > 0.7f;
    float along = flat || !end ? p.x : p.y, up = flat ? p.y : p.z;
    bond b = dressed ? (bond){hash3((int32_t)hit->solid->id, 5, 0), 1}
                     : bond_at(along, up, 0.47f, 0.235f);
    float tone = shade(b.stone), warm = shade(b.stone * 0x9e3779b1u);
    site_vec stone = mix_colour(site_v(0.47f, 0.36f, 0.23f), site_v(0.33f, 0.27f, 0.2f), warm);
    if (dressed) stone = mix_colour(site_v(0.5f, 0.42f, 0.31f), site_v(0.4f, 0.35f, 0.28f), warm);
    float grain = lumps_at(hit->point, 22), blotch = lumps_at(hit->point, 2.2f);
    stone = site_mul(stone, (dressed ? 0.85f + 0.2f * tone : 0.68f + 0.5f * tone) *
                                (0.78f + 0.24f * grain + 0.2f * blotch));
    site_paint paint = {.class_asprs = 6, .reflectance = 0.42f + 0.2f * tone};
    paint.relief =
        (dressed ? 0.004f : 0.012f) * (grain - 0.5f) + (dressed ? 0 : 0.014f * (tone - 0.5f));
    if (b.joint < 0.014f) {
        stone = site_mul(site_v(0.25f, 0.21f, 0.16f), 0.6f + 0.3f * grain);
        paint.relief = -0.018f;
    }
    paint.colour = weather(hit, stone, 0.35f);
    return paint;
}

static site_paint paint_paving(const site_hit *hit)
{
    bond b = bond_at(hit->point.x, hit->point.y, 0.9f, 0.62f);
    float tone = shade(b.stone), grain = lumps_at(hit->point, 14);
    site_vec stone = mix_colour(site_v(0.42f, 0.36f, 0.28f), site_v(0.27f, 0.25f, 0.22f), tone);
    site_paint paint = {.class_asprs = 6, .reflectance = 0.35f, .relief = 0.01f * (tone - 0.5f)};
    stone = site_mul(stone, 0.75f + 0.35f * grain);
    if (b.joint < 0.012f + 0.03f * lumps_at(hit->point, 1.7f)) {
        stone = site_v(0.1f, 0.13f, 0.04f);
        paint.relief = 0.01f * grain - 0.01f;
    }
    float earth = 2.6f * lumps_at(hit->point, 0.55f) + 0.6f * grain - 1.9f;
    paint.colour = mix_colour(stone, site_v(0.19f, 0.2f, 0.075f), earth);
    if (earth > 0.3f) paint.relief += 0.03f * lumps_at(hit->point, 31);
    return paint;
}

static site_paint paint_tiles(const site_hit *hit)
{
    const site_vec p = hit->local;
    float row = p.y / 0.3f, column = p.x / 0.2f;
    int32_t irow = floor_int(row), icolumn = floor_int(column);
    float tone = shade(hash3(irow, icolumn, 5)), curve = column - (float)icolumn - 0.5f;
    site_vec clay = mix_colour(site_v(0.62f, 0.25f, 0.13f), site_v(0.45f, 0.2f, 0.12f), tone);
    clay = mix_colour(clay, site_v(0.16f, 0.15f, 0.09f), 1.7f * lumps_at(hit->point, 1.9f) - 0.95f);
    site_paint paint = {.class_asprs = 6, .reflectance = 0.4f};
    paint.relief = 0.05f - 0.16f * curve * curve + 0.02f * ((float)(irow + 1) - row);
    paint.colour = site_mul(clay, 0.72f + 0.35f * lumps_at(hit->point, 17));
    return paint;
}

static site_paint paint_wood(const site_hit *hit, bool bark)
{
    const site_vec p = hit->local;
    float grain = lumps(p.x * 45, p.y * 45, p.z * (bark ? 8.0f : 3.0f));
    site_vec dark = bark ? site_v(0.07f, 0.05f, 0.035f) : site_v(0.13f, 0.095f, 0.065f);
    site_vec light = bark ? site_v(0.21f, 0.17f, 0.13f) : site_v(0.33f, 0.27f, 0.21f);
    return (site_paint){.colour = mix_colour(dark, light, grain),
                        .reflectance = 0.4f,
                        .relief = bark ? 0.03f * grain : 0,
                        .class_asprs = bark ? 5 : 6};
}

static site_paint paint_leaf(const site_hit *hit)
{
    float tone = shade(hash3((int32_t)hit->solid->id, 1, 2)), tuft = lumps_at(hit->point, 0.9f);
    site_vec green = mix_colour(site_v(0.09f, 0.17f, 0.04f), site_v(0.22f, 0.28f, 0.075f), tone);
    green = mix_colour(green, site_v(0.34f, 0.27f, 0.08f), 1.6f * tuft - 1.05f);
    return (site_paint){
        .colour = green, .reflectance = 0.6f, .class_asprs = hit->point.z < 1 ? 3 : 5};
}

/* Metres to the gravel path, which runs from the gate to the portal and branches to the well. */
static float path_distance(float x, float y)
{
    float bend = 0.5f * sinf(0.45f * x);
    float main_path =
        x < -10.5f && x > -25 ? fabsf(y - bend * site_min(1, 0.25f * (-10.5f - x))) : 9;
    float part =
        ((x + 15.5f) * 1.5f + y * 7.5f) / 58.5f; /* along the line from (-15.5, 0) to (-14, 7.5) */
    part = site_min(site_max(part, 0), 0.86f);
    return site_min(main_path, 0.45f + hypotf(x + 15.5f - 1.5f * part, y - 7.5f * part));
}

static site_paint paint_grass(const site_hit *hit)
{
    const site_vec p = hit->point;
    float wide = lumps(p.x * 0.18f, p.y * 0.18f, 3), patch = lumps(p.x * 0.9f, p.y * 0.9f, 9),
          blade = lumps(p.x * 26, p.y * 26, 1);
    site_vec green = mix_colour(site_v(0.1f, 0.145f, 0.045f), site_v(0.21f, 0.225f, 0.085f),
                                1.5f * wide + 0.8f * patch - 0.65f);
    green = mix_colour(green, site_v(0.34f, 0.28f, 0.14f), 2.2f * patch + wide - 1.75f);
    green = site_mul(green, 0.6f + 0.65f * blade);
    site_paint paint = {.class_asprs = 2,
                        .reflectance = 0.5f,
                        .relief = 0.05f * blade * (0.4f + patch),
                        .colour = green};
    uint32_t flower = hash3(floor_int(p.x * 22), floor_int(p.y * 22), 77);
    if (flower < 0x02000000u && wide > 0.45f)
        paint.colour = flower & 1 ? site_v(0.85f, 0.82f, 0.75f) : site_v(0.8f, 0.62f, 0.08f);
    float edge = path_distance(p.x, p.y) + 0.5f * (patch - 0.5f);
    if (edge < 1.25f) {
        float pebble = shade(hash3(floor_int(p.x * 30), floor_int(p.y * 30), 8));
        site_vec gravel = site_mul(site_v(0.47f, 0.4f, 0.3f), 0.65f + 0.4f * pebble);
        float part = (1.25f - edge) * 4;
        paint.colour = mix_colour(paint.colour, gravel, part);
        paint.relief = mix(paint.relief, 0.008f * pebble, site_min(part, 1));
    }
    return paint;
}

site_paint site_paint_at(const site_hit *hit)
{
    switch (hit->solid == NULL ? SITE_GRASS : hit->solid->material) {
    case SITE_MASONRY:
        return paint_masonry(hit, false);
    case SITE_ASHLAR:
        return paint_masonry(hit, true);
    case SITE_PAVING:
        return paint_paving(hit);
    case SITE_TILES:
        return paint_tiles(hit);
    case SITE_TIMBER:
        return paint_wood(hit, false);
    case SITE_BARK:
        return paint_wood(hit, true);
    case SITE_LEAF:
        return paint_leaf(hit);
    case SITE_TARGET:
        return (site_paint){{0.9f, 0.9f, 0.88f}, 0.9f, 0, 1};
    case SITE_GRASS:
        break;
    }
    return paint_grass(hit);
}

site_vec site_light(const site_hit *hit, site_vec sun, bool in_shadow)
{
    float towards = site_dot(hit->normal, sun);
    /* Leaves let light through; they are never as dark as their angle says. */
    if (hit->solid != NULL && hit->solid->material == SITE_LEAF)
        towards = 0.35f + 0.5f * fabsf(towards);
    float direct = in_shadow ? 0 : site_max(towards, 0);
    float open_sky = 0.62f + 0.38f * hit->normal.z;
    site_vec sky = site_mul(site_v(0.36f, 0.4f, 0.47f), open_sky),
             bounce = site_mul(site_v(0.12f, 0.1f, 0.07f), 1 - open_sky);
    return site_add(site_add(sky, bounce), site_mul(site_v(1.5f, 1.36f, 1.12f), direct));
}
