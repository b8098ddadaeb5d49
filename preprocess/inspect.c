#include "preprocess/inspect.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

/* Files up to this size are read whole without being asked for. */
static const uint64_t READ_BYTES = UINT64_C(256) << 20;
/* Projected coordinates of the Earth stay below 2 10^7 m; coordinates beyond are not in metres, or
 * not of this world. */
static const double FAR_M = 1e8;

static void note(prep_inspection *in, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

static void note(prep_inspection *in, const char *format, ...)
{
    va_list args;
    if (in->note_count == PREP_INSPECT_NOTES_MAX) return;
    va_start(args, format);
    vsnprintf(in->notes[in->note_count++], PREP_INSPECT_NOTE_SIZE, format, args);
    va_end(args);
}

static bool read_points(prep_scan *scan, prep_inspection *in, mospt_err *err)
{
    prep_batch batch;
    if (!prep_batch_init(&batch, &in->info.attributes, PREP_BATCH_CAPACITY, err)) return false;
    bool ok;
    for (int a = 0; a < 3; a++)
        in->low[a] = INFINITY, in->high[a] = -INFINITY;
    while ((ok = prep_scan_read(scan, &batch, err)) && batch.count > 0) {
        for (uint32_t i = 0; i < 3 * batch.count; i++) {
            uint32_t a = i % 3;
            in->low[a] = fmin(in->low[a], batch.xyz[i]);
            in->high[a] = fmax(in->high[a], batch.xyz[i]);
            in->mean[a] += batch.xyz[i];
        }
        in->points += batch.count;
    }
    for (int a = 0; a < 3 && in->points > 0; a++)
        in->mean[a] /= (double)in->points;
    in->was_read = ok;
    prep_batch_fini(&batch);
    return ok;
}

static void judge(prep_inspection *in)
{
    const prep_scan_info *info = &in->info;
    double far = 0;
    for (int a = 0; a < 3 && in->points > 0; a++) {
        double slack = fmax(info->step, 1e-6 * fmax(fabs(in->low[a]), fabs(in->high[a])));
        far = fmax(far, fmax(fabs(in->low[a]), fabs(in->high[a])));
        if (!in->was_read || !info->has_bounds) continue;
        if (in->low[a] >= info->low[a] - slack && in->high[a] <= info->high[a] + slack &&
            info->high[a] - info->low[a] <= 2 * (in->high[a] - in->low[a]) + slack)
            continue;
        char axis = (char)('x' + a);
        note(in,
             "the header says that %c reaches from %.10g to %.10g, the points do from %.10g to "
             "%.10g",
             axis, info->low[a], info->high[a], in->low[a], in->high[a]);
    }
    if (in->was_read && info->point_count > 0 && in->damage.code == MOSPT_OK) {
        uint64_t all = in->points;
        for (int r = 0; r < PREP_DROP_REASONS; r++)
            all += in->dropped[r];
        if (all != info->point_count)
            note(in, "%llu points are declared, %llu are there",
                 (unsigned long long)info->point_count, (unsigned long long)all);
    }
    if (far > FAR_M)
        note(in, "coordinates reach %.3g: not metres, or points that are far off", far);
    if (!info->has_rgb && !info->has_intensity) note(in, "neither colour nor intensity");
}

bool prep_inspect(const char *path, uint32_t index, const prep_scan_options *options, bool read_all,
                  prep_inspection *out, mospt_err *err)
{
    prep_scan *scan = NULL;
    struct stat status;
    bool ok = true;
    *out = (prep_inspection){0};
    if (!prep_scan_open(path, index, options, &scan, err)) return false;
    out->info = *prep_scan_describe(scan);
    if (stat(path, &status) == 0) out->file_bytes = (uint64_t)status.st_size;
    if (read_all || out->file_bytes <= READ_BYTES) {
        ok = read_points(scan, out, err);
    } else {
        out->points = out->info.point_count;
        memcpy(out->low, out->info.low, sizeof out->low);
        memcpy(out->high, out->info.high, sizeof out->high);
    }
    memcpy(out->dropped, prep_scan_dropped(scan), sizeof out->dropped);
    if (prep_scan_damage(scan) != NULL) out->damage = *prep_scan_damage(scan);
    if (ok) judge(out);
    prep_scan_close(scan);
    return ok;
}
