#include "render/cpu/cpu.h"
#include "render/cpu/kernel.h"
#include "render/gl/context.h"
#include "tests/ref_raster.h"
#include "tests/render_tools.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 643, HEIGHT = 361, PIXELS = WIDTH * HEIGHT, BITS = 20, POINTS = 150001 };

/* Points of a made-up room: walls, floor, ceiling, and things that hang in the air.
 * at       grid coordinates of its corner */
static mospt_vertex *make_room(const uint32_t at[3], uint64_t seed)
{
    mospt_vertex *v = malloc(POINTS * sizeof *v);
    for (uint32_t i = 0; i < POINTS; i++) {
        uint32_t p[3], kind = core_below(&seed, 8);
        for (int a = 0; a < 3; a++)
            p[a] = core_below(&seed, 1u << BITS);
        if (kind < 6) p[kind / 2] = kind % 2 * ((1u << BITS) - 1 - p[kind / 2] % 200);
        v[i] = (mospt_vertex){.x = at[0] + p[0], .y = at[1] + p[1], .z = at[2] + p[2]};
        /* Neighbours are alike, as in a scan. */
        v[i].r = (uint8_t)(p[0] >> 12), v[i].g = (uint8_t)(p[1] >> 12),
        v[i].b = (uint8_t)(p[2] >> 12);
        v[i].i = (uint8_t)i;
    }
    return v;
}

static const uint32_t ORIGIN[3] = {0, 0, 0};
static const uint32_t FAR_OUT[3] = {0xeff00000u, 0x7ff00000u, 0x80000000u};

typedef enum { INSIDE, OUTSIDE, FAR_AWAY, LOOKS } look_kind;

static rend_frame frame_of(look_kind look, const uint32_t at[3])
{
    /* In units of the room's width. */
    static const double eyes[LOOKS][3] = {{0.4, 0.45, 0.3}, {-0.5, -0.8, 1.1}, {9, 7, 5}};
    mospt_grid grid = {.step = 1, .bits = BITS};
    rend_camera camera = {.up = {0, 0, 1}, .fov_rad = look == FAR_AWAY ? 0.2 : 1.1};
    uint32_t high[3];
    rend_frame frame;
    for (int a = 0; a < 3; a++) {
        camera.eye[a] = at[a] + eyes[look][a] * (1 << BITS);
        camera.target[a] = at[a] + (a == 0 ? 0.75 : 0.5) * (1 << BITS);
        high[a] = at[a] + (1u << BITS) - 1;
    }
    rend_frame_make(&camera, &grid, at, high, WIDTH, HEIGHT, &frame);
    return frame;
}

/* A tree of three levels whose cells are of many sizes. */
static uint32_t make_octants(uint32_t octants[8 * 73])
{
    uint32_t nodes = 1, made = 0;
    uint64_t state = 5;
    for (; made < nodes; made++)
        for (uint32_t o = 0; o < 8; o++) {
            bool deeper = made < 9 && nodes < 73 && core_below(&state, 3) > 0;
            float width = (float)(core_unit(&state) * (1 << (BITS - 8)));
            uint32_t bits;
            memcpy(&bits, &width, sizeof bits);
            octants[8 * made + o] = deeper ? nodes++ : REND_SPLAT | bits;
        }
    return nodes;
}

static const rgl_scene PLAIN = {.grid_bits = BITS,
                                .px_min = 1,
                                .px_max = 1,
                                .background_top = {0.4f, 0.5f, 0.6f},
                                .background_bottom = {0.1f, 0.2f, 0.9f}};

typedef struct {
    uint8_t rgb[PIXELS * 3];
    float depths[PIXELS];
} picture;

/* Draws all points in so many calls.
 * first, all, last     parts of the first of them, of all, and of the last */
static void draw_calls(rgl *gl, const rgl_scene *scene, rgl_shape shape, int32_t calls, int first,
                       int all, int last)
{
    mospt_err err = {0};
    for (int32_t c = 0; c < calls; c++) {
        int32_t from[2] = {POINTS / calls * c, 0}, count[2] = {POINTS / calls, 0};
        if (c == calls - 1) count[0] = POINTS - from[0];
        count[1] = count[0] / 3, from[1] = from[0] + count[0] - count[1], count[0] -= count[1];
        rgl_batch batch = {.shape = shape, .first = from, .count = count, .range_count = 2};
        int parts = all | (c == 0 ? first : 0) | (c == calls - 1 ? last : 0);
        CORE_NEED(rgl_draw(gl, scene, &batch, 1, parts, &err));
    }
}

