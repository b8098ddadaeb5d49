#include "preprocess/input.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

enum { PACKED_SIZE = 64 * 1024 };

struct prep_input {
    char *path; /* owned */
    int fd;
    struct stat status;
    uint64_t size;
    uint64_t position;     /* of the next unpacked byte */
    uint64_t raw_position; /* of the next byte to take from the file */
    bool is_gzip, is_inflating, is_finished;
    z_stream stream;
    uint8_t *packed; /* [PACKED_SIZE], owned, gzip only */
    const char *fault;
};

static bool read_file(prep_input *in, uint64_t offset, void *out, size_t size, size_t *got,
                      mospt_err *err)
{
    size_t done = 0;
    *got = 0;
    while (done < size && offset + done <= INT64_MAX) {
        ssize_t n = pread(in->fd, (uint8_t *)out + done, size - done, (off_t)(offset + done));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0)
            return mospt_err_set(err, MOSPT_EIO, mospt_at_byte(in->path, offset + done),
                                 "cannot read");
        if (n == 0) break;
        done += (size_t)n;
    }
    *got = done;
    return true;
}

static bool open_file(prep_input *in, mospt_err *err)
{
    /* without O_NONBLOCK, opening a pipe that nobody writes to would wait forever */
    in->fd = open(in->path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (in->fd < 0) return mospt_err_set(err, MOSPT_EIO, mospt_at_file(in->path), "cannot open");
    if (fstat(in->fd, &in->status) != 0)
        return mospt_err_set(err, MOSPT_EIO, mospt_at_file(in->path), "cannot examine");
    if (!S_ISREG(in->status.st_mode))
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(in->path),
                             S_ISDIR(in->status.st_mode) ? "a folder, not a scan file"
                                                         : "not a regular file");
    in->size = (uint64_t)in->status.st_size;
    return true;
}

bool prep_input_open(const char *path, prep_input **out, mospt_err *err)
{
    prep_input *in = calloc(1, sizeof *in);
    if (in == NULL) return mospt_err_nomem(err, sizeof *in);
    in->fd = -1;
    in->path = strdup(path);
    if (in->path == NULL) {
        mospt_err_nomem(err, strlen(path) + 1);
        goto fail;
    }
    uint8_t magic[3];
    size_t got;
    if (!open_file(in, err) || !read_file(in, 0, magic, sizeof magic, &got, err)) goto fail;
    in->is_gzip = got == 3 && magic[0] == 0x1f && magic[1] == 0x8b && magic[2] == 8;
    *out = in;
    return true;
fail:
    prep_input_close(in);
    return false;
}

static void stop_inflating(prep_input *in)
{
    if (in->is_inflating) inflateEnd(&in->stream);
    in->is_inflating = false;
}

void prep_input_close(prep_input *input)
{
    if (input == NULL) return;
    stop_inflating(input);
    if (input->fd >= 0) close(input->fd);
    free(input->packed);
    free(input->path);
    free(input);
}

const char *prep_input_path(const prep_input *input)
{
    return input->path;
}
uint64_t prep_input_size(const prep_input *input)
{
    return input->size;
}
bool prep_input_is_gzip(const prep_input *input)
{
    return input->is_gzip;
}
const struct stat *prep_input_status(const prep_input *input)
{
    return &input->status;
}
uint64_t prep_input_tell(const prep_input *input)
{
    return input->position;
}
const char *prep_input_fault(const prep_input *input)
{
    return input->fault;
}

static bool start_inflating(prep_input *in, mospt_err *err)
{
    if (in->packed == NULL) in->packed = malloc(PACKED_SIZE);
    if (in->packed == NULL) return mospt_err_nomem(err, PACKED_SIZE);
    in->stream = (z_stream){0};
    if (inflateInit2(&in->stream, 15 + 16) != Z_OK) return mospt_err_nomem(err, 32 * 1024);
    in->is_inflating = true;
    return true;
}

static bool refill_packed(prep_input *in, mospt_err *err)
{
    size_t got;
    if (!read_file(in, in->raw_position, in->packed, PACKED_SIZE, &got, err)) return false;
    in->raw_position += got;
    in->stream.next_in = in->packed;
    in->stream.avail_in = (uInt)got;
    return true;
}

/* A gzip file may hold several members one after the other; what follows the last one and is none
 * is padding. */
static bool start_next_member(prep_input *in, mospt_err *err)
{
    if (in->stream.avail_in == 0 && !refill_packed(in, err)) return false;
    if (in->stream.avail_in == 0 || in->stream.next_in[0] != 0x1f) in->is_finished = true;
    else inflateReset(&in->stream);
    return true;
}

static bool read_gzip(prep_input *in, void *out, size_t size, size_t *got, mospt_err *err)
{
    if (!in->is_inflating && !in->is_finished && !start_inflating(in, err)) return false;
    size_t done = 0;
    while (done < size && !in->is_finished) {
        if (in->stream.avail_in == 0 && !refill_packed(in, err)) return false;
        if (in->stream.avail_in == 0) {
            in->fault = "the gzip data ends early";
            in->is_finished = true;
            break;
        }
        size_t want = size - done < 1u << 30 ? size - done : 1u << 30;
        in->stream.next_out = (uint8_t *)out + done;
        in->stream.avail_out = (uInt)want;
        int status = inflate(&in->stream, Z_NO_FLUSH);
        done += want - in->stream.avail_out;
        if (status == Z_STREAM_END) {
            if (!start_next_member(in, err)) return false;
        } else if (status != Z_OK && status != Z_BUF_ERROR) {
            in->fault = "the gzip data is damaged";
            in->is_finished = true;
        }
    }
    *got = done;
    return true;
}

bool prep_input_read(prep_input *input, void *out, size_t size, size_t *got, mospt_err *err)
{
    *got = 0;
    if (input->is_gzip) {
        if (!read_gzip(input, out, size, got, err)) return false;
    } else {
        if (!read_file(input, input->position, out, size, got, err)) return false;
    }
    input->position += *got;
    return true;
}

bool prep_input_seek(prep_input *input, uint64_t offset, mospt_err *err)
{
    if (!input->is_gzip) {
        input->position = offset;
        return true;
    }
    if (offset < input->position) {
        stop_inflating(input);
        input->is_finished = false;
        input->position = input->raw_position = 0;
        input->fault = NULL;
    }
    uint8_t skipped[4096];
    while (input->position < offset) {
        uint64_t left = offset - input->position;
        size_t want = left < sizeof skipped ? (size_t)left : sizeof skipped, got;
        if (!prep_input_read(input, skipped, want, &got, err)) return false;
        if (got < want) break;
    }
    return true;
}

bool prep_input_read_at(prep_input *input, uint64_t offset, void *out, size_t size, size_t *got,
                        mospt_err *err)
{
    return read_file(input, offset, out, size, got, err);
}
