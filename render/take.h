/* render/take.h - one frame of a film: from a moment of a camera path to a picture.
 *
 * A frame is drawn in one or more passes: one for each sub-frame while the shutter is open, times
 * one for each eye, or six faces of a cube for a panorama. Each pass is drawn larger than it will
 * be and reduced (supersampling); passes of one place in the picture are averaged. A frame of one
 * pass and one sample is the picture that rend_shot() makes, bit for bit. threads  the one that
 * created it */
#pragma once
#include "render/curve.h"
#include "render/stage.h"

enum { REND_SAMPLES_MAX = 8, REND_SUBFRAMES_MAX = 64, REND_TITLE_SIZE = 256 };

typedef struct {
    uint32_t width, height; /* pixels of the film's picture */
    uint32_t bits;          /* of a channel of the result: 8 or 16 */
    uint32_t samples;       /* along each side of a pixel; 0: 1 */
    double shutter_s;       /* how long the shutter is open; 0: no motion blur */
    uint32_t subframes;     /* while it is; 0: 8 */
    bool stereo;            /* left and right eye side by side, each half as wide */
    double eye_distance;    /* metres; 0: 0.064 */
    bool panorama;     /* all around, equirectangular; the path says where, and which way is the
                          middle; its field of view does not matter */
    bool live;         /* takes what is resident, and as many points as can be drawn at the film's
                          rate, as a window does, and does not wait */
    const char *title; /* over the first seconds; NULL or "": none */
    bool counter;      /* frame number and time in a corner */
    bool legend;       /* what the colours mean */
    rend_look look;
    rend_limits limits; /* budget_points 0: all; a keyframe may want less; of a frame, so shared by
                           two eyes, or six faces */
    rend_engine_options engine;
} rend_take_options;

typedef struct {
    uint64_t number;
    double time_s;
    double rate;    /* frames a second, which live pictures keep up with; > 0 for them */
    double fade;    /* 0 black, 1 as it is */
    double title_s; /* since the title appeared; beyond its time there is none */
} rend_take_frame;

typedef struct {
    uint64_t points_drawn;  /* the most of any sub-frame: of all passes of one moment */
    uint64_t budget_points; /* in force; REND_ALL: none */
    uint32_t nodes_drawn;   /* of the same sub-frame */
    rend_camera camera;     /* at the frame's time */
    bool has_clip;
    rend_box clip;
    uint32_t pending; /* live: nodes that were missing */
} rend_taken;

/* Where the time went, seconds since the start. */
typedef struct {
    double selecting, loading, drawing, reading; /* loading: waiting for it */
} rend_take_times;

typedef struct rend_take rend_take;

/* What can be known before anything is made.
 * errors   MOSPT_EINVAL */
bool rend_take_fits(const rend_take_options *options, mospt_err *err);

/* Opens an engine of its own.
 * dataset, options   borrowed
 * errors   MOSPT_EINVAL (options), MOSPT_EIO (no driver), MOSPT_ENOMEM */
bool rend_take_create(const mospt_dataset *dataset, const rend_take_options *options,
                      rend_take **out, mospt_err *err);
void rend_take_destroy(rend_take *take);

/* Takes a frame.
 * next     time of the frame after it, which is prepared for while this one is drawn; NULL: none
 * picture  out: [width * height * 3] of uint8_t or uint16_t, top row first */
bool rend_take_run(rend_take *take, const rend_curve *curve, const rend_take_frame *frame,
                   const double *next, void *picture, rend_taken *out, mospt_err *err);

/* Views of the passes at a time, for who wants to know early what will be needed.
 * pass     counted from 0; returns false from the last one on */
bool rend_take_view(const rend_take *take, const rend_curve *curve, double time_s, uint32_t pass,
                    rend_view_of *out);

/* Passes of one moment: the first so many of a frame. threads: any, like rend_take_view(). */
uint32_t rend_take_views(const rend_take *take);

rend_take_times rend_take_spent(const rend_take *take);
void rend_take_figures(const rend_take *take, rend_figures *out);
const char *rend_take_renderer(const rend_take *take); /* its name */

/* Which of the back ends draws: never REND_RENDERER_AUTO. */
rend_renderer rend_take_renderer_kind(const rend_take *take);
