#include "render/film/encoder.h"

#include "render/film/av.h"

#include <stdlib.h>
#include <string.h>

enum { THREADS = 8 }; /* see the header: not the number of processors */

struct rfilm_encoder {
    char path[1024];
    rfilm_options options;
    AVFormatContext *muxer;
    AVStream *stream;
    AVCodecContext *codec;
    struct SwsContext *scaler;
    AVFrame *frame;
    AVPacket *packet;
    int64_t count;
};

/* What is known about a codec. The encoder is the first that FFmpeg was built with. */
static const struct {
    const char *name, *encoders[2];
    uint32_t quality, quality_max;
    const char *speed_option, *speeds[3]; /* by rfilm_preset */
    bool halves_colours;
} CODECS[RFILM_CODECS] = {
    [RFILM_H264] =
        {"h264", {"libx264", NULL}, 18, 51, "preset", {"medium", "veryfast", "slow"}, true},
    [RFILM_VP9] = {"vp9", {"libvpx-vp9", NULL}, 28, 63, "cpu-used", {"3", "5", "1"}, true},
    [RFILM_AV1] = {"av1", {"libsvtav1", NULL}, 28, 63, "preset", {"8", "10", "5"}, true},
    [RFILM_FFV1] = {"ffv1", {"ffv1", NULL}, 0, 0, NULL, {NULL, NULL, NULL}, false},
};

/* Which codecs a container takes, the usual one first. */
static const struct {
    const char *ending;
    rfilm_codec codecs[3];
    int count;
} CONTAINERS[] = {
    {".mp4", {RFILM_H264, RFILM_AV1, RFILM_VP9}, 3},
    {".webm", {RFILM_VP9, RFILM_AV1}, 2},
    {".mkv", {RFILM_FFV1, RFILM_H264, RFILM_VP9}, 3},
};

bool rfilm_codec_for(const char *path, const char *wanted, rfilm_codec *out, mospt_err *err)
{
    const char *dot = strrchr(path, '.');
    for (size_t c = 0; dot != NULL && c < sizeof CONTAINERS / sizeof *CONTAINERS; c++) {
        if (strcmp(dot, CONTAINERS[c].ending) != 0) continue;
        for (int i = 0; i < CONTAINERS[c].count; i++) {
            *out = CONTAINERS[c].codecs[i];
            if (wanted == NULL || strcmp(wanted, CODECS[*out].name) == 0) return true;
        }
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(path), "%s films do not take %.40s",
                             dot, wanted);
    }
    return mospt_err_set(
        err, MOSPT_EINVAL, mospt_at_file(path),
        "the name of a film ends in .mp4, .webm or .mkv, that of pictures in .png");
}

bool rfilm_options_fit(const rfilm_options *o, const char *path, mospt_err *err)
{
    if (CODECS[o->codec].halves_colours && (o->width % 2 != 0 || o->height % 2 != 0))
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(path),
                             "%s films have even sizes, %u x %u is not", CODECS[o->codec].name,
                             o->width, o->height);
    if (o->bits == 16 && o->codec != RFILM_FFV1)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(path),
                             "%s films have 8 bits; .mkv films and .png pictures may have 16",
                             CODECS[o->codec].name);
    if (o->has_quality && o->quality > CODECS[o->codec].quality_max)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(path),
                             "the quality of %s films goes from 0 to %u", CODECS[o->codec].name,
                             CODECS[o->codec].quality_max);
    return true;
}

static enum AVPixelFormat picture_format(const rfilm_options *o)
{
    return o->bits == 16 ? AV_PIX_FMT_RGB48 : AV_PIX_FMT_RGB24;
}

static enum AVPixelFormat film_format(const rfilm_options *o)
{
    if (o->codec != RFILM_FFV1) return AV_PIX_FMT_YUV420P;
    return o->bits == 16 ? AV_PIX_FMT_GBRP16 : AV_PIX_FMT_BGR0;
}

static void tag_colours(AVCodecContext *c, bool lossless)
{
    c->color_primaries = AVCOL_PRI_BT709;
    c->color_trc = lossless ? AVCOL_TRC_IEC61966_2_1 : AVCOL_TRC_BT709;
    c->colorspace = lossless ? AVCOL_SPC_RGB : AVCOL_SPC_BT709;
    c->color_range = lossless ? AVCOL_RANGE_JPEG : AVCOL_RANGE_MPEG;
    c->chroma_sample_location = lossless ? AVCHROMA_LOC_UNSPECIFIED : AVCHROMA_LOC_LEFT;
}

