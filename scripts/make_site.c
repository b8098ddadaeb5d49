/* scripts/make_site.c - scans of a small ruin that does not exist, or of a house of many rooms, as
 * a laser scanner on a tripod would write them.
 *
 * Each scan is a grid of angles seen from one place: dense nearby, thin far away, empty behind what
 * stands in the way, below the tripod and in the sky. One LAS 1.2 file per scan, point format 2.
 * Noise is a function of scan, column and row, so the same arguments give the same bytes. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "mospt/err.h"
#include "scripts/site_paint.h"
#include "scripts/site_rooms.h"
#include "scripts/site_scene.h"

static const double pi = 3.14159265358979;
static const float reach_m = 60, range_noise_m = 0.003f, tripod_m = 1.75f;
static const double lowest_rad = -1.1,
                    highest_rad =
                        1.45; /* the tripod hides what is below, the hinge what is above */

enum { HEADER_BYTES = 227, RECORD_BYTES = 26, BUFFER_RECORDS = 8192, SCANS_MAX = 999 };

typedef struct {
    const char *folder;
    int scan_count;
    double point_count; /* of all scans */
    double origin[3];   /* world coordinates of the site's origin */
    uint32_t seed;
    uint32_t rooms; /* along each side of a house; 0: the ruin */
} options;

typedef struct {
    FILE *file;
    const char *path;
    uint8_t *buffer; /* [BUFFER_RECORDS * RECORD_BYTES], owned */
    size_t buffered;
    uint64_t count;
    int32_t low[3], high[3];
    double offset[3];
} las;

/* --- LAS --- */

static uint8_t *put(uint8_t *to, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        to[i] = (uint8_t)(value >> (8 * i));
    return to + bytes;
}

static uint8_t *put_double(uint8_t *to, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put(to, bits, 8);
}

static bool las_flush(las *out, mospt_err *err)
{
    size_t size = out->buffered * RECORD_BYTES;
    out->buffered = 0;
    if (fwrite(out->buffer, 1, size, out->file) == size) return true;
    return mospt_err_set(err, MOSPT_EIO, mospt_at_file(out->path), "writing points failed");
}

/* Writes the header anew: once to make room, once when counts and bounds are known. */
static bool las_header(las *out, int scan, mospt_err *err)
{
    uint8_t h[HEADER_BYTES] = {0};
    memcpy(h, "LASF", 4);
    put(h + 4, (uint64_t)scan, 2);
    h[24] = 1;
    h[25] = 2;
    snprintf((char *)h + 26, 32, "Instant Points sample site");
    snprintf((char *)h + 58, 32, "make_site");
    put(h + 90, 1, 2); /* day and year: fixed, or no two files would be equal */
    put(h + 92, 2026, 2);
    put(h + 94, HEADER_BYTES, 2);
    put(h + 96, HEADER_BYTES, 4);
    h[104] = 2;
    put(h + 105, RECORD_BYTES, 2);
    put(h + 107, out->count, 4);
    put(h + 111, out->count, 4);
    uint8_t *at = h + 131;
    for (int i = 0; i < 3; i++)
        at = put_double(at, 0.001);
    for (int i = 0; i < 3; i++)
        at = put_double(at, out->offset[i]);
    for (int i = 0; i < 3 && out->count != 0; i++) {
        at = put_double(at, out->high[i] * 0.001 + out->offset[i]);
        at = put_double(at, out->low[i] * 0.001 + out->offset[i]);
    }
    if (fseek(out->file, 0, SEEK_SET) == 0 && fwrite(h, 1, sizeof h, out->file) == sizeof h)
        return true;
    return mospt_err_set(err, MOSPT_EIO, mospt_at_file(out->path), "writing the header failed");
}

typedef struct {
    site_vec point;
    site_vec colour; /* linear */
    float intensity; /* 0 to 1 */
    float elevation_deg;
    uint8_t class_asprs;
    int scan;
} las_point;

static uint64_t to_16_bits(float v)
{
    return v <= 0 ? 0 : v >= 1 ? 65535 : (uint64_t)(v * 65535 + 0.5f);
}

