/* preprocess/e57_vector.h - the binary section that holds the points of one scan (ASTM E2807,
 * compressed vectors).
 *
 * A section is a header and a chain of packets. A data packet holds a piece of each bytestream, one
 * per field of the prototype; a bytestream goes on from packet to packet without a gap, so a value
 * may begin in one and end in the next. Index packets and ignored packets may stand anywhere
 * between them and are passed over.
 *
 * Each bytestream is followed by a place of its own, so that a file that deals out one field far
 * ahead of another takes no more memory than any other, and fields that nobody wants (strings) are
 * never touched. */
#pragma once
#include "preprocess/e57_pages.h"

enum {
    PREP_E57_STREAMS_MAX = 1024, /* fields of a prototype, and thus bytestreams of a packet */
    PREP_E57_BLOCK = 1024,       /* values of a bytestream that are decoded at once */
    PREP_E57_JUMP_MAX = 4096,    /* bytes by which the bytestreams of one packet may lag behind one
                                    another in a sample */
    PREP_E57_STREAM_SIZE = PREP_E57_JUMP_MAX + 8 * PREP_E57_BLOCK + 32,
    PREP_E57_HOLES_MAX =
        16, /* damaged pages in one stream's buffer, which is not as long as that */
};

/* Bytes of a stream's buffer that stand for a damaged page: zeros, but where they are is known, so
 * the values behind them are still good. */
typedef struct {
    size_t from, to;
} prep_e57_hole;

typedef struct {
    uint32_t index;  /* among those of a packet */
    unsigned width;  /* bits of a value, 0 to 64 */
    uint64_t packet; /* logical offset of the next packet to look into */
    uint64_t at,
        left; /* what of the current packet's piece was not fetched yet: logical offset and bytes */
    uint8_t *bytes; /* [PREP_E57_STREAM_SIZE], owned */
    size_t size;    /* bytes fetched */
    size_t bit;     /* in `bytes`, of the next value */
    uint32_t hole_count;
    prep_e57_hole hole[PREP_E57_HOLES_MAX]; /* ascending */
} prep_e57_stream;

typedef struct {
    prep_e57_pages *pages; /* borrowed */
    const char *path;      /* borrowed */
    uint64_t begin, end;   /* logical: first packet, end of the section as far as the file has it */
    uint32_t stream_count;
    const char *fault;    /* static; NULL as long as nothing was found */
    uint64_t fault_place; /* physical */
} prep_e57_vector;

/* Reads the header of a section.
 * offset   physical, from the description of the scan
 * errors   MOSPT_EFORMAT with the place */
bool prep_e57_vector_open(prep_e57_pages *pages, uint64_t offset, uint32_t stream_count,
                          prep_e57_vector *out, mospt_err *err);

/* Values of `bits` each for which the section has room. */
uint64_t prep_e57_vector_room(const prep_e57_vector *vector, uint64_t bits);

/* Puts a stream before its first value. */
void prep_e57_stream_start(prep_e57_stream *stream, const prep_e57_vector *vector, uint32_t index,
                           unsigned width);
void prep_e57_stream_release(prep_e57_stream *stream);

/* Makes the next `count` values, at most PREP_E57_BLOCK, stand whole at stream->bit of
 * stream->bytes, with 9 bytes to spare. available    out, how many do; fewer where the section
 * ends, or the chain of packets breaks: then vector->fault says why errors       MOSPT_EIO,
 * MOSPT_ENOMEM */
bool prep_e57_stream_fill(prep_e57_stream *stream, prep_e57_vector *vector, uint32_t count,
                          uint32_t *available, mospt_err *err);

static inline void prep_e57_stream_take(prep_e57_stream *stream, uint32_t count)
{
    stream->bit += (size_t)count * stream->width;
}

/* Marks which of the next `count` values lie in a hole, at least in part.
 * out      [count], set to 1 for those, left alone for the others
 * returns  whether there are any */
bool prep_e57_stream_mark_holes(const prep_e57_stream *stream, uint32_t count, uint8_t *out);

/* Walks from packet to packet without reading what is in them, to sample a scan in many places. */
typedef struct {
    uint64_t packet;  /* logical offset */
    uint64_t *before; /* [vector->stream_count], borrowed: bytes of each bytestream in the packets
                         before it; zeroed */
} prep_e57_walk;

/* Goes past `packets` data packets; false in front of the end and of damage, too. */
bool prep_e57_walk_on(prep_e57_walk *walk, prep_e57_vector *vector, uint32_t packets);

/* Puts streams before the first record that is whole from that packet on.
 * returns  false if the packet's pieces are too far apart; the streams are as before then */
bool prep_e57_walk_enter(const prep_e57_walk *walk, prep_e57_stream *const *streams,
                         uint32_t count);
