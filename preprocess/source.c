#include "preprocess/source.h"

#include "mospt/file.h"

#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    BATCHES = 3,
    SAMPLES = 256,       /* of a scan */
    MEASURED_MAX = 4096, /* points that are measured or looked at at a time, */
    MEASURED_MIN = 64,
    MEASURED_SIZE = 1 << 20, /* and bytes, where points are wide */
};

static uint32_t measured_points(const mospt_schema *attributes)
{
    size_t fit = MEASURED_SIZE / prep_batch_point_size(attributes);
    return fit > MEASURED_MAX ? MEASURED_MAX : fit < MEASURED_MIN ? MEASURED_MIN : (uint32_t)fit;
}

static bool leave_out(prep_source *s, const char *name, const mospt_err *why, mospt_err *err)
{
    prep_left_out *list = realloc(s->left_out, (s->left_out_count + 1) * sizeof *list);
    if (list == NULL) return mospt_err_nomem(err, sizeof *list);
    s->left_out = list;
    prep_left_out *entry = &list[s->left_out_count];
    *entry = (prep_left_out){.name = strdup(name), .err = *why};
    if (entry->name == NULL) return mospt_err_nomem(err, strlen(name));
    s->left_out_count++;
    return true;
}

static bool add_scan(prep_source *s, const prep_folder_file *file, uint32_t index,
                     const prep_scan_info *info, mospt_err *err)
{
    prep_source_scan *list = realloc(s->scans, (s->scan_count + 1) * sizeof *list);
    if (list == NULL) return mospt_err_nomem(err, sizeof *list);
    s->scans = list;
    list[s->scan_count] = (prep_source_scan){
        .path = strdup(file->path), .name = strdup(file->name), .index = index, .info = *info};
    s->scan_count++;
    if (list[s->scan_count - 1].path == NULL || list[s->scan_count - 1].name == NULL)
        return mospt_err_nomem(err, strlen(file->path));
    return true;
}

/* Looks at the first points of a scan of which its reader has seen none. */
static bool look_at_first(prep_scan_info *info, prep_scan *reader, mospt_err *err)
{
    prep_batch batch;
    mospt_err why; /* whoever reads the scan will find it again */
    if (!prep_batch_init(&batch, &info->attributes, measured_points(&info->attributes), err))
        return false;
    if (prep_scan_read(reader, &batch, &why)) prep_scan_look(info, &batch);
    prep_batch_fini(&batch);
    return true;
}

bool prep_source_open(const prep_folder_list *list, const prep_scan_options *options,
                      const char *scratch, prep_source *out, mospt_err *err)
{
    prep_source s = {.spool_fd = -1, .options = *options, .spool_folder = strdup(scratch)};
    bool ok = prep_scan_memory_create(&s.options.memory, err) &&
              (s.spool_folder != NULL || mospt_err_nomem(err, strlen(scratch)));
    for (size_t f = 0; ok && f < list->count; f++) {
        uint32_t scans = 1;
        for (uint32_t i = 0; ok && i < scans; i++) {
            prep_scan *scan = NULL;
            mospt_err why = {0};
            if (prep_scan_open(list->files[f].path, i, &s.options, &scan, &why)) {
                const prep_scan_info *info = prep_scan_describe(scan);
                scans = info->scan_count;
                ok = add_scan(&s, &list->files[f], i, info, err);
                if (ok && info->has_bounds && !info->was_looked_at)
                    ok = look_at_first(&s.scans[s.scan_count - 1].info, scan, err);
                prep_scan_close(scan);
            } else {
                ok = leave_out(&s, list->files[f].name, &why, err);
            }
        }
    }
    if (ok) *out = s;
    else prep_source_close(&s);
    return ok;
}

static void free_scan(prep_source_scan *scan)
{
    free(scan->path), free(scan->name), free(scan->samples);
}

void prep_source_close(prep_source *s)
{
    for (uint32_t i = 0; i < s->scan_count; i++)
        free_scan(&s->scans[i]);
    for (uint32_t i = 0; i < s->left_out_count; i++)
        free(s->left_out[i].name);
    if (s->spool_fd >= 0) close(s->spool_fd);
    prep_scan_memory_destroy(s->options.memory);
    free(s->scans), free(s->left_out), free(s->spool_folder);
    *s = (prep_source){.spool_fd = -1};
}

/* A batch as it stands in the spool: the number of its points, and their planes. */
typedef struct {
    uint64_t at;
    uint32_t count;
} piece;

