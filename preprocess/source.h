/* preprocess/source.h - all scans of a site as one stream of batches, always in the same order.
 *
 * Scans are described one after the other and closed again, so a thousand of them cost one open
 * file. A thread reads ahead while the builder works. Text is parsed once: what it says is kept on
 * the scratch disk. */
#pragma once
#include "preprocess/folder.h"
#include "preprocess/scan.h"

typedef struct {
    char *path, *name; /* owned */
    uint32_t index;    /* of the scan in its file */
    prep_scan_info info;
    bool measured;        /* low and high are those of the points */
    double (*samples)[3]; /* [sample_count], owned: some of its points, evenly spread;
                             only if measured */
    uint32_t sample_count;
    uint64_t spool_offset, spool_size; /* of its batches in the spool; size 0: read the file */
    /* After it has been read: */
    uint64_t points;
    uint64_t dropped[PREP_DROP_REASONS];
    mospt_err damage; /* code MOSPT_OK: none */
} prep_source_scan;

/* A file, or a scan in it, that gives no points. */
typedef struct {
    char *name;    /* owned */
    mospt_err err; /* why */
} prep_left_out;

typedef struct {
    prep_source_scan *scans; /* [scan_count], owned */
    uint32_t scan_count;
    prep_left_out *left_out; /* [left_out_count], owned */
    uint32_t left_out_count;

    prep_scan_options options; /* its memory is owned */
    int spool_fd;              /* -1: nothing spooled */
    char *spool_folder;        /* owned */
    uint64_t spool_size;
} prep_source;

/* Opens and describes every scan of the files, and looks at some of its points unless all of them
 * will be measured. A file that cannot be read is left out, and is no error.
 * scratch  folder for what text says
 * errors   MOSPT_ENOMEM; MOSPT_ECANCELLED */
bool prep_source_open(const prep_folder_list *list, const prep_scan_options *options,
                      const char *scratch, prep_source *out, mospt_err *err);
void prep_source_close(prep_source *source);

/* Told now and then with the points read so far; returns false to stop. */
typedef bool (*prep_source_report)(void *context, uint64_t points);

/* Reads what must be read to know where every point lies: scans whose format declares no bounds, or
 * all of them. Scans without any point, or that fail, are left out. errors   MOSPT_EIO (scratch
 * disk), MOSPT_ENOMEM, MOSPT_ECANCELLED */
bool prep_source_measure(prep_source *source, bool all, prep_source_report report, void *context,
                         mospt_err *err);

/* Forgets what was measured, and leaves out of range from now on what lies outside this box. */
void prep_source_set_range(prep_source *source, const double low[3], const double high[3]);

/* The stream. */
typedef struct prep_stream prep_stream;

/* batch_capacity  points; three batches are in memory at a time */
bool prep_stream_open(prep_source *source, uint32_t batch_capacity, prep_stream **out,
                      mospt_err *err);

/* The next batch, and the scan that it belongs to; NULL at the end. It is valid until the next
 * call. A scan that fails while it is read ends there: what came before it stays, and its damage
 * says why. */
bool prep_stream_next(prep_stream *stream, const prep_batch **batch, uint32_t *scan,
                      mospt_err *err);
void prep_stream_close(prep_stream *stream);
