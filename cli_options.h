/* cli_options.h - the command line: subcommands, their options, and the pages of help, all from one
 * table. */
#pragma once
#include "mospt/err.h"
#include "render/options.h"

typedef enum {
    CLI_BUILD,
    CLI_VIEW,
    CLI_SHOT,
    CLI_RECORD,
    CLI_JOIN,
    CLI_INFO,
    CLI_CHECK,
    CLI_COMMANDS
} cli_command;

/* What `record` alone wants to know. */
typedef struct {
    bool tour, orbit, live, restart, stereo, panorama, counter;
    const char *save_path, *codec, *report, *title;
    double duration_s, fade_s, eye_distance; /* 0: default */
    double shutter;                          /* share of a frame's time; 0: no motion blur */
    uint32_t rate_num, rate_den;             /* frames a second; 0: default */
    uint64_t first, end;                     /* frames; 0, 0: all */
    uint32_t bits, samples, subframes;       /* 0: default */
    bool has_quality;
    uint32_t quality;
    const char *preset; /* NULL: default */
} cli_film_options;

typedef struct {
    cli_command command;
    const char *const *paths; /* [path_count], borrowed from argv */
    size_t path_count;
    bool help, json, stats, force, quiet, each, dedupe, legend, has_blend, compress_scratch;
    const char *output, *temp_dir, *columns, *attributes, *screenshot, *poses, *crs;
    bool has_crop;
    double crop[6];                /* low x, y, z, high x, y, z */
    uint32_t threads, inner_depth; /* 0: default */
    uint64_t memory;               /* bytes; 0: default */
    uint32_t width, height;        /* 0: default */
    double fps;                    /* of a window; 0: default */
    uint32_t frames;               /* 0: until the window is closed */
    rend_camera_options camera;
    rend_look look;
    rend_limits limits;
    rend_renderer renderer;
    const char *camera_path; /* file with keyframes */
    cli_film_options film;
} cli_options;

/* Reads argv after the subcommand's name.
 * errors   MOSPT_EINVAL, with a sentence that names the option */
bool cli_options_read(cli_command command, int argc, char **argv, cli_options *out, mospt_err *err);

/* "build" ... */
const char *cli_command_name(cli_command command);
bool cli_command_from_name(const char *name, cli_command *out);

/* The page of all subcommands, or that of one. */
char *cli_help(void);
char *cli_command_help(cli_command command);
