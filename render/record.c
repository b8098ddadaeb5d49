#include "render/record.h"

#include "render/choice.h"
#include "render/scheme.h"
#include "render/scout.h"
#include "render/writer.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

enum { RATE_DEFAULT = 30, RATE_MAX = 1000 };

typedef struct {
    const mospt_dataset *dataset;
    rend_record_options options;
    uint64_t all; /* frames of the whole path */
    rend_curve *curve;
    rend_take *take;
    rend_reel *reel;
    rend_writer *writer;
    rend_scout *scout;
    rend_record_result result;
    double start_s, start_cpu_s;
} recorder;

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double cpu_s(void)
{
    struct rusage u;
    getrusage(RUSAGE_SELF, &u);
    return (double)(u.ru_utime.tv_sec + u.ru_stime.tv_sec) +
           1e-6 * (double)(u.ru_utime.tv_usec + u.ru_stime.tv_usec);
}

static double seconds_per_frame(const recorder *r)
{
    return (double)r->options.rate_den / r->options.rate_num;
}

uint64_t rend_record_frames(const rend_path *path, uint32_t rate_num, uint32_t rate_den)
{
    double frames = rend_path_duration(path) * rate_num / rate_den;
    return frames > 1 ? (uint64_t)(frames + 0.5) : 1;
}

/* ---- what is recorded ---- */

static bool set_defaults(recorder *r, mospt_err *err)
{
    rend_record_options *o = &r->options;
    if (o->rate_num == 0) o->rate_num = RATE_DEFAULT, o->rate_den = 1;
    if (o->take.width == 0) o->take.width = REND_WIDTH_DEFAULT;
    if (o->take.height == 0)
        o->take.height = o->take.panorama ? o->take.width / 2 : REND_HEIGHT_DEFAULT;
    if (o->take.bits == 0) o->take.bits = 8;
    if (!rend_path_is_valid(o->path, err)) return false;
    if ((double)o->rate_num / o->rate_den > RATE_MAX)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "more than %d frames a second are not possible", RATE_MAX);
    r->all = rend_record_frames(o->path, o->rate_num, o->rate_den);
    if (o->end == 0) o->end = r->all;
    if (o->first >= o->end || o->end > r->all)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "there are no frames %" PRIu64 " to %" PRIu64 ": the path has %" PRIu64
                             " frames",
                             o->first, o->end - 1, r->all);
    return true;
}

static void print_text(FILE *f, const char *text)
{
    fputc('"', f);
    for (const char *c = text != NULL ? text : ""; *c != '\0'; c++)
        fprintf(f, *c == '"' || *c == '\\' || (unsigned char)*c < 32 ? "\\u%04x" : "%c",
                (unsigned char)*c);
    fputc('"', f);
}

static void print_clip(FILE *f, bool has_clip, const rend_box *clip)
{
    for (int a = 0; has_clip && a < 3; a++)
        fprintf(f, ", \"%.17g to %.17g\"", clip->low[a], clip->high[a]);
}

static void print_key(FILE *f, const rend_key *key)
{
    const double *e = key->camera.eye, *t = key->camera.target, *u = key->camera.up;
    fprintf(f,
            "[%.17g, %.17g, %.17g, %.17g, %.17g, %.17g, %.17g, %.17g, %.17g, %.17g, %.17g, "
            "%" PRIu64 ", ",
            key->time_s, e[0], e[1], e[2], t[0], t[1], t[2], u[0], u[1], u[2], key->camera.fov_rad,
            key->budget_points);
    print_text(f, key->colour);
    print_clip(f, key->has_clip, &key->clip);
    fprintf(f, "]");
}

