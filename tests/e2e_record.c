/* Films, from a dataset to what a player sees. */
#include "render/film/join.h"
#include "render/record.h"
#include "render/shot.h"
#include "tests/ref_film.h"
#include "tests/render_tools.h"

#include <math.h>
#include <png.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

enum { WIDTH = 96, HEIGHT = 64, RATE = 10, FRAMES = 25, BUDGET = 20000 };

/* A path of 2.5 s around and into a site. */
static rend_path path_for(const render_site *site)
{
    const mospt_metadata *m = &site->dataset->metadata;
    rend_path path = {0};
    mospt_err err = {0};
    for (int i = 0; i < 4; i++) {
        rend_key key = {.time_s = 2.5 * i / 3, .camera = {.up = {0, 0, 1}, .fov_rad = 1}};
        for (int a = 0; a < 3; a++) {
            double extent = m->high[a] - m->low[a], middle = m->low[a] + extent / 2;
            key.camera.target[a] = middle;
            key.camera.eye[a] = middle + extent * (a == 2 ? 0.4 : a == 0 ? cos(i) : sin(i));
        }
        CORE_NEED(rend_path_add(&path, &key, NULL, &err));
    }
    return path;
}

static rend_record_options options_for(const rend_path *path, const char *output)
{
    return (rend_record_options){
        .output = output,
        .path = path,
        .take = {.width = WIDTH, .height = HEIGHT, .limits = {.budget_points = BUDGET}},
        .rate_num = RATE,
        .rate_den = 1};
}

/* What all tests record: a dataset, its path, and an undisturbed lossless film. */
typedef struct {
    render_site site;
    rend_path path;
} scene;

static void scene_make(scene *s)
{
    render_site_make(CORE_CLUSTERED, 60000, NULL, &s->site);
    s->path = path_for(&s->site);
}

static void scene_fini(scene *s)
{
    rend_path_fini(&s->path);
    render_site_fini(&s->site);
}

static ref_film record(const scene *s, const char *name, rend_record_options options,
                       rend_record_result *result)
{
    mospt_err err = {0};
    char *path = core_path(s->site.folder, "%s", name),
         *part = core_path(s->site.folder, "%s.part", name);
    options.output = path;
    CORE_NEED(rend_record(s->site.dataset, &options, result, &err));
    assert_false(core_exists(part));
    ref_film film = ref_film_read(path);
    free(path);
    free(part);
    return film;
}

static void assert_same_film(const ref_film *a, const ref_film *b)
{
    assert_int_equal(a->count, b->count);
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    assert_memory_equal(a->rgb, b->rgb, (size_t)a->count * a->width * a->height * 3);
}

/* Dies as if by kill -9 when so many frames have been drawn. */
static bool die_at(void *context, const rend_record_progress *now)
{
    if (now->drawn == *(const uint64_t *)context) raise(SIGKILL);
    return true;
}

/* Must be the first: a child that draws may not come from a process that has drawn. */
static void a_recording_that_is_killed_goes_on_at_its_frame(void **unused)
{
    (void)unused;
    const char *const names[] = {"a.mkv", "a.mp4"};
    const uint64_t deaths[] = {3, 17};
    scene s;
    mospt_err err = {0};
    scene_make(&s);
    for (int n = 0; n < 2; n++)
        for (int d = 0; d < 2; d++) {
            uint64_t death = deaths[d];
            char *path = core_path(s.site.folder, "%d%s", d, names[n]);
            rend_record_options options = options_for(&s.path, path);
            options.progress = die_at, options.context = &death;
            pid_t child = fork();
            if (child == 0) _exit(rend_record(s.site.dataset, &options, NULL, NULL) ? 0 : 1);
            int status;
            assert_true(waitpid(child, &status, 0) == child);
            assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
            assert_false(core_exists(path));
            free(path);
        }
    for (int n = 0; n < 2; n++) {
        ref_film whole = record(&s, names[n], options_for(&s.path, NULL), NULL);
        for (int d = 0; d < 2; d++) {
            char name[32];
            rend_record_result result;
            snprintf(name, sizeof name, "%d%s", d, names[n]);
            ref_film resumed = record(&s, name, options_for(&s.path, NULL), &result);
            /* What waited to be encoded is lost: at most the pictures that go round. */
            assert_true(result.resumed_at + 9 >= deaths[d] && result.resumed_at <= deaths[d]);
            assert_int_equal(result.drawn, FRAMES - result.resumed_at);
            assert_same_film(&resumed, &whole);
            free(resumed.rgb);
        }
        free(whole.rgb);
    }
    (void)err;
    scene_fini(&s);
}

