/* render/view.h - the window: a dataset to walk through. */
#pragma once
#include "mospt/dataset.h"
#include "render/options.h"

typedef struct {
    const char *title;      /* NULL: the dataset's path */
    uint32_t width, height; /* of the window; 0: 1280 x 720 */
    rend_camera_options camera;
    rend_look look;
    rend_limits limits; /* budget_points 0: REND_VIEW_BUDGET_DEFAULT; REND_ALL: no limit */
    rend_engine_options engine;
    double fps;      /* aimed at while the camera moves; 0: REND_FPS_DEFAULT */
    uint64_t frames; /* quit after so many frames, for scripts and tests; 0: when the user does */
    const char *screenshot; /* of the window, words and all, written before it closes; NULL: none */
    const char *path;       /* camera path to edit, see render/strip.h; NULL: a new one */
    bool help;              /* with the help shown */
    uint64_t reset_at;      /* for tests: before that frame the graphics driver seems to be
                               reset; 0: never */
    bool (*should_stop)(void); /* asked a few times a second; true closes the window; NULL: never */
} rend_view_options;

typedef struct {
    uint64_t frames;
    double slowest_ms, mean_ms;
    uint32_t swaps;  /* times that the dataset became another one, and the window went on with it */
    uint32_t resets; /* of the graphics driver, after which it went on */
    uint32_t damaged_nodes;
    uint64_t damaged_points;
    mospt_err damage;   /* of the first of them */
    mospt_err no_words; /* why there were no words over the picture; code MOSPT_OK: there were */
} rend_view_result;

enum { REND_FPS_DEFAULT = 30 };

/* A dataset that is being built, or is built again, is looked at once a second, and the window goes
 * on with what it has become; one that was deleted can be seen to the end. Shows the dataset until
 * the user has seen enough. While the camera moves, a machine that cannot draw the budget so many
 * times a second draws as much of it as it can. When the camera rests, pictures of more and more
 * points follow, each drawn over as many frames as it takes while the one before stays on the
 * screen, up to the budget. When nothing changes and nothing is loading, nothing is drawn. result
 * NULL: not wanted errors   MOSPT_EINVAL (options; no display), MOSPT_EIO (the driver was lost),
 * MOSPT_ENOMEM threads  the main one */
bool rend_view(const mospt_dataset *dataset, const rend_view_options *options,
               rend_view_result *result, mospt_err *err);
