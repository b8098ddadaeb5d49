#include "cli_options.h"

#include "render/choice.h"
#include "render/ramp.h"
#include "render/shading.h"

#include <ctype.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    B = 1 << CLI_BUILD,
    V = 1 << CLI_VIEW,
    S = 1 << CLI_SHOT,
    R = 1 << CLI_RECORD,
    J = 1 << CLI_JOIN,
    I = 1 << CLI_INFO,
    C = 1 << CLI_CHECK
};

typedef bool (*reader)(cli_options *o, const char *value);

static const struct {
    const char *name, *arguments, *purpose, *details;
} commands[CLI_COMMANDS] = {
    [CLI_BUILD] =
        {"build", "SCANS... -o NAME.ipts", "make a dataset of files and folders of scans",
         "Reads LAS, LAZ, E57, PTX, PTS, PCD, PLY and text (.xyz .txt .asc .csv); folders are "
         "searched recursively. No\n"
         "point is ever lost: what is dropped is counted by reason, what is left out is named.\n"},
    [CLI_VIEW] = {"view", "NAME.ipts | SCANS...", "look at a dataset, or at raw scans, in a window",
                  "Raw scans are built first, into a temporary dataset or the one that -o names. "
                  "In the window, F1 shows the keys.\n"},
    [CLI_SHOT] = {"shot", "NAME.ipts | SCANS... -o PICTURE.png",
                  "render one picture, without any display",
                  "Without --eye and --target the picture shows all of the site. The same dataset "
                  "and options give the same bytes.\n"},
    [CLI_RECORD] =
        {"record", "NAME.ipts | SCANS... -o FILM.mp4",
         "make a film of a camera path, without any display",
         "The name decides: .mp4 H.264, .webm VP9 or AV1, .mkv lossless FFV1, .png numbered "
         "pictures. Each frame is the\npicture that `shot` makes of it. Without --path the camera "
         "walks from scan to scan, or turns around the site.\nA recording that was interrupted "
         "goes on with the same command.\n"},
    [CLI_JOIN] = {"join", "FILMS... -o FILM.mp4", "put films that were recorded in parts together",
                  "They must be of the same size and settings; nothing is encoded again.\n"},
    [CLI_INFO] =
        {"info", "NAME.ipts | SCAN", "say what is in a dataset, or in a scan file",
         "Of a scan file: its format, what it holds, and what looks wrong; nothing is built.\n"},
    [CLI_CHECK] = {"check", "NAME.ipts", "prove that nothing in a dataset is lost or damaged",
                   "Reads every byte: checksums, the place of every point, every promise of the "
                   "structure.\n"},
};

static bool read_count(const char *text, uint64_t low, uint64_t high, uint64_t *out)
{
    char *end;
    if (!isdigit((unsigned char)text[0])) return false;
    unsigned long long value = strtoull(text, &end, 10);
    if (*end != '\0' || value < low || value > high) return false;
    *out = value;
    return true;
}

static bool read_u32(const char *text, uint32_t low, uint32_t high, uint32_t *out)
{
    uint64_t value;
    if (!read_count(text, low, high, &value)) return false;
    *out = (uint32_t)value;
    return true;
}

/* A positive number with a unit: K, M, G, T, of `base` (1000 for points, 1024 for bytes). */
static bool read_amount(const char *text, double base, uint64_t *out)
{
    static const char units[] = "KMGT";
    char *end;
    if (!isdigit((unsigned char)text[0]) && text[0] != '.') return false;
    double value = strtod(text, &end);
    if (*end != '\0') {
        const char *unit = strchr(units, toupper((unsigned char)*end));
        if (unit == NULL) return false;
        value *= pow(base, (double)(unit - units + 1));
        end++;
        if (base > 1000 && (*end == 'i' || *end == 'I')) end++;
        if (base > 1000 && (*end == 'b' || *end == 'B')) end++;
    }
    if (*end != '\0' || !(value >= 1) || value > 0x1p62) return false;
    *out = (uint64_t)value;
    return true;
}

static bool read_real(const char *text, double low, double high, double *out)
{
    char *end;
    double value = strtod(text, &end);
    if (end == text || *end != '\0' || !(value >= low && value <= high)) return false;
    *out = value;
    return true;
}

