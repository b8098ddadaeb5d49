/* preprocess/ptx.h - PTX (Leica Cyclone): scans as text, one after the other in a file.
 *
 * Each scan is a header of ten lines and a grid of points, column by column: the number of columns,
 * the number of rows, the scanner's position, its three axes, a 4 x 4 matrix, then lines `x y z
 * intensity [r g b]` in the scanner's frame. A point is a row vector, so that world = (x y z 1) *
 * matrix, and the translation stands in the matrix's last row; prep_scan_info has its transpose. A
 * direction without return is `0 0 0`, and counted.
 *
 * Points carry `intensity` as it is (f32), and their place in the grid (`row_index`,
 * `column_index`; u16, or u32 for grids that need it), which no-returns take up as well. Lines with
 * and without colour may be mixed.
 *
 * The grid that a header declares is not believed: a scan goes on until the next header, or the end
 * of the file. Finding the headers takes one walk over the whole file, which counts lines but
 * parses none of them; a prep_scan_memory keeps what it finds for the next scan. */
#pragma once
#include "preprocess/scan_format.h"

extern const prep_scan_format prep_ptx_format;

enum { PREP_PTX_SCANS_MAX = 65536 }; /* per file; the others are left out, and it is said so */

/* One scan of a file. */
typedef struct {
    uint64_t columns, rows; /* as declared */
    double matrix[16];      /* as in the file, row by row; finite */
    uint64_t offset, line;  /* of the first point: its byte, and the number of lines before it */
    uint64_t end;           /* byte behind the last point's line */
    uint64_t line_count;    /* lines up to there that are not blank */
    uint64_t lost_line; /* line of a header behind it that cannot be understood; 0: there is none */
    uint64_t lost_count; /* lines from there to the next good header: whose points they are is not
                            known */
} prep_ptx_scan;

/* Finds scan `index`. Scans that neither declare nor hold points do not count, if there are others.
 * memory       NULL: none
 * out          written if index < *scan_count
 * has_more     out, the file holds more than PREP_PTX_SCANS_MAX scans
 * errors       MOSPT_EFORMAT, MOSPT_EEMPTY, MOSPT_EIO, MOSPT_ENOMEM */
bool prep_ptx_find(prep_input *input, prep_scan_memory *memory, uint32_t index, prep_ptx_scan *out,
                   uint32_t *scan_count, bool *has_more, mospt_err *err);
