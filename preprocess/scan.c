#include "preprocess/scan.h"

#include "preprocess/e57.h"
#include "preprocess/las.h"
#include "preprocess/pcd.h"
#include "preprocess/ply.h"
#include "preprocess/ptx.h"
#include "preprocess/scan_format.h"
#include "preprocess/text.h"

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Doubles this far from zero are no longer coordinates in metres: their own steps are coarser than
 * a decimetre. */
static const double COORDINATE_MAX = 1e15;

const char *prep_drop_name(prep_drop reason)
{
    static const char *const names[PREP_DROP_REASONS] = {
        "not finite", "out of range", "no return", "unreadable", "outside the crop", "duplicate"};
    return reason < PREP_DROP_REASONS ? names[reason] : "unknown";
}

void prep_scan_set_damage(prep_scan *scan, mospt_where where, const char *format, ...)
{
    if (scan->is_damaged) return;
    char text[sizeof scan->damage.message];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    mospt_err_set(&scan->damage, MOSPT_EFORMAT, where, "%s", text);
    scan->is_damaged = true;
}

/* Names come from files: what a terminal or JSON could choke on becomes an underscore. */
static void clean_name(const char *name, char out[MOSPT_ATTRIBUTE_NAME_MAX])
{
    size_t n = 0;
    for (; name[n] != '\0' && n + 1 < MOSPT_ATTRIBUTE_NAME_MAX; n++)
        out[n] =
            (name[n] > ' ' && name[n] < 127 && name[n] != '"' && name[n] != '\\') ? name[n] : '_';
    while (n > 0 && out[n - 1] == '_')
        n--;
    out[n] = '\0';
    if (n == 0) memcpy(out, "unnamed", 8);
}

int prep_scan_add_attribute(prep_scan *scan, const char *name, mospt_type type, uint32_t components)
{
    mospt_schema *schema = &scan->info.attributes;
    char base[MOSPT_ATTRIBUTE_NAME_MAX], unique[MOSPT_ATTRIBUTE_NAME_MAX];
    clean_name(name, base);
    memcpy(unique, base, sizeof unique);
    for (int n = 2; mospt_schema_find(schema, unique) >= 0; n++)
        snprintf(unique, sizeof unique, "%.36s_%d", base, n);
    if (!mospt_schema_add(schema, unique, type, components, NULL)) return -1;
    return (int)schema->count - 1;
}

void prep_scan_look(prep_scan_info *info, const prep_batch *batch)
{
    mospt_schema *attributes = &info->attributes;
    if (batch->count == 0) return;
    if (!info->was_looked_at) prep_implied_begin(attributes, (const uint8_t *const *)batch->plane);
    info->was_looked_at = true;
    for (uint32_t k = 0; k < attributes->count; k++)
        prep_implied_look(&attributes->at[k], k, batch->plane[k], batch->rgbi, batch->count,
                          &info->differs);
}

double prep_scan_common_step(const double scale[3])
{
    double least = fmin(scale[0], fmin(scale[1], scale[2]));
    for (int parts = 1; parts <= 10; parts++) {
        bool fits = true;
        for (int a = 0; a < 3; a++) {
            double ratio = scale[a] / (least / parts);
            fits = fits && ratio < 1e9 && fabs(ratio - nearbyint(ratio)) < 1e-9 * ratio;
        }
        if (fits) return least / parts;
    }
    return 0;
}

static bool has_extension(const char *path, const char *extension)
{
    size_t n = strlen(path), m = strlen(extension);
    return n > m && path[n - m - 1] == '.' && strcasecmp(path + n - m, extension) == 0;
}

static bool starts_with(const uint8_t *head, size_t size, const char *text)
{
    size_t n = strlen(text);
    return size >= n && memcmp(head, text, n) == 0;
}

/* Reads past one line; returns how many numbers stand on it, or -1 if anything else does. */
static int count_numbers(const char **text)
{
    int count = 0;
    const char *p = *text;
    while (*p != '\n' && *p != '\0') {
        size_t blank = strspn(p, " \t\r");
        size_t number = strspn(p + blank, "+-.0123456789eE");
        if (blank + number == 0) {
            count = -1;
            p += strcspn(p, "\n");
            break;
        }
        count += number > 0 && count >= 0;
        p += blank + number;
    }
    *text = *p == '\n' ? p + 1 : p;
    return count;
}