static bool las_add(las *out, const las_point *p, const double origin[3], mospt_err *err)
{
    const float local[3] = {p->point.x, p->point.y, p->point.z};
    uint8_t *at = out->buffer + out->buffered * RECORD_BYTES;
    for (int i = 0; i < 3; i++) {
        int32_t v = (int32_t)lrint(((double)local[i] + origin[i] - out->offset[i]) * 1000);
        at = put(at, (uint32_t)v, 4);
        if (v < out->low[i] || out->count == 0) out->low[i] = v;
        if (v > out->high[i] || out->count == 0) out->high[i] = v;
    }
    at = put(at, to_16_bits(p->intensity), 2);
    *at++ = 1 | 1 << 3; /* return 1 of 1 */
    *at++ = p->class_asprs;
    *at++ = (uint8_t)(int8_t)lrintf(p->elevation_deg);
    *at++ = 0;
    at = put(at, (uint64_t)p->scan, 2);
    /* A display raises to about 2.2; the square root is near enough and shows shadows a little
     * lighter. */
    at = put(at, to_16_bits(sqrtf(p->colour.x)), 2);
    at = put(at, to_16_bits(sqrtf(p->colour.y)), 2);
    put(at, to_16_bits(sqrtf(p->colour.z)), 2);
    out->count++;
    if (++out->buffered == BUFFER_RECORDS) return las_flush(out, err);
    return true;
}

/* --- the scanner --- */

typedef struct {
    const site_scene *scene;
    site_vec at, sun;
    int number; /* from 1 */
    uint32_t seed;
    int columns, rows;
    const site_solid *hint, *shadow_hint; /* met by the ray before */
} scanner;

static site_vec beam(double azimuth, double elevation)
{
    double flat = cos(elevation);
    return site_v((float)(cos(azimuth) * flat), (float)(sin(azimuth) * flat),
                  (float)sin(elevation));
}

/* Sum of four bytes: as good as normal for 3 mm; standard deviation 1. */
static float noise(uint32_t *random)
{
    uint32_t r = site_random(random);
    int32_t sum = (int32_t)((r & 255) + (r >> 8 & 255) + (r >> 16 & 255) + (r >> 24)) - 510;
    return (float)sum / 147.8f;
}

/* True if the beam comes back, with the point that the scanner reports. */
static bool measure(scanner *s, site_vec direction, uint32_t *random, las_point *out)
{
    site_hit hit;
    if (!site_cast(s->scene, s->at, direction, reach_m, &s->hint, &hit)) return false;
    site_paint paint = site_paint_at(&hit);
    float incidence = site_max(-site_dot(hit.normal, direction), 0.08f);
    /* Rough surfaces scatter back at any angle, so the cosine is damped. */
    float signal = paint.reflectance * (0.25f + 0.75f * incidence) / (1 + hit.t * hit.t * 0.004f);
    float relief = site_min(paint.relief / incidence, 0.12f);
    float range = hit.t - relief + range_noise_m * noise(random);
    site_vec above = site_add(hit.point, site_mul(hit.normal, 0.012f));
    bool in_shadow = site_dot(hit.normal, s->sun) <= 0 &&
                     (hit.solid == NULL || hit.solid->material != SITE_LEAF);
    if (!in_shadow) in_shadow = site_is_hidden(s->scene, above, s->sun, 80, &s->shadow_hint);
    site_vec light = site_light(&hit, s->sun, in_shadow);
    float camera = 1 + 0.02f * noise(random);
    out->point = site_add(s->at, site_mul(direction, range));
    out->colour = site_mul(
        site_v(paint.colour.x * light.x, paint.colour.y * light.y, paint.colour.z * light.z),
        camera);
    out->intensity = site_min(1.4f * signal * (1 + 0.03f * noise(random)), 1);
    out->class_asprs = paint.class_asprs;
    out->scan = s->number;
    return true;
}

/* Share of all directions between lowest and highest that return something. */
static double returning_share(scanner *s)
{
    enum { COLUMNS = 240, ROWS = 96 };
    int hits = 0;
    for (int c = 0; c < COLUMNS; c++) {
        for (int r = 0; r < ROWS; r++) {
            site_hit hit;
            site_vec d = beam(2 * pi * (c + 0.5) / COLUMNS,
                              lowest_rad + (highest_rad - lowest_rad) * (r + 0.5) / ROWS);
            hits += site_cast(s->scene, s->at, d, reach_m, &s->hint, &hit);
        }
    }
    return (double)hits / (COLUMNS * ROWS);
}

