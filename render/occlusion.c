#include "render/occlusion.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { TILE_PX = 4, TILE_PIXELS = TILE_PX * TILE_PX, LEVELS_MAX = 16 };
/* Of a tile's pixels, those that must be covered. */
enum { COVERED = 6, COVERED_OPEN = 9 };
/* Clearly behind: noise and the thickness of a wall are not another room. */
#define BEHIND 1.01f

typedef struct {
    uint32_t width, height;
    float *farthest, *nearest; /* [width * height], in the storage */
} level;

struct rend_occlusion {
    float *depths;  /* [width * height], owned */
    float *storage; /* owned: the levels, and one row of tiles sorted */
    float *sorted;  /* [TILE_PIXELS][levels[0].width] */
    uint32_t width, height;
    level levels[LEVELS_MAX];
    uint32_t level_count;
    rend_frame frame; /* learnt */
    bool knows, same_view;
    float moved;  /* of the eye since, steps */
    float behind; /* BEHIND as a difference of depths */
};

/* What is asked about, in pixels and depth of the view that was learnt. */
typedef struct {
    float low[2], high[2];
    float nearest_w;
} footprint;

/* The same in tiles of one level, both ends included. */
typedef struct {
    uint32_t low[2], high[2];
} span;

rend_occlusion *rend_occlusion_create(void)
{
    return calloc(1, sizeof(rend_occlusion));
}

void rend_occlusion_destroy(rend_occlusion *occlusion)
{
    if (occlusion == NULL) return;
    free(occlusion->depths);
    free(occlusion->storage);
    free(occlusion);
}

/* fminf() and fmaxf() would be calls, because they must treat NaN in their own way. */
static float nearer_of(float a, float b)
{
    return a < b ? a : b;
}

static float farther_of(float a, float b)
{
    return a > b ? a : b;
}

static uint32_t half_of(uint32_t count)
{
    return (count + 1) / 2;
}

/* Sizes of all levels, down to one tile; returns how many tiles they have together. */
static size_t lay_out(rend_occlusion *o, uint32_t width, uint32_t height)
{
    size_t tiles = 0;
    uint32_t w = (width + TILE_PX - 1) / TILE_PX, h = (height + TILE_PX - 1) / TILE_PX;
    for (o->level_count = 0; o->level_count < LEVELS_MAX; w = half_of(w), h = half_of(h)) {
        o->levels[o->level_count++] = (level){.width = w, .height = h};
        tiles += (size_t)w * h;
        if (w == 1 && h == 1) break;
    }
    return tiles;
}

static bool fit(rend_occlusion *o, uint32_t width, uint32_t height)
{
    size_t tiles = lay_out(o, width, height);
    free(o->depths);
    free(o->storage);
    o->width = width, o->height = height;
    o->depths = malloc((size_t)width * height * sizeof *o->depths);
    o->storage =
        malloc((2 * tiles + (size_t)TILE_PIXELS * o->levels[0].width) * sizeof *o->storage);
    if (o->depths == NULL || o->storage == NULL) {
        free(o->depths), free(o->storage);
        o->depths = o->storage = NULL;
        o->width = o->height = 0;
        return false;
    }
    float *at = o->storage;
    for (uint32_t l = 0; l < o->level_count; l++) {
        size_t size = (size_t)o->levels[l].width * o->levels[l].height;
        o->levels[l].farthest = at, o->levels[l].nearest = at + size;
        at += 2 * size;
    }
    o->sorted = at;
    return true;
}

float *rend_occlusion_depths(rend_occlusion *occlusion, uint32_t width, uint32_t height)
{
    occlusion->knows = false;
    bool fits = occlusion->width == width && occlusion->height == height;
    return fits || fit(occlusion, width, height) ? occlusion->depths : NULL;
}

void rend_occlusion_forget(rend_occlusion *occlusion)
{
    occlusion->knows = false;
}

/* ---- learning ---- */

/* The pixels of a row of tiles, those at the same place in their tiles side by side. Tiles beyond
 * the edge repeat the last pixel. */
static void gather(const rend_occlusion *o, uint32_t tile_row)
{
    uint32_t width = o->levels[0].width;
    for (uint32_t p = 0; p < TILE_PIXELS; p++) {
        uint32_t y = tile_row * TILE_PX + p / TILE_PX, x = p % TILE_PX;
        const float *row = o->depths + (size_t)(y < o->height ? y : o->height - 1) * o->width;
        float *out = o->sorted + (size_t)p * width;
        for (uint32_t t = 0; t + 1 < width; t++)
            out[t] = row[t * TILE_PX + x];
        uint32_t last = (width - 1) * TILE_PX + x;
        out[width - 1] = row[last < o->width ? last : o->width - 1];
    }
}

