#include "render/film/av.h"

#include <errno.h>
#include <string.h>

bool rfilm_av_fail(mospt_err *err, const char *path, const char *what, int code)
{
    char text[AV_ERROR_MAX_STRING_SIZE] = "";
    if (code == AVERROR(ENOMEM)) return mospt_err_nomem(err, 0);
    libav.av_strerror(code, text, sizeof text);
    errno = 0;
    return mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "%s: %s", what, text);
}

bool rfilm_av_muxer(const char *container, AVFormatContext **out, mospt_err *err)
{
    static const char *const names[][2] = {
        {".mp4", "mp4"}, {".webm", "webm"}, {".mkv", "matroska"}};
    const char *dot = strrchr(container, '.'), *name = NULL;
    for (size_t i = 0; dot != NULL && i < sizeof names / sizeof *names; i++)
        if (strcmp(dot, names[i][0]) == 0) name = names[i][1];
    if (name == NULL)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(container),
                             "the name of a film ends in .mp4, .webm or .mkv");
    if (!rfilm_libav_load(err)) return false;
    /* FFmpeg would write to standard error. */
    libav.av_log_set_level(AV_LOG_QUIET);
    int code = libav.avformat_alloc_output_context2(out, NULL, name, NULL);
    if (code < 0) return rfilm_av_fail(err, container, "no such container", code);
    /* Nothing that changes from one run to the next; and what spherical and stereo films say of
     * themselves is not in MP4's standard. */
    (*out)->flags |= AVFMT_FLAG_BITEXACT;
    (*out)->strict_std_compliance = FF_COMPLIANCE_UNOFFICIAL;
    return true;
}

bool rfilm_av_start(AVFormatContext *muxer, const char *path, bool fast_start, mospt_err *err)
{
    AVDictionary *options = NULL;
    if (fast_start && strcmp(muxer->oformat->name, "mp4") == 0)
        libav.av_dict_set(&options, "movflags", "+faststart", 0);
    int code = libav.avio_open(&muxer->pb, path, AVIO_FLAG_WRITE);
    if (code >= 0) {
        /* The second pass of the fast start opens the file by this name. */
        libav.av_free(muxer->url);
        muxer->url = libav.av_strdup(path);
        code = libav.avformat_write_header(muxer, &options);
    }
    libav.av_dict_free(&options);
    return code >= 0 || rfilm_av_fail(err, path, "the film cannot be written", code);
}

bool rfilm_av_end(AVFormatContext *muxer, const char *path, mospt_err *err)
{
    int code = libav.av_write_trailer(muxer), closed = libav.avio_closep(&muxer->pb);
    if (code >= 0) code = closed;
    return code >= 0 || rfilm_av_fail(err, path, "the film cannot be written", code);
}

void rfilm_av_free(AVFormatContext *muxer)
{
    if (muxer == NULL) return;
    libav.avio_closep(&muxer->pb);
    libav.avformat_free_context(muxer);
}
