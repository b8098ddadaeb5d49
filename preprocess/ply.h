/* preprocess/ply.h - PLY: ascii, binary little and big endian (Turk, The PLY Polygon File Format,
 * 1994).
 *
 * The points are the element `vertex`, or else the first one with x, y, z whose name speaks of
 * vertices or points. All its scalar properties are kept: colours as display colour (16-bit ones as
 * `rgb` u16 x 3, floating-point ones as `rgb_float` besides), intensity as `intensity`, nx, ny, nz
 * as `normal` f32 x 3, everything else under its own name and type. Lists are passed over, wherever
 * they are. */
#pragma once
#include "preprocess/ahead.h"
#include "preprocess/lines.h"
#include "preprocess/scan_format.h"

extern const prep_scan_format prep_ply_format;

enum { PREP_PLY_NAME_MAX = 64, PREP_PLY_ELEMENTS_MAX = 64, PREP_PLY_PROPERTIES_MAX = 512 };

typedef enum { PREP_PLY_ASCII, PREP_PLY_LITTLE, PREP_PLY_BIG } prep_ply_encoding;

typedef struct {
    char name[PREP_PLY_NAME_MAX];
    mospt_type type;
    bool is_list;
    mospt_type count_type; /* lists only */
} prep_ply_property;

typedef struct {
    char name[PREP_PLY_NAME_MAX];
    uint64_t count;
    uint32_t first, property_count; /* among the header's properties */
    bool has_lists;
    uint32_t row_size; /* bytes of its scalar properties, packed */
} prep_ply_element;

typedef struct {
    prep_ply_encoding encoding;
    prep_ply_element element[PREP_PLY_ELEMENTS_MAX];
    uint32_t element_count;
    prep_ply_property property[PREP_PLY_PROPERTIES_MAX];
    uint32_t property_count;
    uint64_t size;       /* bytes up to the data */
    uint64_t line_count; /* lines up to the data */
} prep_ply_header;

/* Reads the header from the start of the input. Keywords that are not known are passed over.
 * errors   MOSPT_EFORMAT with the line that is wrong, MOSPT_EIO, MOSPT_ENOMEM */
bool prep_ply_header_read(prep_input *input, prep_ply_header *out, mospt_err *err);

/* Index of a property of an element by name, case ignored, -1 if there is none; lists do not count.
 */
int prep_ply_find(const prep_ply_header *header, const prep_ply_element *element, const char *name);

/* Lines of ascii data, and the vertices that they hold. */
typedef struct {
    prep_line_block lines;
    uint8_t *rows; /* [size], owned */
    size_t size;
    uint64_t seen;     /* lines that are not blank: as many vertices, readable or not */
    uint64_t bad_line; /* number of the first line that is no vertex; 0: there is none */
    uint32_t count;    /* vertices that could be read, a row each */
    uint32_t handed_out;
} prep_ply_block;

/* The element's scalar properties, one packed row per vertex, in the byte order of this machine. */
typedef struct {
    const prep_ply_header *header;  /* borrowed */
    const prep_ply_element *vertex; /* borrowed */
    uint64_t offset;                /* of the first vertex in the unpacked data */
    uint64_t line;                  /* lines before it, ascii only */
    uint64_t next, present;         /* vertices behind, with those of the block; in the file */
    uint8_t *rows;                  /* [capacity * row_size], owned */
    uint32_t capacity;
    uint8_t *buffer; /* owned, raw bytes of binary data with lists */
    size_t begin, end;
    bool is_at_end;
    /* ascii: */
    prep_lines lines; /* owned; of the elements before the vertices */
    bool may_split;   /* other threads may help: set by whoever is going to read all vertices */
    prep_line_cutter cutter;
    prep_ahead *ahead;     /* owned */
    prep_ply_block *block; /* borrowed; NULL: none is at hand */
    uint64_t last_line;    /* number of the last line that was read */
    const char *fault;     /* why the lines end early */
} prep_ply_rows;

/* Finds the first vertex behind the elements that come before it. */
bool prep_ply_rows_locate(prep_scan *scan, prep_ply_rows *rows, mospt_err *err);

/* Goes to a vertex: the first one, or any if prep_ply_rows_is_seekable(). */
bool prep_ply_rows_seek(prep_scan *scan, prep_ply_rows *rows, uint64_t vertex, mospt_err *err);
bool prep_ply_rows_is_seekable(const prep_scan *scan, const prep_ply_rows *rows);

/* Reads up to `want` rows, at most `capacity`.
 * count    out; 0 only at the end. Lines that are no vertex are counted as unreadable and left out
 */
bool prep_ply_rows_read(prep_scan *scan, prep_ply_rows *rows, uint32_t want, uint32_t *count,
                        mospt_err *err);

/* Frees the buffers; the next read allocates them again. */
void prep_ply_rows_release(prep_ply_rows *rows);
