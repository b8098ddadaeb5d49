/* render/live.h - the picture in a window: what is there is shown, what is not is asked for.
 *
 * A frame never waits. A picture that takes several frames is of what was resident at the first of
 * them, and goes on as long as the view is the same, to the last byte of it.
 * threads  the one that has the context */
#pragma once
#include "render/picture.h"

/* What a frame in a window may cost. */
typedef struct {
    uint64_t points;       /* drawn; a picture of more is drawn over several frames; 0: no limit */
    uint64_t upload_bytes; /* a node more at most; 0: 64 MiB */
    /* Where the camera will be shortly: when the frame itself misses nothing, what is missing there
     * is read into memory. NULL: nobody knows. */
    const rend_camera *ahead;
} rend_allowance;

typedef enum {
    REND_SETTLED, /* the same view again would draw the same picture, and nothing more is to come */
    REND_WAITING, /* as long as the loader does not wake anybody, too */
    REND_AGAIN,   /* the next frame shows more */
    REND_PART,    /* there is no picture yet: the same view again goes on drawing it */
} rend_progress;

typedef struct {
    rend_picture *picture; /* borrowed */
    rend_selector *ahead;  /* owned: for what will be seen shortly */

    bool begun, again; /* a picture is in hand; in the second round, of blending */
    bool is_guess;     /* what is hidden was asked of another view */
    uint32_t next;     /* in the order */
    rend_view_of view;

    uint8_t *ages;   /* [node count], owned: see rend_select_input */
    uint32_t *young; /* [node count], owned: the nodes that are not grown */
    uint32_t young_count;
    bool is_growing; /* something was not grown in the picture in hand */
    bool in_parts; /* the picture took several frames: the next one is not drawn for growth only */

    uint32_t hidden_before; /* nodes, in the picture before; and points drawn in it */
    uint64_t points_before;
    uint32_t looks, guesses; /* behind pictures since the camera rests; pictures of guesses */
} rend_live;

bool rend_live_init(rend_live *live, rend_picture *picture, mospt_err *err);
void rend_live_fini(rend_live *live); /* {0} is fine */

/* Another generation of the dataset, see rend_picture_swap(); what is drawn already does not grow
 * in again. errors   MOSPT_ENOMEM */
bool rend_live_swap(rend_live *live, mospt_err *err);

/* Drops the picture in hand, after which the picture's selection can be put to other uses. */
void rend_live_drop(rend_live *live);

/* Draws a frame, or goes on with it; uploads and asks for what it misses. */
bool rend_live_frame(rend_live *live, const rend_view_of *view, const rend_allowance *allowed,
                     rend_progress *progress, mospt_err *err);
