#include "preprocess/e57.h"

#include "preprocess/bytes.h"
#include "preprocess/e57_index.h"
#include "preprocess/e57_planes.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    SAMPLE_PROBES = 64,
    SAMPLE_WALK_MAX = 1024 /* packets, at most 64 MiB of a scan */
};

typedef struct {
    prep_e57_found found;
    prep_e57_pages pages;
    prep_e57_vector vector;
    prep_e57_points points;
    uint64_t next; /* record */
    bool is_ended; /* before the last record */
} e57_state;

typedef struct {
    double *intensity; /* [PREP_TONE_SAMPLES], owned */
    size_t intensity_count;
    double *xyz; /* [PREP_E57_BLOCK][3], owned */
    double low[3], high[3];
    double rgb_max, return_index_min;
    uint64_t record_count;
} sample;

static void add_largest(const e57_state *e57, sample *s, int channel, uint32_t count, double *out)
{
    if (channel < 0) return;
    prep_e57_points_values(&e57->points, channel, count, s->xyz, 1);
    for (uint32_t i = 0; i < count; i++)
        if (e57->points.keep[i] && isfinite(s->xyz[i]) && s->xyz[i] > *out) *out = s->xyz[i];
}

static void add_to_sample(e57_state *e57, sample *s, uint32_t count)
{
    prep_e57_points *p = &e57->points;
    prep_e57_points_keep(p, count, p->keep);
    s->record_count += count;
    for (int c = 0; c < 3; c++)
        add_largest(e57, s, p->rgb[c], count, &s->rgb_max);
    if (p->return_index >= 0) {
        prep_e57_points_values(p, p->return_index, count, s->xyz, 1);
        for (uint32_t i = 0; i < count; i++)
            s->return_index_min = fmin(s->return_index_min, s->xyz[i]);
    }
    if (p->intensity >= 0) {
        prep_e57_points_values(p, p->intensity, count, s->xyz, 1);
        for (uint32_t i = 0; i < count && s->intensity_count < PREP_TONE_SAMPLES; i++)
            if (p->keep[i]) s->intensity[s->intensity_count++] = s->xyz[i];
    }
    prep_e57_points_xyz(p, count, s->xyz);
    for (uint32_t i = 0; i < count; i++) {
        for (int a = 0; a < 3 && p->keep[i]; a++) {
            s->low[a] = fmin(s->low[a], s->xyz[3 * i + (uint32_t)a]);
            s->high[a] = fmax(s->high[a], s->xyz[3 * i + (uint32_t)a]);
        }
    }
}

/* Adds up to `count` records that follow each other. */
static bool sample_here(e57_state *e57, sample *s, uint64_t count, mospt_err *err)
{
    while (count > 0) {
        uint32_t want = count < PREP_E57_BLOCK ? (uint32_t)count : PREP_E57_BLOCK, got;
        if (!prep_e57_points_load(&e57->points, &e57->vector, want, &got, err)) return false;
        if (got == 0) break;
        add_to_sample(e57, s, got);
        count -= got;
    }
    return true;
}

/* Packets of a scan, as far as the first one tells: all but the last are of about the same size. */
static uint64_t guess_packets(e57_state *e57)
{
    uint8_t head[4];
    size_t got;
    const prep_e57_vector *v = &e57->vector;
    if (!prep_e57_pages_read(&e57->pages, v->begin, head, sizeof head, &got, NULL) ||
        got < sizeof head)
        return 1;
    return (v->end - v->begin) / ((uint64_t)prep_le16(head + 2) + 1) + 1;
}

/* Takes the sample from packets all over the scan: its first columns may show nothing but the
 * tripod. */
static bool sample_scan(e57_state *e57, sample *s, uint64_t *before, mospt_err *err)
{
    prep_e57_points *p = &e57->points;
    prep_e57_stream *streams[PREP_E57_CHANNELS_MAX];
    for (uint32_t i = 0; i < p->channel_count; i++)
        streams[i] = &p->channel[i].stream;
    uint64_t packets = guess_packets(e57);
    if (packets > SAMPLE_WALK_MAX) packets = SAMPLE_WALK_MAX;
    if (e57->found.desc->record_count <= PREP_TONE_SAMPLES) packets = 1; /* all of them */
    uint64_t probes = packets < SAMPLE_PROBES ? packets : SAMPLE_PROBES;
    prep_e57_walk walk = {.packet = e57->vector.begin, .before = before};
    prep_e57_points_start(p, &e57->vector);
    bool can_jump = true;
    for (uint64_t i = 0; i < probes; i++) {
        uint64_t left = e57->found.desc->record_count - s->record_count;
        uint64_t share = PREP_TONE_SAMPLES / probes;
        if (!sample_here(e57, s, share < left ? share : left, err)) return false;
        e57->pages.ahead = 4;
        can_jump = can_jump && i + 1 < probes &&
                   prep_e57_walk_on(&walk, &e57->vector, (uint32_t)(packets / probes)) &&
                   prep_e57_walk_enter(&walk, streams, p->channel_count);
    }
    return true;
}

