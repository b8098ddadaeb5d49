#include "tests/ref_raster.h"

#include "render/select.h"

#include <math.h>
#include <string.h>

typedef struct {
    double x, y, w; /* pixels from the top left; steps */
    double size;    /* pixels */
} ref_splat;

static double cell_at(const rgl_scene *s, const mospt_vertex *v)
{
    uint32_t node = 0;
    for (int bit = (int)s->grid_bits - 1; bit >= 0; bit--) {
        uint32_t octant = (v->x >> bit & 1) + 2 * (v->y >> bit & 1) + 4 * (v->z >> bit & 1);
        uint32_t found = s->octants[8 * node + octant];
        if (found & REND_SPLAT) {
            float cell;
            found &= ~REND_SPLAT;
            memcpy(&cell, &found, sizeof cell);
            return cell;
        }
        node = found;
    }
    return 1;
}

static bool is_clipped(const rgl_scene *s, const mospt_vertex *v)
{
    const uint32_t g[3] = {v->x, v->y, v->z};
    for (int a = 0; a < 3 && s->clip != NULL; a++)
        if (g[a] < s->clip->low[a] || g[a] > s->clip->high[a]) return true;
    return false;
}

/* False for a point whose centre is outside the view. */
static bool project(const rgl_scene *s, const mospt_vertex *v, ref_splat *out)
{
    const rend_frame *f = &s->frame;
    const double g[3] = {v->x - f->eye[0], v->y - f->eye[1], v->z - f->eye[2]};
    double e[3];
    for (int r = 0; r < 3; r++)
        e[r] = f->rotation[r] * g[0] + f->rotation[3 + r] * g[1] + f->rotation[6 + r] * g[2];
    double x = e[0] / f->tan_half[0], y = e[1] / f->tan_half[1], w = -e[2];
    if (w < f->near_w || w > f->far_w || fabs(x) > w || fabs(y) > w) return false;
    double size = s->octants != NULL ? s->splat_scale * cell_at(s, v) : s->splat_size;
    *out = (ref_splat){
        .x = (0.5 + 0.5 * x / w) * f->width,
        .y = (0.5 - 0.5 * y / w) * f->height,
        .w = w,
        .size = fmin(fmax(f->focal_px * size / w, s->px_min), s->px_max),
    };
    return true;
}

static void cover(const rgl_scene *s, rgl_shape shape, const ref_splat *p, const mospt_vertex *v,
                  uint32_t pixel, uint8_t *rgb, double *w)
{
    double u = (pixel % s->frame.width + 0.5 - p->x) / (0.5 * p->size);
    double t = (pixel / s->frame.width + 0.5 - p->y) / (0.5 * p->size), r2 = u * u + t * t;
    if (fabs(u) > 1 || fabs(t) > 1) return;
    if (p->size < RGL_SQUARE_PX) r2 = 0;
    if (shape != RGL_SQUARE && r2 > 1) return;
    double bent = shape == RGL_PARABOLOID ? r2 * p->size / (2 * s->frame.focal_px) : 0;
    double distance = p->w * (1 + bent);
    if (distance >= w[pixel]) return;
    w[pixel] = distance;
    rgb[3 * pixel] = v->r, rgb[3 * pixel + 1] = v->g, rgb[3 * pixel + 2] = v->b;
}

void ref_raster_draw(const rgl_scene *scene, rgl_shape shape, const mospt_vertex *vertices,
                     uint32_t count, uint8_t *rgb, double *w)
{
    uint32_t width = scene->frame.width, height = scene->frame.height;
    memset(rgb, 0, (size_t)width * height * 3);
    for (uint32_t i = 0; i < width * height; i++)
        w[i] = INFINITY;
    for (uint32_t i = 0; i < count; i++) {
        ref_splat p;
        if (is_clipped(scene, &vertices[i]) || !project(scene, &vertices[i], &p)) continue;
        int reach = (int)(p.size / 2) + 1, x = (int)p.x, y = (int)p.y;
        for (int row = y - reach; row <= y + reach; row++)
            for (int column = x - reach; column <= x + reach; column++)
                if (row >= 0 && row < (int)height && column >= 0 && column < (int)width)
                    cover(scene, shape, &p, &vertices[i], (uint32_t)row * width + (uint32_t)column,
                          rgb, w);
    }
}
