/* preprocess/pcd.h - PCD (Point Cloud Library), versions .5 to .7: ascii, binary and
 * binary_compressed.
 *
 * Fields may come in any order, type and count, their names in any case. `rgb` or `rgba` of 4 bytes
 * hold 0xAARRGGBB, whatever type they are said to have (an alpha that differs from point to point
 * is kept as `alpha`); r, g, b may also stand alone. normal_x, normal_y, normal_z become `normal`
 * f32 x 3; `_` is padding; everything else is kept under its own name, type and count, up to 255
 * values per point.
 *
 * VIEWPOINT says where the sensor stood. PCL keeps it beside the points and does not apply it when
 * it reads them, so coordinates are taken as they are and prep_scan_info.pose tells where the
 * sensor was: the one format where the pose is not "already applied".
 *
 * Compressed data hold one field after the other (all x, then all y ...), packed with LZF, a
 * byte-oriented code that refers back by at most 8 KiB. They are unpacked in bounded memory: one
 * walk over the data notes the state of the decoder where each field begins, and then one decoder
 * per field follows its own. Opening such a file therefore costs unpacking it once, and inside gzip
 * it is refused. Where its sizes contradict each other, the one with which the data agree counts;
 * with none, the data are damaged in an unknown place and the file is refused. A file that was cut
 * gives the points whose x, y and z are there; what is missing of the rest is zero.
 *
 * Text keeps all digits of x, y and z, whatever type they are said to have. */
#pragma once
#include "preprocess/column.h"
#include "preprocess/lines.h"
#include "preprocess/scan_format.h"

extern const prep_scan_format prep_pcd_format;

enum {
    PREP_PCD_NAME_MAX = 64,
    PREP_PCD_FIELDS_MAX = 256,
    PREP_PCD_RECORD_MAX = 1 << 20,
    PREP_PCD_COUNT_MAX = 255
};

typedef enum { PREP_PCD_ASCII, PREP_PCD_BINARY, PREP_PCD_COMPRESSED } prep_pcd_encoding;

typedef struct {
    char name[PREP_PCD_NAME_MAX];
    mospt_type type;
    uint32_t count;  /* values per point */
    uint32_t offset; /* bytes from the start of a record */
} prep_pcd_field;

typedef struct {
    char version[8];
    prep_pcd_encoding encoding;
    prep_pcd_field field[PREP_PCD_FIELDS_MAX];
    uint32_t field_count;
    uint32_t record_size; /* bytes of one point, 1 to PREP_PCD_RECORD_MAX */
    uint64_t points;      /* as declared by POINTS, or else WIDTH and HEIGHT */
    uint64_t grid_points; /* as declared by WIDTH and HEIGHT, or else POINTS */
    double viewpoint[7];  /* tx ty tz qw qx qy qz */
    uint64_t size;        /* bytes up to the data */
    uint64_t line_count;  /* lines up to the data */
} prep_pcd_header;

/* Reads the header from the start of the input. Keywords that are not known are passed over.
 * errors   MOSPT_EFORMAT with the line that is wrong, MOSPT_EIO, MOSPT_ENOMEM */
bool prep_pcd_header_read(prep_input *input, prep_pcd_header *out, mospt_err *err);

static inline uint32_t prep_pcd_field_size(const prep_pcd_field *f)
{
    return (uint32_t)mospt_type_size(f->type) * f->count;
}

enum {
    PREP_PCD_LZF_REACH = 8192,
    PREP_PCD_LZF_STEP = 264 /* bytes that one code unpacks to, at most */
};

/* The state of a decoder between two codes. */
typedef struct {
    uint64_t taken, made;              /* bytes of packed and unpacked data before it */
    uint8_t reach[PREP_PCD_LZF_REACH]; /* the last of them, as many as there are */
} prep_pcd_lzf_mark;