static void set_codec_options(AVCodecContext *c, const rfilm_options *o)
{
    uint32_t quality = o->has_quality ? o->quality : CODECS[o->codec].quality;
    if (CODECS[o->codec].speed_option != NULL) {
        libav.av_opt_set(c->priv_data, CODECS[o->codec].speed_option,
                         CODECS[o->codec].speeds[o->preset], 0);
        libav.av_opt_set_int(c->priv_data, "crf", quality, 0);
    }
    /* Without it some sizes give other bytes whenever memory was used before, or on other
     * processors.
     */
    if (o->codec == RFILM_H264)
        libav.av_opt_set(c->priv_data, "x264-params",
                         o->side_by_side ? "cpu-independent=1:rc-lookahead=12:frame-packing=3"
                                         : "cpu-independent=1:rc-lookahead=12",
                         0);
    if (o->codec == RFILM_VP9) {
        c->bit_rate = 0; /* or crf would only be a limit */
        libav.av_opt_set(c->priv_data, "row-mt", "1", 0);
    }
    if (o->codec == RFILM_FFV1) {
        c->level = 3;
        c->gop_size = 1;
        c->slices = 16;
        libav.av_opt_set(c->priv_data, "slicecrc", "1", 0);
    }
}

static bool open_codec(rfilm_encoder *e, mospt_err *err)
{
    const rfilm_options *o = &e->options;
    /* SVT-AV1 would write to standard error; errors only. */
    setenv("SVT_LOG", "1", 0);
    const AVCodec *codec = libav.avcodec_find_encoder_by_name(CODECS[o->codec].encoders[0]);
    if (codec == NULL)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(e->path),
                             "the FFmpeg of this machine has no %s", CODECS[o->codec].encoders[0]);
    AVCodecContext *c = e->codec = libav.avcodec_alloc_context3(codec);
    if (c == NULL) return mospt_err_nomem(err, sizeof *c);
    c->width = (int)o->width, c->height = (int)o->height;
    c->time_base = (AVRational){(int)o->rate_den, (int)o->rate_num};
    c->framerate = (AVRational){(int)o->rate_num, (int)o->rate_den};
    c->sample_aspect_ratio = (AVRational){1, 1};
    c->pix_fmt = film_format(o);
    c->thread_count = THREADS;
    c->gop_size = 10 * (int)(o->rate_num / o->rate_den + 1); /* a segment is shorter */
    c->flags |= AV_CODEC_FLAG_BITEXACT;
    if (e->muxer->oformat->flags & AVFMT_GLOBALHEADER) c->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    tag_colours(c, o->codec == RFILM_FFV1);
    set_codec_options(c, o);
    int code = libav.avcodec_open2(c, codec, NULL);
    return code >= 0 || rfilm_av_fail(err, e->path, "the encoder does not start", code);
}

/* Tells players that a picture is the view all around, or one for each eye. */
static bool describe(rfilm_encoder *e, mospt_err *err)
{
    size_t size;
    if (e->options.panorama) {
        AVSphericalMapping *sphere = libav.av_spherical_alloc(&size);
        if (sphere == NULL) return mospt_err_nomem(err, 0);
        sphere->projection = AV_SPHERICAL_EQUIRECTANGULAR;
        int code = libav.av_stream_add_side_data(e->stream, AV_PKT_DATA_SPHERICAL,
                                                 (uint8_t *)sphere, size);
        if (code < 0) return libav.av_free(sphere), mospt_err_nomem(err, size);
    }
    if (e->options.side_by_side) {
        AVStereo3D *stereo = libav.av_stereo3d_alloc();
        if (stereo == NULL) return mospt_err_nomem(err, 0);
        stereo->type = AV_STEREO3D_SIDEBYSIDE;
        int code = libav.av_stream_add_side_data(e->stream, AV_PKT_DATA_STEREO3D, (uint8_t *)stereo,
                                                 sizeof *stereo);
        if (code < 0) return libav.av_free(stereo), mospt_err_nomem(err, sizeof *stereo);
        libav.av_dict_set(&e->stream->metadata, "stereo_mode", "left_right", 0);
    }
    return true;
}

static bool open_stream(rfilm_encoder *e, mospt_err *err)
{
    e->stream = libav.avformat_new_stream(e->muxer, NULL);
    if (e->stream == NULL) return mospt_err_nomem(err, sizeof *e->stream);
    e->stream->time_base = e->codec->time_base;
    e->stream->avg_frame_rate = e->stream->r_frame_rate = e->codec->framerate;
    e->stream->sample_aspect_ratio = e->codec->sample_aspect_ratio;
    int code = libav.avcodec_parameters_from_context(e->stream->codecpar, e->codec);
    if (code < 0) return rfilm_av_fail(err, e->path, "the encoder does not start", code);
    return describe(e, err);
}

