#include "render/pace.h"
#include "tests/core_tools.h"

#include <math.h>

/* A machine that takes so long, and now and then much longer. */
typedef struct {
    double fixed_ms, million_ms, megabyte_ms, jitter;
    uint32_t hiccup_every; /* frames; 0: never */
    uint64_t state;
    uint32_t frames;
} machine;

static double draw(machine *m, uint64_t points, uint64_t bytes)
{
    double ms =
        m->fixed_ms + m->million_ms * (double)points * 1e-6 + m->megabyte_ms * (double)bytes * 1e-6;
    ms *= 1 + m->jitter * (2 * core_unit(&m->state) - 1);
    bool hiccup = m->hiccup_every > 0 && ++m->frames % m->hiccup_every == 0;
    return hiccup ? ms + 200 : ms;
}

/* Frames of a camera that moves, with uploads in some of them; returns how many were late. */
static uint32_t fly(rend_pace *pace, machine *m, uint32_t frames, uint64_t available,
                    double *mean_ms)
{
    uint32_t late = 0;
    double sum = 0;
    for (uint32_t i = 0; i < frames; i++) {
        uint64_t points = rend_pace_points(pace);
        if (points > available) points = available;
        uint64_t bytes = i % 3 == 0 ? rend_pace_bytes(pace) : 0;
        double ms = draw(m, points, bytes);
        rend_pace_note(pace, points, bytes, true, ms);
        sum += ms;
        late += ms > 1.1 * pace->target_ms;
    }
    if (mean_ms != NULL) *mean_ms = sum / frames;
    return late;
}

static void frames_come_up_to_the_target_and_stay_below(void **unused)
{
    (void)unused;
    const machine machines[] = {
        {.fixed_ms = 3, .million_ms = 100, .megabyte_ms = 0.3},
        {.fixed_ms = 3, .million_ms = 5, .megabyte_ms = 0.1, .jitter = 0.1},
        {.fixed_ms = 8, .million_ms = 0.5, .megabyte_ms = 0.05, .jitter = 0.1},
        {.fixed_ms = 1, .million_ms = 30, .megabyte_ms = 3, .jitter = 0.1},
    };
    for (size_t i = 0; i < sizeof machines / sizeof *machines; i++)
        for (int fps = 15; fps <= 60; fps *= 2) {
            machine m = machines[i];
            rend_pace pace;
            double mean;
            m.state = i + 1;
            rend_pace_init(&pace, fps);
            fly(&pace, &m, 40, UINT64_MAX, NULL);
            assert_true(fly(&pace, &m, 300, UINT64_MAX, &mean) <= 3); /* one in a hundred */
            assert_true(mean > 0.6 * pace.target_ms && mean < pace.target_ms);
        }
}

static void a_frame_far_off_changes_little(void **unused)
{
    (void)unused;
    machine smooth = {
        .fixed_ms = 3, .million_ms = 50, .megabyte_ms = 0.3, .jitter = 0.05, .state = 1};
    machine rough = smooth;
    rend_pace a, b;
    double smooth_ms, rough_ms;
    rough.hiccup_every = 20;
    rend_pace_init(&a, 30);
    rend_pace_init(&b, 30);
    fly(&a, &smooth, 60, UINT64_MAX, NULL);
    fly(&b, &rough, 60, UINT64_MAX, NULL);
    fly(&a, &smooth, 200, UINT64_MAX, &smooth_ms);
    uint32_t late = fly(&b, &rough, 200, UINT64_MAX, &rough_ms);
    assert_int_equal(late, 10);                    /* the hiccups themselves */
    assert_true(rough_ms - 10 > 0.75 * smooth_ms); /* of 200 ms each, in 20 frames */
}

