#include "tests/ref_film.h"

#include "tests/core_tools.h"

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
#include <stdlib.h>
#include <string.h>

static void add_frame(ref_film *film, const AVFrame *frame, struct SwsContext **scaler)
{
    size_t size = (size_t)film->width * film->height * 3;
    film->rgb = realloc(film->rgb, (film->count + 1) * size);
    assert_non_null(film->rgb);
    *scaler =
        sws_getCachedContext(*scaler, frame->width, frame->height, frame->format, frame->width,
                             frame->height, AV_PIX_FMT_RGB24, SWS_BICUBIC, NULL, NULL, NULL);
    uint8_t *planes[4] = {film->rgb + film->count * size};
    const int strides[4] = {(int)film->width * 3};
    sws_scale(*scaler, (const uint8_t *const *)frame->data, frame->linesize, 0, frame->height,
              planes, strides);
    film->count++;
}

static void describe(const AVFormatContext *file, ref_film *film)
{
    const AVStream *stream = file->streams[0];
    const AVCodecParameters *p = stream->codecpar;
    strncpy(film->codec, avcodec_get_name(p->codec_id), sizeof film->codec - 1);
    film->width = (uint32_t)p->width, film->height = (uint32_t)p->height;
    film->rate_num = (uint32_t)stream->avg_frame_rate.num;
    film->rate_den = (uint32_t)stream->avg_frame_rate.den;
    film->even = true;
    film->is_bt709_video = p->color_primaries == AVCOL_PRI_BT709 &&
                           p->color_trc == AVCOL_TRC_BT709 && p->color_space == AVCOL_SPC_BT709 &&
                           p->color_range == AVCOL_RANGE_MPEG;
    film->is_sphere = av_stream_get_side_data(stream, AV_PKT_DATA_SPHERICAL, NULL) != NULL;
    film->is_side_by_side = av_stream_get_side_data(stream, AV_PKT_DATA_STEREO3D, NULL) != NULL;
}

static void receive(AVCodecContext *codec, AVFrame *frame, const AVStream *stream, ref_film *film,
                    struct SwsContext **scaler)
{
    while (avcodec_receive_frame(codec, frame) == 0) {
        double at = (double)frame->pts * av_q2d(stream->time_base);
        double wanted = (double)film->count * film->rate_den / film->rate_num;
        film->even = film->even && at > wanted - 0.002 && at < wanted + 0.002;
        add_frame(film, frame, scaler);
    }
}

ref_film ref_film_read(const char *path)
{
    ref_film film = {.count = 0};
    AVFormatContext *file = NULL;
    AVPacket *packet = av_packet_alloc();
    AVFrame *frame = av_frame_alloc();
    struct SwsContext *scaler = NULL;
    assert_true(avformat_open_input(&file, path, NULL, NULL) == 0);
    assert_true(avformat_find_stream_info(file, NULL) >= 0);
    assert_int_equal(file->nb_streams, 1);
    describe(file, &film);
    const AVCodec *decoder = avcodec_find_decoder(file->streams[0]->codecpar->codec_id);
    AVCodecContext *codec = avcodec_alloc_context3(decoder);
    avcodec_parameters_to_context(codec, file->streams[0]->codecpar);
    assert_true(avcodec_open2(codec, decoder, NULL) == 0);
    while (av_read_frame(file, packet) == 0) {
        assert_true(avcodec_send_packet(codec, packet) == 0);
        av_packet_unref(packet);
        receive(codec, frame, file->streams[0], &film, &scaler);
    }
    avcodec_send_packet(codec, NULL);
    receive(codec, frame, file->streams[0], &film, &scaler);
    sws_freeContext(scaler);
    avcodec_free_context(&codec);
    av_packet_free(&packet);
    av_frame_free(&frame);
    avformat_close_input(&file);
    return film;
}