static void print_look(FILE *f, const rend_look *look)
{
    fprintf(f, "\"look\": [%d, %.9g, %.9g, %.9g, %d, %d, %.9g, %.9g, %d", (int)look->size_mode,
            (double)look->point_px, (double)look->point_m, (double)look->point_px_max,
            (int)look->colour, (int)look->no_edl, (double)look->edl_strength,
            (double)look->edl_radius_px, (int)look->has_background);
    for (int c = 0; c < 3; c++)
        fprintf(f, ", %.9g, %.9g", (double)look->background_top[c],
                (double)look->background_bottom[c]);
    fprintf(f, ", %.9g, %d, %.9g, %u", (double)look->point_px_min, (int)look->shape,
            (double)look->blend_slab, look->fill_px);
    fprintf(f, ", %d, %.17g, %.17g, %d, %.17g, %.17g, ", (int)look->has_range, look->range[0],
            look->range[1], (int)look->map, look->brightness, look->gamma);
    print_text(f, look->attribute);
    print_clip(f, look->has_clip, &look->clip);
    fprintf(f, "],\n");
}

/* All that decides what the film looks like, and nothing else: two jobs of one text may share their
 * frames. Owned; NULL without memory. */
static char *describe_job(const recorder *r, rfilm_codec codec)
{
    const rend_record_options *o = &r->options;
    const rend_take_options *t = &o->take;
    char *text = NULL;
    size_t size;
    FILE *f = open_memstream(&text, &size);
    if (f == NULL) return NULL;
    fprintf(f,
            "{\"version\": \"%s\", \"generation\": %" PRIu64 ", \"points\": \"%016" PRIx64 "\",\n",
            IPTS_VERSION, r->dataset->metadata.generation, r->dataset->metadata.points_hash);
    fprintf(f,
            "\"size\": [%u, %u, %u], \"rate\": [%u, %u], \"frames\": [%" PRIu64 ", %" PRIu64 "],\n",
            t->width, t->height, t->bits, o->rate_num, o->rate_den, o->first, o->end);
    fprintf(f, "\"codec\": [%d, %d, %d, %u], \"fade\": %.17g,\n", (int)codec, (int)o->preset,
            (int)o->has_quality, o->quality, o->fade_s);
    fprintf(f, "\"take\": [%u, %.17g, %u, %d, %.17g, %d, %d, %d],\n", t->samples, t->shutter_s,
            t->subframes, (int)t->stereo, t->eye_distance, (int)t->panorama, (int)t->live,
            (int)t->counter);
    fprintf(f, "\"budget\": %" PRIu64 ", \"node\": %.9g, \"hidden\": %d, \"renderer\": %d,\n",
            t->limits.budget_points, (double)t->limits.min_node_px, (int)t->limits.no_occlusion,
            (int)rend_take_renderer_kind(r->take));
    print_look(f, &t->look);
    fprintf(f, "\"title\": ");
    print_text(f, t->title);
    fprintf(f, ", \"legend\": %d, \"abrupt\": %d, \"keys\": [\n", (int)t->legend,
            (int)o->path->abrupt);
    for (uint32_t i = 0; i < o->path->count; i++) {
        if (i > 0) fprintf(f, ",\n");
        print_key(f, &o->path->keys[i]);
    }
    fprintf(f, "]}\n");
    fclose(f);
    return text;
}

static bool open_reel(recorder *r, mospt_err *err)
{
    const rend_record_options *o = &r->options;
    rfilm_codec codec = RFILM_FFV1;
    bool pictures = rend_reel_is_pictures(o->output);
    if (!pictures && !rfilm_codec_for(o->output, o->codec, &codec, err)) return false;
    char *job = describe_job(r, codec);
    if (job == NULL) return mospt_err_nomem(err, 0);
    const rend_reel_options reel = {
        .path = o->output,
        .job = job,
        .restart = o->restart,
        .from_start = o->take.live, /* what was live is over */
        .first = o->first,
        .end = o->end,
        .segment_frames = (o->rate_num + o->rate_den - 1) / o->rate_den,
        .film = {.codec = codec,
                 .preset = o->preset,
                 .has_quality = o->has_quality,
                 .quality = o->quality,
                 .width = o->take.width,
                 .height = o->take.height,
                 .bits = o->take.bits,
                 .rate_num = o->rate_num,
                 .rate_den = o->rate_den,
                 .side_by_side = o->take.stereo,
                 .panorama = o->take.panorama},
    };
    bool ok = rend_reel_open(&reel, &r->reel, err);
    free(job);
    return ok;
}