static void order(float *restrict nearer, float *restrict farther, uint32_t count)
{
    for (uint32_t t = 0; t < count; t++) {
        float a = nearer[t], b = farther[t];
        nearer[t] = nearer_of(a, b);
        farther[t] = farther_of(a, b);
    }
}

/* Batcher's odd-even merge sort, all tiles of a row at once. */
static void sort_tiles(float *sorted, uint32_t width)
{
    for (uint32_t p = 1; p < TILE_PIXELS; p *= 2)
        for (uint32_t k = p; k >= 1; k /= 2)
            for (uint32_t j = k % p; j + k < TILE_PIXELS; j += 2 * k)
                for (uint32_t i = j; i < j + k && i + k < TILE_PIXELS; i++)
                    if (i / (2 * p) == (i + k) / (2 * p))
                        order(sorted + (size_t)i * width, sorted + (size_t)(i + k) * width, width);
}

/* covered  of a tile's pixels */
static void find_tiles(rend_occlusion *o, uint32_t covered)
{
    level *l = &o->levels[0];
    for (uint32_t y = 0; y < l->height; y++) {
        gather(o, y);
        sort_tiles(o->sorted, l->width);
        memcpy(l->nearest + (size_t)y * l->width, o->sorted + (size_t)(covered - 1) * l->width,
               l->width * sizeof *l->nearest);
    }
}

/* Farthest of a tile and its eight neighbours. */
static void shrink_silhouettes(const level *l)
{
    for (uint32_t y = 0; y < l->height; y++) {
        uint32_t y0 = y > 0 ? y - 1 : 0, y1 = y + 1 < l->height ? y + 1 : y;
        for (uint32_t x = 0; x < l->width; x++) {
            uint32_t x0 = x > 0 ? x - 1 : 0, x1 = x + 1 < l->width ? x + 1 : x;
            float farthest = 0;
            for (uint32_t v = y0; v <= y1; v++)
                for (uint32_t u = x0; u <= x1; u++)
                    farthest = farther_of(farthest, l->nearest[(size_t)v * l->width + u]);
            l->farthest[(size_t)y * l->width + x] = farthest;
        }
    }
}

static void reduce(const level *fine, const level *coarse)
{
    for (uint32_t y = 0; y < coarse->height; y++)
        for (uint32_t x = 0; x < coarse->width; x++) {
            float farthest = 0, nearest = 1;
            for (uint32_t v = 2 * y; v < 2 * y + 2 && v < fine->height; v++)
                for (uint32_t u = 2 * x; u < 2 * x + 2 && u < fine->width; u++) {
                    farthest = farther_of(farthest, fine->farthest[(size_t)v * fine->width + u]);
                    nearest = nearer_of(nearest, fine->nearest[(size_t)v * fine->width + u]);
                }
            coarse->farthest[(size_t)y * coarse->width + x] = farthest;
            coarse->nearest[(size_t)y * coarse->width + x] = nearest;
        }
}

void rend_occlusion_learn(rend_occlusion *occlusion, const rend_frame *frame, bool is_open)
{
    find_tiles(occlusion, is_open ? COVERED_OPEN : COVERED);
    shrink_silhouettes(&occlusion->levels[0]);
    for (uint32_t l = 1; l < occlusion->level_count; l++)
        reduce(&occlusion->levels[l - 1], &occlusion->levels[l]);
    occlusion->frame = *frame;
    occlusion->behind = logf(BEHIND) / logf(frame->far_w / frame->near_w);
    occlusion->knows = true;
    rend_occlusion_aim(occlusion, frame);
}

/* ---- asking ---- */

bool rend_occlusion_aim(rend_occlusion *occlusion, const rend_frame *frame)
{
    const rend_frame *f = &occlusion->frame;
    double square = 0;
    for (int a = 0; a < 3; a++)
        square += (frame->eye[a] - f->eye[a]) * (frame->eye[a] - f->eye[a]);
    occlusion->moved = (float)sqrt(square);
    occlusion->same_view = occlusion->knows && square == 0 && frame->width == f->width &&
                           frame->height == f->height &&
                           memcmp(frame->rotation, f->rotation, sizeof f->rotation) == 0 &&
                           memcmp(frame->tan_half, f->tan_half, sizeof f->tan_half) == 0;
    return occlusion->same_view || !occlusion->knows;
}

