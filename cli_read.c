#include "cli_read.h"

#include "cli_value.h"
#include "render/choice.h"
#include "render/ramp.h"
#include "render/shading.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool cli_read_output(cli_options *o, const char *v)
{
    return (o->output = v)[0] != '\0';
}
bool cli_read_temp_dir(cli_options *o, const char *v)
{
    return (o->temp_dir = v)[0] != '\0';
}
bool cli_read_columns(cli_options *o, const char *v)
{
    return (o->columns = v)[0] != '\0';
}
bool cli_read_attributes(cli_options *o, const char *v)
{
    return (o->attributes = v)[0] != '\0';
}
bool cli_read_poses(cli_options *o, const char *v)
{
    return (o->poses = v)[0] != '\0';
}
bool cli_read_crs(cli_options *o, const char *v)
{
    return (o->crs = v)[0] != '\0';
}
bool cli_read_screenshot(cli_options *o, const char *v)
{
    return (o->screenshot = v)[0] != '\0';
}
bool cli_read_json(cli_options *o, const char *v)
{
    return (void)v, o->json = true;
}
bool cli_read_stats(cli_options *o, const char *v)
{
    return (void)v, o->stats = true;
}
bool cli_read_compress_scratch(cli_options *o, const char *v)
{
    return (void)v, o->compress_scratch = true;
}
bool cli_read_force(cli_options *o, const char *v)
{
    return (void)v, o->force = true;
}
bool cli_read_each(cli_options *o, const char *v)
{
    return (void)v, o->each = true;
}
bool cli_read_dedupe(cli_options *o, const char *v)
{
    return (void)v, o->dedupe = true;
}
bool cli_read_quiet(cli_options *o, const char *v)
{
    return (void)v, o->quiet = true;
}
bool cli_read_help(cli_options *o, const char *v)
{
    return (void)v, o->help = true;
}
bool cli_read_no_occlusion(cli_options *o, const char *v)
{
    return (void)v, o->limits.no_occlusion = true;
}

bool cli_read_fps(cli_options *o, const char *v)
{
    return cli_value_real(v, 1, 240, &o->fps);
}

bool cli_read_no_edl(cli_options *o, const char *v)
{
    return (void)v, o->look.no_edl = true;
}
bool cli_read_threads(cli_options *o, const char *v)
{
    return cli_value_u32(v, 1, 1024, &o->threads);
}
bool cli_read_frames(cli_options *o, const char *v)
{
    return cli_value_u32(v, 1, UINT32_MAX, &o->frames);
}
bool cli_read_memory(cli_options *o, const char *v)
{
    return cli_value_amount(v, 1024, &o->memory);
}
bool cli_read_depth(cli_options *o, const char *v)
{
    return cli_value_u32(v, 1, 9, &o->inner_depth);
}
bool cli_read_renderer(cli_options *o, const char *v)
{
    static const char *const names[] = {"auto", "gl", "cpu"}; /* of rend_renderer */
    for (int i = 0; i < 3; i++)
        if (strcmp(v, names[i]) == 0) return o->renderer = (rend_renderer)i, true;
    return false;
}
bool cli_read_ram(cli_options *o, const char *v)
{
    return cli_value_amount(v, 1024, &o->limits.ram_cache_bytes);
}
bool cli_read_gpu(cli_options *o, const char *v)
{
    return cli_value_amount(v, 1024, &o->limits.gpu_cache_bytes);
}
bool cli_read_eye(cli_options *o, const char *v)
{
    return o->camera.has_eye = cli_value_triple(v, o->camera.eye);
}
bool cli_read_target(cli_options *o, const char *v)
{
    return o->camera.has_target = cli_value_triple(v, o->camera.target);
}
bool cli_read_fov(cli_options *o, const char *v)
{
    return o->camera.has_fov = cli_value_real(v, 1, 170, &o->camera.fov_deg);
}

bool cli_read_crop(cli_options *o, const char *v)
{
    return o->has_crop = cli_value_box(v, o->crop);
}

bool cli_read_clip(cli_options *o, const char *v)
{
    double box[6];
    o->look.has_clip = cli_value_box(v, box);
    for (int a = 0; o->look.has_clip && a < 3; a++)
        o->look.clip.low[a] = box[a], o->look.clip.high[a] = box[a + 3];
    return o->look.has_clip;
}