static bool read_triple(const char *text, double out[3])
{
    int used = 0;
    if (sscanf(text, "%lf,%lf,%lf%n", &out[0], &out[1], &out[2], &used) != 3 || text[used] != '\0')
        return false;
    return isfinite(out[0]) && isfinite(out[1]) && isfinite(out[2]);
}

static bool o_output(cli_options *o, const char *v)
{
    return (o->output = v)[0] != '\0';
}
static bool o_temp_dir(cli_options *o, const char *v)
{
    return (o->temp_dir = v)[0] != '\0';
}
static bool o_columns(cli_options *o, const char *v)
{
    return (o->columns = v)[0] != '\0';
}
static bool o_attributes(cli_options *o, const char *v)
{
    return (o->attributes = v)[0] != '\0';
}
static bool o_poses(cli_options *o, const char *v)
{
    return (o->poses = v)[0] != '\0';
}
static bool o_crs(cli_options *o, const char *v)
{
    return (o->crs = v)[0] != '\0';
}
static bool o_screenshot(cli_options *o, const char *v)
{
    return (o->screenshot = v)[0] != '\0';
}
static bool o_json(cli_options *o, const char *v)
{
    return (void)v, o->json = true;
}
static bool o_stats(cli_options *o, const char *v)
{
    return (void)v, o->stats = true;
}
static bool o_force(cli_options *o, const char *v)
{
    return (void)v, o->force = true;
}
static bool o_each(cli_options *o, const char *v)
{
    return (void)v, o->each = true;
}
static bool o_dedupe(cli_options *o, const char *v)
{
    return (void)v, o->dedupe = true;
}
static bool o_quiet(cli_options *o, const char *v)
{
    return (void)v, o->quiet = true;
}
static bool o_help(cli_options *o, const char *v)
{
    return (void)v, o->help = true;
}
static bool o_no_occlusion(cli_options *o, const char *v)
{
    return (void)v, o->limits.no_occlusion = true;
}

static bool o_fps(cli_options *o, const char *v)
{
    char *end;
    o->fps = strtod(v, &end);
    return end != v && *end == '\0' && o->fps >= 1 && o->fps <= 240;
}

static bool o_no_edl(cli_options *o, const char *v)
{
    return (void)v, o->look.no_edl = true;
}
static bool o_threads(cli_options *o, const char *v)
{
    return read_u32(v, 1, 1024, &o->threads);
}
static bool o_frames(cli_options *o, const char *v)
{
    return read_u32(v, 1, UINT32_MAX, &o->frames);
}
static bool o_memory(cli_options *o, const char *v)
{
    return read_amount(v, 1024, &o->memory);
}
static bool o_depth(cli_options *o, const char *v)
{
    return read_u32(v, 1, 9, &o->inner_depth);
}
static bool o_renderer(cli_options *o, const char *v)
{
    static const char *const names[] = {"auto", "gl", "cpu"}; /* of rend_renderer */
    for (int i = 0; i < 3; i++)
        if (strcmp(v, names[i]) == 0) return o->renderer = (rend_renderer)i, true;
    return false;
}
static bool o_ram(cli_options *o, const char *v)
{
    return read_amount(v, 1024, &o->limits.ram_cache_bytes);
}
static bool o_gpu(cli_options *o, const char *v)
{
    return read_amount(v, 1024, &o->limits.gpu_cache_bytes);
}
static bool o_eye(cli_options *o, const char *v)
{
    return o->camera.has_eye = read_triple(v, o->camera.eye);
}
static bool o_target(cli_options *o, const char *v)
{
    return o->camera.has_target = read_triple(v, o->camera.target);
}
static bool o_fov(cli_options *o, const char *v)
{
    return o->camera.has_fov = read_real(v, 1, 170, &o->camera.fov_deg);
}

/* Low x, y, z, high x, y, z; -inf and inf are numbers, too. */
static bool read_box(const char *text, double c[6])
{
    int used = 0;
    return sscanf(text, "%lf,%lf,%lf,%lf,%lf,%lf%n", &c[0], &c[1], &c[2], &c[3], &c[4], &c[5],
                  &used) == 6 &&
           text[used] == '\0' && c[0] <= c[3] && c[1] <= c[4] && c[2] <= c[5];
}