static void a_slower_machine_is_noticed_at_once(void **unused)
{
    (void)unused;
    machine m = {.fixed_ms = 3, .million_ms = 10, .megabyte_ms = 0.3, .jitter = 0.05, .state = 1};
    rend_pace pace;
    rend_pace_init(&pace, 30);
    fly(&pace, &m, 100, UINT64_MAX, NULL);
    m.million_ms = 30; /* another splat size */
    assert_true(fly(&pace, &m, 12, UINT64_MAX, NULL) < 12);
    assert_int_equal(fly(&pace, &m, 100, UINT64_MAX, NULL), 0);
}

/* All frames alike say nothing about what a point costs; then there is much more to draw. */
static void a_small_scene_teaches_no_nonsense(void **unused)
{
    (void)unused;
    machine m = {.fixed_ms = 5, .million_ms = 40, .megabyte_ms = 0.3, .jitter = 0.05, .state = 1};
    rend_pace pace;
    rend_pace_init(&pace, 30);
    fly(&pace, &m, 200, 100000, NULL);
    assert_true(rend_pace_points(&pace) >= 100000);
    assert_true(fly(&pace, &m, 30, UINT64_MAX, NULL) <= 3);
    assert_int_equal(fly(&pace, &m, 100, UINT64_MAX, NULL), 0);
}

/* Parts of a large picture at rest tell what a point costs, and moving frames, all alike, what all
 * the rest does. */
static void what_was_learnt_at_rest_is_not_forgotten(void **unused)
{
    (void)unused;
    machine m = {.fixed_ms = 2, .million_ms = 5, .megabyte_ms = 0.3, .jitter = 0.1, .state = 1};
    rend_pace pace;
    double mean;
    rend_pace_init(&pace, 30);
    for (int i = 0; i < 20; i++) {
        uint64_t points = rend_pace_points(&pace);
        rend_pace_note(&pace, points, 0, false, draw(&m, points, 0));
    }
    m.fixed_ms = 18;                               /* with shading */
    fly(&pace, &m, 60, 400000, NULL);              /* little is in sight */
    assert_true(rend_pace_points(&pace) > 590000); /* half as many again as were tried */
    fly(&pace, &m, 30, UINT64_MAX, NULL);
    assert_true(fly(&pace, &m, 100, UINT64_MAX, &mean) <= 4);
    assert_true(mean > 0.6 * pace.target_ms);
}

/* Shading alone takes longer than a frame should: points are drawn all the same, and not few. */
static void a_machine_that_is_too_slow_shows_something(void **unused)
{
    (void)unused;
    machine m = {.fixed_ms = 40, .million_ms = 20, .jitter = 0.2, .state = 1};
    rend_pace pace;
    rend_pace_init(&pace, 30);
    fly(&pace, &m, 200, UINT64_MAX, NULL);
    assert_true(rend_pace_points(&pace) > 200000);
    assert_true(rend_pace_points(&pace) < 2000000);
}

static void odd_frames_break_nothing(void **unused)
{
    (void)unused;
    rend_pace pace;
    rend_pace_init(&pace, 30);
    for (int i = 0; i < 100; i++) {
        rend_pace_note(&pace, i % 2 ? 0 : UINT64_MAX / 2, i % 3 ? 0 : UINT64_MAX / 2, i % 4 != 0,
                       i % 5 ? 0 : 1e9);
        assert_true(rend_pace_points(&pace) > 0 && rend_pace_bytes(&pace) > 0);
        for (int k = 0; k < REND_PACE_TERMS; k++)
            assert_true(isfinite(pace.cost[k]) && pace.cost[k] >= 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_come_up_to_the_target_and_stay_below),
        cmocka_unit_test(a_frame_far_off_changes_little),
        cmocka_unit_test(a_slower_machine_is_noticed_at_once),
        cmocka_unit_test(a_small_scene_teaches_no_nonsense),
        cmocka_unit_test(what_was_learnt_at_rest_is_not_forgotten),
        cmocka_unit_test(a_machine_that_is_too_slow_shows_something),
        cmocka_unit_test(odd_frames_break_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