/* ---- frames ---- */

static double fade_at(const recorder *r, uint64_t frame)
{
    double fade = r->options.fade_s, per = seconds_per_frame(r);
    double nearest = fmin((double)frame, (double)(r->all - 1 - frame)) * per;
    return fade > 0 ? fmin(nearest / fade, 1) : 1;
}

static rend_take_frame describe_frame(const recorder *r, uint64_t frame)
{
    double time_s = (double)frame * seconds_per_frame(r);
    return (rend_take_frame){.number = frame,
                             .time_s = time_s,
                             .rate = 1 / seconds_per_frame(r),
                             .fade = fade_at(r, frame),
                             .title_s = time_s};
}

/* As in a path's file; nothing without a clip box. */
static void print_sides(const rend_taken *taken, char *out, size_t size)
{
    size_t used = 0;
    out[0] = '\0';
    for (int i = 0; taken->has_clip && i < 6; i++) {
        double side = i < 3 ? taken->clip.low[i] : taken->clip.high[i - 3];
        used += (size_t)snprintf(out + used, size - used, i == 0 ? ", \"clip\": [" : ", ");
        used += (size_t)snprintf(out + used, size - used, isfinite(side) ? "%.17g" : "null", side);
    }
    if (taken->has_clip) snprintf(out + used, size - used, "]");
}

static void write_note(const rend_take_frame *frame, const rend_taken *taken,
                       char note[REND_NOTE_SIZE])
{
    const rend_camera *c = &taken->camera;
    char budget[32] = "null", clip[192];
    print_sides(taken, clip, sizeof clip);
    if (taken->budget_points != REND_ALL)
        snprintf(budget, sizeof budget, "%" PRIu64, taken->budget_points);
    snprintf(note, REND_NOTE_SIZE,
             "{\"frame\": %" PRIu64 ", \"time\": %.17g, \"points\": %" PRIu64
             ", \"budget\": %s, \"nodes\": %u, \"missing\": %u, \"eye\": [%.17g, %.17g, %.17g], "
             "\"target\": [%.17g, %.17g, %.17g], \"up\": [%.17g, %.17g, %.17g], \"fov\": %.17g%s}",
             frame->number, frame->time_s, taken->points_drawn, budget, taken->nodes_drawn,
             taken->pending, c->eye[0], c->eye[1], c->eye[2], c->target[0], c->target[1],
             c->target[2], c->up[0], c->up[1], c->up[2], c->fov_rad * 180 / 3.14159265358979323846,
             clip);
}

static bool tell(recorder *r, const rend_take_frame *frame, const rend_taken *taken, mospt_err *err)
{
    rend_record_result *result = &r->result;
    result->drawn++;
    if (taken->points_drawn > result->points_most) result->points_most = taken->points_drawn;
    if (taken->points_drawn > taken->budget_points) result->over_budget++;
    const rend_record_progress now = {.frame = frame->number,
                                      .first = r->options.first,
                                      .end = r->options.end,
                                      .drawn = result->drawn,
                                      .seconds = now_s() - r->start_s,
                                      .points = taken->points_drawn};
    if (r->options.progress == NULL || r->options.progress(r->options.context, &now)) return true;
    return mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(),
                         "stopped; the same command goes on with it");
}

