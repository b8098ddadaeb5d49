#include "render/reel.h"

#include "mospt/file.h"
#include "render/film/join.h"
#include "render/image.h"
#include "render/rushes.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { JOB_SIZE_MAX = 64 << 20, NOTES_SIZE_MAX = 1 << 30 };

struct rend_reel {
    rend_reel_options options;
    char *folder; /* owned */
    bool pictures;
    uint64_t next;
    rfilm_encoder *encoder; /* of the segment in hand; NULL between segments */
    rend_rushes *rushes;
    char *film, *raw; /* owned: where those two write */
    FILE *notes;
};

/* Owned; NULL without memory. */
static char *make_name(const char *format, ...) __attribute__((format(printf, 1, 2)));
static char *make_name(const char *format, ...)
{
    char *name = NULL;
    va_list values;
    va_start(values, format);
    int length = vasprintf(&name, format, values);
    va_end(values);
    return length >= 0 ? name : NULL;
}

static const char *ending(const char *path)
{
    const char *dot = strrchr(path, '.');
    return dot != NULL ? dot : "";
}

bool rend_reel_is_pictures(const char *path)
{
    return strcmp(ending(path), ".png") == 0;
}

char *rend_reel_picture_name(const char *path, uint64_t frame)
{
    char *stem = strdup(path), *name;
    if (stem == NULL) return NULL;
    stem[strlen(path) - strlen(ending(path))] = '\0';
    name = make_name("%s-%06" PRIu64 ".png", stem, frame);
    free(stem);
    return name;
}

static bool is_there(const char *path)
{
    struct stat status;
    return stat(path, &status) == 0;
}

static size_t frame_size(const rend_reel *r)
{
    const rfilm_options *f = &r->options.film;
    return (size_t)f->width * f->height * 3 * (f->bits / 8);
}

/* ---- segments ---- */

static uint64_t segment_of(const rend_reel *r, uint64_t frame)
{
    return frame / r->options.segment_frames;
}

static uint64_t segment_end(const rend_reel *r, uint64_t segment)
{
    uint64_t end = (segment + 1) * r->options.segment_frames;
    return end < r->options.end ? end : r->options.end;
}

/* Owned name of a segment's film; containers are told by the ending, also here. */
static char *segment_name(const rend_reel *r, uint64_t segment)
{
    return make_name("%s/%08" PRIu64 "%s", r->folder, segment, ending(r->options.path));
}

/* Whole segments, in order; the first that is missing is the one to go on with. */
static bool skip_whole_segments(rend_reel *r, mospt_err *err)
{
    while (r->next < r->options.end) {
        char *name = segment_name(r, segment_of(r, r->next));
        if (name == NULL) return mospt_err_nomem(err, 0);
        bool whole = is_there(name);
        free(name);
        if (!whole) break;
        r->next = segment_end(r, segment_of(r, r->next));
    }
    return true;
}

static bool skip_pictures(rend_reel *r, mospt_err *err)
{
    for (; r->next < r->options.end; r->next++) {
        char *name = rend_reel_picture_name(r->options.path, r->next);
        if (name == NULL) return mospt_err_nomem(err, 0);
        bool whole = is_there(name);
        free(name);
        if (!whole) break;
    }
    return true;
}

static void forget_segment(rend_reel *r)
{
    rfilm_encoder_destroy(r->encoder);
    rend_rushes_close(r->rushes);
    free(r->film);
    free(r->raw);
    r->encoder = NULL, r->rushes = NULL, r->film = r->raw = NULL;
}

/* Its name says that a segment is whole: that must hold after a power cut, too. */
static bool flush(const char *path, mospt_err *err)
{
    int fd = open(path, O_RDWR | O_CLOEXEC);
    bool ok = fd >= 0 && fsync(fd) == 0;
    if (!ok) mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be written");
    if (fd >= 0) close(fd);
    return ok;
}

static bool end_segment(rend_reel *r, mospt_err *err)
{
    char *name = segment_name(r, segment_of(r, r->next - 1));
    bool ok = name != NULL || mospt_err_nomem(err, 0);
    ok = ok && rfilm_encoder_finish(r->encoder, err) && flush(r->film, err);
    ok = ok && (rename(r->film, name) == 0 ||
                mospt_err_set(err, MOSPT_EIO, mospt_at_file(name), "cannot be written"));
    if (ok) unlink(r->raw);
    free(name);
    forget_segment(r);
    return ok;
}

static bool end_if_whole(rend_reel *r, mospt_err *err)
{
    bool whole = r->next == segment_end(r, segment_of(r, r->next - 1));
    return !whole || end_segment(r, err);
}

