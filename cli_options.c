#include "cli_options.h"

#include "cli_read.h"

#include <ctype.h>
#include <getopt.h>
#include <stdio.h>
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

static const struct {
    const char *name, *value; /* value NULL: a switch */
    int letter;               /* 0: none */
    int commands;
    cli_reader *read;
    const char *help;
} options[] = {
    {"output", "PATH", 'o', B | V | S | R | J, cli_read_output,
     "where the dataset, the picture or the film goes"},
    {"each", NULL, 0, B, cli_read_each,
     "one dataset per scan file, in the folder -o; only what has changed is built"},
    {"force", NULL, 0, B | V, cli_read_force, "replace a dataset that is there"},
    {"threads", "N", 0, B | V | S | R, cli_read_threads,
     "threads of the builder and of --renderer cpu (default: one per processor)"},
    {"memory", "SIZE", 0, B | V | S | R, cli_read_memory,
     "most memory the build takes, 64M or more (default: a quarter of the machine)"},
    {"temp-dir", "FOLDER", 0, B | V | S | R, cli_read_temp_dir,
     "where scratch files go (default: beside the output)"},
    {"compress-scratch", NULL, 0, B | V | S | R, cli_read_compress_scratch,
     "compress scratch files: for a disk that is slower than the processor"},
    {"inner-depth", "N", 0, B | V | S | R, cli_read_depth,
     "levels of the octree inside each node, 1 to 9 (default: 6)"},
    {"columns", "NAMES", 0, B | V | S | R, cli_read_columns,
     "columns of text files, as in x,y,z,intensity,r,g,b; - skips one"},
    {"attributes", "NAMES", 0, B | V | S | R, cli_read_attributes,
     "those to keep, as in intensity,classification, or none (default: all)"},
    {"poses", "FILE", 0, B | V | S | R | I, cli_read_poses,
     "moves scans: lines of a file name and a 4 x 4 matrix (NAME.pose.txt beside a scan does it "
     "too)"},
    {"crop", "BOX", 0, B | V | S | R | I, cli_read_crop,
     "keep what is inside X0,Y0,Z0,X1,Y1,Z1; the rest is counted"},
    {"dedupe", NULL, 0, B | V | S | R, cli_read_dedupe,
     "of points at one position, keep only the first; the rest is counted"},
    {"crs", "TEXT", 0, B | V, cli_read_crs,
     "coordinate reference system to note (default: what the scans say)"},
    {"budget", "POINTS", 0, V | S | R, cli_read_budget,
     "most points drawn in a frame, as in 2M, or all (default: 3M in a window, else all)"},
    {"min-node-size", "PX", 0, V | S | R, cli_read_min_node_size,
     "nodes that are smaller on the screen are not drawn (default: by detail)"},
    {"point-size", "SIZE", 0, V | S | R, cli_read_point_size,
     "pixels, as in 2; metres, as in 0.01m; or auto (default)"},
    {"point-min", "PX", 0, V | S | R, cli_read_point_min, "no splat is smaller (default: 1)"},
    {"point-max", "PX", 0, V | S | R, cli_read_point_max, "no splat is larger (default: 6)"},
    {"shape", "NAME", 0, V | S | R, cli_read_shape,
     "of splats: square, round, paraboloid (they cut each other sharply) or auto (default)"},
    {"blend", "SHARE", 0, V | S | R, cli_read_blend,
     "average points up to this share of the distance behind the nearest; 0 shows the nearest "
     "alone "
     "(default: 0.01 in pictures and films, else 0; 0 where points have a size in pixels)"},
    {"fill", "PX", 0, V | S | R, cli_read_fill,
     "close holes in near surfaces from so many pixels around, up to 8 (default: 0)"},
    {"color", "BY", 0, V | S | R, cli_read_colour,
     "rgb (default), intensity, elevation, classification, return, time, scan, density, distance, "
     "or "
     "an attribute"},
    {"colour", "BY", 0, V | S | R, cli_read_colour, NULL},
    {"color-range", "A,B", 0, V | S | R, cli_read_colour_range,
     "values at both ends of the colours (default: all but the lowest and highest hundredth)"},
    {"color-map", "NAME", 0, V | S | R, cli_read_colour_map,
     "viridis, turbo, inferno, grey or diverging (default: grey for intensity, else viridis)"},
    {"brightness", "FACTOR", 0, V | S | R, cli_read_brightness, "of RGB colours (default: 1)"},
    {"gamma", "G", 0, V | S | R, cli_read_gamma,
     "of RGB colours; above 1 lifts the dark ones (default: 1)"},
    {"legend", NULL, 0, S | R, cli_read_legend, "what the colours mean, in the picture"},
    {"no-edl", NULL, 0, V | S | R, cli_read_no_edl, "without eye-dome lighting"},
    {"clip", "BOX", 0, V | S | R, cli_read_clip,
     "show only what is inside X0,Y0,Z0,X1,Y1,Z1; -inf or inf where a side is open"},
    {"edl-strength", "FACTOR", 0, V | S | R, cli_read_edl_strength,
     "how dark eye-dome lighting draws edges (default: 1)"},
    {"edl-radius", "PX", 0, V | S | R, cli_read_edl_radius,
     "how far it looks (default: 1 for each 720 pixels of the height)"},
    {"background", "COLOURS", 0, V | S | R, cli_read_background,
     "one, or top and bottom: names or RRGGBB, as in white or 203040,000000 (default: grey)"},
    {"size", "WxH", 0, V | S | R, cli_read_size,
     "of the picture or window, pixels (default: 1280x720)"},
    {"eye", "X,Y,Z", 0, V | S, cli_read_eye,
     "where the camera stands, in the coordinates of the scans"},
    {"target", "X,Y,Z", 0, V | S, cli_read_target, "what it looks at"},
    {"up", "X,Y,Z", 0, V | S, cli_read_up, "which way is up: a direction, or x, y, z (default: z)"},
    {"fov", "DEGREES", 0, V | S, cli_read_fov, "vertical field of view, 1 to 170 (default: 60)"},
    {"renderer", "NAME", 0, V | S | R, cli_read_renderer,
     "gl, cpu, or auto (default): cpu where OpenGL would draw on the processor too"},
    {"ram-cache", "SIZE", 0, V | S | R, cli_read_ram, "most memory for loaded nodes (default: 1G)"},
    {"gpu-cache", "SIZE", 0, V | S | R, cli_read_gpu,
     "most graphics memory for nodes (default: 1G)"},
    {"no-occlusion", NULL, 0, V | S | R, cli_read_no_occlusion,
     "spend points on nodes that are hidden behind others, too"},
    {"fps", "RATE", 0, V, cli_read_fps,
     "frames a second while the camera moves, 1 to 240 (default: 30)"},
    {"frames", "N", 0, V, cli_read_frames, "close the window after so many frames"},
    {"screenshot", "PATH", 0, V, cli_read_screenshot, "write the window's picture when it closes"},
    {"path", "FILE", 0, V | R, cli_read_path,
     "camera path: keyframes in JSON, a Potree project, or a Bundler file; `view` saves to it"},
    {"tour", NULL, 0, R, cli_read_tour, "walk from scan position to scan position at eye height"},
    {"orbit", NULL, 0, R, cli_read_orbit, "turn around the whole site"},
    {"save-path", "FILE", 0, R, cli_read_save_path,
     "write the path that is recorded, to change it by hand"},
    {"duration", "SECONDS", 0, R, cli_read_duration, "stretch the path to this length"},
    {"fps", "RATE", 0, R, cli_read_rate,
     "frames a second, as in 30, 29.97 or 24000/1001 (default: 30)"},
    {"frames", "A-B", 0, R, cli_read_frame_range,
     "only these frames, counted from 0; whole seconds join best"},
    {"codec", "NAME", 0, R, cli_read_codec,
     "h264, av1, vp9 or ffv1, as far as the container takes it"},
    {"quality", "N", 0, R, cli_read_quality, "0 best to 51 (H.264) or 63 (default: 18 or 28)"},
    {"preset", "NAME", 0, R, cli_read_preset, "fast, medium or slow: slower makes smaller files"},
    {"depth", "BITS", 0, R, cli_read_bits, "8 or 16 per channel, for .png and .mkv (default: 8)"},
    {"samples", "N", 0, R, cli_read_samples,
     "draw N x N times as large and reduce it, 1 to 8 (default: 1)"},
    {"shutter", "SHARE", 0, R, cli_read_shutter,
     "motion blur: how much of a frame's time the shutter is open, 0 to 1 (default: 0)"},
    {"subframes", "N", 0, R, cli_read_subframes, "pictures while it is open, 1 to 64 (default: 8)"},
    {"fade", "SECONDS", 0, R, cli_read_fade, "from black at the start and to black at the end"},
    {"title", "TEXT", 0, R, cli_read_title, "over the first four seconds"},
    {"counter", NULL, 0, R, cli_read_counter, "frame number and time in a corner"},
    {"stereo", NULL, 0, R, cli_read_stereo, "two eyes, side by side"},
    {"eye-distance", "METRES", 0, R, cli_read_eye_distance,
     "between the two eyes (default: 0.064)"},
    {"panorama", NULL, 0, R, cli_read_panorama, "all around, equirectangular, 2:1"},
    {"live", NULL, 0, R, cli_read_live,
     "as a window would have shown it on this machine, instead of waiting for every point"},
    {"restart", NULL, 0, R, cli_read_restart, "discard an unfinished recording of something else"},
    {"report", "FILE", 0, R, cli_read_report, "all frames in JSON: points drawn, budget, camera"},
    {"columns", "NAMES", 0, I, cli_read_columns, NULL},
    {"stats", NULL, 0, I, cli_read_stats,
     "read every point: extent, means, memory of other structures"},
    {"json", NULL, 0, B | V | S | R | J | I | C, cli_read_json,
     "the result as JSON on standard output"},
    {"quiet", NULL, 'q', B | V | S | R | J | C, cli_read_quiet, "no progress line"},
    {"help", NULL, 'h', B | V | S | R | J | I | C, cli_read_help, "this page"},
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
           (options[option].commands & (J | C)) == 0 && options[option].read != cli_read_threads;
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