static void every_frame_is_the_shot_of_its_camera(void **unused)
{
    (void)unused;
    scene s;
    mospt_err err = {0};
    rend_curve *curve;
    rend_record_result result;
    scene_make(&s);
    const mospt_metadata *site = &s.site.dataset->metadata;
    for (int i = 1; i < 4; i++) {
        s.path.keys[i].has_clip = true;
        s.path.keys[i].clip =
            (rend_box){{-INFINITY, -INFINITY, -INFINITY}, {INFINITY, INFINITY, site->high[2] / i}};
    }
    CORE_NEED(rend_curve_create(&s.path, &curve, &err));
    char *film = core_path(s.site.folder, "f.png"), *shot = core_path(s.site.folder, "shot.png");
    rend_record_options options = options_for(&s.path, film);
    CORE_NEED(rend_record(s.site.dataset, &options, &result, &err));
    assert_int_equal(result.frames, FRAMES);
    assert_int_equal(result.over_budget, 0);
    assert_true(result.points_most <= BUDGET && result.points_most > 0);
    for (uint64_t i = 0; i < FRAMES; i += 4) {
        rend_moment m;
        size_t a_size, b_size;
        rend_curve_at(curve, (double)i / RATE, &m);
        rend_shot_options one = {.path = shot,
                                 .width = WIDTH,
                                 .height = HEIGHT,
                                 .limits = {.budget_points = BUDGET},
                                 .look = {.has_clip = m.has_clip, .clip = m.clip},
                                 .camera = {.has_eye = true,
                                            .has_target = true,
                                            .has_up = true,
                                            .has_fov = true,
                                            .fov_deg = m.camera.fov_rad * 180 / acos(-1)}};
        memcpy(one.camera.eye, m.camera.eye, sizeof one.camera.eye);
        memcpy(one.camera.target, m.camera.target, sizeof one.camera.target);
        memcpy(one.camera.up, m.camera.up, sizeof one.camera.up);
        CORE_NEED(rend_shot(s.site.dataset, &one, NULL, &err));
        char *name = rend_reel_picture_name(film, i);
        uint8_t *a = core_file_read(shot, &a_size), *b = core_file_read(name, &b_size);
        assert_int_equal(a_size, b_size);
        assert_memory_equal(a, b, a_size);
        free(a), free(b), free(name);
    }
    rend_curve_destroy(curve);
    free(film), free(shot);
    scene_fini(&s);
}

static void caches_do_not_show_and_nothing_is_lost_in_a_lossless_film(void **unused)
{
    (void)unused;
    scene s;
    mospt_err err = {0};
    scene_make(&s);
    rend_record_options options = options_for(&s.path, NULL);
    ref_film a = record(&s, "a.mkv", options, NULL);
    options.take.limits.ram_cache_bytes = options.take.limits.gpu_cache_bytes = 1;
    ref_film b = record(&s, "b.mkv", options, NULL);
    assert_same_film(&a, &b);
    assert_string_equal(a.codec, "ffv1");
    assert_true(a.even);
    char *film = core_path(s.site.folder, "f.png");
    options.output = film;
    CORE_NEED(rend_record(s.site.dataset, &options, NULL, &err));
    for (uint64_t i = 0; i < FRAMES; i++) {
        char *name = rend_reel_picture_name(film, i);
        uint8_t rgb[WIDTH * HEIGHT * 3];
        png_image image = {.version = PNG_IMAGE_VERSION};
        assert_true(png_image_begin_read_from_file(&image, name));
        image.format = PNG_FORMAT_RGB;
        assert_true(png_image_finish_read(&image, NULL, rgb, 0, NULL));
        assert_memory_equal(rgb, a.rgb + i * sizeof rgb, sizeof rgb);
        free(name);
    }
    free(film), free(a.rgb), free(b.rgb);
    scene_fini(&s);
}

