/* preprocess/input.h - the bytes of a scan file, read in pieces and never mapped: peak resident
 * memory is a promise.
 *
 * A gzip file is unpacked on the way, so that text and PLY need not know; formats that jump about
 * in their file ask for a plain one. */
#pragma once
#include "mospt/err.h"

#include <sys/stat.h>

typedef struct prep_input prep_input; /* opaque; one thread at a time */

/* Opens a regular file. Anything else (a folder, a pipe) is refused rather than waited for.
 * out      closed by prep_input_close() */
bool prep_input_open(const char *path, prep_input **out, mospt_err *err);
void prep_input_close(prep_input *input);

const char *prep_input_path(const prep_input *input); /* as given to open; borrowed */
uint64_t prep_input_size(const prep_input *input);    /* bytes of the file itself, packed or not */
bool prep_input_is_gzip(const prep_input *input);
const struct stat *prep_input_status(const prep_input *input); /* as it was opened; borrowed */

/* Reads the next bytes, unpacked.
 * got      out, bytes read; fewer than `size` at the end of the data, or where a gzip stream is
 * damaged errors   MOSPT_EIO, MOSPT_ENOMEM */
bool prep_input_read(prep_input *input, void *out, size_t size, size_t *got, mospt_err *err);

/* Offset of the next byte that prep_input_read() delivers, counted in unpacked bytes. */
uint64_t prep_input_tell(const prep_input *input);

/* Moves there; in a gzip file this unpacks again from the start where it leads backwards. */
bool prep_input_seek(prep_input *input, uint64_t offset, mospt_err *err);

/* Reads at an offset of the file itself, without moving. Not for gzip. */
bool prep_input_read_at(prep_input *input, uint64_t offset, void *out, size_t size, size_t *got,
                        mospt_err *err);

/* Why the data ended early ("the gzip data is damaged"), NULL if it did not. */
const char *prep_input_fault(const prep_input *input);