static void choose_grid(scanner *s, double point_count)
{
    double share = fmax(returning_share(s), 0.01);
    double step = sqrt(2 * pi * (highest_rad - lowest_rad) * share / point_count);
    s->columns = (int)fmax(1, round(2 * pi / step));
    s->rows = (int)fmax(1, round((highest_rad - lowest_rad) / step));
}

static bool sweep(scanner *s, las *out, const double origin[3], mospt_err *err)
{
    double step = (highest_rad - lowest_rad) / s->rows;
    for (int c = 0; c < s->columns; c++) {
        double azimuth = 2 * pi * (c + 0.5) / s->columns, cos_azimuth = cos(azimuth),
               sin_azimuth = sin(azimuth);
        uint32_t column_seed =
            s->seed ^ (uint32_t)s->number * 0x85ebca6bu ^ (uint32_t)c * 0xc2b2ae35u;
        for (int r = 0; r < s->rows; r++) {
            uint32_t random = column_seed ^ (uint32_t)r * 0x27d4eb2fu;
            float elevation = (float)(lowest_rad + step * (r + 0.5 + 0.1 * (double)noise(&random)));
            float flat = cosf(elevation);
            site_vec d = {(float)cos_azimuth * flat, (float)sin_azimuth * flat, sinf(elevation)};
            las_point p = {.elevation_deg = elevation * 57.29578f};
            if (measure(s, d, &random, &p) && !las_add(out, &p, origin, err)) return false;
        }
    }
    return las_flush(out, err);
}

/* Scan positions: the ones that a surveyor would take first, then a spiral over the yard. */
static site_vec position(int index)
{
    static const float first[][2] = {{-13.0f, -2.6f}, {-0.4f, -0.5f}, {1.0f, -9.9f},
                                     {-3.5f, 9.5f},   {11.0f, -7.5f}, {-11.5f, -11.5f},
                                     {12.8f, 3.5f},   {7.0f, -0.2f}};
    enum { FIRST = sizeof first / sizeof *first };
    float x, y, floor;
    if (index < FIRST) {
        x = first[index][0];
        y = first[index][1];
    } else {
        float angle = 2.399963f * (float)index, away = 10 + fmodf(3.7f * (float)index, 7);
        x = -2 + 1.15f * away * cosf(angle);
        y = 0.8f * away * sinf(angle);
    }
    bool inside = fabsf(y) < 3.6f && x > -9 && x < 5.4f, choir = index == 7;
    floor = choir ? 0.45f : inside ? 0 : site_ground(x, y);
    return site_v(x, y, floor + tripod_m);
}

/* A tripod needs half a metre of room on all sides. */
static bool has_room(const site_scene *scene, site_vec at)
{
    for (int i = 0; i < 24; i++) {
        const site_solid *hint = NULL;
        if (site_is_hidden(scene, at, beam(2 * pi * i / 24, -0.3 + 0.3 * (i % 3)), 0.5f, &hint))
            return false;
    }
    return true;
}

static bool write_scan(scanner *s, const options *o, const char *path, uint64_t *count,
                       mospt_err *err)
{
    las out = {.path = path};
    bool ok = false;
    for (int i = 0; i < 3; i++)
        out.offset[i] = floor(o->origin[i]);
    out.buffer = malloc((size_t)BUFFER_RECORDS * RECORD_BYTES);
    if (out.buffer == NULL) return mospt_err_nomem(err, (size_t)BUFFER_RECORDS * RECORD_BYTES);
    out.file = fopen(path, "wb");
    if (out.file == NULL) {
        mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "creating the file failed");
        goto done;
    }
    choose_grid(s, o->point_count / o->scan_count);
    if (!las_header(&out, s->number, err)) goto done;
    if (!sweep(s, &out, o->origin, err)) goto done;
    if (!las_header(&out, s->number, err)) goto done;
    *count = out.count;
    ok = true;
done:
    if (out.file != NULL && fclose(out.file) != 0 && ok)
        ok = mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "writing failed");
    free(out.buffer);
    return ok;
}

