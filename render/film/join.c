#include "render/film/join.h"

#include "render/film/av.h"

#include <string.h>

typedef struct {
    const char *path;
    AVFormatContext *muxer;
    AVStream *stream;
    AVRational rate; /* frames a second */
    int64_t frames;  /* of the inputs so far */
} joiner;

static bool open_input(const char *path, AVFormatContext **out, AVStream **stream, mospt_err *err)
{
    int code = libav.avformat_open_input(out, path, NULL, NULL);
    if (code >= 0) code = libav.avformat_find_stream_info(*out, NULL);
    if (code == AVERROR(ENOENT) || code == AVERROR(EACCES))
        return rfilm_av_fail(err, path, "cannot be opened", code);
    if (code < 0 || (*out)->nb_streams != 1 ||
        (*out)->streams[0]->codecpar->codec_type != AVMEDIA_TYPE_VIDEO)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(path),
                             "is no film of one picture track");
    *stream = (*out)->streams[0];
    return true;
}

/* What the first input says of its pictures holds for the whole film. */
static bool start(joiner *j, const AVStream *first, mospt_err *err)
{
    j->rate = first->avg_frame_rate.num > 0 ? first->avg_frame_rate : first->r_frame_rate;
    j->stream = libav.avformat_new_stream(j->muxer, NULL);
    if (j->stream == NULL ||
        libav.avcodec_parameters_copy(j->stream->codecpar, first->codecpar) < 0 ||
        libav.av_dict_copy(&j->stream->metadata, first->metadata, 0) < 0)
        return mospt_err_nomem(err, 0);
    if (j->rate.num <= 0 || j->rate.den <= 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(j->path), "has no frame rate");
    for (int i = 0; i < first->nb_side_data; i++) {
        const AVPacketSideData *from = &first->side_data[i];
        uint8_t *to = libav.av_stream_new_side_data(j->stream, from->type, from->size);
        if (to == NULL) return mospt_err_nomem(err, from->size);
        memcpy(to, from->data, from->size);
    }
    j->stream->codecpar->codec_tag = 0; /* the container's own */
    j->stream->time_base = av_inv_q(j->rate);
    j->stream->avg_frame_rate = j->stream->r_frame_rate = j->rate;
    j->stream->sample_aspect_ratio = first->sample_aspect_ratio;
    return rfilm_av_start(j->muxer, j->path, true, err);
}

static bool is_same_kind(const AVCodecParameters *a, const AVCodecParameters *b)
{
    return a->codec_id == b->codec_id && a->width == b->width && a->height == b->height &&
           a->format == b->format && a->extradata_size == b->extradata_size &&
           (a->extradata_size == 0 ||
            memcmp(a->extradata, b->extradata, (size_t)a->extradata_size) == 0);
}

/* Containers count time in their own units; a frame's number is what it was meant to be. */
static int64_t frame_number(const joiner *j, int64_t time, AVRational unit)
{
    return time == AV_NOPTS_VALUE ? time
                                  : libav.av_rescale_q(time, unit, av_inv_q(j->rate)) + j->frames;
}

static bool copy_packets(joiner *j, AVFormatContext *from, const char *path, mospt_err *err)
{
    AVPacket *packet = libav.av_packet_alloc();
    int64_t count = 0;
    int code = packet == NULL ? AVERROR(ENOMEM) : 0;
    while (code >= 0 && (code = libav.av_read_frame(from, packet)) >= 0) {
        AVRational unit = from->streams[0]->time_base;
        packet->pts = frame_number(j, packet->pts, unit);
        packet->dts = frame_number(j, packet->dts, unit);
        packet->duration = 1;
        packet->pos = -1;
        libav.av_packet_rescale_ts(packet, av_inv_q(j->rate), j->stream->time_base);
        code = libav.av_interleaved_write_frame(j->muxer, packet);
        count++;
    }
    libav.av_packet_free(&packet);
    if (code != AVERROR_EOF) return rfilm_av_fail(err, path, "cannot be copied", code);
    j->frames += count;
    return true;
}

static bool add_input(joiner *j, const char *path, bool first, mospt_err *err)
{
    AVFormatContext *from = NULL;
    AVStream *stream = NULL;
    bool ok = open_input(path, &from, &stream, err);
    if (ok && first) ok = start(j, stream, err);
    else if (ok && !is_same_kind(j->stream->codecpar, stream->codecpar))
        ok = mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(path),
                           "was recorded with other settings than the first film");
    ok = ok && copy_packets(j, from, path, err);
    libav.avformat_close_input(&from);
    return ok;
}

bool rfilm_join(const char *const *inputs, size_t count, const char *path, const char *container,
                rfilm_joined *joined, void *user, uint64_t *frames, mospt_err *err)
{
    joiner j = {.path = path};
    bool ok = rfilm_av_muxer(container, &j.muxer, err);
    for (size_t i = 0; ok && i < count; i++) {
        ok = add_input(&j, inputs[i], i == 0, err);
        if (ok && joined != NULL && !joined(user, i + 1, count))
            ok = mospt_err_set(err, MOSPT_ECANCELLED, mospt_nowhere(), "stopped");
    }
    ok = ok && rfilm_av_end(j.muxer, path, err);
    rfilm_av_free(j.muxer);
    if (ok && frames != NULL) *frames = (uint64_t)j.frames;
    return ok;
}