/* Moves points of a batch, from `first` on, to or from those of a piece, from `begin` on. */
static bool move_points(prep_source *s, prep_batch *batch, uint32_t first, const piece *p,
                        uint32_t begin, uint32_t count, bool write, mospt_err *err)
{
    uint8_t *plane[MOSPT_ATTRIBUTES_MAX + 2] = {(uint8_t *)batch->xyz, batch->rgbi};
    size_t size[MOSPT_ATTRIBUTES_MAX + 2] = {PREP_BATCH_XYZ_SIZE, PREP_BATCH_RGBI_SIZE};
    uint64_t at = p->at + sizeof p->count;
    for (uint32_t k = 0; k < batch->plane_count; k++)
        plane[k + 2] = batch->plane[k], size[k + 2] = batch->plane_size[k];
    for (uint32_t k = 0; k < batch->plane_count + 2; k++) {
        uint8_t *bytes = plane[k] + first * size[k];
        uint64_t from = at + begin * size[k];
        bool ok = write ? mospt_file_write_at(s->spool_fd, s->spool_folder, from, bytes,
                                              size[k] * count, err)
                        : mospt_file_read_at(s->spool_fd, s->spool_folder, from, bytes,
                                             size[k] * count, err);
        if (!ok) return false;
        at += size[k] * p->count;
    }
    return true;
}

static bool spool_write(prep_source *s, const mospt_schema *attributes, prep_batch *batch,
                        mospt_err *err)
{
    if (s->spool_fd < 0) {
        char path[4096];
        snprintf(path, sizeof path, "%s/instantpoints-text-XXXXXX", s->spool_folder);
        s->spool_fd = mkostemp(path, O_CLOEXEC);
        if (s->spool_fd < 0)
            return mospt_err_set(err, MOSPT_EIO, mospt_at_file(s->spool_folder),
                                 "no scratch file can be made there");
        unlink(path);
    }
    piece p = {.at = s->spool_size, .count = batch->count};
    s->spool_size += sizeof p.count + p.count * prep_batch_point_size(attributes);
    return mospt_file_write_at(s->spool_fd, s->spool_folder, p.at, &p.count, sizeof p.count, err) &&
           move_points(s, batch, 0, &p, 0, p.count, true, err);
}

/* Takes what a scan says of itself once it has been read to its end, or to its damage. */
static void take_account(prep_source_scan *scan, const prep_scan *reader)
{
    const mospt_err *damage = prep_scan_damage(reader);
    memcpy(scan->dropped, prep_scan_dropped(reader), sizeof scan->dropped);
    if (damage != NULL) scan->damage = *damage;
}

/* Every so many points one is taken; when there is no more room, every second of them goes. */
typedef struct {
    double (*at)[3];
    uint32_t count;
    uint64_t stride, skip; /* points until the next one */
} sampling;

static void take_samples(sampling *s, const prep_batch *batch)
{
    for (uint64_t i = s->skip; i < batch->count; i += s->stride) {
        if (s->count == SAMPLES) {
            for (uint32_t k = 0; k < SAMPLES / 2; k++)
                memcpy(s->at[k], s->at[2 * k], sizeof *s->at);
            s->count = SAMPLES / 2;
            s->stride *= 2;
        }
        memcpy(s->at[s->count++], batch->xyz + 3 * i, sizeof *s->at);
        s->skip = i + s->stride;
    }
    s->skip -= batch->count < s->skip ? batch->count : s->skip;
}

static bool measure_scan(prep_source *s, prep_source_scan *scan, uint64_t *points,
                         prep_source_report report, void *context, mospt_err *why, mospt_err *err)
{
    prep_scan *reader = NULL;
    prep_batch batch = {0};
    bool ok = false, keep = scan->info.is_text;
    sampling samples = {.stride = 1};
    if (!prep_scan_open(scan->path, scan->index, &s->options, &reader, why)) return true;
    for (int a = 0; a < 3; a++)
        scan->info.low[a] = INFINITY, scan->info.high[a] = -INFINITY;
    scan->points = 0;
    scan->spool_offset = s->spool_size;
    if (!prep_batch_init(&batch, &scan->info.attributes, measured_points(&scan->info.attributes),
                         err))
        goto done;
    samples.at = malloc(SAMPLES * sizeof *samples.at);
    if (samples.at == NULL) {
        mospt_err_nomem(err, SAMPLES * sizeof *samples.at);
        goto done;
    }
    for (;;) {
        if (!prep_scan_read(reader, &batch, why)) {
            if (scan->points > 0) scan->damage = *why, *why = (mospt_err){0};
            break;
        }
        if (batch.count == 0) break;
        for (uint32_t i = 0; i < batch.count; i++)
            for (int a = 0; a < 3; a++) {
                scan->info.low[a] = fmin(scan->info.low[a], batch.xyz[3 * i + (uint32_t)a]);
                scan->info.high[a] = fmax(scan->info.high[a], batch.xyz[3 * i + (uint32_t)a]);
            }
        take_samples(&samples, &batch);
        prep_scan_look(&scan->info, &batch);
        if (keep && !spool_write(s, &scan->info.attributes, &batch, err)) goto done;
        scan->points += batch.count;
        *points += batch.count;
        if (!report(context, *points)) {
            mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
            goto done;
        }
    }
    if (scan->damage.code == MOSPT_OK) take_account(scan, reader);
    else memcpy(scan->dropped, prep_scan_dropped(reader), sizeof scan->dropped);
    scan->spool_size = keep ? s->spool_size - scan->spool_offset : 0;
    scan->measured = true;
    scan->samples = samples.at;
    scan->sample_count = samples.count;
    samples.at = NULL;
    if (scan->points == 0 && why->code == MOSPT_OK)
        mospt_err_set(why, MOSPT_EEMPTY, mospt_at_file(scan->path), "holds no point");
    ok = true;
done:
    free(samples.at);
    prep_batch_fini(&batch);
    prep_scan_close(reader);
    return ok;
}