static double mean_difference(const ref_film *a, const ref_film *b)
{
    size_t size = (size_t)a->count * a->width * a->height * 3;
    double sum = 0;
    for (size_t i = 0; i < size; i++)
        sum += abs(a->rgb[i] - b->rgb[i]);
    return sum / (double)size;
}

static void every_container_says_what_is_in_it(void **unused)
{
    (void)unused;
    const char *const names[][3] = {{"a.mp4", NULL, "h264"}, {"a.webm", NULL, "vp9"}};
    scene s;
    scene_make(&s);
    ref_film truth = record(&s, "t.mkv", options_for(&s.path, NULL), NULL);
    for (int i = 0; i < 2; i++) {
        rend_record_options options = options_for(&s.path, NULL);
        options.codec = names[i][1];
        options.preset = RFILM_FAST;
        ref_film film = record(&s, names[i][0], options, NULL);
        assert_string_equal(film.codec, names[i][2]);
        assert_int_equal(film.count, FRAMES);
        assert_true(film.width == WIDTH && film.height == HEIGHT && film.even);
        assert_int_equal(film.rate_num, RATE * film.rate_den);
        assert_true(film.is_bt709_video);
        assert_true(mean_difference(&film, &truth) < 12); /* other colours would be 30 off */
        free(film.rgb);
    }
    free(truth.rgb);
    scene_fini(&s);
}

static void parts_join_to_the_whole(void **unused)
{
    (void)unused;
    const char *const endings[] = {"mkv", "mp4"};
    scene s;
    mospt_err err = {0};
    scene_make(&s);
    for (int e = 0; e < 2; e++) {
        char name[3][16];
        char *path[4];
        uint64_t frames;
        for (int i = 0; i < 3; i++) {
            snprintf(name[i], sizeof name[i], "%d.%s", i, endings[e]);
            path[i] = core_path(s.site.folder, "%s", name[i]);
        }
        path[3] = core_path(s.site.folder, "joined.%s", endings[e]);
        rend_record_options options = options_for(&s.path, NULL);
        ref_film whole = record(&s, name[2], options, NULL);
        options.end = 10;
        free(record(&s, name[0], options, NULL).rgb);
        options.first = 10, options.end = FRAMES;
        free(record(&s, name[1], options, NULL).rgb);
        CORE_NEED(
            rfilm_join((const char *const *)path, 2, path[3], path[3], NULL, NULL, &frames, &err));
        assert_int_equal(frames, FRAMES);
        ref_film joined = ref_film_read(path[3]);
        assert_true(joined.even);
        assert_same_film(&joined, &whole);
        free(joined.rgb), free(whole.rgb);
        for (int i = 0; i < 4; i++)
            free(path[i]);
    }
    scene_fini(&s);
}

