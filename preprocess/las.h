/* preprocess/las.h - LAS 1.0 to 1.4, point formats 0 to 10 (ASPRS, "LAS Specification 1.4 - R15").
 *
 * The header and the decoding of records serve uncompressed LAS and whoever unpacks compressed
 * records.
 *
 * Attributes, all as stored: intensity u16, return_number u8, number_of_returns u8, classification
 * u8, flags u8 (below), scanner_channel u8 (formats 6 to 10), scan_angle i8 in degrees (0 to 5) or
 * i16 in units of 0.006 degrees (6 to 10), user_data u8, point_source u16, gps_time f64, rgb u16 x
 * 3 (where a colour is not black), nir u16, extra bytes under the names and types that their
 * description gives them, bytes without description as extra_bytes u8 x n. Wave packets are not
 * kept. */
#pragma once
#include "preprocess/scan_format.h"
#include "preprocess/tone.h"

extern const prep_scan_format prep_las_format;

/* Bits of the attribute `flags`, the same for all point formats. */
enum {
    PREP_LAS_SYNTHETIC = 1,
    PREP_LAS_KEY_POINT = 2,
    PREP_LAS_WITHHELD = 4,
    PREP_LAS_OVERLAP = 8,         /* formats 6 to 10 only; before, class 12 says so */
    PREP_LAS_SCAN_DIRECTION = 16, /* the mirror moved towards positive angles */
    PREP_LAS_EDGE_OF_FLIGHT_LINE = 32,
};

enum { PREP_LAS_FORMATS = 11, PREP_LAS_EXTRA_MAX = 64 };

/* One entry of the description of extra bytes. */
typedef struct {
    char name[33];
    mospt_type type;
    uint32_t components;
} prep_las_extra;

typedef struct {
    uint8_t version_minor;
    uint8_t point_format; /* 0 to 10 */
    bool is_compressed;   /* LAZ */
    uint16_t header_size;
    uint16_t record_length;
    uint32_t vlr_count;
    uint64_t data_offset; /* within the file */
    uint64_t declared;    /* points, as the header says */
    uint64_t present; /* whole records that the file has room for, at most `declared`; compressed:
                         `declared` */
    double scale[3], offset[3];
    double low[3], high[3];
    bool has_bounds; /* finite and ordered */
    prep_las_extra extra[PREP_LAS_EXTRA_MAX];
    uint32_t extra_count;
    bool has_tail;           /* something is meant to stand behind the points */
    char crs[PREP_CRS_SIZE]; /* WKT where there is one, else "EPSG:..." of the GeoTIFF keys or their
                                text; "" */
    uint64_t geotext_at, geotext_size;   /* where that text is, within the file */
    uint16_t citation_at, citation_size; /* within it */
} prep_las_header;

/* Reads the header and the records that describe extra bytes, every length checked against the
 * file. errors   MOSPT_EFORMAT with the byte that is wrong, MOSPT_EIO */
bool prep_las_header_read(prep_input *input, prep_las_header *out, mospt_err *err);

/* Bytes of a record of this format without extra bytes. */
uint32_t prep_las_record_size(uint8_t point_format);

/* A sample of the records: what it says about colour and intensity, and some of them. */
typedef struct {
    uint16_t rgb_max;
    double *intensity; /* [PREP_TONE_SAMPLES], owned, of the first records */
    size_t count;
    uint8_t *kept; /* [kept_count][record_length], owned, of each look the first */
    size_t kept_count, kept_of_look;
} prep_las_sample;

/* looks    how often records will be added */
bool prep_las_sample_init(prep_las_sample *sample, const prep_las_header *header, uint32_t looks,
                          mospt_err *err);
void prep_las_sample_fini(prep_las_sample *sample);
void prep_las_sample_add(prep_las_sample *sample, const prep_las_header *header,
                         const uint8_t *records, size_t count);

/* Where each plane of a batch is found in a record. */
typedef struct {
    uint8_t kind; /* how to decode it */
    uint8_t shift, mask;
    uint8_t size; /* bytes of one component */
    uint16_t components;
    uint16_t at; /* byte in the record */
} prep_las_field;

typedef struct {
    uint32_t record_length;
    double scale[3], offset[3];
    bool has_rgb, rgb_is_16;
    bool has_intensity;
    prep_tone tone;
    uint32_t rgb_at;
    prep_las_field field[MOSPT_ATTRIBUTES_MAX];
    uint32_t field_count;
} prep_las_layout;

/* Adds the attributes of a header to scan->info and says where they are; fills has_rgb and
 * has_intensity too. */
void prep_las_layout_make(prep_scan *scan, const prep_las_header *header, prep_las_sample *sample,
                          prep_las_layout *out);

/* A prep_unpack for records of a prep_las_layout. */
prep_unpack prep_las_unpack;

/* Fills scan->info with what the header says: format, count, bounds, step, offset. */
void prep_las_describe(prep_scan *scan, const prep_las_header *header);