void prep_source_set_range(prep_source *s, const double low[3], const double high[3])
{
    s->options.has_range = true;
    memcpy(s->options.range_low, low, sizeof s->options.range_low);
    memcpy(s->options.range_high, high, sizeof s->options.range_high);
    for (uint32_t i = 0; i < s->scan_count; i++) {
        prep_source_scan *scan = &s->scans[i];
        free(scan->samples);
        scan->samples = NULL;
        scan->sample_count = 0;
        scan->measured = scan->info.was_looked_at = false;
        scan->info.differs = (prep_differing){0};
        memset(&scan->damage, 0, sizeof scan->damage);
    }
}

bool prep_source_measure(prep_source *s, bool all, prep_source_report report, void *context,
                         mospt_err *err)
{
    uint32_t kept = 0;
    uint64_t points = 0;
    bool ok = true;
    for (uint32_t i = 0; i < s->scan_count; i++) {
        prep_source_scan *scan = &s->scans[i];
        mospt_err why = {0};
        bool look = ok && !scan->measured && (all || !scan->info.has_bounds);
        if (look) ok = measure_scan(s, scan, &points, report, context, &why, err);
        if (ok && why.code != MOSPT_OK) {
            ok = leave_out(s, scan->name, &why, err);
            free_scan(scan);
            continue;
        }
        prep_source_scan moved = *scan;
        s->scans[kept++] = moved;
    }
    s->scan_count = kept;
    return ok;
}

/* A slot is filled by the reading thread, handed over, used, and handed back. */
typedef struct {
    prep_batch batch;
    uint32_t scan;
    bool made;
} slot;

struct prep_stream {
    prep_source *source;
    uint32_t capacity;
    pthread_t thread;
    bool thread_runs;
    slot slots[BATCHES];

    pthread_mutex_t lock;
    pthread_cond_t change;
    /* Under the lock: */
    uint64_t filled,
        used; /* slots so far; the first of them are filled % BATCHES and used % BATCHES */
    bool end, stop;
    mospt_err err;
    /* The user's thread only: */
    bool holds;
};

static bool prepare(prep_stream *st, slot *to, uint32_t scan, mospt_err *err)
{
    to->scan = scan;
    to->batch.count = 0;
    const mospt_schema *attributes = &st->source->scans[scan].info.attributes;
    if (to->made && prep_batch_suits(&to->batch, attributes)) return true;
    if (to->made) prep_batch_fini(&to->batch);
    to->made = prep_batch_init(&to->batch, attributes, st->capacity, err);
    to->batch.takes_packed = to->made;
    return to->made;
}

/* Waits for a free slot; NULL if the stream is being closed. */
static slot *await_slot(prep_stream *st)
{
    pthread_mutex_lock(&st->lock);
    while (!st->stop && st->filled - st->used == BATCHES)
        pthread_cond_wait(&st->change, &st->lock);
    slot *free_slot = st->stop ? NULL : &st->slots[st->filled % BATCHES];
    pthread_mutex_unlock(&st->lock);
    return free_slot;
}

static void hand_over(prep_stream *st)
{
    pthread_mutex_lock(&st->lock);
    st->filled++;
    pthread_cond_broadcast(&st->change);
    pthread_mutex_unlock(&st->lock);
}

/* Where the points of a scan in the spool are read. */
typedef struct {
    uint64_t at, end; /* of the piece, of the last one */
    uint32_t taken;   /* points of it */
} cursor;