static bool o_crop(cli_options *o, const char *v)
{
    return o->has_crop = read_box(v, o->crop);
}

static bool o_clip(cli_options *o, const char *v)
{
    double box[6];
    o->look.has_clip = read_box(v, box);
    for (int a = 0; o->look.has_clip && a < 3; a++)
        o->look.clip.low[a] = box[a], o->look.clip.high[a] = box[a + 3];
    return o->look.has_clip;
}

static bool o_budget(cli_options *o, const char *v)
{
    if (strcmp(v, "all") != 0) return read_amount(v, 1000, &o->limits.budget_points);
    o->limits.budget_points = REND_ALL;
    return true;
}

static bool o_min_node_size(cli_options *o, const char *v)
{
    double px;
    if (!read_real(v, 0, 1e6, &px)) return false;
    o->limits.min_node_px = px > 0 ? (float)px : 1e-6f; /* 0: no node is too small */
    return true;
}

static bool o_point_size(cli_options *o, const char *v)
{
    double size;
    size_t n = strlen(v);
    o->look.size_mode = REND_SIZE_AUTO;
    if (strcmp(v, "auto") == 0) return true;
    if (n > 1 && v[n - 1] == 'm') {
        char *end;
        size = strtod(v, &end);
        o->look.size_mode = REND_SIZE_WORLD;
        o->look.point_m = (float)size;
        return end == v + n - 1 && size > 0 && isfinite(size);
    }
    o->look.size_mode = REND_SIZE_FIXED;
    if (!read_real(v, 1, 64, &size)) return false;
    o->look.point_px = (float)size;
    return true;
}

static bool o_up(cli_options *o, const char *v)
{
    o->camera.has_up = true;
    if (strlen(v) == 1 && strchr("xyz", v[0]) != NULL) {
        for (int a = 0; a < 3; a++)
            o->camera.up[a] = v[0] == "xyz"[a];
        return true;
    }
    return read_triple(v, o->camera.up) &&
           fabs(o->camera.up[0]) + fabs(o->camera.up[1]) + fabs(o->camera.up[2]) > 0;
}

static bool o_size(cli_options *o, const char *v)
{
    int used = 0;
    if (sscanf(v, "%u%*1[xX]%u%n", &o->width, &o->height, &used) != 2 || v[used] != '\0')
        return false;
    return o->width >= 1 && o->width <= REND_SIZE_MAX && o->height >= 1 &&
           o->height <= REND_SIZE_MAX;
}

/* Whether the scans have such an attribute is known when they have been read. */
static bool o_colour(cli_options *o, const char *v)
{
    rend_choice_read(v, &o->look);
    return v[0] != '\0';
}

static bool o_colour_range(cli_options *o, const char *v)
{
    double *r = o->look.range;
    int used = 0;
    o->look.has_range = sscanf(v, "%lf,%lf%n", &r[0], &r[1], &used) == 2 && v[used] == '\0' &&
                        isfinite(r[0]) && isfinite(r[1]) && r[0] < r[1];
    return o->look.has_range;
}

static bool o_colour_map(cli_options *o, const char *v)
{
    return rend_ramp_from_name(v, &o->look.map);
}
static bool o_brightness(cli_options *o, const char *v)
{
    return read_real(v, 0.01, 100, &o->look.brightness);
}
static bool o_gamma(cli_options *o, const char *v)
{
    return read_real(v, 0.1, 10, &o->look.gamma);
}
static bool o_legend(cli_options *o, const char *v)
{
    return (void)v, o->legend = true;
}

static bool o_shape(cli_options *o, const char *v)
{
    return rend_shading_shape_from_name(v, &o->look.shape);
}

static bool read_real_float(const char *v, double low, double high, float *out)
{
    double value;
    if (!read_real(v, low, high, &value)) return false;
    *out = (float)value;
    return true;
}

