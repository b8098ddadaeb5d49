#include "render/rushes.h"

#include "mospt/file.h"
#include "mospt/hash.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct rend_rushes {
    int fd;
    char *path; /* owned */
    size_t frame_size;
    uint32_t count;
};

static uint64_t record_size(const rend_rushes *r)
{
    return r->frame_size + sizeof(uint64_t);
}

bool rend_rushes_read(const rend_rushes *rushes, uint32_t index, void *frame, mospt_err *err)
{
    uint64_t hash, at = index * record_size(rushes);
    if (!mospt_file_read_at(rushes->fd, rushes->path, at, frame, rushes->frame_size, err) ||
        !mospt_file_read_at(rushes->fd, rushes->path, at + rushes->frame_size, &hash, sizeof hash,
                            err))
        return false;
    return hash == mospt_hash(frame, rushes->frame_size) ||
           mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(rushes->path, at),
                         "the frame is not what was written");
}

static bool count_frames(rend_rushes *r, mospt_err *err)
{
    struct stat status;
    void *frame = malloc(r->frame_size);
    if (frame == NULL) return mospt_err_nomem(err, r->frame_size);
    bool ok = fstat(r->fd, &status) == 0;
    uint64_t all = ok ? (uint64_t)status.st_size / record_size(r) : 0;
    while (r->count < all && rend_rushes_read(r, r->count, frame, NULL))
        r->count++;
    free(frame);
    ok = ok && ftruncate(r->fd, (off_t)(r->count * record_size(r))) == 0;
    return ok || mospt_err_set(err, MOSPT_EIO, mospt_at_file(r->path), "cannot be read");
}

bool rend_rushes_open(const char *path, size_t frame_size, rend_rushes **out, mospt_err *err)
{
    rend_rushes *r = calloc(1, sizeof *r);
    if (r != NULL) r->path = strdup(path);
    if (r == NULL || r->path == NULL) {
        free(r);
        return mospt_err_nomem(err, sizeof *r);
    }
    r->frame_size = frame_size;
    r->fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    bool ok = r->fd >= 0 || mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be written");
    if (!ok || !count_frames(r, err)) {
        rend_rushes_close(r);
        return false;
    }
    *out = r;
    return true;
}

void rend_rushes_close(rend_rushes *rushes)
{
    if (rushes == NULL) return;
    if (rushes->fd >= 0) close(rushes->fd);
    free(rushes->path);
    free(rushes);
}

uint32_t rend_rushes_count(const rend_rushes *rushes)
{
    return rushes->count;
}

bool rend_rushes_add(rend_rushes *rushes, const void *frame, mospt_err *err)
{
    uint64_t hash = mospt_hash(frame, rushes->frame_size);
    uint64_t at = rushes->count * record_size(rushes);
    if (!mospt_file_write_at(rushes->fd, rushes->path, at, frame, rushes->frame_size, err) ||
        !mospt_file_write_at(rushes->fd, rushes->path, at + rushes->frame_size, &hash, sizeof hash,
                             err))
        return false;
    rushes->count++;
    return true;
}