static void what_does_not_fit_together_is_not_joined(void **unused)
{
    (void)unused;
    scene s;
    mospt_err err = {0};
    scene_make(&s);
    rend_record_options options = options_for(&s.path, NULL);
    options.end = 2;
    free(record(&s, "a.mp4", options, NULL).rgb);
    options.take.width = 2 * WIDTH;
    free(record(&s, "b.mp4", options, NULL).rgb);
    char *a = core_path(s.site.folder, "a.mp4"), *b = core_path(s.site.folder, "b.mp4"),
         *text = core_path(s.site.folder, "c.mp4"), *out = core_path(s.site.folder, "o.mp4");
    core_file_write(text, "no film", 7);
    const char *const unlike[] = {a, b}, *const no_film[] = {text, a}, *const missing[] = {"/no"};
    CORE_FAILS(rfilm_join(unlike, 2, out, out, NULL, NULL, NULL, &err), MOSPT_EFORMAT);
    CORE_FAILS(rfilm_join(no_film, 2, out, out, NULL, NULL, NULL, &err), MOSPT_EFORMAT);
    CORE_FAILS(rfilm_join(missing, 1, out, out, NULL, NULL, NULL, &err), MOSPT_EIO);
    CORE_FAILS(rfilm_join(unlike, 1, out, "film.doc", NULL, NULL, NULL, &err), MOSPT_EINVAL);
    free(a), free(b), free(text), free(out);
    scene_fini(&s);
}

static void two_eyes_and_panoramas_are_told_to_players(void **unused)
{
    (void)unused;
    const char *const names[] = {"a.mp4", "a.mkv"};
    scene s;
    scene_make(&s);
    for (int n = 0; n < 2; n++) {
        rend_record_result result;
        rend_record_options options = options_for(&s.path, NULL);
        options.end = 2;
        options.take.stereo = true;
        options.take.eye_distance = 0.1 * s.site.dataset->metadata.high[0];
        ref_film film = record(&s, names[n], options, &result);
        assert_true(film.is_side_by_side && result.points_most <= BUDGET);
        uint32_t differ = 0;
        for (uint32_t y = 0; y < HEIGHT; y++)
            differ += memcmp(film.rgb + y * WIDTH * 3, film.rgb + (y * WIDTH + WIDTH / 2) * 3,
                             WIDTH / 2 * 3) != 0;
        assert_true(differ > HEIGHT / 4);
        free(film.rgb);
        options.take.stereo = false, options.take.panorama = true;
        options.take.width = 128, options.take.height = 64;
        film = record(&s, names[n], options, &result);
        assert_true(film.is_sphere && result.points_most <= BUDGET);
        free(film.rgb);
    }
    scene_fini(&s);
}

static void samples_and_an_open_shutter_smooth_the_picture(void **unused)
{
    (void)unused;
    scene s;
    scene_make(&s);
    rend_record_options options = options_for(&s.path, NULL);
    options.first = 12, options.end = 13; /* at full speed */
    ref_film plain = record(&s, "a.mkv", options, NULL);
    options.take.samples = 3;
    ref_film fine = record(&s, "b.mkv", options, NULL);
    options.take.samples = 1, options.take.shutter_s = 0.1, options.take.subframes = 4;
    ref_film moved = record(&s, "c.mkv", options, NULL);
    double edges[3] = {0, 0, 0};
    const ref_film *const films[] = {&plain, &fine, &moved};
    for (int f = 0; f < 3; f++)
        for (size_t i = 3; i < WIDTH * HEIGHT * 3; i++)
            edges[f] += abs(films[f]->rgb[i] - films[f]->rgb[i - 3]);
    assert_true(edges[1] < 0.95 * edges[0] && edges[2] < 0.95 * edges[0]);
    assert_true(edges[1] > 0.1 * edges[0] && edges[2] > 0.1 * edges[0]);
    free(plain.rgb), free(fine.rgb), free(moved.rgb);
    scene_fini(&s);
}

