/* preprocess/inspect.h - what a scan file says of itself, and whether that is true. */
#pragma once
#include "preprocess/scan.h"

enum { PREP_INSPECT_NOTES_MAX = 8, PREP_INSPECT_NOTE_SIZE = 256 };

typedef struct {
    prep_scan_info info;
    uint64_t file_bytes;
    bool was_read;   /* every point: what follows is of the points, not of the header */
    uint64_t points; /* that can be used */
    double low[3], high[3], mean[3]; /* metres; only with points > 0 */
    uint64_t dropped[PREP_DROP_REASONS];
    mospt_err damage; /* code MOSPT_OK: none */
    char notes[PREP_INSPECT_NOTES_MAX]
              [PREP_INSPECT_NOTE_SIZE]; /* what looks wrong, a sentence each */
    uint32_t note_count;
} prep_inspection;

/* Looks at scan `index` of a file.
 * read_all  read every point, however many there are; else only where that takes about a second at
 * most errors    those of prep_scan_open() and prep_scan_read() */
bool prep_inspect(const char *path, uint32_t index, const prep_scan_options *options, bool read_all,
                  prep_inspection *out, mospt_err *err);
