/* preprocess/scan.h - one scan, whatever its file format: what is known of it, and its points in
 * batches.
 *
 * A file holds one or several scans (E57 and PTX hold several). Opening one reads no more than its
 * header and a sample of its points; a scan that is only described holds no large buffers, so a
 * thousand of them may be described one by one. Points come in file order, always the same,
 * whatever the batch size. */
#pragma once
#include "preprocess/batch.h"
#include "preprocess/implied.h"
#include "preprocess/pose.h"
#include "preprocess/scan_memory.h"

/* Why a point of a scan is not in the dataset. */
typedef enum {
    PREP_DROP_NOT_FINITE,   /* a coordinate is NaN or infinite */
    PREP_DROP_OUT_OF_RANGE, /* outside what any grid can hold */
    PREP_DROP_NO_RETURN,    /* the scanner marked the direction as without return, or the point as
                               invalid */
    PREP_DROP_UNREADABLE,   /* a line or a record that is no point */
    PREP_DROP_CROPPED,      /* outside the box that was asked for */
    PREP_DROP_DUPLICATE,    /* at the position of a point before it, if those are to be left out */
    PREP_DROP_REASONS,
} prep_drop;

/* "not finite", "out of range", "no return", "unreadable", "outside the crop", "duplicate" */
const char *prep_drop_name(prep_drop reason);

enum { PREP_CRS_SIZE = 4096 };

typedef struct {
    char name[256];  /* of the scan inside its file, or the file's base name */
    char format[64]; /* for people: "LAS 1.2, point format 3", "PLY binary little endian", "text, 7
                        columns" */
    uint32_t scan_count;  /* scans in the file */
    uint32_t image_count; /* pictures in the file, which are not read */
    uint64_t
        point_count; /* as declared and as far as the file's size agrees; 0 if only reading tells */
    bool has_bounds; /* the header declares bounds; they may lie */
    double low[3], high[3]; /* metres, world; only with has_bounds */
    bool is_text;           /* parsing is the cost: read once and spool, rather than read twice */
    double step; /* resolution that the format declares (LAS: what all scales are multiples of),
                    0 for floating point */
    double offset[3]; /* LAS: offset of its integer coordinates; else 0 */
    bool has_rgb, has_intensity;
    bool has_pose;
    double pose[16]; /* scanner to world, row-major, applied to the points (PCD: not, see pcd.h);
                        only with has_pose */
    char crs[PREP_CRS_SIZE]; /* coordinate reference system: WKT, "EPSG:25832", or what the file
                                says; "" if nothing */
    mospt_schema attributes; /* planes of its batches, in this order */
    /* Some of its points were looked at: its attributes are said to be constant, as far as they can
     * be, and `differs` has those that are not, or not their colour. */
    bool was_looked_at;
    prep_differing differs;
} prep_scan_info;

/* Looks at what points of a scan have in common. */
void prep_scan_look(prep_scan_info *info, const prep_batch *batch);

typedef struct prep_scan prep_scan; /* opaque; one thread at a time */

typedef struct {
    const char *columns;         /* meaning of text columns, as --columns gives it
                                    ("x,y,z,intensity,r,g,b,-"); NULL: recognise */
    const prep_pose_list *poses; /* borrowed; NULL: only sidecars move scans */
    bool has_crop;
    double crop_low[3], crop_high[3]; /* metres, world: what lies outside is dropped and counted */
    bool has_range;
    double range_low[3], range_high[3]; /* metres, world: what lies outside is out of range */
    prep_scan_memory *memory;           /* borrowed; for whoever opens many scans of a file in turn;
                                           NULL: each finds its place in the file by itself */
} prep_scan_options;

/* Opens scan `index` of a file, whose format is recognised by content first and by name last.
 * out      closed by prep_scan_close()
 * errors   MOSPT_EIO; MOSPT_EFORMAT: damaged, or no scan format that this program knows;
 * MOSPT_EEMPTY: valid but without points; all with file and place */
bool prep_scan_open(const char *path, uint32_t index, const prep_scan_options *options,
                    prep_scan **out, mospt_err *err);
void prep_scan_close(prep_scan *scan);

/* Borrowed, valid until the scan is closed. */
const prep_scan_info *prep_scan_describe(const prep_scan *scan);

/* Fills `batch` with the next points, at most its capacity; count 0 at the end of the scan. Points
 * whose coordinates are not finite are left out and counted.
 * batch    made by prep_batch_init() for the scan's attributes; one that takes packed records may
 *          come with them
 * errors   MOSPT_EIO, MOSPT_ENOMEM only: a damaged file ends early and says so through
 *          prep_scan_damage() */
bool prep_scan_read(prep_scan *scan, prep_batch *batch, mospt_err *err);

/* Goes back to the first point and forgets the counts below. */
bool prep_scan_rewind(prep_scan *scan, mospt_err *err);

/* [PREP_DROP_REASONS] points left out so far; borrowed. */
const uint64_t *prep_scan_dropped(const prep_scan *scan);

/* What is wrong with the file although part of it could be read, with its place; NULL as long as
 * nothing was found. */
const mospt_err *prep_scan_damage(const prep_scan *scan);
