/* render/reel.h - a film on its way to the disk, such that nothing is lost when the machine is.
 *
 * Beside the film WALK.mp4 stands a folder WALK.mp4.part until it is done: what is being recorded
 * (job.json), a film for each whole segment, the frames since (render/rushes.h) and a note for each
 * frame. Whoever opens the same job again goes on at the frame it had reached, and the film has the
 * same frames as one that was never interrupted: every segment is encoded by itself. At the end the
 * segments are joined, and the film appears all at once.
 *
 * WALK.png stands for numbered pictures WALK-000000.png; they appear one by one.
 * threads  one at a time */
#pragma once
#include "mospt/err.h"
#include "render/film/encoder.h"

typedef struct {
    const char *path;        /* .mp4, .webm, .mkv, or .png */
    const char *job;         /* text that says all that decides what the frames look like */
    bool restart;            /* an unfinished recording of something else is discarded */
    bool from_start;         /* nor does one of the same go on */
    uint64_t first, end;     /* frames first to end - 1 */
    uint32_t segment_frames; /* segments end at multiples of it */
    rfilm_options film;      /* size, bits and rate also count for pictures */
} rend_reel_options;

typedef struct rend_reel rend_reel;

/* True if the name is that of numbered pictures. */
bool rend_reel_is_pictures(const char *path);

/* Name of a numbered picture, owned; NULL without memory. */
char *rend_reel_picture_name(const char *path, uint64_t frame);

/* errors   MOSPT_EINVAL: an unfinished recording of something else is there; MOSPT_EIO,
 * MOSPT_ENOMEM */
bool rend_reel_open(const rend_reel_options *options, rend_reel **out, mospt_err *err);

/* What is not finished stays on the disk. */
void rend_reel_close(rend_reel *reel);

/* The frame that is wanted next; `end` of the options when all are there. */
uint64_t rend_reel_next(const rend_reel *reel);

/* Adds that frame.
 * rgb      as rfilm_encoder_add() takes it
 * note     one line of JSON, {"frame": N, ...} */
bool rend_reel_add(rend_reel *reel, const void *rgb, const char *note, mospt_err *err);

/* Makes the film of the segments.
 * notes    file for the notes of all frames, a list in JSON; NULL: not wanted */
bool rend_reel_finish(rend_reel *reel, const char *notes, mospt_err *err);