/* PTX has no signature, but it opens with columns, rows, the scanner's position, three axes and a 4
 * x 4 matrix. */
static bool looks_like_ptx(const uint8_t *head, size_t size)
{
    static const int shape[10] = {1, 1, 3, 3, 3, 3, 4, 4, 4, 4};
    char text[1024];
    size_t n = size < sizeof text - 1 ? size : sizeof text - 1;
    memcpy(text, head, n);
    text[n] = '\0';
    const char *p = text;
    for (int i = 0; i < 10; i++) {
        if (count_numbers(&p) != shape[i]) return false;
    }
    return true;
}

static bool looks_like_pcd(const uint8_t *head, size_t size)
{
    if (starts_with(head, size, "# .PCD")) return true;
    bool has_fields =
        starts_with(head, size, "FIELDS ") || memmem(head, size, "\nFIELDS ", 8) != NULL;
    return has_fields && memmem(head, size, "\nDATA ", 6) != NULL;
}

/* Several lines of as many numbers each, below a count of them at most. */
static bool looks_like_points(const uint8_t *head, size_t size)
{
    enum { LINES_LEAST = 4, LINES_MOST = 12 };
    char text[1024];
    size_t n = size < sizeof text - 1 ? size : sizeof text - 1;
    memcpy(text, head, n);
    while (n < size && n > 0 && text[n - 1] != '\n')
        n--;
    text[n] = '\0';
    const char *p = text;
    int columns = count_numbers(&p);
    if (columns == 1) columns = count_numbers(&p);
    int lines = 1;
    for (; lines < LINES_MOST && *p != '\0'; lines++)
        if (count_numbers(&p) != columns) return false;
    return columns >= 3 && lines >= LINES_LEAST;
}

static bool looks_like_utf16(const uint8_t *head, size_t size)
{
    static const uint8_t marks[2][2] = {{0xff, 0xfe}, {0xfe, 0xff}};
    size_t look = size < 64 ? size : 64, zeros[2] = {0};
    if (size < 4) return false;
    if (memcmp(head, marks[0], 2) == 0 || memcmp(head, marks[1], 2) == 0) return true;
    for (size_t i = 0; i < look; i++)
        zeros[i % 2] += head[i] == 0;
    return (zeros[0] >= look / 2 && zeros[1] == 0) || (zeros[1] >= look / 2 && zeros[0] == 0);
}

/* Text has hardly any control characters; a single one is a fault in it, and no reason to refuse
 * the rest. */
static bool is_binary(const uint8_t *head, size_t size)
{
    size_t controls = 0;
    for (size_t i = 0; i < size; i++)
        controls += head[i] < 32 && !isspace(head[i]) && head[i] != 26;
    return controls > 2 + size / 100;
}

prep_file_kind prep_scan_recognise(const char *path, const uint8_t *head, size_t size)
{
    static const struct {
        const char *extension;
        prep_file_kind kind;
    } names[] = {{"las", PREP_FILE_LAS},    {"laz", PREP_FILE_LAS}, {"ply", PREP_FILE_PLY},
                 {"ply.gz", PREP_FILE_PLY}, {"e57", PREP_FILE_E57}, {"pcd", PREP_FILE_PCD},
                 {"ptx", PREP_FILE_PTX}};
    if (starts_with(head, size, "LASF")) return PREP_FILE_LAS;
    if (starts_with(head, size, "ASTM-E57")) return PREP_FILE_E57;
    if (starts_with(head, size, "ply") && size > 3 && isspace(head[3])) return PREP_FILE_PLY;
    if (looks_like_pcd(head, size)) return PREP_FILE_PCD;
    if (looks_like_ptx(head, size)) return PREP_FILE_PTX;
    if (looks_like_points(head, size)) return PREP_FILE_TEXT;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        if (has_extension(path, names[i].extension)) return names[i].kind;
    }
    return is_binary(head, size) ? PREP_FILE_BINARY : PREP_FILE_TEXT;
}

