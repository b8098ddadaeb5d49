/* Pictures of a few hundred points that are known one by one, against what render/gl/rgl.h says. */
#include "render/gl/context.h"
#include "render/gl/rgl.h"
#include "tests/core_tools.h"

#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

/* A square picture with a field of view of 90 degrees: at a distance of SIDE / 2 * k steps a pixel
 * is k steps wide. */
enum { SIDE = 64, PIXELS = SIDE * SIDE, EYE_Y = 16, MIDDLE = 2048, MOST = 4 * PIXELS };

typedef struct {
    rgl_context *context;
    rgl *gl;
    rgl_scene scene;
    rgl_shape shape;
    bool smallest;
    mospt_vertex *points; /* [count] */
    uint32_t count;
    uint8_t rgb[PIXELS][3];
} stand;

static void setup(stand *s)
{
    mospt_err err = {0};
    const mospt_grid grid = {.step = 1, .bits = 12};
    const uint32_t low[3] = {0, 0, 0}, high[3] = {4095, 4095, 4095};
    const rend_camera camera = {.eye = {MIDDLE, EYE_Y, MIDDLE},
                                .target = {MIDDLE, 4000, MIDDLE},
                                .up = {0, 0, 1},
                                .fov_rad = 1.5707963267948966};
    memset(s, 0, sizeof *s);
    CORE_NEED(rgl_context_create(&s->context, &err));
    CORE_NEED(rgl_gl_create(&s->gl, &err));
    CORE_NEED(rgl_arena_create(s->gl, MOST, &err));
    rend_frame_make(&camera, &grid, low, high, SIDE, SIDE, &s->scene.frame);
    s->scene.grid_bits = grid.bits;
    s->scene.px_min = s->scene.px_max = 1;
    s->points = malloc(MOST * sizeof *s->points);
}

static void teardown(stand *s)
{
    rgl_destroy(s->gl);
    rgl_context_destroy(s->context);
    free(s->points);
}

/* A point in the middle of a pixel (from the lower left) where a pixel is k steps wide, k even. */
static void add(stand *s, int column, int row, int k, int deeper, const uint8_t rgb[3])
{
    assert_true(s->count < MOST);
    s->points[s->count++] = (mospt_vertex){(uint32_t)(MIDDLE + (2 * column + 1 - SIDE) * k / 2),
                                           (uint32_t)(EYE_Y + SIDE / 2 * k + deeper),
                                           (uint32_t)(MIDDLE + (2 * row + 1 - SIDE) * k / 2),
                                           rgb[0],
                                           rgb[1],
                                           rgb[2],
                                           0};
}

static void upload(stand *s)
{
    mospt_err err = {0};
    CORE_NEED(rgl_arena_upload(s->gl, 0, s->points, s->count, &err));
}

static void draw_part(stand *s, uint32_t from, uint32_t to, int parts)
{
    mospt_err err = {0};
    const int32_t first = (int32_t)from, count = (int32_t)(to - from);
    const rgl_batch batch = {s->shape, s->smallest, &first, &count, 1};
    CORE_NEED(rgl_draw(s->gl, &s->scene, &batch, 1, parts, &err));
}

static void read_back(stand *s)
{
    mospt_err err = {0};
    CORE_NEED(rgl_read_pixels(s->gl, false, SIDE, SIDE, s->rgb[0], &err));
}

static void draw(stand *s)
{
    upload(s);
    draw_part(s, 0, s->count, RGL_BEGIN | RGL_END | (s->scene.blend_slab > 0 ? RGL_AGAIN : 0));
    read_back(s);
}

static const uint8_t *at(const stand *s, int column, int row)
{
    return s->rgb[(SIDE - 1 - row) * SIDE + column];
}

static bool is(const uint8_t *pixel, const uint8_t rgb[3])
{
    return memcmp(pixel, rgb, 3) == 0;
}

static const uint8_t RED[3] = {200, 10, 20}, BLUE[3] = {10, 50, 220}, GREEN[3] = {0, 255, 0},
                     BLACK[3] = {0, 0, 0};

static uint32_t count_of(const stand *s, const uint8_t rgb[3])
{
    uint32_t count = 0;
    for (int p = 0; p < PIXELS; p++)
        count += is(s->rgb[p], rgb);
    return count;
}

static void fill_plane(stand *s, int k, int deeper, const uint8_t rgb[3])
{
    for (int row = 0; row < SIDE; row++)
        for (int column = 0; column < SIDE; column++)
            add(s, column, row, k, deeper, rgb);
}