static void draw_in(rgl *gl, const rgl_scene *scene, const mospt_vertex *v, rgl_shape shape,
                    int32_t calls, picture *out)
{
    mospt_err err = {0};
    bool blend = scene->blend_slab > 0;
    CORE_NEED(rgl_arena_create(gl, POINTS, &err));
    CORE_NEED(rgl_arena_upload(gl, 0, v, POINTS, &err));
    if (blend && calls > 1) {
        draw_calls(gl, scene, shape, calls, RGL_BEGIN, 0, 0);
        draw_calls(gl, scene, shape, calls, 0, RGL_AGAIN, RGL_END);
    } else {
        draw_calls(gl, scene, shape, calls, RGL_BEGIN | (blend ? RGL_AGAIN : 0), 0, RGL_END);
    }
    CORE_NEED(rgl_read_pixels(gl, false, WIDTH, HEIGHT, out->rgb, &err));
    CORE_NEED(rgl_read_depths(gl, out->depths, &err));
}

static picture *draw(rgl *gl, const rgl_scene *scene, const mospt_vertex *v, rgl_shape shape)
{
    picture *p = malloc(sizeof *p);
    draw_in(gl, scene, v, shape, 1, p);
    return p;
}

static rgl *make_cpu(uint32_t threads, const char *kernel)
{
    mospt_err err = {0};
    rgl *gl = NULL;
    CORE_NEED(rcpu_create(&(rcpu_options){threads, kernel}, &gl, &err));
    return gl;
}

/* ---- the same picture as OpenGL's ---- */

static bool differs(const picture *a, const picture *b, uint32_t pixel)
{
    for (uint32_t c = 3 * pixel; c < 3 * pixel + 3; c++)
        if (abs(a->rgb[c] - b->rgb[c]) > 2) return true;
    return false;
}

static void assert_alike(const picture *gl, const picture *cpu, const char *what)
{
    uint32_t different = 0, covered = 0;
    for (uint32_t i = 0; i < PIXELS; i++) {
        different += differs(gl, cpu, i);
        covered += cpu->depths[i] < 1;
    }
    if (different > PIXELS / 1000 || covered < PIXELS / 100)
        fail_msg("%s: %u of %u pixels differ, %u are covered", what, different, PIXELS, covered);
}

typedef struct {
    const char *name;
    bool octants, clip;
    rgl_shape shape;
    float size, least, most, edl, radius, slab;
    uint32_t fill;
} size_case;

static const size_case SIZES[] = {
    {"one pixel", .least = 1, .most = 1},
    {"one pixel, lit", .least = 1, .most = 1, .edl = 24, .radius = 1},
    {"fixed", .least = 2.6f, .most = 2.6f, .edl = 24, .radius = 1},
    {"world", .size = 1 << (BITS - 8), .least = 1, .most = 9, .edl = 48, .radius = 3},
    {"cells", .octants = true, .least = 1, .most = 6, .edl = 24, .radius = 2},
    {"discs", .octants = true, .shape = RGL_ROUND, .least = 1, .most = 12},
    {"small discs", .shape = RGL_ROUND, .least = 1, .most = 1},
    {"bent", .octants = true, .shape = RGL_PARABOLOID, .least = 1, .most = 16},
    {"clipped", .clip = true, .least = 1, .most = 1, .edl = 24, .radius = 1},
    {"clipped discs", .clip = true, .shape = RGL_ROUND, .least = 5, .most = 5},
    {"blended", .least = 1, .most = 1, .slab = 0.02f, .edl = 24, .radius = 1},
    {"blended cells", .octants = true, .least = 1, .most = 6, .slab = 0.01f},
    {"blended discs", .octants = true, .shape = RGL_ROUND, .least = 3, .most = 9, .slab = 0.05f},
    {"blended, bent", .shape = RGL_PARABOLOID, .least = 7, .most = 7, .slab = 0.02f},
    {"filled", .least = 1, .most = 1, .fill = 2},
    {"filled widely", .least = 2, .most = 2, .fill = 8, .edl = 24, .radius = 2},
    {"blended and filled", .least = 2, .most = 2, .slab = 0.02f, .fill = 3, .edl = 24, .radius = 1},
    {"large squares", .least = 40, .most = 40, .edl = 24, .radius = 1},
};