/* Pictures have all levels; films leave some out at both ends, and have other primaries. */
static bool open_scaler(rfilm_encoder *e, mospt_err *err)
{
    const rfilm_options *o = &e->options;
    int width = (int)o->width, height = (int)o->height;
    const int *bt709 = libav.sws_getCoefficients(SWS_CS_ITU709);
    e->scaler = libav.sws_getContext(
        width, height, picture_format(o), width, height, film_format(o),
        SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP | SWS_BITEXACT, NULL, NULL, NULL);
    e->frame = libav.av_frame_alloc();
    e->packet = libav.av_packet_alloc();
    if (e->scaler == NULL || e->frame == NULL || e->packet == NULL) return mospt_err_nomem(err, 0);
    if (o->codec != RFILM_FFV1)
        libav.sws_setColorspaceDetails(e->scaler, bt709, 1, bt709, 0, 0, 1 << 16, 1 << 16);
    e->frame->format = film_format(o);
    e->frame->width = width, e->frame->height = height;
    return libav.av_frame_get_buffer(e->frame, 0) >= 0 || mospt_err_nomem(err, 0);
}

bool rfilm_encoder_open(const char *path, const char *container, const rfilm_options *options,
                        rfilm_encoder **out, mospt_err *err)
{
    if (!rfilm_options_fit(options, path, err) || !rfilm_libav_load(err)) return false;
    rfilm_encoder *e = calloc(1, sizeof *e);
    if (e == NULL) return mospt_err_nomem(err, sizeof *e);
    e->options = *options;
    strncpy(e->path, path, sizeof e->path - 1);
    if (!rfilm_av_muxer(container, &e->muxer, err) || !open_codec(e, err) || !open_stream(e, err) ||
        !open_scaler(e, err) || !rfilm_av_start(e->muxer, path, false, err)) {
        rfilm_encoder_destroy(e);
        return false;
    }
    *out = e;
    return true;
}

/* Moves what the encoder has finished to the file. */
static bool drain(rfilm_encoder *e, mospt_err *err)
{
    for (;;) {
        int code = libav.avcodec_receive_packet(e->codec, e->packet);
        if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return true;
        if (code < 0) return rfilm_av_fail(err, e->path, "a frame cannot be encoded", code);
        e->packet->duration = 1;
        libav.av_packet_rescale_ts(e->packet, e->codec->time_base, e->stream->time_base);
        e->packet->stream_index = e->stream->index;
        code = libav.av_interleaved_write_frame(e->muxer, e->packet);
        if (code < 0) return rfilm_av_fail(err, e->path, "the film cannot be written", code);
    }
}

bool rfilm_encoder_add(rfilm_encoder *encoder, const void *rgb, mospt_err *err)
{
    rfilm_encoder *e = encoder;
    const uint8_t *const planes[4] = {rgb};
    const int strides[4] = {(int)(e->options.width * 3 * (e->options.bits / 8))};
    int code = libav.av_frame_make_writable(e->frame);
    if (code < 0) return mospt_err_nomem(err, 0);
    libav.sws_scale(e->scaler, planes, strides, 0, (int)e->options.height, e->frame->data,
                    e->frame->linesize);
    e->frame->pts = e->count++;
    code = libav.avcodec_send_frame(e->codec, e->frame);
    if (code < 0) return rfilm_av_fail(err, e->path, "a frame cannot be encoded", code);
    return drain(e, err);
}

bool rfilm_encoder_finish(rfilm_encoder *encoder, mospt_err *err)
{
    int code = libav.avcodec_send_frame(encoder->codec, NULL);
    if (code < 0)
        return rfilm_av_fail(err, encoder->path, "the last frames cannot be encoded", code);
    return drain(encoder, err) && rfilm_av_end(encoder->muxer, encoder->path, err);
}

void rfilm_encoder_destroy(rfilm_encoder *encoder)
{
    if (encoder == NULL) return;
    libav.avcodec_free_context(&encoder->codec);
    libav.av_frame_free(&encoder->frame);
    libav.av_packet_free(&encoder->packet);
    libav.sws_freeContext(encoder->scaler);
    rfilm_av_free(encoder->muxer);
    free(encoder);
}