static bool o_blend(cli_options *o, const char *v)
{
    o->has_blend = true;
    return read_real_float(v, 0, 1, &o->look.blend_slab) &&
           (o->look.blend_slab == 0 || o->look.blend_slab >= 1e-4f);
}
static bool o_fill(cli_options *o, const char *v)
{
    return read_u32(v, 0, REND_FILL_PX_MAX, &o->look.fill_px);
}
static bool o_edl_strength(cli_options *o, const char *v)
{
    o->look.no_edl = strcmp(v, "0") == 0;
    return o->look.no_edl || read_real_float(v, 0.01, 100, &o->look.edl_strength);
}
static bool o_edl_radius(cli_options *o, const char *v)
{
    return read_real_float(v, 1, 100, &o->look.edl_radius_px);
}
static bool o_point_min(cli_options *o, const char *v)
{
    return read_real_float(v, 1, 64, &o->look.point_px_min);
}
static bool o_point_max(cli_options *o, const char *v)
{
    return read_real_float(v, 1, 64, &o->look.point_px_max);
}

/* A name or six hexadecimal digits; ends at a comma or at the end. */
static bool read_rgb(const char *v, float out[3], const char **end)
{
    static const struct {
        const char *name;
        unsigned rgb;
    } names[] = {{"black", 0x000000}, {"white", 0xffffff}, {"grey", 0x808080}, {"sky", 0x87a5c7}};
    unsigned rgb = 0;
    size_t length = strcspn(v, ",");
    int used = 0;
    bool known = false;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strlen(names[i].name) == length && strncmp(names[i].name, v, length) == 0)
            rgb = names[i].rgb, known = true;
    const char *digits = v[0] == '#' ? v + 1 : v;
    known = known || (sscanf(digits, "%6x%n", &rgb, &used) == 1 && used == 6 &&
                      digits + used == v + length && isxdigit((unsigned char)digits[0]) &&
                      isxdigit((unsigned char)digits[1]));
    for (int c = 0; c < 3; c++)
        out[c] = (float)(rgb >> (16 - 8 * c) & 255) / 255;
    *end = v + length;
    return known;
}

static bool o_background(cli_options *o, const char *v)
{
    float *top = o->look.background_top, *bottom = o->look.background_bottom;
    const char *end;
    o->look.has_background = true;
    if (!read_rgb(v, top, &end)) return false;
    if (*end == '\0') return memcpy(bottom, top, 3 * sizeof *top), true;
    return read_rgb(end + 1, bottom, &end) && *end == '\0';
}

static bool o_path(cli_options *o, const char *v)
{
    return (o->camera_path = v)[0] != '\0';
}
static bool o_save_path(cli_options *o, const char *v)
{
    return (o->film.save_path = v)[0] != '\0';
}
static bool o_codec(cli_options *o, const char *v)
{
    return (o->film.codec = v)[0] != '\0';
}
static bool o_report(cli_options *o, const char *v)
{
    return (o->film.report = v)[0] != '\0';
}
static bool o_title(cli_options *o, const char *v)
{
    return (o->film.title = v)[0] != '\0' && strlen(v) < 200;
}
static bool o_tour(cli_options *o, const char *v)
{
    return (void)v, o->film.tour = true;
}
static bool o_orbit(cli_options *o, const char *v)
{
    return (void)v, o->film.orbit = true;
}
static bool o_live(cli_options *o, const char *v)
{
    return (void)v, o->film.live = true;
}
static bool o_restart(cli_options *o, const char *v)
{
    return (void)v, o->film.restart = true;
}
static bool o_stereo(cli_options *o, const char *v)
{
    return (void)v, o->film.stereo = true;
}
static bool o_panorama(cli_options *o, const char *v)
{
    return (void)v, o->film.panorama = true;
}
static bool o_counter(cli_options *o, const char *v)
{
    return (void)v, o->film.counter = true;
}
static bool o_duration(cli_options *o, const char *v)
{
    return read_real(v, 0.01, 1e6, &o->film.duration_s);
}
static bool o_fade(cli_options *o, const char *v)
{
    return read_real(v, 0, 1e6, &o->film.fade_s);
}
static bool o_eye_distance(cli_options *o, const char *v)
{
    return read_real(v, 1e-6, 1e6, &o->film.eye_distance);
}
static bool o_shutter(cli_options *o, const char *v)
{
    return read_real(v, 0, 1, &o->film.shutter);
}
static bool o_subframes(cli_options *o, const char *v)
{
    return read_u32(v, 1, 64, &o->film.subframes);
}
static bool o_samples(cli_options *o, const char *v)
{
    return read_u32(v, 1, 8, &o->film.samples);
}
static bool o_quality(cli_options *o, const char *v)
{
    return o->film.has_quality = read_u32(v, 0, 63, &o->film.quality);
}

