/* render/pace.h - how much fits into a frame: a model of what frames cost, fitted to those before.
 *
 *   milliseconds = fixed + point * points + byte * bytes uploaded + show, if it puts out a picture
 *
 * none of them below zero, by least squares over frames: newer ones count more, and a frame far off
 * the others (a page fault, another program) hardly at all. Frames of a camera that moves are all
 * alike, and would not tell what a point costs; so the last few frames of each order of magnitude
 * are remembered, parts of large pictures among them. What is not known stays near where it was.
 *
 * Pure: knows no clock; whoever draws says how long it took. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

enum {
    REND_PACE_SIZES = 16, /* by points: up to 2^13, up to 2^14, ... */
    REND_PACE_EACH = 16,
    REND_PACE_FRAMES = REND_PACE_SIZES * REND_PACE_EACH,
    REND_PACE_TERMS = 4,
};

typedef struct {
    double terms[REND_PACE_TERMS]; /* 1, millions of points, megabytes uploaded, 1 if shown */
    double ms;
    uint64_t number; /* counts frames from 1; 0: none */
} rend_pace_frame;

typedef struct {
    double target_ms;
    double cost[REND_PACE_TERMS];             /* milliseconds for one of each term */
    rend_pace_frame frames[REND_PACE_FRAMES]; /* each size a ring */
    uint64_t count;
    uint32_t next[REND_PACE_SIZES];
} rend_pace;

/* fps      frames a second that are aimed at, > 0 */
void rend_pace_init(rend_pace *pace, double fps);

/* Tells what a frame was and took.
 * shown    it put out a picture: shading, words, the screen */
void rend_pace_note(rend_pace *pace, uint64_t points, uint64_t bytes, bool shown, double ms);

/* Points that can be drawn and shown in time in one frame, besides the uploads that
 * rend_pace_bytes() allows. Grows by no more than a half beyond what was drawn lately. */
uint64_t rend_pace_points(const rend_pace *pace);

/* Bytes that may be uploaded in one frame: what takes a tenth of its time. */
uint64_t rend_pace_bytes(const rend_pace *pace);