/* Frames that were drawn before the recording was interrupted are encoded again. */
static bool replay(rend_reel *r, mospt_err *err)
{
    uint32_t count = rend_rushes_count(r->rushes);
    void *frame = malloc(frame_size(r));
    bool ok = frame != NULL || mospt_err_nomem(err, frame_size(r));
    for (uint32_t i = 0; ok && i < count; i++)
        ok =
            rend_rushes_read(r->rushes, i, frame, err) && rfilm_encoder_add(r->encoder, frame, err);
    free(frame);
    r->next += count;
    return ok && (count == 0 || end_if_whole(r, err));
}

static bool begin_segment(rend_reel *r, mospt_err *err)
{
    uint64_t segment = segment_of(r, r->next);
    r->film = make_name("%s/%08" PRIu64 ".tmp", r->folder, segment);
    r->raw = make_name("%s/%08" PRIu64 ".rushes", r->folder, segment);
    if (r->film == NULL || r->raw == NULL) return mospt_err_nomem(err, 0);
    return rfilm_encoder_open(r->film, r->options.path, &r->options.film, &r->encoder, err) &&
           rend_rushes_open(r->raw, frame_size(r), &r->rushes, err) && replay(r, err);
}

/* ---- opening ---- */

/* Pictures of an older recording would look as if they were of this one. */
static bool remove_pictures(rend_reel *r, mospt_err *err)
{
    for (uint64_t i = r->options.first; r->pictures && i < r->options.end; i++) {
        char *name = rend_reel_picture_name(r->options.path, i);
        if (name == NULL) return mospt_err_nomem(err, 0);
        bool gone = unlink(name) == 0 || errno == ENOENT;
        if (!gone) mospt_err_set(err, MOSPT_EIO, mospt_at_file(name), "cannot be replaced");
        free(name);
        if (!gone) return false;
    }
    return true;
}

static bool start_job(rend_reel *r, const char *job_file, mospt_err *err)
{
    if (!mospt_file_remove_tree(r->folder, err) || !remove_pictures(r, err)) return false;
    if (mkdir(r->folder, 0777) != 0)
        return mospt_err_set(err, MOSPT_EIO, mospt_at_file(r->folder), "cannot be created");
    return mospt_file_replace(job_file, r->options.job, strlen(r->options.job), err);
}

/* Goes on with a job that is there, or starts it. */
static bool open_job(rend_reel *r, mospt_err *err)
{
    char *file = mospt_file_join(r->folder, "job.json"), *text = NULL;
    size_t size;
    if (file == NULL) return mospt_err_nomem(err, 0);
    bool is_here = is_there(file) && mospt_file_read_whole(file, JOB_SIZE_MAX, &text, &size, NULL);
    bool is_same = is_here && strcmp(text, r->options.job) == 0, ok = true;
    free(text);
    if (is_here && !is_same && !r->options.restart)
        ok = mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(r->folder),
                           "holds an unfinished recording of something else, or with other "
                           "options; --restart discards it");
    else if (!is_same || r->options.from_start) ok = start_job(r, file, err);
    free(file);
    return ok;
}

static bool open_notes(rend_reel *r, mospt_err *err)
{
    char *file = mospt_file_join(r->folder, "notes");
    if (file == NULL) return mospt_err_nomem(err, 0);
    r->notes = fopen(file, "a");
    if (r->notes == NULL) mospt_err_set(err, MOSPT_EIO, mospt_at_file(file), "cannot be written");
    free(file);
    return r->notes != NULL;
}

bool rend_reel_open(const rend_reel_options *options, rend_reel **out, mospt_err *err)
{
    rend_reel *r = calloc(1, sizeof *r);
    if (r == NULL) return mospt_err_nomem(err, sizeof *r);
    r->options = *options;
    r->next = options->first;
    r->pictures = rend_reel_is_pictures(options->path);
    r->folder = make_name("%s.part", options->path);
    bool ok = r->folder != NULL || mospt_err_nomem(err, 0);
    ok = ok && (r->pictures || rfilm_options_fit(&options->film, options->path, err));
    ok = ok && open_job(r, err) && open_notes(r, err) &&
         (r->pictures ? skip_pictures(r, err) : skip_whole_segments(r, err));
    if (ok && !r->pictures && r->next < options->end) ok = begin_segment(r, err);
    if (!ok) rend_reel_close(r);
    else *out = r;
    return ok;
}

