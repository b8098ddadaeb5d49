/* render/record.h - a film of a camera path, without a display.
 *
 * Converged, each frame waits until all that the budget asks for is there: the film is the same,
 * frame by frame, on the same graphics driver, whatever the cache sizes, however often it was
 * interrupted, and each frame is what rend_shot() makes of the same camera and budget. Live, it is
 * what a window would have shown at that speed on this machine: a frame takes what is resident, and
 * one that took longer to draw stays longer.
 *
 * Selecting, loading, drawing and encoding go on at the same time: while a frame is drawn the next
 * one is selected and loaded, the one before is encoded (render/writer.h), and the disk reads for
 * later ones (render/scout.h). */
#pragma once
#include "render/path.h"
#include "render/reel.h"
#include "render/take.h"

typedef struct {
    uint64_t frame, first, end; /* the one that was drawn last, of frames first to end - 1 */
    uint64_t drawn;             /* in this run */
    double seconds;             /* of this run */
    uint64_t points;            /* of that frame */
} rend_record_progress;

typedef struct {
    const char *output;     /* .mp4, .webm, .mkv, or .png for numbered pictures */
    const rend_path *path;  /* borrowed */
    rend_take_options take; /* width and height 0: 1280 x 720; bits 0: 8 */
    const char *codec;      /* NULL: the usual one for the file's name */
    rfilm_preset preset;
    bool has_quality;
    uint32_t quality;
    uint32_t rate_num, rate_den; /* frames a second; 0: 30 */
    uint64_t first, end;         /* only frames first to end - 1; 0, 0: all */
    double fade_s;               /* from and to black at both ends of the path */
    bool restart;                /* discards an unfinished recording of something else */
    const char *report;          /* file for a list of all frames in JSON; NULL: none */
    bool (*progress)(void *context, const rend_record_progress *now); /* false stops; NULL: none */
    void *context;
} rend_record_options;

typedef struct {
    uint64_t frames, drawn; /* of the film; in this run */
    uint64_t resumed_at;    /* first frame of this run */
    double seconds;
    double starting_s;     /* of them before the first frame: graphics driver, caches */
    rend_take_times spent; /* seconds of each stage in this run */
    double encoding_s;
    double cpu_s;         /* of all processors together, of the whole process */
    uint64_t points_most; /* in a frame of this run */
    uint64_t over_budget; /* frames of this run that drew more than their budget: none */
    uint32_t damaged_nodes;
    uint64_t damaged_points;
    mospt_err damage;
    uint32_t resets; /* of the graphics driver, after which it went on */
    char renderer[128];
} rend_record_result;

/* Number of frames of a path at a rate. */
uint64_t rend_record_frames(const rend_path *path, uint32_t rate_num, uint32_t rate_den);

/* Records, or goes on with a recording that was interrupted.
 * result   NULL: not wanted
 * errors   MOSPT_EINVAL (options, path), MOSPT_EIO, MOSPT_ENOMEM, MOSPT_ECANCELLED: what is done
 *          stays, and the same call goes on with it. A damaged node is no error: see the result. */
bool rend_record(const mospt_dataset *dataset, const rend_record_options *options,
                 rend_record_result *result, mospt_err *err);