static void fades_words_and_sixteen_bits(void **unused)
{
    (void)unused;
    scene s;
    mospt_err err = {0};
    scene_make(&s);
    rend_record_options options = options_for(&s.path, NULL);
    ref_film plain = record(&s, "a.mkv", options, NULL);
    options.fade_s = 0.5;
    ref_film faded = record(&s, "b.mkv", options, NULL);
    size_t size = WIDTH * HEIGHT * 3;
    for (size_t i = 0; i < size; i++) {
        assert_true(faded.rgb[i] == 0 && faded.rgb[(FRAMES - 1) * size + i] == 0);
        assert_true(faded.rgb[12 * size + i] == plain.rgb[12 * size + i]);
        assert_true(abs(faded.rgb[2 * size + i] - (plain.rgb[2 * size + i] * 2 + 2) / 5) <= 1);
    }
    options.fade_s = 0, options.end = 9;
    options.take.counter = true, options.take.title = "A title";
    ref_film words = record(&s, "c.mkv", options, NULL);
    assert_true(memcmp(words.rgb + 8 * size, plain.rgb + 8 * size, size) != 0);
    assert_memory_equal(words.rgb + 8 * size, plain.rgb + 8 * size, size / 3); /* above them */
    options.take.counter = false, options.take.title = NULL;
    options.take.bits = 16;
    char *film = core_path(s.site.folder, "f.png"), *name = rend_reel_picture_name(film, 8);
    options.output = film, options.first = 8;
    CORE_NEED(rend_record(s.site.dataset, &options, NULL, &err));
    uint8_t *png, *rgb = malloc(size);
    size_t png_size;
    png = core_file_read(name, &png_size);
    assert_int_equal(png[24], 16); /* bits per channel, in the file's head */
    png_image image = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_memory(&image, png, png_size));
    image.format = PNG_FORMAT_RGB | PNG_FORMAT_FLAG_LINEAR;
    uint16_t *wide = malloc(2 * size);
    assert_true(png_image_finish_read(&image, NULL, wide, 0, NULL));
    free(png), free(rgb), free(wide), free(film), free(name);
    free(plain.rgb), free(faded.rgb), free(words.rgb);
    scene_fini(&s);
}

static void live_films_have_all_frames_too(void **unused)
{
    (void)unused;
    scene s;
    scene_make(&s);
    rend_record_result result;
    rend_record_options options = options_for(&s.path, NULL);
    options.take.live = true;
    options.end = 8;
    ref_film film = record(&s, "a.mkv", options, &result);
    assert_int_equal(film.count, 8);
    assert_true(result.points_most <= BUDGET);
    assert_true(result.seconds > 0.7); /* as long as the film */
    free(film.rgb);
    scene_fini(&s);
}

static bool stop_at_five(void *context, const rend_record_progress *now)
{
    (void)context;
    return now->drawn < 5;
}

static void another_recording_does_not_go_on_with_an_unfinished_one(void **unused)
{
    (void)unused;
    scene s;
    mospt_err err = {0};
    rend_record_result result;
    scene_make(&s);
    char *path = core_path(s.site.folder, "a.mkv");
    rend_record_options options = options_for(&s.path, path);
    options.progress = stop_at_five;
    CORE_FAILS(rend_record(s.site.dataset, &options, NULL, &err), MOSPT_ECANCELLED);
    options.progress = NULL;
    options.take.limits.budget_points = BUDGET / 2;
    CORE_FAILS(rend_record(s.site.dataset, &options, NULL, &err), MOSPT_EINVAL);
    options.restart = true;
    CORE_NEED(rend_record(s.site.dataset, &options, &result, &err));
    assert_int_equal(result.resumed_at, 0);
    free(path);
    scene_fini(&s);
}

/* Stops a film at its fifth frame; tells whether another goes on with it. */
static bool goes_on(const scene *s, const rend_record_options *first,
                    const rend_record_options *second)
{
    mospt_err err = {0}, refusal = {0};
    rend_record_options stopped = *first, next = *second;
    char *path = core_path(s->site.folder, "other.mkv");
    stopped.output = next.output = path;
    stopped.progress = stop_at_five;
    CORE_FAILS(rend_record(s->site.dataset, &stopped, NULL, &err), MOSPT_ECANCELLED);
    bool ok = rend_record(s->site.dataset, &next, NULL, &refusal);
    /* Nothing unfinished is left for the next question. */
    stopped.progress = NULL;
    if (!ok) CORE_NEED(rend_record(s->site.dataset, &stopped, NULL, &err));
    free(path);
    /* MOSPT_EIO: a machine without OpenGL. */
    assert_true(ok || refusal.code == MOSPT_EINVAL ||
                (refusal.code == MOSPT_EIO && next.take.engine.renderer == REND_RENDERER_GL));
    return ok;
}