static bool o_bits(cli_options *o, const char *v)
{
    return read_u32(v, 8, 16, &o->film.bits) && o->film.bits % 8 == 0;
}

static bool o_preset(cli_options *o, const char *v)
{
    o->film.preset = v;
    return strcmp(v, "fast") == 0 || strcmp(v, "medium") == 0 || strcmp(v, "slow") == 0;
}

/* 30, 29.97 (which means 30000/1001) or a fraction. */
static bool o_rate(cli_options *o, const char *v)
{
    double rate;
    int used = 0;
    cli_film_options *f = &o->film;
    if (sscanf(v, "%u/%u%n", &f->rate_num, &f->rate_den, &used) == 2 && v[used] == '\0')
        return f->rate_den > 0 && f->rate_num >= f->rate_den && f->rate_num / f->rate_den <= 1000;
    if (!read_real(v, 1, 1000, &rate)) return false;
    double whole = ceil(rate);
    bool television = rate < whole && fabs(rate - whole / 1.001) < 0.006;
    f->rate_num = television ? (uint32_t)whole * 1000 : (uint32_t)(rate * 1000 + 0.5);
    f->rate_den = television ? 1001 : 1000;
    if (!television && f->rate_num % 1000 == 0) f->rate_num /= 1000, f->rate_den = 1;
    return true;
}

/* A-B, both counted from 0 and both recorded; A- goes to the end. */
static bool o_frame_range(cli_options *o, const char *v)
{
    char *dash;
    if (!isdigit((unsigned char)v[0])) return false;
    o->film.first = strtoull(v, &dash, 10);
    if (*dash != '-') return false;
    if (dash[1] == '\0') return true;
    if (!read_count(dash + 1, o->film.first, UINT32_MAX, &o->film.end)) return false;
    o->film.end++;
    return true;
}