static bool choose_format(prep_scan *scan, mospt_err *err)
{
    uint8_t head[PREP_HEAD_SIZE];
    size_t got;
    mospt_where where = mospt_at_file(scan->path);
    if (!prep_input_read(scan->input, head, sizeof head, &got, err)) return false;
    if (!prep_input_seek(scan->input, 0, err)) return false;
    if (got == 0) {
        const char *fault = prep_input_fault(scan->input);
        return mospt_err_set(err, MOSPT_EFORMAT, where, "%s",
                             fault != NULL ? fault : "the file is empty (0 bytes)");
    }
    switch (prep_scan_recognise(scan->path, head, got)) {
    case PREP_FILE_LAS:
        scan->format = &prep_las_format;
        return true;
    case PREP_FILE_PLY:
        scan->format = &prep_ply_format;
        return true;
    case PREP_FILE_TEXT:
        scan->format = &prep_text_format;
        return true;
    case PREP_FILE_E57:
        scan->format = &prep_e57_format;
        return true;
    case PREP_FILE_PCD:
        scan->format = &prep_pcd_format;
        return true;
    case PREP_FILE_PTX:
        scan->format = &prep_ptx_format;
        return true;
    case PREP_FILE_BINARY:
        break;
    }
    return mospt_err_set(err, MOSPT_EFORMAT, where, "%s",
                         looks_like_utf16(head, got)
                             ? "text in UTF-16 is not read; save it as UTF-8"
                             : "binary data, but no scan format that this program knows");
}

static bool place_scan(prep_scan *scan, const prep_scan_options *options, mospt_err *err);

/* On one line, as whoever shows it expects; WKT may be indented. */
static void tidy_crs(char *crs)
{
    char *out = crs;
    for (const char *p = crs; *p != '\0'; p++) {
        bool is_blank = (unsigned char)*p <= ' ';
        if (is_blank && (out == crs || out[-1] == ' ')) continue;
        *out++ = is_blank ? ' ' : *p;
    }
    while (out > crs && out[-1] == ' ')
        out--;
    *out = '\0';
}

bool prep_scan_open(const char *path, uint32_t index, const prep_scan_options *options,
                    prep_scan **out, mospt_err *err)
{
    static const prep_scan_options defaults = {0};
    prep_scan *scan = calloc(1, sizeof *scan);
    if (scan == NULL) return mospt_err_nomem(err, sizeof *scan);
    if (!prep_input_open(path, &scan->input, err)) goto fail;
    scan->path = prep_input_path(scan->input);

    const char *slash = strrchr(path, '/');
    snprintf(scan->info.name, sizeof scan->info.name, "%s", slash != NULL ? slash + 1 : path);
    scan->info.scan_count = 1;
    if (!choose_format(scan, err)) goto fail;
    if (!scan->format->open(scan, index, options != NULL ? options : &defaults, err)) goto fail;
    if (index >= scan->info.scan_count) {
        mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(path), "scan %u of a file that holds %u",
                      index, scan->info.scan_count);
        goto fail;
    }
    if (!place_scan(scan, options != NULL ? options : &defaults, err)) goto fail;
    tidy_crs(scan->info.crs);
    scan->was_damaged_at_open = scan->is_damaged;
    *out = scan;
    return true;
fail:
    prep_scan_close(scan);
    return false;
}

void prep_scan_close(prep_scan *scan)
{
    if (scan == NULL) return;
    if (scan->format != NULL) scan->format->close(scan);
    prep_input_close(scan->input);
    free(scan->keep);
    free(scan);
}

const prep_scan_info *prep_scan_describe(const prep_scan *scan)
{
    return &scan->info;
}

/* NaN fails every comparison. */
static bool is_in_range(const prep_scan *scan, const double *xyz)
{
    for (int a = 0; a < 3; a++)
        if (!(xyz[a] >= scan->range_low[a] && xyz[a] <= scan->range_high[a])) return false;
    return true;
}

/* Moves what the scan declares to where its pose puts it. */
static void move_info(prep_scan *scan)
{
    prep_scan_info *info = &scan->info;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY},
           pose[16];
    for (int corner = 0; corner < 8; corner++) {
        double in[3], out[3];
        for (int a = 0; a < 3; a++)
            in[a] = corner >> a & 1 ? info->high[a] : info->low[a];
        prep_pose_apply(scan->move, in, out);
        for (int a = 0; a < 3; a++)
            low[a] = fmin(low[a], out[a]), high[a] = fmax(high[a], out[a]);
    }
    if (info->has_bounds) memcpy(info->low, low, sizeof low), memcpy(info->high, high, sizeof high);
    if (info->has_pose) prep_pose_multiply(scan->move, info->pose, pose);
    else memcpy(pose, scan->move, sizeof pose);
    memcpy(info->pose, pose, sizeof pose);
    info->has_pose = true;
    info->step = 0; /* the file's lattice is turned */
    for (int a = 0; a < 3; a++)
        info->offset[a] = 0;
}

