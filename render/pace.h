/* render/pace.h - how much fits into a frame: a model of what frames cost, fitted to those before.
 *
 *   milliseconds = fixed + point * points drawn + byte * bytes uploaded, none of them below zero
 *
 * by least squares over the last frames, newer ones counting more, and a frame far off the others
 * (a page fault, another program) hardly at all. With few frames, or frames all alike, what is not
 * known stays near where it was.
 *
 * Pure: knows no clock; whoever draws says how long it took. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

enum { REND_PACE_FRAMES = 32 };

typedef struct {
    double millions, megabytes, ms; /* points drawn, bytes uploaded, time taken */
} rend_pace_frame;

typedef struct {
    double target_ms;
    double cost[3]; /* milliseconds: of any frame, of a million points, of a megabyte */
    rend_pace_frame frames[REND_PACE_FRAMES]; /* a ring */
    uint32_t count, next;
} rend_pace;

/* fps      frames a second that are aimed at, > 0 */
void rend_pace_init(rend_pace *pace, double fps);

/* Tells what a frame was and took. */
void rend_pace_note(rend_pace *pace, uint64_t points, uint64_t bytes, double ms);

/* Points that can be drawn in time in one frame, besides the uploads that rend_pace_bytes() allows.
 * Grows by no more than a half beyond what was drawn lately. */
uint64_t rend_pace_points(const rend_pace *pace);

/* Bytes that may be uploaded in one frame: what takes a fifth of its time. */
uint64_t rend_pace_bytes(const rend_pace *pace);
