/* preprocess/e57_xml.h - what the XML section of an E57 file says of its scans (ASTM E2807, e57Root
 * and data3D).
 *
 * The section is parsed as it is read and no tree of it is kept: files with thousands of pictures
 * carry tens of megabytes of XML. A document type declaration is refused, and with it every way to
 * make a little XML into a lot. */
#pragma once
#include "preprocess/e57_pages.h"

enum { PREP_E57_FIELDS_MAX = 1024, PREP_E57_FIELD_NAME_MAX = 64, PREP_E57_CRS_MAX = 65536 };

typedef enum {
    PREP_E57_INTEGER,
    PREP_E57_SCALED,
    PREP_E57_FLOAT,
    PREP_E57_DOUBLE,
    PREP_E57_UNREAD
} prep_e57_kind;

/* One field of the records of a scan, in the order of their bytestreams. */
typedef struct {
    char name[PREP_E57_FIELD_NAME_MAX]; /* with its prefix: "nor:normalX"; cut if longer */
    prep_e57_kind kind;
    int64_t low, high;    /* integers, scaled or not: range that their bits were chosen for */
    double scale, offset; /* value = integer * scale + offset */
    double least, most;   /* floating point: declared range, NaN if none is */
} prep_e57_field;

/* The name of a field without its prefix. Borrowed from it. */
const char *prep_e57_local_name(const char *name);

typedef struct {
    char name[256], guid[256]; /* "" if there is none */
    bool has_points, has_prototype;
    char fault[256]; /* why the points cannot be read, "" if nothing stands against it */
    uint64_t offset; /* physical, of the binary section */
    uint64_t record_count;
    /* NaN where the file is silent */
    double rotation[4], translation[3];              /* w x y z; metres */
    double low[3], high[3];                          /* cartesianBounds, in the scan's own frame */
    double range_max, elevation_low, elevation_high; /* of sphericalBounds */
    double rgb_low[3], rgb_high[3];
    uint32_t field_count;
    prep_e57_field field[PREP_E57_FIELDS_MAX];
} prep_e57_scan;

typedef struct {
    char *crs; /* owned, coordinateMetadata of the whole file, NULL if it is silent */
    uint32_t image_count;
    bool has_all_scans; /* data3D was read to its end, or the XML as a whole */
    bool is_not_utf8;   /* failed on a byte that is no text: try again as Latin-1 */
} prep_e57_file;

/* Told of each scan when its element ends; the scan is only borrowed. False stops reading, with
 * `err` set. */
typedef bool (*prep_e57_on_scan)(void *context, const prep_e57_scan *scan, mospt_err *err);

typedef struct {
    uint64_t offset, size; /* logical */
    bool as_latin1;
    prep_e57_on_scan on_scan;
    void *context;
} prep_e57_xml;

/* Reads the XML section.
 * out      filled as far as the section was read, also on failure; release with free(out->crs)
 * errors   MOSPT_EFORMAT, MOSPT_EIO, MOSPT_ENOMEM, and those of on_scan */
bool prep_e57_xml_read(prep_e57_pages *pages, const prep_e57_xml *xml, prep_e57_file *out,
                       mospt_err *err);