static void what_draws_and_how_belongs_to_the_recording(void **unused)
{
    (void)unused;
    scene s;
    scene_make(&s);
    const rend_record_options usual = options_for(&s.path, NULL);
    rend_record_options gl = usual, cpu = usual, other = usual;
    gl.take.engine.renderer = REND_RENDERER_GL;
    cpu.take.engine.renderer = REND_RENDERER_CPU;
    assert_false(goes_on(&s, &cpu, &gl));
    assert_true(goes_on(&s, &cpu, &cpu));
    /* The usual choice is one of both, and not the other. */
    assert_true(goes_on(&s, &usual, &gl) != goes_on(&s, &usual, &cpu));
    other.take.look.blend_slab = REND_BLEND_DEFAULT;
    assert_false(goes_on(&s, &usual, &other));
    other = usual, other.take.look.fill_px = 2;
    assert_false(goes_on(&s, &usual, &other));
    other = usual, other.take.look.shape = REND_SHAPE_ROUND;
    assert_false(goes_on(&s, &usual, &other));
    other = usual, other.take.look.point_px_min = 2;
    assert_false(goes_on(&s, &usual, &other));
    scene_fini(&s);
}

static void the_report_has_a_line_for_each_frame(void **unused)
{
    (void)unused;
    scene s;
    mospt_err err = {0};
    scene_make(&s);
    char *path = core_path(s.site.folder, "a.mkv"), *report = core_path(s.site.folder, "r.json");
    rend_record_options options = options_for(&s.path, path);
    options.report = report;
    options.progress = stop_at_five; /* and then in two runs */
    CORE_FAILS(rend_record(s.site.dataset, &options, NULL, &err), MOSPT_ECANCELLED);
    options.progress = NULL;
    CORE_NEED(rend_record(s.site.dataset, &options, NULL, &err));
    size_t size;
    char *text = (char *)core_file_read(report, &size), *at = text;
    for (unsigned i = 0; i < FRAMES; i++) {
        unsigned frame, points, budget;
        double time_s;
        at = strstr(at, "{\"frame\"");
        assert_non_null(at);
        assert_int_equal(sscanf(at, "{\"frame\": %u, \"time\": %lf, \"points\": %u, \"budget\": %u",
                                &frame, &time_s, &points, &budget),
                         4);
        assert_true(frame == i && budget == BUDGET && points <= budget && points > 0);
        at++;
    }
    assert_null(strstr(at, "{\"frame\""));
    free(text), free(path), free(report);
    scene_fini(&s);
}

static bool full_at_eight(void *context, const rend_record_progress *now)
{
    struct rlimit limit = {.rlim_cur = 4096, .rlim_max = RLIM_INFINITY};
    (void)context;
    if (now->drawn == 8) assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
    return true;
}

