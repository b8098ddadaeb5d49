#include "tests/ref_picture.h"

#include "tests/core_tools.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    double eye[3], right[3], up[3], back[3], focal_px;
    uint32_t width, height;
} pinhole;

static void cover(const pinhole *c, const double world[3], uint8_t *covered)
{
    double x = 0, y = 0, w = 0;
    for (int a = 0; a < 3; a++) {
        double d = world[a] - c->eye[a];
        x += c->right[a] * d, y += c->up[a] * d, w -= c->back[a] * d;
    }
    if (!(w > 0)) return;
    double column = floor(c->width / 2.0 + x / w * c->focal_px);
    double row = floor(c->height / 2.0 - y / w * c->focal_px);
    if (column < 0 || column >= c->width || row < 0 || row >= c->height) return;
    covered[(size_t)row * c->width + (size_t)column] = 1;
}

void ref_picture_cover(const mospt_dataset *dataset, const rend_camera *camera,
                       const rend_box *clip, uint32_t width, uint32_t height, uint8_t *covered)
{
    const mospt_hierarchy *h = &dataset->hierarchy;
    mospt_err err = {0};
    pinhole c = {.width = width, .height = height};
    c.focal_px = height / 2.0 / tan(camera->fov_rad / 2);
    memcpy(c.eye, camera->eye, sizeof c.eye);
    rend_camera_axes(camera, c.right, c.up, c.back);
    memset(covered, 0, (size_t)width * height);
    for (uint32_t n = 0; n < h->count; n++) {
        mospt_vertex *v = malloc(h->nodes[n].count * sizeof *v + 1);
        CORE_NEED(mospt_dataset_read_vertices(dataset, n, v, &err));
        for (uint32_t i = 0; i < h->nodes[n].count; i++) {
            const uint32_t g[3] = {v[i].x, v[i].y, v[i].z};
            double world[3];
            mospt_grid_to_world(&dataset->metadata.grid, g, world);
            bool inside = true;
            for (int a = 0; clip != NULL && a < 3; a++)
                inside = inside && world[a] >= clip->low[a] && world[a] <= clip->high[a];
            if (inside) cover(&c, world, covered);
        }
        free(v);
    }
}