bool cli_read_budget(cli_options *o, const char *v)
{
    if (strcmp(v, "all") != 0) return cli_value_amount(v, 1000, &o->limits.budget_points);
    o->limits.budget_points = REND_ALL;
    return true;
}

bool cli_read_min_node_size(cli_options *o, const char *v)
{
    double px;
    if (!cli_value_real(v, 0, 1e6, &px)) return false;
    o->limits.min_node_px = px > 0 ? (float)px : 1e-6f; /* 0: no node is too small */
    return true;
}

bool cli_read_point_size(cli_options *o, const char *v)
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
    if (!cli_value_real(v, 1, 64, &size)) return false;
    o->look.point_px = (float)size;
    return true;
}

bool cli_read_up(cli_options *o, const char *v)
{
    o->camera.has_up = true;
    if (strlen(v) == 1 && strchr("xyz", v[0]) != NULL) {
        for (int a = 0; a < 3; a++)
            o->camera.up[a] = v[0] == "xyz"[a];
        return true;
    }
    return cli_value_triple(v, o->camera.up) &&
           fabs(o->camera.up[0]) + fabs(o->camera.up[1]) + fabs(o->camera.up[2]) > 0;
}

bool cli_read_size(cli_options *o, const char *v)
{
    uint32_t size[2];
    if (!cli_value_pair(v, "xX", size)) return false;
    o->width = size[0], o->height = size[1];
    return o->width <= REND_SIZE_MAX && o->height <= REND_SIZE_MAX;
}

/* Whether the scans have such an attribute is known when they have been read. */
bool cli_read_colour(cli_options *o, const char *v)
{
    rend_choice_read(v, &o->look);
    return v[0] != '\0';
}

bool cli_read_colour_range(cli_options *o, const char *v)
{
    double *r = o->look.range;
    int used = 0;
    o->look.has_range = sscanf(v, "%lf,%lf%n", &r[0], &r[1], &used) == 2 && v[used] == '\0' &&
                        isfinite(r[0]) && isfinite(r[1]) && r[0] < r[1];
    return o->look.has_range;
}

bool cli_read_colour_map(cli_options *o, const char *v)
{
    return rend_ramp_from_name(v, &o->look.map);
}
bool cli_read_brightness(cli_options *o, const char *v)
{
    return cli_value_real(v, 0.01, 100, &o->look.brightness);
}
bool cli_read_gamma(cli_options *o, const char *v)
{
    return cli_value_real(v, 0.1, 10, &o->look.gamma);
}
bool cli_read_legend(cli_options *o, const char *v)
{
    return (void)v, o->legend = true;
}

bool cli_read_shape(cli_options *o, const char *v)
{
    return rend_shading_shape_from_name(v, &o->look.shape);
}

bool cli_read_blend(cli_options *o, const char *v)
{
    o->has_blend = true;
    return cli_value_float(v, 0, 1, &o->look.blend_slab) &&
           (o->look.blend_slab == 0 || o->look.blend_slab >= 1e-4f);
}
bool cli_read_fill(cli_options *o, const char *v)
{
    return cli_value_u32(v, 0, REND_FILL_PX_MAX, &o->look.fill_px);
}
bool cli_read_edl_strength(cli_options *o, const char *v)
{
    o->look.no_edl = strcmp(v, "0") == 0;
    return o->look.no_edl || cli_value_float(v, 0.01, 100, &o->look.edl_strength);
}
bool cli_read_edl_radius(cli_options *o, const char *v)
{
    return cli_value_float(v, 1, 100, &o->look.edl_radius_px);
}
bool cli_read_point_min(cli_options *o, const char *v)
{
    return cli_value_float(v, 1, 64, &o->look.point_px_min);
}
bool cli_read_point_max(cli_options *o, const char *v)
{
    return cli_value_float(v, 1, 64, &o->look.point_px_max);
}

bool cli_read_background(cli_options *o, const char *v)
{
    float *top = o->look.background_top, *bottom = o->look.background_bottom;
    const char *end;
    o->look.has_background = true;
    if (!cli_value_rgb(v, top, &end)) return false;
    if (*end == '\0') return memcpy(bottom, top, 3 * sizeof *top), true;
    return cli_value_rgb(end + 1, bottom, &end) && *end == '\0';
}