static bool is_inside(const sample *s, const double low[3], const double high[3], double slack)
{
    for (int a = 0; a < 3; a++)
        if (s->low[a] < low[a] - slack || s->high[a] > high[a] + slack) return false;
    return true;
}

/* The box of the scan in its own frame, as its description gives it. */
static bool declared_box(const e57_state *e57, double low[3], double high[3])
{
    const prep_e57_scan *d = e57->found.desc;
    bool ok = true;
    for (int a = 0; a < 3; a++) {
        low[a] = d->low[a];
        high[a] = d->high[a];
        ok = ok && low[a] <= high[a];
    }
    double range = d->range_max;
    if (ok || !e57->points.is_spherical || !(range > 0)) return ok;
    for (int a = 0; a < 3; a++)
        low[a] = -range, high[a] = range;
    if (fabs(d->elevation_low) < 1.58) low[2] = fmin(0, range * sin(d->elevation_low));
    if (fabs(d->elevation_high) < 1.58) high[2] = fmax(0, range * sin(d->elevation_high));
    return true;
}

/* Bounds that a sample refutes, or that are a hundred times as large as it, would do more harm than
 * none: the builder takes the size of the grid from them. */
static void set_bounds(prep_scan *scan, const e57_state *e57, const sample *s)
{
    const double *m = e57->points.pose;
    double box[2][3], low[3], high[3], extent = 0, seen = 0;
    if (!declared_box(e57, box[0], box[1])) return;
    for (int a = 0; a < 3; a++) {
        low[a] = high[a] = m[4 * a + 3];
        for (int b = 0; b < 3; b++) {
            double p = m[4 * a + b] * box[0][b], q = m[4 * a + b] * box[1][b];
            low[a] += fmin(p, q);
            high[a] += fmax(p, q);
        }
        extent = fmax(extent, high[a] - low[a]);
        seen = fmax(seen, s->high[a] - s->low[a]);
    }
    if (!(extent < 1e9) || extent > 100 * seen || !is_inside(s, low, high, 1e-3 + 1e-3 * extent))
        return;
    scan->info.has_bounds = true;
    memcpy(scan->info.low, low, sizeof low);
    memcpy(scan->info.high, high, sizeof high);
}

static bool take_sample(prep_scan *scan, e57_state *e57, mospt_err *err)
{
    sample s = {.return_index_min = INFINITY};
    uint64_t *before = calloc(PREP_E57_STREAMS_MAX, sizeof *before);
    s.intensity = malloc(PREP_TONE_SAMPLES * sizeof *s.intensity);
    s.xyz = malloc(3 * PREP_E57_BLOCK * sizeof *s.xyz);
    for (int a = 0; a < 3; a++)
        s.low[a] = INFINITY, s.high[a] = -INFINITY;
    bool ok = before != NULL && s.intensity != NULL && s.xyz != NULL;
    if (!ok) mospt_err_nomem(err, PREP_TONE_SAMPLES * sizeof *s.intensity);
    ok = ok && sample_scan(e57, &s, before, err);
    if (ok && s.record_count == 0) {
        const prep_e57_vector *v = &e57->vector;
        ok =
            mospt_err_set(err, MOSPT_EFORMAT,
                          mospt_at_byte(scan->path, v->fault != NULL ? v->fault_place
                                                                     : prep_e57_physical(v->begin)),
                          "%s", v->fault != NULL ? v->fault : "the section of points holds none");
    }
    if (ok) {
        e57->points.tone = prep_tone_make(s.intensity, s.intensity_count);
        scan->info.has_intensity = e57->points.intensity >= 0 && !e57->points.tone.is_flat;
        prep_e57_planes_add(&e57->points, scan, e57->found.desc, s.rgb_max, s.return_index_min);
        set_bounds(scan, e57, &s);
    }
    free(s.intensity);
    free(s.xyz);
    free(before);
    return ok;
}

/* Scaled integers that are only shifted keep their grid. */
static void set_step(prep_scan *scan, const e57_state *e57)
{
    const prep_e57_points *p = &e57->points;
    double scale[3];
    if (p->is_spherical || p->has_rotation) return;
    for (int a = 0; a < 3; a++) {
        const prep_e57_field *f = p->channel[p->xyz[a]].field;
        if (f->kind != PREP_E57_SCALED && f->kind != PREP_E57_INTEGER) return;
        scale[a] = fabs(f->scale);
        /* finer than anything measured: not a grid, but a float in disguise */
        if (!(scale[a] >= 1e-9)) return;
    }
    scan->info.step = prep_scan_common_step(scale);
    for (int a = 0; a < 3 && scan->info.step > 0; a++)
        scan->info.offset[a] = p->channel[p->xyz[a]].field->offset + p->pose[4 * a + 3];
}