/* False without an error where the writer has met one, which is told when it ends. */
static bool record_frame(recorder *r, uint64_t number, mospt_err *err)
{
    rend_take_frame frame = describe_frame(r, number);
    rend_taken taken;
    char note[REND_NOTE_SIZE];
    double next = (double)(number + 1) * seconds_per_frame(r);
    if (r->scout != NULL) rend_scout_reached(r->scout, number);
    void *picture = rend_writer_slot(r->writer);
    if (picture == NULL) return false;
    if (!rend_take_run(r->take, r->curve, &frame, number + 1 < r->options.end ? &next : NULL,
                       picture, &taken, err))
        return false;
    write_note(&frame, &taken, note);
    rend_writer_put(r->writer, note);
    return tell(r, &frame, &taken, err);
}

static bool record_converged(recorder *r, mospt_err *err)
{
    bool ok = true;
    for (uint64_t i = rend_reel_next(r->reel); ok && i < r->options.end; i++)
        ok = record_frame(r, i, err);
    return ok;
}

/* ---- live ---- */

static void sleep_s(double seconds)
{
    if (!(seconds > 0)) return;
    struct timespec t = {.tv_sec = (time_t)seconds};
    t.tv_nsec = (long)((seconds - (double)t.tv_sec) * 1e9);
    nanosleep(&t, NULL);
}

/* Shows one picture for as many frames as went by while it was drawn. */
static bool put_for(recorder *r, const void *picture, size_t size, const rend_taken *taken,
                    uint64_t *frame, uint64_t until, mospt_err *err)
{
    for (; *frame < until && *frame < r->options.end; ++*frame) {
        char note[REND_NOTE_SIZE];
        rend_take_frame now = describe_frame(r, *frame);
        void *slot = rend_writer_slot(r->writer);
        if (slot == NULL) return false;
        memcpy(slot, picture, size);
        write_note(&now, taken, note);
        rend_writer_put(r->writer, note);
        if (!tell(r, &now, taken, err)) return false;
    }
    return true;
}

/* The clock of the film is that of the drawing alone: it stands still while frames wait to be
 * encoded. */
static bool record_live(recorder *r, size_t size, mospt_err *err)
{
    double per = seconds_per_frame(r), film_s = (double)r->options.first * per;
    uint64_t frame = r->options.first;
    void *picture = malloc(size);
    bool ok = picture != NULL || mospt_err_nomem(err, size);
    while (ok && frame < r->options.end) {
        rend_take_frame now = describe_frame(r, frame);
        rend_taken taken;
        double start = now_s();
        ok = rend_take_run(r->take, r->curve, &now, NULL, picture, &taken, err);
        sleep_s(per - (now_s() - start));
        film_s += fmax(now_s() - start, per);
        uint64_t until = (uint64_t)(film_s / per + 1e-6);
        ok =
            ok && put_for(r, picture, size, &taken, &frame, until > frame ? until : frame + 1, err);
    }
    free(picture);
    return ok;
}

/* ---- all of it ---- */

/* Before hours of drawing, not after. */
static bool colours_fit(const recorder *r, mospt_err *err)
{
    const rend_path *path = r->options.path;
    bool ok = rend_scheme_fits(r->dataset, &r->options.take.look, err);
    for (uint32_t i = 0; ok && i < path->count; i++) {
        rend_look look = {0};
        if (path->keys[i].colour[0] == '\0') continue;
        rend_choice_read(path->keys[i].colour, &look);
        ok = rend_scheme_fits(r->dataset, &look, err);
    }
    return ok;
}

/* Before hours of drawing, too. */
static bool can_report(const recorder *r, mospt_err *err)
{
    FILE *f = r->options.report != NULL ? fopen(r->options.report, "a") : NULL;
    if (f != NULL) fclose(f);
    return f != NULL || r->options.report == NULL ||
           mospt_err_set(err, MOSPT_EIO, mospt_at_file(r->options.report), "cannot be written");
}

