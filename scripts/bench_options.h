/* scripts/bench_options.h - the command line that benchmarks of drawing share:
 *
 *     DATASET [--budget N] [--threads N] [--size WxH] [--renderer gl|cpu] [--point-size PX|auto]
 *             [--no-edl] [--no-occlusion]
 */
#pragma once
#include "render/options.h"
#include "render/picture.h"

typedef struct {
    const char *dataset;
    rend_engine_options engine;
    rend_view_of view; /* without a camera */
} bench_options;

/* What a program understands beyond that.
 * value    what follows the name; NULL: nothing does
 * returns  how many arguments that was: 1, the name; 2, the value too; 0: unknown, or wrong */
typedef int bench_options_own(void *user, const char *name, const char *value);

/* What is not given: 2 million points of one pixel, drawn by all processors. */
bench_options bench_options_usual(void);

/* Changes what is given. False where something is unknown or missing, or nothing would be drawn. */
bool bench_options_parse(int argc, char **argv, bench_options_own *own, void *user,
                         bench_options *options);

/* Says what went wrong; returns the program's exit status. */
int bench_options_fail(const char *program, const mospt_err *err);
