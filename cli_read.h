/* cli_read.h - what the value of each option means: one reader per option. */
#pragma once
#include "cli_options.h"

/* Notes the option in `o`; false if the value does not fit.
 * value    borrowed from argv; "" for a switch */
typedef bool cli_reader(cli_options *o, const char *value);

/* Input, output and the build. */
cli_reader cli_read_output, cli_read_each, cli_read_force, cli_read_threads, cli_read_memory,
    cli_read_temp_dir, cli_read_compress_scratch, cli_read_depth, cli_read_columns,
    cli_read_attributes, cli_read_poses, cli_read_crop, cli_read_dedupe, cli_read_crs;

/* How much is drawn, and how it looks. */
cli_reader cli_read_budget, cli_read_min_node_size, cli_read_no_occlusion, cli_read_ram,
    cli_read_gpu, cli_read_renderer, cli_read_point_size, cli_read_point_min, cli_read_point_max,
    cli_read_shape, cli_read_blend, cli_read_fill, cli_read_colour, cli_read_colour_range,
    cli_read_colour_map, cli_read_brightness, cli_read_gamma, cli_read_legend, cli_read_no_edl,
    cli_read_edl_strength, cli_read_edl_radius, cli_read_background, cli_read_clip, cli_read_size;

/* The camera and the window. */
cli_reader cli_read_eye, cli_read_target, cli_read_up, cli_read_fov, cli_read_path, cli_read_fps,
    cli_read_frames, cli_read_screenshot;

/* The film. */
cli_reader cli_read_tour, cli_read_orbit, cli_read_save_path, cli_read_duration, cli_read_rate,
    cli_read_frame_range, cli_read_codec, cli_read_quality, cli_read_preset, cli_read_bits,
    cli_read_samples, cli_read_shutter, cli_read_subframes, cli_read_fade, cli_read_title,
    cli_read_counter, cli_read_stereo, cli_read_eye_distance, cli_read_panorama, cli_read_live,
    cli_read_restart, cli_read_report;

/* The report and the help. */
cli_reader cli_read_stats, cli_read_json, cli_read_quiet, cli_read_help;
