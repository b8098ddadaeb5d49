/* render/path.h - a camera path: what the eye does, and when.
 *
 * A list of keyframes by time, as render/path_file.h stores them and a window edits them; what lies
 * between two of them is render/curve.h's business. Pure; axes as in render/camera.h. */
#pragma once
#include "render/camera.h"

enum { REND_KEYS_MAX = 10000, REND_COLOUR_NAME_SIZE = 64 };
#define REND_KEY_GAP_S 0.001 /* two keyframes are never nearer in time */
#define REND_TIME_MAX_S 1e6

typedef struct {
    double time_s; /* from the start of the film, >= 0 */
    rend_camera camera;
    uint64_t budget_points; /* 0: that of the recording; REND_ALL: no limit */
    /* What colours show, as on the command line (render/choice.h); "": as at the keyframe before,
     * or as in the recording. */
    char colour[REND_COLOUR_NAME_SIZE];
    bool has_clip; /* without one, that of the recording */
    rend_box clip; /* infinite where a side is open */
} rend_key;

typedef struct {
    rend_key *keys; /* [count], owned, by rising time */
    uint32_t count;
    bool abrupt; /* starts and ends at full speed, instead of easing in and out */
} rend_path;

void rend_path_fini(rend_path *path);

/* True if there is a keyframe, times rise and every camera can be looked through; else says which
 * keyframe, counted from 1, is wrong. */
bool rend_path_is_valid(const rend_path *path, mospt_err *err);

/* Adds a keyframe at its place in time; one that is there already is replaced.
 * at       out: its index; NULL: not wanted
 * errors   MOSPT_EINVAL: too many, MOSPT_ENOMEM */
bool rend_path_add(rend_path *path, const rend_key *key, uint32_t *at, mospt_err *err);
void rend_path_remove(rend_path *path, uint32_t index);

/* Moves a keyframe in time: no further than to its neighbours, so that the order stays. */
void rend_path_move(rend_path *path, uint32_t index, double time_s);

/* Stretches all times so that the last keyframe is at `duration_s`; the first moves to 0. */
void rend_path_fit(rend_path *path, double duration_s);

double rend_path_duration(const rend_path *path);
