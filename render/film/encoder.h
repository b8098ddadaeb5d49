/* render/film/encoder.h - pictures to a film file; no header of FFmpeg's libraries shows here.
 *
 * The name says what it becomes: .mp4 H.264, .webm VP9 or AV1, .mkv FFV1, which is lossless. The
 * frame rate is constant; colours are tagged for what they are: BT.709 in video range, or RGB where
 * nothing may be lost. The number of encoding threads is fixed, so that the same pictures give the
 * same bytes on any machine.
 * threads  one at a time */
#pragma once
#include "mospt/err.h"

typedef enum { RFILM_H264, RFILM_VP9, RFILM_AV1, RFILM_FFV1, RFILM_CODECS } rfilm_codec;
typedef enum { RFILM_MEDIUM, RFILM_FAST, RFILM_SLOW } rfilm_preset;

enum { RFILM_QUALITY_MAX = 63 };

typedef struct {
    rfilm_codec codec;
    rfilm_preset preset;         /* how long to look for a smaller file of the same quality */
    bool has_quality;            /* else one that looks like the pictures */
    uint32_t quality;            /* 0 best to 51 (H.264) or 63; lossless ones have none */
    uint32_t width, height;      /* pixels; even where the codec halves colours */
    uint32_t bits;               /* of a channel of the pictures: 8 or 16 */
    uint32_t rate_num, rate_den; /* frames a second */
    bool side_by_side, panorama; /* what players are told about the pictures */
} rfilm_options;

/* The codec for a file name: `wanted` if the container takes it, or without one its first.
 * wanted   "h264", "vp9", "av1", "ffv1"; NULL: that of the name
 * errors   MOSPT_EINVAL: the name ends in no known container, or one that does not take the codec
 */
bool rfilm_codec_for(const char *path, const char *wanted, rfilm_codec *out, mospt_err *err);

/* What can be known before the first picture: size, bits and quality.
 * path     for errors
 * errors   MOSPT_EINVAL */
bool rfilm_options_fit(const rfilm_options *options, const char *path, mospt_err *err);

typedef struct rfilm_encoder rfilm_encoder;

/* container  a file name with the ending that says which container it is
 * path       where it goes, under any name
 * errors     MOSPT_EINVAL (size, no such encoder), MOSPT_EIO, MOSPT_ENOMEM */
bool rfilm_encoder_open(const char *path, const char *container, const rfilm_options *options,
                        rfilm_encoder **out, mospt_err *err);

/* Adds a picture.
 * rgb      [width * height * 3] of uint8_t or uint16_t, top row first */
bool rfilm_encoder_add(rfilm_encoder *encoder, const void *rgb, mospt_err *err);

/* Writes what is still under way, and ends the file. */
bool rfilm_encoder_finish(rfilm_encoder *encoder, mospt_err *err);

/* An unfinished file stays as it is. */
void rfilm_encoder_destroy(rfilm_encoder *encoder);
