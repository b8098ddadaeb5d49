#include "render/panorama.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

/* Pixels of a face that lie beyond 90 degrees, on each side. */
static uint32_t margin_of(uint32_t inner)
{
    return 4 + inner / 128;
}

/* Half of a face in units of its distance. */
static double reach(const rend_panorama *p)
{
    uint32_t inner = (uint32_t)ceil(p->width / PI);
    return (double)p->face / inner;
}

/* Right, up and forward of a face in those of the eye. */
static const double AXES[REND_FACES][3][3] = {
    {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},   {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}},
    {{-1, 0, 0}, {0, 1, 0}, {0, 0, -1}}, {{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}},
    {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}},  {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
};

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Where a direction goes through the cube. */
static void place_pixel(rend_panorama *p, size_t i, const double direction[3])
{
    uint32_t face = 0;
    for (uint32_t f = 1; f < REND_FACES; f++)
        if (dot3(AXES[f][2], direction) > dot3(AXES[face][2], direction)) face = f;
    double w = dot3(AXES[face][2], direction) * reach(p), half = 0.5 * p->face;
    double x = half + half * dot3(AXES[face][0], direction) / w - 0.5;
    double y = half - half * dot3(AXES[face][1], direction) / w - 0.5;
    x = fmin(fmax(x, 0), p->face - 2), y = fmin(fmax(y, 0), p->face - 2);
    p->offsets[i] = (face * p->face + (uint32_t)y) * p->face + (uint32_t)x;
    p->shares[i][0] = (uint8_t)((x - floor(x)) * 256);
    p->shares[i][1] = (uint8_t)((y - floor(y)) * 256);
}

bool rend_panorama_init(uint32_t width, uint32_t height, rend_panorama *out, mospt_err *err)
{
    size_t pixels = (size_t)width * height;
    uint32_t inner = (uint32_t)ceil(width / PI);
    rend_panorama p = {.width = width, .height = height, .face = inner + 2 * margin_of(inner)};
    p.offsets = malloc(pixels * sizeof *p.offsets);
    p.shares = malloc(pixels * sizeof *p.shares);
    if (p.offsets == NULL || p.shares == NULL) {
        rend_panorama_fini(&p);
        return mospt_err_nomem(err, pixels * 6);
    }
    for (size_t i = 0; i < pixels; i++) {
        double longitude = ((double)(i % width) + 0.5) / width * 2 * PI - PI;
        double latitude = PI / 2 - ((double)(i / width) + 0.5) / height * PI;
        const double direction[3] = {cos(latitude) * sin(longitude), sin(latitude),
                                     cos(latitude) * cos(longitude)};
        place_pixel(&p, i, direction);
    }
    *out = p;
    return true;
}

void rend_panorama_fini(rend_panorama *panorama)
{
    free(panorama->offsets);
    free(panorama->shares);
    *panorama = (rend_panorama){0};
}

void rend_panorama_camera(const rend_panorama *panorama, const rend_camera *camera, uint32_t face,
                          rend_camera *out)
{
    double eye_up[3], back[3], axes[3][3], length = sqrt(dot3(camera->up, camera->up));
    double distance = 0;
    rend_camera_axes(camera, axes[0], eye_up, back);
    for (int a = 0; a < 3; a++) {
        axes[1][a] = camera->up[a] / length;
        distance += (camera->target[a] - camera->eye[a]) * (camera->target[a] - camera->eye[a]);
    }
    for (int a = 0; a < 3; a++) { /* up x right */
        int b = (a + 1) % 3, c = (a + 2) % 3;
        axes[2][a] = axes[1][b] * axes[0][c] - axes[1][c] * axes[0][b];
    }
    *out = *camera;
    for (int a = 0; a < 3; a++) {
        double forward = 0;
        out->up[a] = 0;
        for (int k = 0; k < 3; k++) {
            forward += AXES[face][2][k] * axes[k][a];
            out->up[a] += AXES[face][1][k] * axes[k][a];
        }
        out->target[a] = out->eye[a] + sqrt(distance) * forward;
    }
    out->fov_rad = 2 * atan(reach(panorama));
}

void rend_panorama_sample(const rend_panorama *panorama, const uint32_t *faces, size_t i,
                          uint64_t rgb[3])
{
    const uint32_t *at = faces + 3 * (size_t)panorama->offsets[i];
    const uint32_t *below = at + 3 * (size_t)panorama->face;
    uint32_t x = panorama->shares[i][0], y = panorama->shares[i][1];
    for (int c = 0; c < 3; c++) {
        uint64_t upper = (uint64_t)at[c] * (256 - x) + (uint64_t)at[3 + c] * x;
        uint64_t lower = (uint64_t)below[c] * (256 - x) + (uint64_t)below[3 + c] * x;
        rgb[c] = upper * (256 - y) + lower * y;
    }
}