static void points_in_a_slab_give_their_mean(void **unused)
{
    (void)unused;
    stand s;
    setup(&s);
    const uint8_t mean[3] = {(200 + 10 + 1) / 2, (10 + 50) / 2, (20 + 220) / 2};
    fill_plane(&s, 16, 0, RED); /* 512 steps away */
    fill_plane(&s, 16, 4, BLUE);
    fill_plane(&s, 24, 0, GREEN); /* far behind */
    s.scene.blend_slab = 0.02f;   /* ten steps */
    draw(&s);
    /* The far plane's pixels beside a point of the near ones are hidden by it. */
    assert_int_equal(count_of(&s, mean), PIXELS);
    s.scene.blend_slab = 0.002f; /* one step */
    draw(&s);
    assert_int_equal(count_of(&s, RED), PIXELS);
    teardown(&s);
}

/* Random points, some on top of each other; every order and division gives the same bytes. */
static void blending_knows_no_order_and_no_parts(void **unused)
{
    (void)unused;
    stand s;
    uint64_t state = 11;
    setup(&s);
    for (int i = 0; i < 3000; i++) {
        const uint8_t rgb[3] = {(uint8_t)core_random(&state), (uint8_t)core_random(&state),
                                (uint8_t)core_random(&state)};
        add(&s, (int)core_below(&state, SIDE), (int)core_below(&state, SIDE), 16,
            (int)core_below(&state, 40), rgb);
    }
    s.scene.blend_slab = 0.03f;
    s.scene.splat_size = 60, s.scene.px_max = 4;
    s.scene.edl_strength = 24, s.scene.edl_radius_px = 1;
    for (int shape = 0; shape < RGL_SHAPES; shape++) {
        uint8_t whole[PIXELS][3];
        s.shape = (rgl_shape)shape;
        draw(&s);
        memcpy(whole, s.rgb, sizeof whole);
        for (uint32_t i = 0; i < s.count / 2; i++) { /* reversed */
            mospt_vertex v = s.points[i];
            s.points[i] = s.points[s.count - 1 - i], s.points[s.count - 1 - i] = v;
        }
        upload(&s);
        for (uint32_t from = 0; from < s.count; from += 700)
            draw_part(&s, from, from + 700 < s.count ? from + 700 : s.count,
                      from == 0 ? RGL_BEGIN : 0);
        for (uint32_t from = 0; from < s.count; from += 1100)
            draw_part(&s, from, from + 1100 < s.count ? from + 1100 : s.count,
                      RGL_AGAIN | (from + 1100 >= s.count ? RGL_END : 0));
        read_back(&s);
        assert_memory_equal(whole, s.rgb, sizeof whole);
    }
    teardown(&s);
}

/* A wall with a fifth of its points missing in front of green ones, beside a slope of sky. */
static void filling_closes_holes_and_leaves_silhouettes_alone(void **unused)
{
    (void)unused;
    stand s;
    uint64_t state = 7;
    bool wall[SIDE][SIDE] = {{false}};
    setup(&s);
    for (int row = 8; row < 56; row++)
        for (int column = 8; column < 56 && 3 * column < 100 + row; column++) {
            wall[row][column] = true;
            /* Its borders have all their points. */
            bool border = row == 8 || row == 55 || column == 8 || column == 55 ||
                          3 * (column + 1) >= 100 + row;
            if (border || core_below(&state, 5) > 0) add(&s, column, row, 16, 0, RED);
            else add(&s, column, row, row < 30 ? 30 : 16, row < 30 ? 0 : 200, GREEN);
        }
    for (uint32_t radius = 0; radius <= 3; radius++) {
        uint32_t holes = 0, grown = 0;
        s.scene.fill_px = radius;
        draw(&s);
        for (int row = 0; row < SIDE; row++)
            for (int column = 0; column < SIDE; column++) {
                holes += wall[row][column] && !is(at(&s, column, row), RED);
                grown += !wall[row][column] && !is(at(&s, column, row), BLACK);
            }
        assert_int_equal(grown, 0);
        if (radius == 0) assert_true(holes > 200);
        if (radius == 1) assert_true(holes < 150);
        if (radius == 2) assert_true(holes < 5);
        if (radius == 3) assert_int_equal(holes, 0);
    }
    teardown(&s);
}