/* What a scene borrows. */
typedef struct {
    uint32_t octants[8 * 73];
    rend_clip clip;
} tree;

static rgl_scene scene_of(const size_case *c, look_kind look, const uint32_t at[3], tree *t)
{
    rgl_scene scene = PLAIN;
    scene.frame = frame_of(look, at);
    scene.octant_nodes = make_octants(t->octants);
    scene.octants = c->octants ? t->octants : NULL;
    for (int a = 0; a < 3; a++)
        t->clip.low[a] = at[a] + (1 << BITS) / 5, t->clip.high[a] = at[a] + (4u << BITS) / 5;
    scene.clip = c->clip ? &t->clip : NULL;
    scene.splat_scale = 1.25f, scene.splat_size = c->size;
    scene.px_min = c->least, scene.px_max = c->most;
    scene.edl_strength = c->edl, scene.edl_radius_px = c->radius;
    scene.blend_slab = c->slab, scene.fill_px = c->fill;
    return scene;
}

static void compare_with_gl(rgl *gl, rgl *cpu, const uint32_t at[3])
{
    mospt_vertex *v = make_room(at, 3);
    for (int look = 0; look < LOOKS; look++)
        for (size_t s = 0; s < sizeof SIZES / sizeof SIZES[0]; s++) {
            const size_case *c = &SIZES[s];
            tree t;
            rgl_scene scene = scene_of(c, (look_kind)look, at, &t);
            picture *a = draw(gl, &scene, v, c->shape), *b = draw(cpu, &scene, v, c->shape);
            assert_alike(a, b, c->name);
            free(a), free(b);
        }
    free(v);
}

static void pictures_are_those_of_opengl(void **state)
{
    (void)state;
    mospt_err err = {0};
    rgl_context *context = NULL;
    rgl *gl = NULL, *cpu = make_cpu(2, NULL);
    CORE_NEED(rgl_context_create(&context, &err));
    CORE_NEED(rgl_gl_create(&gl, &err));
    compare_with_gl(gl, cpu, ORIGIN);
    compare_with_gl(gl, cpu, FAR_OUT);
    rgl_destroy(gl);
    rgl_destroy(cpu);
    rgl_context_destroy(context);
}

/* ---- the picture that the definition asks for ---- */

static void assert_as_defined(rgl *cpu, const size_case *c, look_kind look, const mospt_vertex *v)
{
    tree t;
    rgl_scene scene = scene_of(c, look, FAR_OUT, &t);
    uint8_t *rgb = malloc(PIXELS * 3);
    double *w = malloc(PIXELS * sizeof *w);
    uint32_t wrong = 0;
    memset(scene.background_top, 0, sizeof scene.background_top);
    memset(scene.background_bottom, 0, sizeof scene.background_bottom);
    picture *p = draw(cpu, &scene, v, c->shape);
    ref_raster_draw(&scene, c->shape, v, POINTS, rgb, w);
    for (uint32_t i = 0; i < PIXELS; i++) {
        bool same = memcmp(rgb + 3 * i, p->rgb + 3 * i, 3) == 0;
        float ours =
            p->depths[i] < 1 ? rend_frame_depth_to_w(&scene.frame, p->depths[i]) : INFINITY;
        wrong += !same || !((w[i] == INFINITY && ours == INFINITY) || fabs(ours / w[i] - 1) < 2e-5);
    }
    /* Those that are within the 512th of a pixel beside an edge: two of 256 for each of its sides.
     */
    if (wrong > PIXELS / 60)
        fail_msg("%s: %u of %d pixels are not as defined", c->name, wrong, PIXELS);
    free(p), free(rgb), free(w);
}

static void pictures_are_as_defined(void **state)
{
    (void)state;
    rgl *cpu = make_cpu(2, NULL);
    mospt_vertex *v = make_room(FAR_OUT, 6);
    for (size_t s = 0; s < sizeof SIZES / sizeof SIZES[0]; s++)
        for (int look = 0; look < LOOKS && SIZES[s].edl == 0; look++)
            if (SIZES[s].slab == 0 && SIZES[s].fill == 0)
                assert_as_defined(cpu, &SIZES[s], (look_kind)look, v);
    free(v);
    rgl_destroy(cpu);
}

/* ---- always the same picture ---- */