/* A decoder that reads a range of a file and hands out what it unpacks piece by piece. */
typedef struct {
    prep_input *input;     /* borrowed, not gzip */
    uint64_t offset, size; /* the packed data, as many as are there */
    uint64_t taken, made;
    uint8_t *packed; /* owned */
    size_t packed_begin, packed_end;
    uint8_t *out; /* [capacity] and room for one code, owned; what is at [begin, end) has not been
                     handed out */
    size_t begin, end, capacity;
    bool is_finished, is_broken; /* the data ended; a code made no sense */
} prep_pcd_lzf;

/* piece    the most bytes that will be asked for at once */
bool prep_pcd_lzf_init(prep_pcd_lzf *z, prep_input *input, uint64_t offset, uint64_t size,
                       size_t piece, mospt_err *err);
void prep_pcd_lzf_fini(prep_pcd_lzf *z);

/* Unpacks and drops, up to the first code that ends at or behind byte `made` of the unpacked data.
 */
bool prep_pcd_lzf_advance(prep_pcd_lzf *z, uint64_t made, mospt_err *err);
void prep_pcd_lzf_save(const prep_pcd_lzf *z, prep_pcd_lzf_mark *out);
void prep_pcd_lzf_restore(prep_pcd_lzf *z, const prep_pcd_lzf_mark *mark);

/* Makes the next `size` bytes lie at out + begin; what the data do not hold is zero. */
bool prep_pcd_lzf_need(prep_pcd_lzf *z, size_t size, mospt_err *err);

/* Goes on behind them. */
void prep_pcd_lzf_take(prep_pcd_lzf *z, size_t size);

enum { PREP_PCD_SAMPLE_PLACES = 32 };

/* The fields of one block of points after another. */
typedef struct {
    const prep_pcd_header *header;        /* borrowed */
    int xyz[3];                           /* fields that a point must have */
    bool is_used[PREP_PCD_FIELDS_MAX];    /* which are wanted, and */
    bool is_sampled[PREP_PCD_FIELDS_MAX]; /* which of them prep_pcd_rows_sample() gives */
    uint64_t points;                      /* to lay out compressed data by; else as declared */
    uint64_t present;                     /* of them, as far as the file's size tells */
    uint64_t next;                        /* point, or line of one */
    uint32_t capacity;                    /* points in a block */
    uint32_t count;                       /* points in the block at hand */
    uint8_t *rows;                        /* [capacity * record_size], owned; ascii and binary */
    prep_lines lines;                     /* owned; ascii */
    uint64_t packed_offset, packed_size;
    prep_pcd_lzf_mark
        *start; /* [field_count], owned; decoders at the first point of fields in use */
    prep_pcd_lzf_mark *place; /* [field_count * PREP_PCD_SAMPLE_PLACES], owned, while sampling */
    prep_pcd_lzf *plane;      /* [field_count], owned */
    bool is_at_end;
} prep_pcd_rows;

/* Finds out how many points there are. Set header, xyz, is_used and is_sampled before.
 * errors   MOSPT_EFORMAT: far too few data, or compressed data that contradict themselves */
bool prep_pcd_rows_locate(prep_scan *scan, prep_pcd_rows *rows, mospt_err *err);

/* Goes to the first point, and reads up to `want` from there.
 * count    out; 0 only at the end. Lines that are no point are counted as unreadable and left out
 */
void prep_pcd_rows_rewind(prep_pcd_rows *rows);
bool prep_pcd_rows_read(prep_scan *scan, prep_pcd_rows *rows, uint32_t want, uint32_t *count,
                        mospt_err *err);

/* Reads points from a place for the sampled fields: place k of PREP_PCD_SAMPLE_PLACES is k parts
 * into the file, or the next points where a file can only be read forward. Between locate() and
 * rewind() only. */
bool prep_pcd_rows_sample(prep_scan *scan, prep_pcd_rows *rows, uint32_t place, uint32_t want,
                          uint32_t *count, mospt_err *err);

/* One value per point of the block at hand. */
prep_column prep_pcd_rows_column(const prep_pcd_rows *rows, int field, uint32_t component);

/* Frees the buffers; the next read allocates them again. */
void prep_pcd_rows_release(prep_pcd_rows *rows);
void prep_pcd_rows_fini(prep_pcd_rows *rows);