/* Before anything is made: the folder of the film is what has to be mended. */
static bool can_write_beside(const char *output, mospt_err *err)
{
    char *folder = strdup(output);
    if (folder == NULL) return mospt_err_nomem(err, strlen(output) + 1);
    char *slash = strrchr(folder, '/');
    if (slash != NULL) slash[slash == folder ? 1 : 0] = '\0';
    const char *place = slash != NULL ? folder : ".";
    bool ok = access(place, W_OK | X_OK) == 0 ||
              mospt_err_set(err, MOSPT_EIO, mospt_at_file(place), "no film can be put here");
    free(folder);
    return ok;
}

static bool start(recorder *r, mospt_err *err)
{
    if (!set_defaults(r, err) || !rend_take_fits(&r->options.take, err) || !colours_fit(r, err) ||
        !can_write_beside(r->options.output, err) || !can_report(r, err))
        return false;
    /* The reel after what draws: pictures of two back ends do not mix. */
    return rend_curve_create(r->options.path, &r->curve, err) &&
           rend_take_create(r->dataset, &r->options.take, &r->take, err) && open_reel(r, err);
}

static bool draw_all(recorder *r, mospt_err *err)
{
    const rend_take_options *o = &r->options.take;
    size_t size = (size_t)o->width * o->height * 3 * (o->bits / 8);
    uint64_t next = rend_reel_next(r->reel);
    if (!rend_writer_start(r->reel, size, &r->writer, err)) return false;
    if (!o->live && !rend_scout_start(r->dataset, r->take, r->curve, seconds_per_frame(r), next,
                                      r->options.end, &r->scout, err))
        return false;
    r->result.starting_s = now_s() - r->start_s;
    bool drawn = o->live ? record_live(r, size, err) : record_converged(r, err);
    rend_scout_destroy(r->scout);
    mospt_err write_err = {0};
    bool written = rend_writer_finish(r->writer, &write_err);
    if (!written && err != NULL) *err = write_err; /* it came first */
    return drawn && written;
}

/* A full disk, above all: what is done is not lost. */
static void say_that_it_goes_on(const recorder *r, mospt_err *err)
{
    if (err == NULL || err->code != MOSPT_EIO || r->reel == NULL || r->options.take.live) return;
    size_t used = strlen(err->message), room = sizeof err->message - used;
    uint64_t next = rend_reel_next(r->reel);
    if (next == r->options.end)
        snprintf(err->message + used, room, "; all frames are there, the same command finishes it");
    else
        snprintf(err->message + used, room,
                 "; once that is mended, the same command goes on from frame %" PRIu64, next);
}

static void note_result(recorder *r)
{
    rend_figures figures;
    rend_take_figures(r->take, &figures);
    r->result.spent = rend_take_spent(r->take);
    if (r->writer != NULL) r->result.encoding_s = rend_writer_busy_s(r->writer);
    r->result.damaged_nodes = figures.damaged_nodes;
    r->result.damaged_points = figures.damaged_points;
    r->result.damage = figures.damage;
    r->result.resets = figures.resets;
    strncpy(r->result.renderer, rend_take_renderer(r->take), sizeof r->result.renderer - 1);
}

bool rend_record(const mospt_dataset *dataset, const rend_record_options *options,
                 rend_record_result *result, mospt_err *err)
{
    recorder r = {
        .dataset = dataset, .options = *options, .start_s = now_s(), .start_cpu_s = cpu_s()};
    bool ok = start(&r, err);
    if (ok) {
        r.result.resumed_at = rend_reel_next(r.reel);
        ok = r.result.resumed_at == r.options.end || draw_all(&r, err);
        if (ok) note_result(&r);
    }
    rend_writer_destroy(r.writer);
    rend_take_destroy(r.take);
    ok = ok && rend_reel_finish(r.reel, options->report, err);
    if (!ok) say_that_it_goes_on(&r, err);
    rend_reel_close(r.reel);
    rend_curve_destroy(r.curve);
    r.result.frames = r.options.end - r.options.first;
    r.result.seconds = now_s() - r.start_s;
    r.result.cpu_s = cpu_s() - r.start_cpu_s;
    if (ok && result != NULL) *result = r.result;
    return ok;
}