static void assert_same(const picture *a, const picture *b)
{
    assert_memory_equal(a->rgb, b->rgb, sizeof a->rgb);
    assert_memory_equal(a->depths, b->depths, sizeof a->depths);
}

/* Draws every size with the backend, and compares with one thread of the portable kernel. */
static void compare_with_plain(rgl *cpu, int32_t calls)
{
    mospt_vertex *v = make_room(FAR_OUT, 4);
    rgl *plain = make_cpu(1, "portable");
    picture *b = malloc(sizeof *b);
    for (size_t s = 0; s < sizeof SIZES / sizeof SIZES[0]; s++) {
        const size_case *c = &SIZES[s];
        tree t;
        rgl_scene scene = scene_of(c, s % 2 == 0 ? INSIDE : OUTSIDE, FAR_OUT, &t);
        picture *a = draw(plain, &scene, v, c->shape);
        draw_in(cpu, &scene, v, c->shape, calls, b);
        assert_same(a, b);
        free(a);
    }
    free(b), free(v);
    rgl_destroy(plain);
}

static void every_kernel_draws_the_same(void **state)
{
    (void)state;
    static const char *const names[] = {"portable", "avx2", "avx512"};
    for (int i = 0; i < 3; i++) {
        if (rcpu_kernel_find(names[i]) == NULL) continue;
        rgl *cpu = make_cpu(1, names[i]);
        compare_with_plain(cpu, 1);
        rgl_destroy(cpu);
    }
}

static void the_number_of_threads_does_not_show(void **state)
{
    (void)state;
    for (uint32_t threads = 2; threads < 20; threads += 4) {
        rgl *cpu = make_cpu(threads, NULL);
        compare_with_plain(cpu, 1);
        rgl_destroy(cpu);
    }
}

static void parts_make_the_same_picture(void **state)
{
    (void)state;
    rgl *cpu = make_cpu(3, NULL);
    compare_with_plain(cpu, 7);
    rgl_destroy(cpu);
}

/* The order of points is the order of threads, of caches and of nodes: none may show. */
static void the_order_of_points_does_not_show(void **state)
{
    (void)state;
    rgl *cpu = make_cpu(2, NULL);
    rgl_scene scene = PLAIN;
    mospt_vertex *v = make_room(ORIGIN, 9);
    scene.frame = frame_of(OUTSIDE, ORIGIN), scene.px_max = scene.px_min = 3;
    for (uint32_t i = 0; i < POINTS; i++) /* many of one place, in two colours */
        if (i % 2 == 1) v[i].x = v[i - 1].x, v[i].y = v[i - 1].y, v[i].z = v[i - 1].z;
    picture *a = draw(cpu, &scene, v, RGL_SQUARE);
    for (uint32_t i = 0; i < POINTS / 2; i++) {
        mospt_vertex swapped = v[i];
        v[i] = v[POINTS - 1 - i], v[POINTS - 1 - i] = swapped;
    }
    picture *b = draw(cpu, &scene, v, RGL_SQUARE);
    assert_same(a, b);
    free(a), free(b), free(v);
    rgl_destroy(cpu);
}

/* A picture goes on after RGL_END, as OpenGL's does. */
static void more_points_join_a_finished_picture(void **state)
{
    (void)state;
    mospt_err err = {0};
    rgl *cpu = make_cpu(2, NULL);
    rgl_scene scene = PLAIN;
    mospt_vertex *v = make_room(ORIGIN, 9);
    scene.frame = frame_of(INSIDE, ORIGIN), scene.edl_strength = 24, scene.edl_radius_px = 1;
    picture *whole = draw(cpu, &scene, v, RGL_SQUARE), *joined = malloc(sizeof *joined);
    int32_t first[2] = {0, POINTS / 2}, count[2] = {POINTS / 2, POINTS - POINTS / 2};
    for (int half = 0; half < 2; half++) {
        rgl_batch batch = {.first = &first[half], .count = &count[half], .range_count = 1};
        int parts = RGL_END | (half == 0 ? RGL_BEGIN : 0);
        CORE_NEED(rgl_draw(cpu, &scene, &batch, 1, parts, &err));
    }
    CORE_NEED(rgl_read_pixels(cpu, false, WIDTH, HEIGHT, joined->rgb, &err));
    CORE_NEED(rgl_read_depths(cpu, joined->depths, &err));
    assert_same(whole, joined);
    free(whole), free(joined), free(v);
    rgl_destroy(cpu);
}