static const struct {
    const char *name, *value; /* value NULL: a switch */
    int letter;               /* 0: none */
    int commands;
    reader read;
    const char *help;
} options[] = {
    {"output", "PATH", 'o', B | V | S | R | J, o_output,
     "where the dataset, the picture or the film goes"},
    {"each", NULL, 0, B, o_each,
     "one dataset per scan file, in the folder -o; only what has changed is built"},
    {"force", NULL, 0, B | V, o_force, "replace a dataset that is there"},
    {"threads", "N", 0, B | V | S | R, o_threads,
     "threads of the builder and of --renderer cpu (default: one per processor)"},
    {"memory", "SIZE", 0, B | V | S | R, o_memory,
     "most memory the build takes, 64M or more (default: a quarter of the machine)"},
    {"temp-dir", "FOLDER", 0, B | V | S | R, o_temp_dir,
     "where scratch files go (default: beside the output)"},
    {"inner-depth", "N", 0, B | V | S | R, o_depth,
     "levels of the octree inside each node, 1 to 9 (default: 6)"},
    {"columns", "NAMES", 0, B | V | S | R, o_columns,
     "columns of text files, as in x,y,z,intensity,r,g,b; - skips one"},
    {"attributes", "NAMES", 0, B | V | S | R, o_attributes,
     "those to keep, as in intensity,classification, or none (default: all)"},
    {"poses", "FILE", 0, B | V | S | R | I, o_poses,
     "moves scans: lines of a file name and a 4 x 4 matrix (NAME.pose.txt beside a scan does it "
     "too)"},
    {"crop", "BOX", 0, B | V | S | R | I, o_crop,
     "keep what is inside X0,Y0,Z0,X1,Y1,Z1; the rest is counted"},
    {"dedupe", NULL, 0, B | V | S | R, o_dedupe,
     "of points at one position, keep only the first; the rest is counted"},
    {"crs", "TEXT", 0, B | V, o_crs,
     "coordinate reference system to note (default: what the scans say)"},
    {"budget", "POINTS", 0, V | S | R, o_budget,
     "most points drawn in a frame, as in 2M, or all (default: 3M in a window, else all)"},
    {"min-node-size", "PX", 0, V | S | R, o_min_node_size,
     "nodes that are smaller on the screen are not drawn (default: by detail)"},
    {"point-size", "SIZE", 0, V | S | R, o_point_size,
     "pixels, as in 2; metres, as in 0.01m; or auto (default)"},
    {"point-min", "PX", 0, V | S | R, o_point_min, "no splat is smaller (default: 1)"},
    {"point-max", "PX", 0, V | S | R, o_point_max, "no splat is larger (default: 6)"},
    {"shape", "NAME", 0, V | S | R, o_shape,
     "of splats: square, round, paraboloid (they cut each other sharply) or auto (default)"},
    {"blend", "SHARE", 0, V | S | R, o_blend,
     "average points up to this share of the distance behind the nearest; 0 shows the nearest "
     "alone "
     "(default: 0.01 in pictures and films, else 0; 0 where points have a size in pixels)"},
    {"fill", "PX", 0, V | S | R, o_fill,
     "close holes in near surfaces from so many pixels around, up to 8 (default: 0)"},
    {"color", "BY", 0, V | S | R, o_colour,
     "rgb (default), intensity, elevation, classification, return, time, scan, density, distance, "
     "or "
     "an attribute"},
    {"colour", "BY", 0, V | S | R, o_colour, NULL},
    {"color-range", "A,B", 0, V | S | R, o_colour_range,
     "values at both ends of the colours (default: all but the lowest and highest hundredth)"},
    {"color-map", "NAME", 0, V | S | R, o_colour_map,
     "viridis, turbo, inferno, grey or diverging (default: grey for intensity, else viridis)"},
    {"brightness", "FACTOR", 0, V | S | R, o_brightness, "of RGB colours (default: 1)"},
    {"gamma", "G", 0, V | S | R, o_gamma,
     "of RGB colours; above 1 lifts the dark ones (default: 1)"},
    {"legend", NULL, 0, S | R, o_legend, "what the colours mean, in the picture"},
    {"no-edl", NULL, 0, V | S | R, o_no_edl, "without eye-dome lighting"},
    {"clip", "BOX", 0, V | S | R, o_clip,
     "show only what is inside X0,Y0,Z0,X1,Y1,Z1; -inf or inf where a side is open"},
    {"edl-strength", "FACTOR", 0, V | S | R, o_edl_strength,
     "how dark eye-dome lighting draws edges (default: 1)"},
    {"edl-radius", "PX", 0, V | S | R, o_edl_radius,
     "how far it looks (default: 1 for each 720 pixels of the height)"},
    {"background", "COLOURS", 0, V | S | R, o_background,
     "one, or top and bottom: names or RRGGBB, as in white or 203040,000000 (default: grey)"},
    {"size", "WxH", 0, V | S | R, o_size, "of the picture or window, pixels (default: 1280x720)"},
    {"eye", "X,Y,Z", 0, V | S, o_eye, "where the camera stands, in the coordinates of the scans"},
    {"target", "X,Y,Z", 0, V | S, o_target, "what it looks at"},
    {"up", "X,Y,Z", 0, V | S, o_up, "which way is up: a direction, or x, y, z (default: z)"},
    {"fov", "DEGREES", 0, V | S, o_fov, "vertical field of view, 1 to 170 (default: 60)"},
    {"renderer", "NAME", 0, V | S | R, o_renderer,
     "gl, cpu, or auto (default): cpu where OpenGL would draw on the processor too"},
    {"ram-cache", "SIZE", 0, V | S | R, o_ram, "most memory for loaded nodes (default: 1G)"},
    {"gpu-cache", "SIZE", 0, V | S | R, o_gpu, "most graphics memory for nodes (default: 1G)"},
    {"no-occlusion", NULL, 0, V | S | R, o_no_occlusion,
     "spend points on nodes that are hidden behind others, too"},
    {"fps", "RATE", 0, V, o_fps, "frames a second while the camera moves, 1 to 240 (default: 30)"},
    {"frames", "N", 0, V, o_frames, "close the window after so many frames"},
    {"screenshot", "PATH", 0, V, o_screenshot, "write the window's picture when it closes"},
    {"path", "FILE", 0, V | R, o_path,
     "camera path: keyframes in JSON, a Potree project, or a Bundler file; `view` saves to it"},
    {"tour", NULL, 0, R, o_tour, "walk from scan position to scan position at eye height"},
    {"orbit", NULL, 0, R, o_orbit, "turn around the whole site"},
    {"save-path", "FILE", 0, R, o_save_path,
     "write the path that is recorded, to change it by hand"},
    {"duration", "SECONDS", 0, R, o_duration, "stretch the path to this length"},
    {"fps", "RATE", 0, R, o_rate, "frames a second, as in 30, 29.97 or 24000/1001 (default: 30)"},
    {"frames", "A-B", 0, R, o_frame_range,
     "only these frames, counted from 0; whole seconds join best"},
    {"codec", "NAME", 0, R, o_codec, "h264, av1, vp9 or ffv1, as far as the container takes it"},
    {"quality", "N", 0, R, o_quality, "0 best to 51 (H.264) or 63 (default: 18 or 28)"},
    {"preset", "NAME", 0, R, o_preset, "fast, medium or slow: slower makes smaller files"},
    {"depth", "BITS", 0, R, o_bits, "8 or 16 per channel, for .png and .mkv (default: 8)"},
    {"samples", "N", 0, R, o_samples,
     "draw N x N times as large and reduce it, 1 to 8 (default: 1)"},
    {"shutter", "SHARE", 0, R, o_shutter,
     "motion blur: how much of a frame's time the shutter is open, 0 to 1 (default: 0)"},
    {"subframes", "N", 0, R, o_subframes, "pictures while it is open, 1 to 64 (default: 8)"},
    {"fade", "SECONDS", 0, R, o_fade, "from black at the start and to black at the end"},
    {"title", "TEXT", 0, R, o_title, "over the first four seconds"},
    {"counter", NULL, 0, R, o_counter, "frame number and time in a corner"},
    {"stereo", NULL, 0, R, o_stereo, "two eyes, side by side"},
    {"eye-distance", "METRES", 0, R, o_eye_distance, "between the two eyes (default: 0.064)"},
    {"panorama", NULL, 0, R, o_panorama, "all around, equirectangular, 2:1"},
    {"live", NULL, 0, R, o_live,
     "as a window would have shown it on this machine, instead of waiting for every point"},
    {"restart", NULL, 0, R, o_restart, "discard an unfinished recording of something else"},
    {"report", "FILE", 0, R, o_report, "all frames in JSON: points drawn, budget, camera"},
    {"columns", "NAMES", 0, I, o_columns, NULL},
    {"stats", NULL, 0, I, o_stats, "read every point: extent, means, memory of other structures"},
    {"json", NULL, 0, B | V | S | R | J | I | C, o_json, "the result as JSON on standard output"},
    {"quiet", NULL, 'q', B | V | S | R | J | C, o_quiet, "no progress line"},
    {"help", NULL, 'h', B | V | S | R | J | I | C, o_help, "this page"},
};
enum { OPTION_COUNT = sizeof options / sizeof options[0] };

