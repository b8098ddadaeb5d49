/* preprocess/laz.h - LAZ: compressed LAS (rapidlasso, "LAZ Specification 1.4"), decoded to the
 * records of its LAS twin.
 *
 * Read are the compressors "pointwise" (1), "pointwise and chunked" (2) and "layered and chunked"
 * (3) with the items of point formats 0 to 10. A chunk starts from nothing: chunks are decoded by
 * several threads at a time, a few ahead of whoever reads, and any of them can be looked at without
 * those before it. COPC files are LAZ, in the order of their chunks.
 *
 * What a damaged file loses: LAZ has no checksums, so a wrong bit is found where a decoder does not
 * end with its bytes. The records of the chunk decoded so far are delivered all the same, then
 * those of the next chunk. Without a usable chunk table, chunks are found one after the other. */
#pragma once
#include "preprocess/las.h"

enum {
    PREP_LAZ_CHUNKS_MAX = 1 << 22,
    PREP_LAZ_EXTRA_MAX = 4096, /* extra bytes of a record; each has a kilobyte of models */
};

typedef enum {
    PREP_LAZ_ROWS = 1,
    PREP_LAZ_ROW_CHUNKS = 2,
    PREP_LAZ_LAYER_CHUNKS = 3
} prep_laz_compressor;

/* How records are compressed. */
typedef struct {
    prep_laz_compressor compressor;
    uint32_t chunk_points; /* 0: chunks say how many they hold */
    uint8_t point_format;
    uint8_t version;       /* of the items: 1 or 2 in rows, 3 or 4 in layers */
    bool leaves_out_waves; /* layers only: wave packets are passed over and come out as those of the
                              chunk's first record */
    uint16_t record_length;
    uint16_t gps_at, rgb_at, nir_at, wave_at, extra_at; /* bytes in the record; 0: there is none */
    uint16_t extra_size;
} prep_laz_format;

/* Checks the record "laszip encoded" against the header.
 * record   [size], the payload
 * offset   of it in the file, for messages
 * errors   MOSPT_EFORMAT: something that is unknown, or that contradicts the header */
bool prep_laz_format_parse(const prep_las_header *header, const char *file, const uint8_t *record,
                           size_t size, uint64_t offset, prep_laz_format *out, mospt_err *err);

/* Decodes one chunk, some records at a time; opaque. */
typedef struct prep_laz_chunk prep_laz_chunk;

bool prep_laz_chunk_create(const prep_laz_format *format, prep_laz_chunk **out, mospt_err *err);
void prep_laz_chunk_destroy(prep_laz_chunk *chunk);

/* Starts with the chunk at [offset, offset + size) of a file. What does not fit in a window is read
 * as it is needed. points   in the chunk, as the chunk table says; 0: as the chunk says (layers
 * only) ends_early  the chunk's end is not known: bytes behind its last point are no damage errors
 * MOSPT_EIO, MOSPT_ENOMEM threads  several at a time, each with its own decoder; the file may be
 * the same */
bool prep_laz_chunk_begin(prep_laz_chunk *chunk, prep_input *input, uint64_t offset, uint64_t size,
                          uint64_t points, bool ends_early, mospt_err *err);

/* Reads the next records of the chunk.
 * records  [count * record_length]
 * got      out; fewer than `count` at the end of the chunk, or of what could be decoded */
bool prep_laz_chunk_read(prep_laz_chunk *chunk, uint8_t *records, size_t count, size_t *got,
                         mospt_err *err);

/* What is wrong with the chunk, NULL if nothing was found; complete once all is read.
 * byte     out, where */
const char *prep_laz_chunk_damage(const prep_laz_chunk *chunk, uint64_t *byte);
uint64_t prep_laz_chunk_end(const prep_laz_chunk *chunk); /* rows: first byte that was not needed */

/* Decodes a chunk from memory.
 * bytes    [size]
 * records  [points * record_length]
 * got      out; fewer than `points` if the chunk is damaged
 * returns  false only for MOSPT_ENOMEM
 * threads  any, several at a time */
bool prep_laz_chunk_decode(const prep_laz_format *format, const uint8_t *bytes, size_t size,
                           uint64_t points, uint8_t *records, uint64_t *got, mospt_err *err);

/* The points of a LAZ file; opaque, one thread at a time. */
typedef struct prep_laz prep_laz;

/* Finds the chunks. No threads and no large buffers before the first read.
 * input    borrowed until close; only prep_input_read_at() is used
 * threads  that decode; 0: prep_ahead_thread_count()
 * errors   MOSPT_EFORMAT, MOSPT_EIO, MOSPT_ENOMEM */
bool prep_laz_open(prep_input *input, const prep_las_header *header, uint32_t threads,
                   prep_laz **out, mospt_err *err);
void prep_laz_close(prep_laz *laz);

const prep_laz_format *prep_laz_format_of(const prep_laz *laz);

/* For whoever has no use for wave packets: where they have a layer of their own, it is not decoded.
 * Before the first read. */
void prep_laz_leave_out_waves(prep_laz *laz);

/* Points that the chunks hold, as far as chunks and header tell. */
uint64_t prep_laz_point_count(const prep_laz *laz);

/* The next records of the file.
 * records  out, borrowed until the next call
 * count    out, at most `most`; 0 at the end */
bool prep_laz_read(prep_laz *laz, size_t most, const uint8_t **records, size_t *count,
                   mospt_err *err);

/* Goes back to the first record. */
void prep_laz_rewind(prep_laz *laz);

/* Chunks whose place is known; 1 if the others are found only by decoding. */
uint32_t prep_laz_chunk_count(const prep_laz *laz);
uint64_t prep_laz_chunk_first(const prep_laz *laz, uint32_t chunk); /* point */

/* Points that stand before `point` in its chunk, and have to be decoded to look at it; UINT64_MAX
 * if its chunk's place is not known. */
uint64_t prep_laz_lead(const prep_laz *laz, uint64_t point);

/* Reads records from any point whose chunk is known, without disturbing prep_laz_read().
 * records  [count * record_length]
 * got      out, at most `count`; fewer at the end of the known chunks, or at damage */
bool prep_laz_look(prep_laz *laz, uint64_t point, uint8_t *records, size_t count, size_t *got,
                   mospt_err *err);

/* What is wrong with the file as far as it was read; NULL if nothing was found. The first fault is
 * told. */
const mospt_err *prep_laz_damage(const prep_laz *laz);
