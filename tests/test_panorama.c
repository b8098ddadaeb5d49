#include "render/orbit.h"
#include "render/panorama.h"
#include "tests/core_tools.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

/* Fills the faces with the direction that each pixel looks at, seen through its camera. */
static uint32_t *paint_directions(const rend_panorama *p, const rend_camera *camera)
{
    uint32_t *faces = malloc((size_t)p->face * p->face * REND_FACES * 3 * sizeof *faces);
    for (uint32_t f = 0; f < REND_FACES; f++) {
        rend_camera c;
        rend_panorama_camera(p, camera, f, &c);
        for (uint32_t i = 0; i < p->face * p->face; i++) {
            double at[3], length = 0;
            rend_orbit_unproject(&c, i % p->face + 0.5, i / p->face + 0.5, 1, p->face, p->face, at);
            for (int a = 0; a < 3; a++)
                length += (at[a] - c.eye[a]) * (at[a] - c.eye[a]);
            for (int a = 0; a < 3; a++)
                faces[3 * ((size_t)f * p->face * p->face + i) + (size_t)a] =
                    (uint32_t)(((at[a] - c.eye[a]) / sqrt(length) + 1) * 10000);
        }
    }
    return faces;
}

static void every_pixel_looks_where_it_stands(void **unused)
{
    (void)unused;
    /* Level heading along +y, tilted down: the tilt does not count. */
    const rend_camera camera = {
        .eye = {3, 4, 5}, .target = {3, 14, 1}, .up = {0, 0, 2}, .fov_rad = 0.3};
    rend_panorama p;
    mospt_err err = {0};
    CORE_NEED(rend_panorama_init(256, 128, &p, &err));
    uint32_t *faces = paint_directions(&p, &camera);
    for (size_t i = 0; i < 256 * 128; i++) {
        double longitude = ((double)(i % 256) + 0.5) / 256 * 2 * PI - PI;
        double latitude = PI / 2 - ((double)(i / 256) + 0.5) / 128 * PI;
        const double wanted[3] = {cos(latitude) * sin(longitude), cos(latitude) * cos(longitude),
                                  sin(latitude)};
        uint64_t rgb[3];
        rend_panorama_sample(&p, faces, i, rgb);
        for (int a = 0; a < 3; a++)
            assert_true(fabs((double)rgb[a] / 65536 / 10000 - 1 - wanted[a]) < 0.002);
    }
    free(faces);
    rend_panorama_fini(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_pixel_looks_where_it_stands),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