static bool make_folder(const char *path, mospt_err *err)
{
    char part[3072];
    size_t size = strlen(path);
    if (size == 0 || size >= sizeof part)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "the folder's path has %zu characters", size);
    for (size_t i = 1; i <= size; i++) {
        if (path[i] != '/' && path[i] != '\0') continue;
        memcpy(part, path, i);
        part[i] = '\0';
        if (mkdir(part, 0777) != 0 && errno != EEXIST)
            return mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "creating the folder failed");
    }
    return true;
}

static bool make_site(const options *o, mospt_err *err)
{
    site_scene scene;
    bool ok = false;
    if (!make_folder(o->folder, err)) return false;
    if (o->rooms > 0 ? !site_rooms_init(&scene, o->rooms, o->seed, err)
                     : !site_scene_init(&scene, o->seed, err))
        return false;
    uint64_t total = 0;
    for (int i = 0, place = 0; i < o->scan_count; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/scan_%02d.las", o->folder, i + 1);
        scanner s = {.scene = &scene, .number = i + 1, .seed = o->seed};
        s.sun = site_unit(site_v(-0.62f, -0.75f, 0.78f));
        do
            s.at = o->rooms > 0 ? site_rooms_position(o->rooms, (uint32_t)place++, tripod_m)
                                : position(place++);
        while (!has_room(&scene, s.at) && place < 100000);
        uint64_t count = 0;
        if (!write_scan(&s, o, path, &count, err)) goto done;
        printf("%s: %llu points\n", path, (unsigned long long)count);
        total += count;
    }
    printf("%llu points in %d scans\n", (unsigned long long)total, o->scan_count);
    ok = true;
done:
    site_scene_fini(&scene);
    return ok;
}

/* --- the command line --- */

static bool parse_number(const char *text, double low, double high, double *out)
{
    char *end;
    *out = strtod(text, &end);
    return end != text && *end == '\0' && *out >= low && *out <= high;
}

static bool parse_origin(const char *text, double out[3])
{
    for (int i = 0; i < 3; i++) {
        char *end;
        out[i] = strtod(text, &end);
        if (end == text || !(fabs(out[i]) < 1e9) || *end != (i < 2 ? ',' : '\0')) return false;
        text = end + 1;
    }
    return true;
}

static bool parse_option(options *o, const char *name, const char *value)
{
    double number;
    if (strcmp(name, "--origin") == 0) return parse_origin(value, o->origin);
    if (strcmp(name, "--points") == 0) return parse_number(value, 1, 4e9, &o->point_count);
    if (strcmp(name, "--scans") == 0) {
        if (!parse_number(value, 1, SCANS_MAX, &number)) return false;
        o->scan_count = (int)number;
        return true;
    }
    if (strcmp(name, "--rooms") == 0) {
        if (!parse_number(value, 1, 100, &number)) return false;
        o->rooms = (uint32_t)number;
        return true;
    }
    if (strcmp(name, "--seed") != 0 || !parse_number(value, 0, UINT32_MAX, &number)) return false;
    o->seed = (uint32_t)number;
    return true;
}

int main(int argc, char **argv)
{
    options o = {.scan_count = 4, .point_count = 2e6, .seed = 1};
    bool ok = true;
    for (int i = 1; i < argc && ok; i++) {
        if (argv[i][0] == '-') {
            ok = i + 1 < argc && parse_option(&o, argv[i], argv[i + 1]);
            i++;
        } else {
            ok = o.folder == NULL;
            o.folder = argv[i];
        }
    }
    if (!ok || o.folder == NULL) {
        fprintf(stderr,
                "usage: make_site FOLDER [--scans N] [--points N] [--origin X,Y,Z] [--seed N] "
                "[--rooms N]\n"
                "--rooms: a house of N x N rooms on two floors instead of a ruin.\n"
                "Writes FOLDER/scan_01.las and so on: 4 scans with 2e6 points together, unless "
                "told otherwise.\n");
        return 2;
    }
    mospt_err err = {0};
    if (make_site(&o, &err)) return 0;
    char text[2048];
    mospt_err_text(&err, text, sizeof text);
    fprintf(stderr, "make_site: %s\n", text);
    return 1;
}
