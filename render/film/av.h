/* render/film/av.h - what encoder.c and join.c share. */
#pragma once
#include "render/film/libav.h"

/* Says what one of FFmpeg's negative numbers means; returns false. */
bool rfilm_av_fail(mospt_err *err, const char *path, const char *what, int code);

/* Loads FFmpeg's libraries and makes the muxer for the ending of `container`, with the file not yet
 * open.
 * errors   MOSPT_EINVAL, MOSPT_ENOMEM */
bool rfilm_av_muxer(const char *container, AVFormatContext **out, mospt_err *err);

/* Opens the file and writes its head.
 * fast_start   the index comes first */
bool rfilm_av_start(AVFormatContext *muxer, const char *path, bool fast_start, mospt_err *err);

/* Writes the tail and closes the file. */
bool rfilm_av_end(AVFormatContext *muxer, const char *path, mospt_err *err);

void rfilm_av_free(AVFormatContext *muxer); /* NULL is fine */