/* A floor to the horizon: what is behind most of its neighbours is no hole there. */
static void filling_leaves_slopes_alone(void **unused)
{
    (void)unused;
    stand s;
    uint8_t plain[PIXELS][3];
    setup(&s);
    for (int row = 0; row < SIDE; row++)
        for (int column = 0; column < SIDE; column++) {
            const uint8_t rgb[3] = {(uint8_t)(3 * row), (uint8_t)(3 * column), 99};
            add(&s, column, row, 16 + 2 * row, 0, rgb);
        }
    draw(&s);
    memcpy(plain, s.rgb, sizeof plain);
    s.scene.fill_px = 2;
    draw(&s);
    assert_memory_equal(plain, s.rgb, sizeof plain);
    teardown(&s);
}

static void shapes_do_not_differ_at_one_pixel(void **unused)
{
    (void)unused;
    stand s;
    uint8_t square[PIXELS][3];
    setup(&s);
    for (int row = 0; row < SIDE; row += 3)
        for (int column = 0; column < SIDE; column += 2)
            add(&s, column, row, 16 + 2 * (column % 5), 0, row % 2 ? RED : BLUE);
    s.scene.splat_size = 1, s.scene.px_max = 6;
    for (int shape = 0; shape < RGL_SHAPES; shape++)
        for (int smallest = 0; smallest < 2; smallest++) {
            s.shape = (rgl_shape)shape, s.smallest = smallest;
            draw(&s);
            if (shape == 0 && !smallest) memcpy(square, s.rgb, sizeof square);
            assert_memory_equal(square, s.rgb, sizeof square);
        }
    assert_int_equal(count_of(&s, BLACK), PIXELS - s.count);
    teardown(&s);
}

/* Two splats of sixteen pixels, eight apart. */
static void discs_hide_and_paraboloids_cut(void **unused)
{
    (void)unused;
    stand s;
    setup(&s);
    add(&s, 26, 30, 16, 0, RED);
    add(&s, 34, 30, 16, 0, BLUE);
    s.scene.splat_size = 256, s.scene.px_max = 64;
    s.shape = RGL_SQUARE;
    draw(&s);
    assert_true(count_of(&s, RED) >= 256 && count_of(&s, RED) <= 17 * 17);
    s.shape = RGL_ROUND;
    draw(&s);
    uint32_t disc = count_of(&s, RED), rest = count_of(&s, BLUE);
    assert_true(disc > 185 && disc < 217 && rest < disc); /* 201 */
    assert_true(is(at(&s, 33, 30), RED));                 /* drawn first */
    s.shape = RGL_PARABOLOID;
    draw(&s);
    assert_true(is(at(&s, 29, 30), RED) && is(at(&s, 31, 30), BLUE));
    assert_int_equal(count_of(&s, RED) + count_of(&s, BLUE), disc + rest);
    for (int row = 22; row < 39; row++)
        for (int column = 0; column < SIDE; column++) {
            if (column < 30) assert_false(is(at(&s, column, row), BLUE));
            if (column > 30) assert_false(is(at(&s, column, row), RED));
        }
    teardown(&s);
}

static void widths_stay_between_their_limits(void **unused)
{
    (void)unused;
    stand s;
    setup(&s);
    add(&s, 30, 30, 16, 0, RED);
    const struct {
        float size, low, high;
        uint32_t pixels;
    } cases[] = {{48, 1, 64, 9}, {48, 5, 64, 25}, {160, 1, 7, 49}, {1, 1, 9, 1}, {0, 3, 9, 9}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        s.scene.splat_size = cases[c].size;
        s.scene.px_min = cases[c].low, s.scene.px_max = cases[c].high;
        draw(&s);
        assert_int_equal(count_of(&s, RED), cases[c].pixels);
    }
    s.smallest = true; /* its size is not looked at */
    s.scene.splat_size = 160, s.scene.px_min = 3;
    draw(&s);
    assert_int_equal(count_of(&s, RED), 9);
    teardown(&s);
}

