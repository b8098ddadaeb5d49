/* cli_progress.h - the progress line of a long job, on standard error.
 *
 * On a terminal one line is rewritten ten times a second; elsewhere (a log file) a line is added
 * every ten seconds. */
#pragma once
#include "preprocess/build.h"

typedef struct {
    bool quiet, terminal;
    double start, last; /* seconds, of the job and of the line */
    prep_phase phase;
    double phase_start;
    uint64_t phase_first;
    bool shown;
} cli_progress;

void cli_progress_start(cli_progress *progress, bool quiet);

/* Shows where a build is. */
void cli_progress_build(cli_progress *progress, const prep_progress *now);

/* Shows `done` of `total` of some other job. */
void cli_progress_share(cli_progress *progress, const char *what, uint64_t done, uint64_t total);

/* Shows a recording: `done` of `total` frames are there, `drawn` of them were drawn in `seconds`.
 */
void cli_progress_frames(cli_progress *progress, uint64_t done, uint64_t total, uint64_t drawn,
                         double seconds, uint64_t points);

/* Clears the line. */
void cli_progress_end(cli_progress *progress);

/* Seconds of a clock that never steps. */
double cli_clock(void);