const char *cli_command_name(cli_command command)
{
    return commands[command].name;
}

bool cli_command_from_name(const char *name, cli_command *out)
{
    for (int c = 0; c < CLI_COMMANDS; c++) {
        if (strcmp(commands[c].name, name) != 0) continue;
        *out = (cli_command)c;
        return true;
    }
    return false;
}

static bool misuse(mospt_err *err, const char *format, const char *what, const char *more)
{
    return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(), format, what, more);
}

/* Pictures that nobody waits for are drawn twice, so that noisy scans do not sparkle. A window, or
 * a film of what it would show, spends the time on more points; and whoever wants points of so many
 * pixels wants to see points. */
static void choose_blending(cli_options *o)
{
    bool still = o->command == CLI_SHOT || (o->command == CLI_RECORD && !o->film.live);
    if (still && !o->has_blend && o->look.size_mode != REND_SIZE_FIXED)
        o->look.blend_slab = REND_BLEND_DEFAULT;
}

bool cli_options_read(cli_command command, int argc, char **argv, cli_options *out, mospt_err *err)
{
    struct option list[OPTION_COUNT + 1] = {{0}};
    char letters[2 * OPTION_COUNT + 3] = ":";
    cli_options o = {.command = command};
    size_t count = 0, letter_count = 1;
    for (int i = 0; i < OPTION_COUNT; i++) {
        if (!(options[i].commands >> command & 1)) continue;
        list[count++] = (struct option){options[i].name, options[i].value != NULL, NULL, 256 + i};
        if (options[i].letter == 0) continue;
        letters[letter_count++] = (char)options[i].letter;
        if (options[i].value != NULL) letters[letter_count++] = ':';
    }
    letters[letter_count] = '\0';
    optind = 1;
    opterr = 0;
    for (;;) {
        int at = optind, found = getopt_long(argc, argv, letters, list, NULL);
        if (found == -1) break;
        if (found == ':') return misuse(err, "%s wants a value%s", argv[optind - 1], "");
        if (found == '?')
            return misuse(err, "%s is no option of `instantpoints %s`", argv[at],
                          commands[command].name);
        for (int i = 0; i < OPTION_COUNT; i++) {
            if (found != 256 + i && (found != options[i].letter || found == 0)) continue;
            const char *value = options[i].value != NULL ? optarg : "";
            if (!options[i].read(&o, value)) {
                char name[64];
                snprintf(name, sizeof name, "--%s %s", options[i].name,
                         options[i].value != NULL ? options[i].value : "");
                return misuse(err, "\"%s\" does not fit %s", value, name);
            }
            break;
        }
    }
    choose_blending(&o);
    o.paths = (const char *const *)(argv + optind);
    o.path_count = (size_t)(argc - optind);
    *out = o;
    return true;
}

