/* render/film/libav.h - FFmpeg's libraries, loaded when the first film is written or read.
 *
 * They bring a hundred others with them, and being linked to them would cost every start of the
 * program a tenth of a second; nothing but films needs them. The only header with those of FFmpeg
 * in it. */
#pragma once
#include "mospt/err.h"

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libavutil/spherical.h>
#include <libavutil/stereo3d.h>
#include <libswscale/swscale.h>

#define RFILM_AVCODEC(X)                                                                           \
    X(av_packet_alloc)                                                                             \
    X(av_packet_free)                                                                              \
    X(av_packet_rescale_ts)                                                                        \
    X(avcodec_alloc_context3)                                                                      \
    X(avcodec_find_encoder_by_name)                                                                \
    X(avcodec_free_context)                                                                        \
    X(avcodec_open2)                                                                               \
    X(avcodec_parameters_copy)                                                                     \
    X(avcodec_parameters_from_context)                                                             \
    X(avcodec_receive_packet)                                                                      \
    X(avcodec_send_frame)

#define RFILM_AVFORMAT(X)                                                                          \
    X(av_interleaved_write_frame)                                                                  \
    X(av_read_frame)                                                                               \
    X(av_stream_add_side_data)                                                                     \
    X(av_stream_new_side_data)                                                                     \
    X(av_write_trailer)                                                                            \
    X(avformat_alloc_output_context2)                                                              \
    X(avformat_close_input)                                                                        \
    X(avformat_find_stream_info)                                                                   \
    X(avformat_free_context)                                                                       \
    X(avformat_new_stream)                                                                         \
    X(avformat_open_input)                                                                         \
    X(avformat_write_header)                                                                       \
    X(avio_closep)                                                                                 \
    X(avio_open)

#define RFILM_AVUTIL(X)                                                                            \
    X(av_dict_copy)                                                                                \
    X(av_dict_free)                                                                                \
    X(av_dict_set)                                                                                 \
    X(av_frame_alloc)                                                                              \
    X(av_frame_free)                                                                               \
    X(av_frame_get_buffer)                                                                         \
    X(av_frame_make_writable)                                                                      \
    X(av_free)                                                                                     \
    X(av_log_set_level)                                                                            \
    X(av_opt_set)                                                                                  \
    X(av_opt_set_int)                                                                              \
    X(av_rescale_q)                                                                                \
    X(av_spherical_alloc)                                                                          \
    X(av_stereo3d_alloc)                                                                           \
    X(av_strdup)                                                                                   \
    X(av_strerror)

#define RFILM_SWSCALE(X)                                                                           \
    X(sws_freeContext)                                                                             \
    X(sws_getCoefficients)                                                                         \
    X(sws_getContext)                                                                              \
    X(sws_scale)                                                                                   \
    X(sws_setColorspaceDetails)

/* The functions above, under their own names. */
typedef struct {
#define RFILM_MEMBER(name) __typeof__(name) *name;
    RFILM_AVUTIL(RFILM_MEMBER)
    RFILM_AVCODEC(RFILM_MEMBER)
    RFILM_AVFORMAT(RFILM_MEMBER)
    RFILM_SWSCALE(RFILM_MEMBER)
#undef RFILM_MEMBER
} rfilm_libav;

/* To be used after loading only; never changes then. */
extern rfilm_libav libav;

/* Loads the libraries that this program was built for, if they are not yet loaded.
 * errors   MOSPT_EINVAL: one is not installed
 * threads  any */
bool rfilm_libav_load(mospt_err *err);
