#include "cli_record.h"

#include "cli_progress.h"
#include "cli_words.h"

#include "render/film/join.h"
#include "render/path_file.h"
#include "render/reel.h"
#include "render/tour.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    cli_progress progress;
    bool (*should_stop)(void);
} context;

static bool make_path(const cli_options *o, const mospt_dataset *dataset, rend_path *out,
                      mospt_err *err)
{
    const uint32_t width = o->width > 0 ? o->width : REND_WIDTH_DEFAULT,
                   height = o->height > 0 ? o->height : REND_HEIGHT_DEFAULT;
    if (o->camera_path != NULL) return rend_path_read(o->camera_path, out, err);
    if (o->film.orbit)
        return rend_tour_orbit(dataset, (double)width / height / (o->film.stereo ? 2 : 1), out,
                               err);
    return rend_tour_walk(dataset, out, err);
}

bool cli_record_path(const cli_options *options, const mospt_dataset *dataset, rend_path *out,
                     mospt_err *err)
{
    rend_path path = {0};
    bool ok = make_path(options, dataset, &path, err);
    if (ok && options->film.duration_s > 0) rend_path_fit(&path, options->film.duration_s);
    if (ok && options->film.save_path != NULL)
        ok = rend_path_write(&path, options->film.save_path, err);
    if (ok) *out = path;
    else rend_path_fini(&path);
    return ok;
}

static bool on_frame(void *user, const rend_record_progress *now)
{
    context *c = user;
    cli_progress_frames(&c->progress, now->frame + 1 - now->first, now->end - now->first,
                        now->drawn, now->seconds, now->points);
    return !c->should_stop();
}

static rend_record_options record_options(const cli_options *o, const rend_path *path, context *c)
{
    const cli_film_options *f = &o->film;
    const char *preset = f->preset != NULL ? f->preset : "medium";
    double rate = f->rate_num > 0 ? (double)f->rate_num / f->rate_den : 30;
    return (rend_record_options){
        .output = o->output,
        .path = path,
        .take = {.width = o->width,
                 .height = o->height,
                 .bits = f->bits,
                 .samples = f->samples,
                 .shutter_s = f->shutter / rate,
                 .subframes = f->subframes,
                 .stereo = f->stereo,
                 .eye_distance = f->eye_distance,
                 .panorama = f->panorama,
                 .live = f->live,
                 .title = f->title,
                 .counter = f->counter,
                 .legend = o->legend,
                 .look = o->look,
                 .limits = o->limits,
                 .engine = {o->renderer, o->threads}},
        .codec = f->codec,
        .preset = strcmp(preset, "fast") == 0   ? RFILM_FAST
                  : strcmp(preset, "slow") == 0 ? RFILM_SLOW
                                                : RFILM_MEDIUM,
        .has_quality = f->has_quality,
        .quality = f->quality,
        .rate_num = f->rate_num,
        .rate_den = f->rate_den,
        .first = f->first,
        .end = f->end,
        .fade_s = f->fade_s,
        .restart = f->restart,
        .report = f->report,
        .progress = on_frame,
        .context = c,
    };
}

bool cli_record(const cli_options *options, const mospt_dataset *dataset, bool (*should_stop)(void),
                rend_record_result *result, mospt_err *err)
{
    rend_path path = {0};
    context c = {.should_stop = should_stop};
    if (!cli_record_path(options, dataset, &path, err)) return false;
    rend_record_options record = record_options(options, &path, &c);
    if (record.first > 0 && record.end == 0)
        record.end = rend_record_frames(&path, record.rate_num > 0 ? record.rate_num : 30,
                                        record.rate_num > 0 ? record.rate_den : 1);
    cli_progress_start(&c.progress, options->quiet);
    bool ok = rend_record(dataset, &record, result, err);
    cli_progress_end(&c.progress);
    rend_path_fini(&path);
    return ok;
}

static void report_json(const cli_options *o, const rend_record_result *r)
{
    json_t *stages = json_pack("{s:f, s:f, s:f, s:f, s:f}", "selecting", r->spent.selecting,
                               "loading", r->spent.loading, "drawing", r->spent.drawing,
                               "reading_back", r->spent.reading, "encoding", r->encoding_s);
    cli_write_json(
        stdout, json_pack("{s:o, s:I, s:I, s:I, s:f, s:f, s:f, s:o, s:I, s:I, s:I, s:s}", "film",
                          cli_text_json(o->output), "frames", (json_int_t)r->frames, "drawn",
                          (json_int_t)r->drawn, "resumed_at", (json_int_t)r->resumed_at, "seconds",
                          r->seconds, "starting_seconds", r->starting_s, "processor_seconds",
                          r->cpu_s, "stage_seconds", stages, "points_most",
                          (json_int_t)r->points_most, "over_budget", (json_int_t)r->over_budget,
                          "damaged_nodes", (json_int_t)r->damaged_nodes, "renderer", r->renderer));
}

/* Where to look: a film, or the first of numbered pictures. */
static void print_place(const cli_options *o)
{
    char *picture =
        rend_reel_is_pictures(o->output) ? rend_reel_picture_name(o->output, o->film.first) : NULL;
    if (picture != NULL) printf("%s and after", picture);
    else printf("%s", o->output);
    free(picture);
}

void cli_record_report(const cli_options *options, const rend_record_result *r)
{
    if (options->json) {
        report_json(options, r);
        return;
    }
    print_place(options);
    printf(": %" PRIu64 " frames", r->frames);
    if (r->drawn < r->frames) printf(", %" PRIu64 " of them in this run", r->drawn);
    if (r->drawn > 0)
        printf(", at most %.2f M points each, %.1f frames/s on %s", (double)r->points_most / 1e6,
               (double)r->drawn / r->seconds, r->renderer);
    printf("\n");
}

static bool on_joined(void *user, size_t done, size_t count)
{
    context *c = user;
    cli_progress_share(&c->progress, "joining", done, count);
    return !c->should_stop();
}

bool cli_join(const cli_options *options, bool (*should_stop)(void), mospt_err *err)
{
    uint64_t frames = 0;
    context c = {.should_stop = should_stop};
    size_t size = strlen(options->output) + 8;
    char *part = malloc(size);
    if (part == NULL) return mospt_err_nomem(err, size);
    snprintf(part, size, "%s.tmp", options->output);
    cli_progress_start(&c.progress, options->quiet);
    bool ok = rfilm_join(options->paths, options->path_count, part, options->output, on_joined, &c,
                         &frames, err);
    cli_progress_end(&c.progress);
    if (ok && rename(part, options->output) != 0)
        ok = mospt_err_set(err, MOSPT_EIO, mospt_at_file(options->output), "cannot be written");
    if (!ok) remove(part);
    free(part);
    if (ok && options->json)
        cli_write_json(stdout, json_pack("{s:o, s:I}", "film", cli_text_json(options->output),
                                         "frames", (json_int_t)frames));
    else if (ok)
        printf("%s: %" PRIu64 " frames of %zu films\n", options->output, frames,
               options->path_count);
    return ok;
}