char *cli_help(void)
{
    char *text = NULL;
    size_t size;
    FILE *f = open_memstream(&text, &size);
    if (f == NULL) return NULL;
    fprintf(f,
            "Instant Points %s: any amount of raw laser-scan points, at once\n\n"
            "usage: instantpoints COMMAND ...\n\n",
            IPTS_VERSION);
    for (int c = 0; c < CLI_COMMANDS; c++)
        fprintf(f, "  %-6s %-36s %s\n", commands[c].name, commands[c].arguments,
                commands[c].purpose);
    fprintf(f, "\n`instantpoints help COMMAND` has the options. Exit codes: 0 done, 1 failed, 2 "
               "wrong use,\n"
               "3 done, but some input was left out (it is named).\n");
    fclose(f);
    return text;
}

/* Options that only count where a command that shows something builds a dataset first. */
static bool is_for_building(int option, cli_command command)
{
    return (command == CLI_SHOT || command == CLI_RECORD) && (options[option].commands & B) != 0 &&
           (options[option].commands & (J | C)) == 0 && options[option].read != o_threads;
}

static void print_building(FILE *f, cli_command command)
{
    int count = 0;
    for (int i = 0; i < OPTION_COUNT; i++)
        if ((options[i].commands >> command & 1) && is_for_building(i, command))
            fprintf(f, "%s--%s",
                    count++ > 0 ? ", "
                                : "\nScans instead of a dataset are built first, into a temporary "
                                  "one. For that, as with\n`instantpoints build`: ",
                    options[i].name);
    if (count > 0) fprintf(f, ".\n");
}

char *cli_command_help(cli_command command)
{
    char *text = NULL;
    size_t size;
    FILE *f = open_memstream(&text, &size);
    if (f == NULL) return NULL;
    fprintf(f, "usage: instantpoints %s %s\n\n%c%s.\n%s\n", commands[command].name,
            commands[command].arguments, toupper((unsigned char)commands[command].purpose[0]),
            commands[command].purpose + 1, commands[command].details);
    for (int i = 0; i < OPTION_COUNT; i++) {
        char left[64];
        if (!(options[i].commands >> command & 1) || options[i].help == NULL ||
            is_for_building(i, command))
            continue;
        snprintf(left, sizeof left, "%c%c%s --%s%s%s", options[i].letter != 0 ? '-' : ' ',
                 options[i].letter != 0 ? options[i].letter : ' ',
                 options[i].letter != 0 ? "," : " ", options[i].name,
                 options[i].value != NULL ? " " : "",
                 options[i].value != NULL ? options[i].value : "");
        fprintf(f, "  %-26s %s\n", left, options[i].help);
    }
    print_building(f, command);
    fclose(f);
    return text;
}