static void a_full_disk_says_where_it_goes_on(void **unused)
{
    (void)unused;
    const struct rlimit none = {.rlim_cur = RLIM_INFINITY, .rlim_max = RLIM_INFINITY};
    const char *const names[] = {"a.mkv", "a.mp4", "a.png"};
    scene s;
    mospt_err err = {0};
    scene_make(&s);
    signal(SIGXFSZ, SIG_IGN);
    for (int n = 0; n < 3; n++) {
        rend_record_result result;
        unsigned long long frame = 0;
        char *path = core_path(s.site.folder, "%s", names[n]);
        rend_record_options options = options_for(&s.path, path);
        options.progress = full_at_eight;
        CORE_FAILS(rend_record(s.site.dataset, &options, NULL, &err), MOSPT_EIO);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &none), 0);
        const char *told = strstr(err.message, "goes on from frame ");
        assert_non_null(told);
        assert_int_equal(sscanf(told, "goes on from frame %llu", &frame), 1);
        options.progress = NULL;
        CORE_NEED(rend_record(s.site.dataset, &options, &result, &err));
        assert_true(result.resumed_at == frame);
        free(path);
    }
    signal(SIGXFSZ, SIG_DFL);
    scene_fini(&s);
}

static void a_folder_that_is_not_there_is_named(void **unused)
{
    (void)unused;
    scene s;
    mospt_err err = {0};
    scene_make(&s);
    char *path = core_path(s.site.folder, "none/a.mp4"), *none = core_path(s.site.folder, "none");
    rend_record_options options = options_for(&s.path, path);
    CORE_FAILS(rend_record(s.site.dataset, &options, NULL, &err), MOSPT_EIO);
    assert_string_equal(err.file, none);
    free(path), free(none);
    scene_fini(&s);
}

static void what_makes_no_sense_is_refused(void **unused)
{
    (void)unused;
    scene s;
    mospt_err err = {0};
    scene_make(&s);
    char *path = core_path(s.site.folder, "a.mp4"), *doc = core_path(s.site.folder, "a.doc"),
         *part = core_path(s.site.folder, "a.mp4.part");
    for (int fault = 0; fault < 12; fault++) {
        rend_path none = {0};
        rend_record_options options = options_for(&s.path, path);
        if (fault == 0) options.output = doc;
        if (fault == 1) options.codec = "ffv1"; /* not in an MP4 */
        if (fault == 2) options.take.width = 97;
        if (fault == 3) options.first = 30, options.end = 40;
        if (fault == 4) options.path = &none;
        if (fault == 5) options.take.panorama = true; /* 3:2 */
        if (fault == 6) options.take.panorama = options.take.stereo = true;
        if (fault == 7) options.take.width = 20000;
        if (fault == 8) options.has_quality = true, options.quality = 60;
        if (fault == 9) options.take.samples = 99;
        if (fault == 10) options.take.bits = 16; /* H.264 has 8 */
        if (fault == 11) options.report = "/no/such/folder/report.json";
        CORE_FAILS(rend_record(s.site.dataset, &options, NULL, &err),
                   fault == 11 ? MOSPT_EIO : MOSPT_EINVAL);
        assert_false(core_exists(path) || core_exists(part)); /* nothing that is in the way later */
    }
    free(path), free(doc), free(part);
    scene_fini(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_recording_that_is_killed_goes_on_at_its_frame),
        cmocka_unit_test(every_frame_is_the_shot_of_its_camera),
        cmocka_unit_test(caches_do_not_show_and_nothing_is_lost_in_a_lossless_film),
        cmocka_unit_test(every_container_says_what_is_in_it),
        cmocka_unit_test(parts_join_to_the_whole),
        cmocka_unit_test(what_does_not_fit_together_is_not_joined),
        cmocka_unit_test(two_eyes_and_panoramas_are_told_to_players),
        cmocka_unit_test(samples_and_an_open_shutter_smooth_the_picture),
        cmocka_unit_test(fades_words_and_sixteen_bits),
        cmocka_unit_test(live_films_have_all_frames_too),
        cmocka_unit_test(another_recording_does_not_go_on_with_an_unfinished_one),
        cmocka_unit_test(what_draws_and_how_belongs_to_the_recording),
        cmocka_unit_test(the_report_has_a_line_for_each_frame),
        cmocka_unit_test(a_full_disk_says_where_it_goes_on),
        cmocka_unit_test(a_folder_that_is_not_there_is_named),
        cmocka_unit_test(what_makes_no_sense_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