/* Fills a batch from the spool, which may have been written in larger ones. */
static bool read_spool(prep_stream *st, const mospt_schema *attributes, prep_batch *batch,
                       cursor *from, mospt_err *err)
{
    prep_source *s = st->source;
    batch->packed.unpack = NULL;
    while (from->at < from->end && batch->count < st->capacity) {
        piece p = {.at = from->at};
        if (!mospt_file_read_at(s->spool_fd, s->spool_folder, p.at, &p.count, sizeof p.count, err))
            return false;
        uint32_t n = p.count - from->taken, room = st->capacity - batch->count;
        if (n > room) n = room;
        if (!move_points(s, batch, batch->count, &p, from->taken, n, false, err)) return false;
        batch->count += n;
        from->taken += n;
        if (from->taken < p.count) continue;
        from->at += sizeof p.count + p.count * prep_batch_point_size(attributes);
        from->taken = 0;
    }
    return true;
}

static bool stream_spool(prep_stream *st, uint32_t index, mospt_err *err)
{
    const prep_source_scan *scan = &st->source->scans[index];
    cursor from = {.at = scan->spool_offset, .end = scan->spool_offset + scan->spool_size};
    while (from.at < from.end) {
        slot *to = await_slot(st);
        if (to == NULL) return true;
        if (!prepare(st, to, index, err) ||
            !read_spool(st, &scan->info.attributes, &to->batch, &from, err))
            return false;
        hand_over(st);
    }
    return true;
}

static bool stream_file(prep_stream *st, uint32_t index, mospt_err *err)
{
    prep_source_scan *scan = &st->source->scans[index];
    prep_scan *reader = NULL;
    bool ok = true, more = true;
    scan->points = 0;
    if (!prep_scan_open(scan->path, scan->index, &st->source->options, &reader, &scan->damage))
        return true;
    while (more) {
        slot *to = await_slot(st);
        if (to == NULL) break;
        ok = prepare(st, to, index, err);
        if (!ok) break;
        mospt_err why = {0};
        more = prep_scan_read(reader, &to->batch, &why);
        if (!more) scan->damage = why;
        if (!more || to->batch.count == 0) break;
        scan->points += to->batch.count;
        hand_over(st);
    }
    mospt_err failed = scan->damage;
    take_account(scan, reader);
    if (!more) scan->damage = failed;
    prep_scan_close(reader);
    return ok;
}

static void *read_ahead(void *argument)
{
    prep_stream *st = argument;
    mospt_err err = {0};
    bool ok = true;
    for (uint32_t i = 0; ok && i < st->source->scan_count; i++)
        ok = st->source->scans[i].spool_size > 0 ? stream_spool(st, i, &err)
                                                 : stream_file(st, i, &err);
    pthread_mutex_lock(&st->lock);
    st->end = true;
    st->err = err;
    pthread_cond_broadcast(&st->change);
    pthread_mutex_unlock(&st->lock);
    return NULL;
}

bool prep_stream_open(prep_source *source, uint32_t batch_capacity, prep_stream **out,
                      mospt_err *err)
{
    prep_stream *st = calloc(1, sizeof *st);
    if (st == NULL) return mospt_err_nomem(err, sizeof *st);
    st->source = source;
    st->capacity = batch_capacity;
    pthread_mutex_init(&st->lock, NULL);
    pthread_cond_init(&st->change, NULL);
    if (pthread_create(&st->thread, NULL, read_ahead, st) != 0) {
        prep_stream_close(st);
        return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(), "no thread can be started");
    }
    st->thread_runs = true;
    *out = st;
    return true;
}

bool prep_stream_next(prep_stream *st, const prep_batch **batch, uint32_t *scan, mospt_err *err)
{
    bool ok = true;
    *batch = NULL;
    pthread_mutex_lock(&st->lock);
    if (st->holds) {
        st->used++;
        st->holds = false;
        pthread_cond_broadcast(&st->change);
    }
    while (!st->end && st->filled == st->used)
        pthread_cond_wait(&st->change, &st->lock);
    if (st->filled > st->used) {
        slot *from = &st->slots[st->used % BATCHES];
        *batch = &from->batch;
        *scan = from->scan;
        st->holds = true;
    } else if (st->err.code != MOSPT_OK) {
        if (err != NULL) *err = st->err;
        ok = false;
    }
    pthread_mutex_unlock(&st->lock);
    return ok;
}

void prep_stream_close(prep_stream *st)
{
    if (st == NULL) return;
    pthread_mutex_lock(&st->lock);
    st->stop = true;
    pthread_cond_broadcast(&st->change);
    pthread_mutex_unlock(&st->lock);
    if (st->thread_runs) pthread_join(st->thread, NULL);
    for (int i = 0; i < BATCHES; i++)
        if (st->slots[i].made) prep_batch_fini(&st->slots[i].batch);
    pthread_mutex_destroy(&st->lock);
    pthread_cond_destroy(&st->change);
    free(st);
}
