/* cli_options.h - the command line: subcommands, their options, and the pages of help, all from one
 * table. */
#pragma once
#include "mospt/err.h"
#include "render/options.h"

typedef enum { CLI_BUILD, CLI_VIEW, CLI_SHOT, CLI_INFO, CLI_CHECK, CLI_COMMANDS } cli_command;

typedef struct {
    cli_command command;
    const char *const *paths; /* [path_count], borrowed from argv */
    size_t path_count;
    bool help, json, stats, force, quiet, each, dedupe, legend;
    const char *output, *temp_dir, *columns, *attributes, *screenshot, *poses, *crs;
    bool has_crop;
    double crop[6];                /* low x, y, z, high x, y, z */
    uint32_t threads, inner_depth; /* 0: default */
    uint64_t memory;               /* bytes; 0: default */
    uint32_t width, height;        /* 0: default */
    uint32_t frames;               /* 0: until the window is closed */
    rend_camera_options camera;
    rend_look look;
    rend_limits limits;
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