static const char *kind_name(const e57_state *e57)
{
    switch (e57->points.channel[e57->points.xyz[0]].field->kind) {
    case PREP_E57_INTEGER:
        return "integers";
    case PREP_E57_SCALED:
        return "scaled integers";
    case PREP_E57_FLOAT:
        return "single precision";
    default:
        return "double precision";
    }
}

static void describe(prep_scan *scan, const e57_state *e57, uint32_t index)
{
    prep_scan_info *info = &scan->info;
    const prep_e57_scan *d = e57->found.desc;
    const prep_e57_points *p = &e57->points;
    snprintf(info->format, sizeof info->format, "E57 %" PRIu32 ".%" PRIu32 ", %s, %s",
             e57->found.major, e57->found.minor, p->is_spherical ? "spherical" : "Cartesian",
             kind_name(e57));
    if (d->name[0] != '\0' || d->guid[0] != '\0')
        snprintf(info->name, sizeof info->name, "%s", d->name[0] != '\0' ? d->name : d->guid);
    else if (info->scan_count > 1)
        snprintf(info->name, sizeof info->name, "scan %" PRIu32, index + 1);
    uint64_t room = prep_e57_vector_room(&e57->vector, prep_e57_points_bits(p));
    info->point_count = d->record_count < room ? d->record_count : room;
    info->has_pose = p->has_pose;
    memcpy(info->pose, p->pose, sizeof p->pose);
    info->pose[15] = 1;
    set_step(scan, e57);
}

static void release(e57_state *e57)
{
    prep_e57_points_release(&e57->points);
    prep_e57_pages_release(&e57->pages);
}

static bool e57_rewind(prep_scan *scan, mospt_err *err)
{
    e57_state *e57 = scan->state;
    (void)err;
    prep_e57_points_start(&e57->points, &e57->vector);
    e57->pages.ahead = PREP_E57_RUN_PAGES;
    e57->vector.fault = NULL;
    e57->next = 0;
    e57->is_ended = false;
    return true;
}

static bool e57_open(prep_scan *scan, uint32_t index, const prep_scan_options *options,
                     mospt_err *err)
{
    if (prep_input_is_gzip(scan->input))
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(scan->path),
                             "an E57 file inside gzip: unpack it first");
    e57_state *e57 = calloc(1, sizeof *e57);
    if (e57 == NULL) return mospt_err_nomem(err, sizeof *e57);
    scan->state = e57;
    prep_e57_pages_init(&e57->pages, scan->input);
    if (!prep_e57_find(scan, &e57->pages, options->memory, index, &e57->found, err)) return false;
    scan->info.scan_count = e57->found.scan_count;
    const prep_e57_scan *d = e57->found.desc;
    if (d == NULL) return true; /* the caller has something to say about that */

    prep_e57_points_init(&e57->points, d);
    if (!prep_e57_vector_open(&e57->pages, d->offset, d->field_count, &e57->vector, err))
        return false;
    if (!take_sample(scan, e57, err)) return false;
    describe(scan, e57, index);
    release(e57);
    return e57_rewind(scan, err);
}

static void note_end(prep_scan *scan, const e57_state *e57)
{
    const prep_e57_vector *v = &e57->vector;
    prep_scan_set_damage(
        scan,
        mospt_at_byte(scan->path, v->fault != NULL ? v->fault_place : prep_e57_physical(v->end)),
        "%s; %" PRIu64 " of %" PRIu64 " records were read",
        v->fault != NULL ? v->fault : "the scan's points end here", e57->next,
        e57->found.desc->record_count);
}

static bool e57_read(prep_scan *scan, prep_batch *batch, mospt_err *err)
{
    e57_state *e57 = scan->state;
    while (batch->count < batch->capacity && e57->next < e57->found.desc->record_count &&
           !e57->is_ended) {
        uint64_t left = e57->found.desc->record_count - e57->next;
        uint32_t want = batch->capacity - batch->count, got;
        if (want > PREP_E57_BLOCK) want = PREP_E57_BLOCK;
        if (want > left) want = (uint32_t)left;
        if (!prep_e57_points_load(&e57->points, &e57->vector, want, &got, err)) return false;
        if (e57->points.has_lost)
            prep_scan_set_damage(scan, mospt_at_byte(scan->path, e57->vector.fault_place),
                                 "%s; the points in it are left out", e57->vector.fault);
        prep_e57_planes_emit(&e57->points, scan, got, batch);
        e57->next += got;
        e57->is_ended = got == 0;
        if (e57->is_ended) note_end(scan, e57);
    }
    return true;
}

static void e57_close(prep_scan *scan)
{
    e57_state *e57 = scan->state;
    if (e57 == NULL) return;
    release(e57);
    free(e57->found.desc);
    free(e57);
}

const prep_scan_format prep_e57_format = {e57_open, e57_read, e57_rewind, e57_close};