static void the_background_goes_from_top_to_bottom(void **unused)
{
    (void)unused;
    stand s;
    setup(&s);
    const float top[3] = {1, 0, 0.5f}, bottom[3] = {0, 1, 0.5f};
    memcpy(s.scene.background_top, top, sizeof top);
    memcpy(s.scene.background_bottom, bottom, sizeof bottom);
    add(&s, 30, 30, 16, 0, RED);
    for (int way = 0; way < 8; way++) { /* in place, or through any of the passes */
        s.scene.edl_strength = way & 1 ? 24 : 0, s.scene.edl_radius_px = 1;
        s.scene.fill_px = way & 2 ? 1 : 0;
        s.scene.blend_slab = way & 4 ? 0.01f : 0;
        draw(&s);
        for (int row = 0; row < SIDE; row++) {
            int up = (int)(255 * (row + 0.5) / SIDE + 0.5);
            const uint8_t *p = at(&s, 5, row);
            assert_true(abs(p[0] - up) <= 1 && abs(p[1] - (255 - up)) <= 1 && abs(p[2] - 128) <= 1);
        }
        assert_true(is(at(&s, 30, 30), RED));
    }
    teardown(&s);
}

/* A step between two planes is darkened on its far side only, more by more strength. */
static void lighting_darkens_what_lies_behind_an_edge(void **unused)
{
    (void)unused;
    stand s;
    setup(&s);
    for (int row = 0; row < SIDE; row++)
        for (int column = 0; column < SIDE; column++)
            add(&s, column, row, column < 32 ? 16 : 18, 0, RED);
    int last = 256;
    for (float strength = 0; strength < 40; strength += 12) {
        s.scene.edl_strength = strength, s.scene.edl_radius_px = 1;
        draw(&s);
        int edge = at(&s, 32, 30)[0];
        assert_true(edge < last);
        assert_int_equal(at(&s, 31, 30)[0], RED[0]);
        assert_int_equal(at(&s, 33, 30)[0], RED[0]);
        last = edge;
    }
    s.scene.edl_radius_px = 3;
    draw(&s);
    assert_true(at(&s, 34, 30)[0] < RED[0] && at(&s, 35, 30)[0] == RED[0]);
    teardown(&s);
}

/* Left two planes, right one that is halfway between them: blended they are one surface. */
static void lighting_sees_the_mean_depth_of_what_is_blended(void **unused)
{
    (void)unused;
    stand s;
    setup(&s);
    for (int row = 0; row < SIDE; row++)
        for (int column = 0; column < SIDE; column++) {
            add(&s, column, row, 16, column < 32 ? 0 : 4, RED);
            add(&s, column, row, 16, column < 32 ? 8 : 4, RED);
        }
    s.scene.edl_strength = 100, s.scene.edl_radius_px = 1;
    draw(&s);
    assert_true(at(&s, 32, 30)[0] < RED[0] - 40);
    s.scene.blend_slab = 0.02f;
    draw(&s);
    for (int column = 31; column <= 32; column++)
        assert_true(at(&s, column, 30)[0] >= RED[0] - 2);
    teardown(&s);
}

/* Through the ring several times, to the same place: each picture has the points of its own time.
 */
static void uploads_are_seen_by_what_is_drawn_after_them(void **unused)
{
    (void)unused;
    stand s;
    setup(&s);
    fill_plane(&s, 16, 0, RED);
    for (int round = 0; round < 1200; round++) { /* of 64 KiB */
        const uint8_t rgb[3] = {(uint8_t)round, (uint8_t)(round / 5), 77};
        for (uint32_t i = 0; i < s.count; i++)
            memcpy(&s.points[i].r, rgb, sizeof rgb);
        upload(&s);
        draw_part(&s, 0, s.count, RGL_BEGIN | RGL_END);
        if (round % 97 > 0) continue;
        read_back(&s);
        assert_int_equal(count_of(&s, rgb), PIXELS);
    }
    teardown(&s);
}

static void an_upload_larger_than_the_ring_arrives(void **unused)
{
    (void)unused;
    enum { REPEATS = 600, MANY = REPEATS * PIXELS }; /* 37.5 MiB */
    stand s;
    mospt_err err = {0};
    setup(&s);
    mospt_vertex *many = malloc(MANY * sizeof *many);
    fill_plane(&s, 16, 0, RED);
    for (int r = 0; r < REPEATS; r++) {
        memcpy(many + (size_t)r * PIXELS, s.points, PIXELS * sizeof *many);
        for (int p = 0; p < PIXELS; p++)
            many[r * PIXELS + p].g = (uint8_t)r, many[r * PIXELS + p].b = (uint8_t)(r >> 8);
    }
    CORE_NEED(rgl_arena_create(s.gl, MANY + 5, &err));
    CORE_NEED(rgl_arena_upload(s.gl, 5, many, MANY, &err));
    for (int r = 0; r < REPEATS; r += 37) {
        const uint8_t rgb[3] = {RED[0], (uint8_t)r, (uint8_t)(r >> 8)};
        draw_part(&s, 5 + (uint32_t)r * PIXELS, 5 + (uint32_t)(r + 1) * PIXELS,
                  RGL_BEGIN | RGL_END);
        read_back(&s);
        assert_int_equal(count_of(&s, rgb), PIXELS);
    }
    free(many);
    teardown(&s);
}