bool cli_read_path(cli_options *o, const char *v)
{
    return (o->camera_path = v)[0] != '\0';
}
bool cli_read_save_path(cli_options *o, const char *v)
{
    return (o->film.save_path = v)[0] != '\0';
}
bool cli_read_codec(cli_options *o, const char *v)
{
    return (o->film.codec = v)[0] != '\0';
}
bool cli_read_report(cli_options *o, const char *v)
{
    return (o->film.report = v)[0] != '\0';
}
bool cli_read_title(cli_options *o, const char *v)
{
    return (o->film.title = v)[0] != '\0' && strlen(v) < 200;
}
bool cli_read_tour(cli_options *o, const char *v)
{
    return (void)v, o->film.tour = true;
}
bool cli_read_orbit(cli_options *o, const char *v)
{
    return (void)v, o->film.orbit = true;
}
bool cli_read_live(cli_options *o, const char *v)
{
    return (void)v, o->film.live = true;
}
bool cli_read_restart(cli_options *o, const char *v)
{
    return (void)v, o->film.restart = true;
}
bool cli_read_stereo(cli_options *o, const char *v)
{
    return (void)v, o->film.stereo = true;
}
bool cli_read_panorama(cli_options *o, const char *v)
{
    return (void)v, o->film.panorama = true;
}
bool cli_read_counter(cli_options *o, const char *v)
{
    return (void)v, o->film.counter = true;
}
bool cli_read_duration(cli_options *o, const char *v)
{
    return cli_value_real(v, 0.01, 1e6, &o->film.duration_s);
}
bool cli_read_fade(cli_options *o, const char *v)
{
    return cli_value_real(v, 0, 1e6, &o->film.fade_s);
}
bool cli_read_eye_distance(cli_options *o, const char *v)
{
    return cli_value_real(v, 1e-6, 1e6, &o->film.eye_distance);
}
bool cli_read_shutter(cli_options *o, const char *v)
{
    return cli_value_real(v, 0, 1, &o->film.shutter);
}
bool cli_read_subframes(cli_options *o, const char *v)
{
    return cli_value_u32(v, 1, 64, &o->film.subframes);
}
bool cli_read_samples(cli_options *o, const char *v)
{
    return cli_value_u32(v, 1, 8, &o->film.samples);
}
bool cli_read_quality(cli_options *o, const char *v)
{
    return o->film.has_quality = cli_value_u32(v, 0, 63, &o->film.quality);
}

bool cli_read_bits(cli_options *o, const char *v)
{
    return cli_value_u32(v, 8, 16, &o->film.bits) && o->film.bits % 8 == 0;
}

bool cli_read_preset(cli_options *o, const char *v)
{
    o->film.preset = v;
    return strcmp(v, "fast") == 0 || strcmp(v, "medium") == 0 || strcmp(v, "slow") == 0;
}

/* 30, 29.97 (which means 30000/1001) or a fraction. */
bool cli_read_rate(cli_options *o, const char *v)
{
    double rate;
    uint32_t fraction[2];
    cli_film_options *f = &o->film;
    if (cli_value_pair(v, "/", fraction)) {
        f->rate_num = fraction[0], f->rate_den = fraction[1];
        return f->rate_num <= INT32_MAX && f->rate_num >= f->rate_den &&
               f->rate_num / f->rate_den <= 1000;
    }
    if (!cli_value_real(v, 1, 1000, &rate)) return false;
    double whole = ceil(rate);
    bool television = rate < whole && fabs(rate - whole / 1.001) < 0.006;
    f->rate_num = television ? (uint32_t)whole * 1000 : (uint32_t)(rate * 1000 + 0.5);
    f->rate_den = television ? 1001 : 1000;
    if (!television && f->rate_num % 1000 == 0) f->rate_num /= 1000, f->rate_den = 1;
    return true;
}

/* A-B, both counted from 0 and both recorded; A- goes to the end. */
bool cli_read_frame_range(cli_options *o, const char *v)
{
    char *dash;
    if (!isdigit((unsigned char)v[0])) return false;
    o->film.first = strtoull(v, &dash, 10);
    if (*dash != '-') return false;
    if (dash[1] == '\0') return true;
    if (!cli_value_count(dash + 1, o->film.first, UINT32_MAX, &o->film.end)) return false;
    o->film.end++;
    return true;
}
