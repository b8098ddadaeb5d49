/* preprocess/scan_format.h - what the reader of one file format implements. Internal to the
 * readers; everyone else uses scan.h.
 *
 * scan.c opens the input, recognises the format, and calls the reader below; it leaves out
 * coordinates that no grid can hold, keeps the counts, and closes the input. A reader fills `info`
 * and keeps what it needs in `state`. */
#pragma once
#include "preprocess/input.h"
#include "preprocess/scan.h"

typedef struct {
    /* Fills scan->info (name, format name and scan_count 1 are preset) and scan->state from the
     * header and a sample. The input stands at its first byte. On failure, close() is called all
     * the same. index    scan in the file; a reader that knows only one ignores it */
    bool (*open)(prep_scan *scan, uint32_t index, const prep_scan_options *options, mospt_err *err);
    /* Appends points to the batch (batch->count is where to go on) until it is full or the scan
     * ends. Large buffers are allocated by the first call. Fills all of it with packed records, or
     * none. */
    bool (*read)(prep_scan *scan, prep_batch *batch, mospt_err *err);
    bool (*rewind)(prep_scan *scan, mospt_err *err);
    void (*close)(prep_scan *scan); /* frees scan->state, which may be NULL */
} prep_scan_format;

struct prep_scan {
    const prep_scan_format *format;
    const char *path;  /* borrowed from the input */
    prep_input *input; /* owned */
    void *state;       /* the reader's own */
    prep_scan_info info;
    bool is_moved; /* by `move`, after the format has delivered a point */
    double move[16];
    double range_low[3], range_high[3]; /* what lies outside cannot be kept */
    bool has_crop;
    double crop_low[3], crop_high[3];
    uint64_t dropped[PREP_DROP_REASONS];
    uint8_t *keep; /* owned, [keep_capacity] */
    uint32_t keep_capacity;
    bool is_damaged;
    mospt_err damage;
    bool was_damaged_at_open; /* damage that the header alone shows outlives a rewind */
};

/* Notes what is wrong with a file that can be read all the same; the first fault found is the one
 * that is told. */
void prep_scan_set_damage(prep_scan *scan, mospt_where where, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* True if the builder gets every point between these bounds, and where the file puts it: neither
 * moved nor cropped nor out of range. Then a batch that takes packed records may be given them. */
bool prep_scan_keeps_all(const prep_scan *scan, const double low[3], const double high[3]);

/* Appends an attribute under a name that is printable, not empty, not too long and not taken yet.
 * returns  its index, or -1 if there is no room for more */
int prep_scan_add_attribute(prep_scan *scan, const char *name, mospt_type type,
                            uint32_t components);

/* The coarsest step of which three scales are multiples: positions on such a lattice keep every
 * bit. scale    [3], > 0 returns  0 if there is none that is worth the name */
double prep_scan_common_step(const double scale[3]);

/* What the bytes, and failing that the name, say about a file. */
typedef enum {
    PREP_FILE_LAS,
    PREP_FILE_PLY,
    PREP_FILE_E57,
    PREP_FILE_PCD,
    PREP_FILE_PTX,
    PREP_FILE_TEXT,
    PREP_FILE_BINARY,
} prep_file_kind;

/* head     [size], the first bytes, unpacked */
prep_file_kind prep_scan_recognise(const char *path, const uint8_t *head, size_t size);

enum { PREP_HEAD_SIZE = 4096 };