/* False if some of the cube is not in front of the eye. */
static bool project(const rend_frame *f, const uint32_t corner[3], uint64_t width, footprint *out)
{
    float middle[3] = {0, 0, 0}, half = 0.5f * (float)width;
    for (int a = 0; a < 3; a++) {
        float away = (float)((double)corner[a] + 0.5 * (double)width - f->eye[a]);
        for (int e = 0; e < 3; e++)
            middle[e] += f->rotation[3 * a + e] * away;
    }
    *out = (footprint){{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, INFINITY};
    for (int c = 0; c < 8; c++) {
        float at[3] = {middle[0], middle[1], middle[2]};
        for (int a = 0; a < 3; a++)
            for (int e = 0; e < 3; e++)
                at[e] += f->rotation[3 * a + e] * ((c >> a & 1) ? half : -half);
        float w = -at[2];
        if (!(w > f->near_w)) return false;
        float x = 0.5f * (float)f->width + f->focal_px * at[0] / w;
        float y = 0.5f * (float)f->height - f->focal_px * at[1] / w;
        out->low[0] = fminf(out->low[0], x), out->high[0] = fmaxf(out->high[0], x);
        out->low[1] = fminf(out->low[1], y), out->high[1] = fmaxf(out->high[1], y);
        out->nearest_w = fminf(out->nearest_w, w);
    }
    return true;
}

static void grow(footprint *p, float by_px)
{
    for (int a = 0; a < 2; a++)
        p->low[a] -= by_px, p->high[a] += by_px;
}

/* The tiles of a level that a footprint covers; false where the picture does not tell: what lies
 * beyond its edge is out of sight for the same view only. */
static bool cover(const rend_occlusion *o, const footprint *p, uint32_t of_level, span *out)
{
    const float size[2] = {(float)o->width, (float)o->height};
    for (int a = 0; a < 2; a++) {
        bool beyond = p->low[a] < 0 || p->high[a] > size[a];
        if ((beyond && !o->same_view) || p->high[a] < 0 || p->low[a] >= size[a]) return false;
        float low = fmaxf(p->low[a], 0), high = fminf(p->high[a], size[a] - 1);
        out->low[a] = (uint32_t)low / TILE_PX >> of_level;
        out->high[a] = (uint32_t)fmaxf(high, low) / TILE_PX >> of_level;
    }
    return true;
}

/* A level at which a footprint covers few tiles. */
static uint32_t level_of(const rend_occlusion *o, const footprint *p)
{
    float wide = fmaxf(p->high[0] - p->low[0], p->high[1] - p->low[1]);
    uint32_t l = 0;
    while (l + 1 < o->level_count && wide > (float)(2 * TILE_PX << l))
        l++;
    return l;
}

/* How far things in front of a footprint may have moved on the screen since: as far as the nearest
 * of them. */
static float parallax_px(const rend_occlusion *o, const footprint *p)
{
    span s;
    uint32_t l = level_of(o, p);
    float nearest = 1;
    if (!cover(o, p, l, &s)) return INFINITY;
    for (uint32_t y = s.low[1]; y <= s.high[1]; y++)
        for (uint32_t x = s.low[0]; x <= s.high[0]; x++)
            nearest = fminf(nearest, o->levels[l].nearest[(size_t)y * o->levels[l].width + x]);
    return o->moved * o->frame.focal_px / rend_frame_depth_to_w(&o->frame, nearest);
}

/* True if all of the footprint's tiles below one tile are nearer than a depth. */
static bool is_covered(const rend_occlusion *o, const footprint *p, float depth, uint32_t of_level,
                       const uint32_t tile[2])
{
    const level *l = &o->levels[of_level];
    if (l->farthest[(size_t)tile[1] * l->width + tile[0]] < depth) return true;
    if (of_level == 0) return false;
    span s;
    if (!cover(o, p, of_level - 1, &s)) return false;
    for (uint32_t y = 2 * tile[1]; y < 2 * tile[1] + 2; y++)
        for (uint32_t x = 2 * tile[0]; x < 2 * tile[0] + 2; x++) {
            const uint32_t below[2] = {x, y};
            bool inside = x >= s.low[0] && x <= s.high[0] && y >= s.low[1] && y <= s.high[1];
            if (inside && !is_covered(o, p, depth, of_level - 1, below)) return false;
        }
    return true;
}

bool rend_occlusion_hides(const rend_occlusion *occlusion, const uint32_t corner[3], uint64_t width)
{
    const rend_occlusion *o = occlusion;
    footprint p;
    span s;
    if (!o->knows || !project(&o->frame, corner, width, &p)) return false;
    float depth = logf(p.nearest_w / o->frame.near_w) / logf(o->frame.far_w / o->frame.near_w);
    if (o->moved > 0) grow(&p, parallax_px(o, &p));
    uint32_t l = level_of(o, &p);
    if (!cover(o, &p, l, &s)) return false;
    for (uint32_t y = s.low[1]; y <= s.high[1]; y++)
        for (uint32_t x = s.low[0]; x <= s.high[0]; x++) {
            const uint32_t tile[2] = {x, y};
            if (!is_covered(o, &p, depth - o->behind, l, tile)) return false;
        }
    return true;
}