static void depths_show_before_the_end(void **state)
{
    (void)state;
    mospt_err err = {0};
    rgl *cpu = make_cpu(2, NULL);
    rgl_scene scene = PLAIN;
    mospt_vertex *v = make_room(ORIGIN, 9);
    scene.frame = frame_of(INSIDE, ORIGIN);
    picture *whole = draw(cpu, &scene, v, RGL_SQUARE);
    float *depths = malloc(PIXELS * sizeof *depths), around[9];
    int32_t first = 0, count = POINTS;
    rgl_batch batch = {.first = &first, .count = &count, .range_count = 1};
    CORE_NEED(rgl_draw(cpu, &scene, &batch, 1, RGL_BEGIN, &err));
    CORE_NEED(rgl_read_depths(cpu, depths, &err));
    assert_memory_equal(depths, whole->depths, PIXELS * sizeof *depths);
    CORE_NEED(rgl_read_depth(cpu, 100, 50, 1, around, &err));
    for (int i = 0; i < 9; i++)
        assert_true(around[i] == depths[(50 - 1 + i / 3) * WIDTH + 100 - 1 + i % 3]);
    free(whole), free(depths), free(v);
    rgl_destroy(cpu);
}

/* More points in a pixel than the narrow sums of its colours can hold. */
static void any_number_of_points_in_a_pixel_is_averaged(void **state)
{
    (void)state;
    rgl_scene scene = PLAIN;
    mospt_vertex *v = malloc(POINTS * sizeof *v);
    scene.frame = frame_of(INSIDE, ORIGIN), scene.blend_slab = 0.01f;
    for (uint32_t i = 0; i < POINTS; i++) {
        v[i] = (mospt_vertex){.x = 3u << (BITS - 2), .y = 1u << (BITS - 1), .z = 1u << (BITS - 1)};
        v[i].r = i % 2 == 0 ? 10 : 200, v[i].g = i % 2 == 0 ? 20 : 100;
        v[i].b = i % 2 == 0 ? 30 : 50;
    }
    for (uint32_t threads = 1; threads <= 3; threads++) {
        rgl *cpu = make_cpu(threads, NULL);
        picture *p = draw(cpu, &scene, v, RGL_SQUARE);
        uint32_t covered = 0;
        for (uint32_t i = 0; i < PIXELS; i++) {
            if (p->depths[i] == p->depths[0]) continue;
            covered++;
            assert_int_equal(p->rgb[3 * i], 105);
            assert_int_equal(p->rgb[3 * i + 1], 60);
            assert_int_equal(p->rgb[3 * i + 2], 40);
        }
        assert_int_equal(covered, 1);
        free(p);
        rgl_destroy(cpu);
    }
    free(v);
}

static void impossible_pictures_are_refused(void **state)
{
    (void)state;
    mospt_err err = {0};
    rgl *cpu = make_cpu(2, NULL);
    rgl_scene scene = PLAIN;
    scene.frame = frame_of(INSIDE, ORIGIN);
    scene.frame.width = 0;
    CORE_FAILS(rgl_draw(cpu, &scene, NULL, 0, RGL_BEGIN | RGL_END, &err), MOSPT_EINVAL);
    scene.frame.width = 100000;
    CORE_FAILS(rgl_draw(cpu, &scene, NULL, 0, RGL_BEGIN | RGL_END, &err), MOSPT_EINVAL);
    CORE_FAILS(rgl_arena_create(cpu, UINT64_C(1) << 31, &err), MOSPT_EINVAL);
    rgl_destroy(cpu);
    CORE_FAILS(rcpu_create(&(rcpu_options){.kernel = "abacus"}, &cpu, &err), MOSPT_EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pictures_are_those_of_opengl),
        cmocka_unit_test(pictures_are_as_defined),
        cmocka_unit_test(every_kernel_draws_the_same),
        cmocka_unit_test(the_number_of_threads_does_not_show),
        cmocka_unit_test(parts_make_the_same_picture),
        cmocka_unit_test(the_order_of_points_does_not_show),
        cmocka_unit_test(more_points_join_a_finished_picture),
        cmocka_unit_test(depths_show_before_the_end),
        cmocka_unit_test(any_number_of_points_in_a_pixel_is_averaged),
        cmocka_unit_test(impossible_pictures_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