/* What the crop leaves of the declared bounds. Where that is nothing, reading will tell. */
static void crop_info(prep_scan *scan)
{
    prep_scan_info *info = &scan->info;
    for (int a = 0; a < 3; a++) {
        info->low[a] = fmax(info->low[a], scan->crop_low[a]);
        info->high[a] = fmin(info->high[a], scan->crop_high[a]);
        if (info->low[a] > info->high[a]) info->has_bounds = false;
    }
}

static bool place_scan(prep_scan *scan, const prep_scan_options *options, mospt_err *err)
{
    if (!prep_pose_find(options->poses, scan->path, scan->info.name, &scan->is_moved, scan->move,
                        err))
        return false;
    if (scan->is_moved) move_info(scan);
    for (int a = 0; a < 3; a++) {
        scan->range_low[a] = options->has_range ? options->range_low[a] : -COORDINATE_MAX;
        scan->range_high[a] = options->has_range ? options->range_high[a] : COORDINATE_MAX;
    }
    scan->has_crop = options->has_crop;
    memcpy(scan->crop_low, options->crop_low, sizeof scan->crop_low);
    memcpy(scan->crop_high, options->crop_high, sizeof scan->crop_high);
    if (scan->has_crop) crop_info(scan);
    return true;
}

static bool is_kept(const prep_scan *scan, const double *xyz)
{
    if (!is_in_range(scan, xyz)) return false;
    for (int a = 0; scan->has_crop && a < 3; a++)
        if (xyz[a] < scan->crop_low[a] || xyz[a] > scan->crop_high[a]) return false;
    return true;
}

static prep_drop reason_for(const prep_scan *scan, const double *p)
{
    if (is_in_range(scan, p)) return PREP_DROP_CROPPED;
    return isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]) ? PREP_DROP_OUT_OF_RANGE
                                                              : PREP_DROP_NOT_FINITE;
}

static bool drop_unusable(prep_scan *scan, prep_batch *batch, mospt_err *err)
{
    uint32_t first = 0;
    while (first < batch->count && is_kept(scan, batch->xyz + 3 * (size_t)first))
        first++;
    if (first == batch->count) return true;

    if (scan->keep_capacity < batch->count) {
        free(scan->keep);
        scan->keep = malloc(batch->capacity);
        scan->keep_capacity = scan->keep != NULL ? batch->capacity : 0;
        if (scan->keep == NULL) return mospt_err_nomem(err, batch->capacity);
    }
    for (uint32_t i = 0; i < batch->count; i++) {
        const double *p = batch->xyz + 3 * (size_t)i;
        scan->keep[i] = is_kept(scan, p);
        if (!scan->keep[i]) scan->dropped[reason_for(scan, p)]++;
    }
    prep_batch_compact(batch, scan->keep);
    return true;
}

bool prep_scan_keeps_all(const prep_scan *scan, const double low[3], const double high[3])
{
    return !scan->is_moved && !scan->has_crop && is_in_range(scan, low) && is_in_range(scan, high);
}

static void move_points(const prep_scan *scan, prep_batch *batch)
{
    for (uint32_t i = 0; i < batch->count; i++) {
        double *p = batch->xyz + 3 * (size_t)i, moved[3];
        prep_pose_apply(scan->move, p, moved);
        memcpy(p, moved, sizeof moved);
    }
}

bool prep_scan_read(prep_scan *scan, prep_batch *batch, mospt_err *err)
{
    do {
        batch->count = 0;
        batch->packed.unpack = NULL;
        if (!scan->format->read(scan, batch, err)) return false;
        if (batch->count == 0 || batch->packed.unpack != NULL) return true;
        if (scan->is_moved) move_points(scan, batch);
        if (!drop_unusable(scan, batch, err)) return false;
    } while (batch->count == 0);
    return true;
}

bool prep_scan_rewind(prep_scan *scan, mospt_err *err)
{
    memset(scan->dropped, 0, sizeof scan->dropped);
    if (!scan->was_damaged_at_open) scan->is_damaged = false;
    return scan->format->rewind(scan, err);
}

const uint64_t *prep_scan_dropped(const prep_scan *scan)
{
    return scan->dropped;
}

const mospt_err *prep_scan_damage(const prep_scan *scan)
{
    return scan->is_damaged ? &scan->damage : NULL;
}
