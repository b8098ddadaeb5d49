/* preprocess/laz_stream.h - compressed bytes on their way to a range decoder, through a window of
 * bounded size.
 *
 * Before a point is decoded, the decoder asks for as many bytes as a point may need at most; while
 * it decodes, it need not look. Behind the last byte come zeros: a decoder that was led astray
 * reads them, and is found out before the next point. */
#pragma once
#include "preprocess/input.h"
#include "preprocess/laz_range.h"

/* Where compressed bytes lie: in a file or in memory. */
typedef struct {
    prep_input *input;    /* borrowed; NULL: `bytes` */
    const uint8_t *bytes; /* borrowed, [size] */
    uint64_t offset; /* of the first byte in the file; in memory, of the first byte as messages give
                        it */
    uint64_t size;
} prep_laz_source;

typedef struct {
    prep_laz_range range;
    const uint8_t *limit; /* once range.next is beyond it, prep_laz_stream_refill() is due */
    uint8_t *window;      /* [capacity + margin], borrowed */
    size_t capacity, margin, held; /* bytes held in the window, zeros behind the end not counted */
    prep_laz_source source;        /* what is not in the window yet */
    mospt_err *err;                /* borrowed; set if reading failed */
    bool has_failed;
} prep_laz_stream;

/* Reads `size` bytes and leaves the rest in the source.
 * returns  false if there are fewer, or if reading failed, which alone sets err->code */
bool prep_laz_source_take(prep_laz_source *source, void *out, size_t size, mospt_err *err);
void prep_laz_source_skip(prep_laz_source *source, uint64_t size);

/* Sizes of a window for `size` bytes of which one point takes `need` at most. */
size_t prep_laz_stream_capacity(uint64_t size, size_t need, size_t most);
size_t prep_laz_stream_margin(size_t need);

/* Begins to decode.
 * source   all of it, and nothing else, is the code
 * window   [capacity + margin] */
bool prep_laz_stream_begin(prep_laz_stream *stream, prep_laz_source source, uint8_t *window,
                           size_t capacity, size_t margin, mospt_err *err);

/* Makes sure that the next point can be decoded.
 * returns  false if the decoder has read beyond the last byte */
bool prep_laz_stream_refill(prep_laz_stream *stream);

/* Whether the decoder has read beyond the last byte. */
bool prep_laz_stream_is_beyond(const prep_laz_stream *stream);

/* Bytes of the source that the decoder has not consumed; 0 if it went beyond. */
uint64_t prep_laz_stream_left(const prep_laz_stream *stream);