/* No memory for the arena is no end: a smaller one does. */
static void an_arena_that_does_not_fit_can_be_made_smaller(void **unused)
{
    (void)unused;
#ifdef __SANITIZE_ADDRESS__ /* which needs all the addresses there are */
    skip();
#endif
    stand s;
    mospt_err err = {0};
    struct rlimit before, less;
    setup(&s);
    getrlimit(RLIMIT_AS, &before);
    less = before;
    less.rlim_cur = (rlim_t)16 << 30;
    setrlimit(RLIMIT_AS, &less);
    bool made = rgl_arena_create(s.gl, INT32_MAX, &err); /* 32 GiB */
    setrlimit(RLIMIT_AS, &before);
    assert_false(made);
    assert_int_equal(err.code, MOSPT_ENOMEM);
    CORE_NEED(rgl_arena_create(s.gl, MOST, &err));
    fill_plane(&s, 16, 0, RED);
    draw(&s);
    assert_int_equal(count_of(&s, RED), PIXELS);
    teardown(&s);
}

/* A reset cannot be had here: all that is in another context than before must be made anew. */
static void after_a_reset_the_picture_is_the_same(void **unused)
{
    (void)unused;
    stand s;
    mospt_err err = {0};
    static uint8_t before[PIXELS][3];
    setup(&s);
    s.scene.blend_slab = 0.01f, s.scene.fill_px = 2;
    s.scene.edl_strength = 24, s.scene.edl_radius_px = 1;
    fill_plane(&s, 16, 0, RED);
    fill_plane(&s, 16, 2, BLUE);
    add(&s, 20, 20, 8, 0, GREEN);
    draw(&s);
    memcpy(before, s.rgb, sizeof before);
    rgl_set_renew(s.gl, rgl_context_renew, s.context);
    assert_false(rgl_is_lost(s.gl));
    rgl_pretend_reset(s.gl);
    CORE_FAILS(rgl_arena_upload(s.gl, 0, s.points, s.count, &err), MOSPT_EIO);
    assert_true(rgl_is_lost(s.gl));
    CORE_NEED(rgl_recover(s.gl, &err));
    assert_false(rgl_is_lost(s.gl));
    CORE_NEED(rgl_arena_create(s.gl, MOST, &err));
    draw(&s);
    assert_memory_equal(before, s.rgb, sizeof before);
    assert_true(count_of(&s, BLACK) < PIXELS / 2);
    /* And once more, with no context to be had, nor one there. */
    rgl_set_renew(s.gl, NULL, NULL);
    rgl_pretend_reset(s.gl);
    CORE_FAILS(rgl_arena_create(s.gl, MOST, &err), MOSPT_EIO);
    rgl_context_destroy(s.context);
    s.context = NULL;
    CORE_FAILS(rgl_recover(s.gl, &err), MOSPT_EIO);
    teardown(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_in_a_slab_give_their_mean),
        cmocka_unit_test(blending_knows_no_order_and_no_parts),
        cmocka_unit_test(filling_closes_holes_and_leaves_silhouettes_alone),
        cmocka_unit_test(filling_leaves_slopes_alone),
        cmocka_unit_test(shapes_do_not_differ_at_one_pixel),
        cmocka_unit_test(discs_hide_and_paraboloids_cut),
        cmocka_unit_test(widths_stay_between_their_limits),
        cmocka_unit_test(the_background_goes_from_top_to_bottom),
        cmocka_unit_test(lighting_darkens_what_lies_behind_an_edge),
        cmocka_unit_test(lighting_sees_the_mean_depth_of_what_is_blended),
        cmocka_unit_test(uploads_are_seen_by_what_is_drawn_after_them),
        cmocka_unit_test(an_upload_larger_than_the_ring_arrives),
        cmocka_unit_test(an_arena_that_does_not_fit_can_be_made_smaller),
        cmocka_unit_test(after_a_reset_the_picture_is_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