void rend_reel_close(rend_reel *reel)
{
    if (reel == NULL) return;
    forget_segment(reel);
    if (reel->notes != NULL) fclose(reel->notes);
    free(reel->folder);
    free(reel);
}

uint64_t rend_reel_next(const rend_reel *reel)
{
    return reel->next;
}

/* ---- adding ---- */

static bool add_picture(rend_reel *r, const void *rgb, mospt_err *err)
{
    const rfilm_options *f = &r->options.film;
    char *name = rend_reel_picture_name(r->options.path, r->next);
    if (name == NULL) return mospt_err_nomem(err, 0);
    bool ok = f->bits == 16 ? rend_image_write16(name, rgb, f->width, f->height, err)
                            : rend_image_write(name, rgb, f->width, f->height, err);
    free(name);
    if (ok) r->next++;
    return ok;
}

bool rend_reel_add(rend_reel *reel, const void *rgb, const char *note, mospt_err *err)
{
    if (fprintf(reel->notes, "%s\n", note) < 0 || fflush(reel->notes) != 0)
        return mospt_err_set(err, MOSPT_EIO, mospt_at_file(reel->folder), "cannot be written");
    if (reel->pictures) return add_picture(reel, rgb, err);
    if (reel->encoder == NULL && !begin_segment(reel, err)) return false;
    if (!rend_rushes_add(reel->rushes, rgb, err) || !rfilm_encoder_add(reel->encoder, rgb, err))
        return false;
    reel->next++;
    return end_if_whole(reel, err);
}

/* ---- the end ---- */

/* The last whole line that was written for each frame. */
static bool copy_notes(rend_reel *r, char *text, FILE *out, mospt_err *err)
{
    uint64_t count = r->options.end - r->options.first, frame;
    const char **lines = calloc(count, sizeof *lines);
    if (lines == NULL) return mospt_err_nomem(err, count * sizeof *lines);
    for (char *line = text, *end; (end = strchr(line, '\n')) != NULL; line = end + 1) {
        *end = '\0';
        if (end > line && end[-1] == '}' && sscanf(line, "{\"frame\": %" SCNu64, &frame) == 1 &&
            frame >= r->options.first && frame < r->options.end)
            lines[frame - r->options.first] = line;
    }
    fprintf(out, "[\n");
    for (uint64_t i = 0; i < count; i++)
        fprintf(out, "%s%s\n", lines[i] != NULL ? lines[i] : "null", i + 1 < count ? "," : "");
    fprintf(out, "]\n");
    free(lines);
    return true;
}

static bool write_notes(rend_reel *r, const char *path, mospt_err *err)
{
    char *file = mospt_file_join(r->folder, "notes"), *text = NULL, *list = NULL;
    size_t size, list_size = 0;
    FILE *out = open_memstream(&list, &list_size);
    bool ok = (file != NULL && out != NULL) || mospt_err_nomem(err, 0);
    ok = ok && mospt_file_read_whole(file, NOTES_SIZE_MAX, &text, &size, err) &&
         copy_notes(r, text, out, err);
    if (out != NULL && fclose(out) != 0 && ok) ok = mospt_err_nomem(err, list_size);
    ok = ok && mospt_file_replace(path, list, list_size, err);
    free(file), free(text), free(list);
    return ok;
}

static bool join_segments(rend_reel *r, mospt_err *err)
{
    uint64_t first = segment_of(r, r->options.first), count = segment_of(r, r->options.end - 1) + 1;
    char **names = calloc(count - first, sizeof *names);
    char *film = mospt_file_join(r->folder, "film.tmp");
    bool ok = (names != NULL && film != NULL) || mospt_err_nomem(err, count * sizeof *names);
    for (uint64_t i = first; ok && i < count; i++)
        ok = (names[i - first] = segment_name(r, i)) != NULL || mospt_err_nomem(err, 0);
    ok = ok && rfilm_join((const char *const *)names, count - first, film, r->options.path, NULL,
                          NULL, NULL, err);
    if (ok && rename(film, r->options.path) != 0)
        ok = mospt_err_set(err, MOSPT_EIO, mospt_at_file(r->options.path), "cannot be written");
    for (uint64_t i = first; names != NULL && i < count; i++)
        free(names[i - first]);
    free(names), free(film);
    return ok;
}

bool rend_reel_finish(rend_reel *reel, const char *notes, mospt_err *err)
{
    if (notes != NULL && !write_notes(reel, notes, err)) return false;
    return (reel->pictures || join_segments(reel, err)) &&
           mospt_file_remove_tree(reel->folder, err);
}
