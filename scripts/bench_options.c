#include "scripts/bench_options.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bench_options bench_options_usual(void)
{
    return (bench_options){.engine = {.renderer = REND_RENDERER_CPU},
                           .view = {.width = REND_WIDTH_DEFAULT,
                                    .height = REND_HEIGHT_DEFAULT,
                                    .look = {.size_mode = REND_SIZE_FIXED, .point_px = 1},
                                    .budget_points = 2000000}};
}

static bool set_value(bench_options *o, const char *name, const char *value)
{
    rend_view_of *v = &o->view;
    if (strcmp(name, "--budget") == 0) v->budget_points = (uint64_t)atof(value);
    else if (strcmp(name, "--threads") == 0) o->engine.threads = (uint32_t)atol(value);
    else if (strcmp(name, "--size") == 0) return sscanf(value, "%ux%u", &v->width, &v->height) == 2;
    else if (strcmp(name, "--renderer") == 0)
        o->engine.renderer = strcmp(value, "gl") == 0 ? REND_RENDERER_GL : REND_RENDERER_CPU;
    else if (strcmp(name, "--point-size") == 0) {
        v->look.size_mode = strcmp(value, "auto") == 0 ? REND_SIZE_AUTO : REND_SIZE_FIXED;
        v->look.point_px = (float)atof(value);
    } else return false;
    return true;
}

/* See bench_options_own. */
static int set(bench_options *o, const char *name, const char *value)
{
    if (strcmp(name, "--no-edl") == 0) o->view.look.no_edl = true;
    else if (strcmp(name, "--no-occlusion") == 0) o->view.no_occlusion = true;
    else if (name[0] != '-') o->dataset = name;
    else return value != NULL && set_value(o, name, value) ? 2 : 0;
    return 1;
}

bool bench_options_parse(int argc, char **argv, bench_options_own *own, void *user,
                         bench_options *options)
{
    for (int i = 1, taken; i < argc; i += taken) {
        taken = set(options, argv[i], argv[i + 1]);
        if (taken == 0) taken = own(user, argv[i], argv[i + 1]);
        if (taken == 0) return false;
    }
    return options->dataset != NULL && options->view.width > 0 && options->view.height > 0 &&
           options->view.budget_points > 0;
}

int bench_options_fail(const char *program, const mospt_err *err)
{
    char text[2048];
    mospt_err_text(err, text, sizeof text);
    fprintf(stderr, "%s: %s\n", program, text);
    return 1;
}
