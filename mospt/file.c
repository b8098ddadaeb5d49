#include "mospt/file.h"

#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Larger transfers than this are cut by the kernel anyway. */
static const size_t TRANSFER_MAX = (size_t)1 << 30;

char *mospt_file_join(const char *folder, const char *name)
{
    size_t a = strlen(folder), b = strlen(name);
    while (a > 1 && folder[a - 1] == '/')
        a--;
    char *path = malloc(a + b + 2);
    if (path == NULL) return NULL;
    memcpy(path, folder, a);
    path[a] = '/';
    memcpy(path + a + 1, name, b + 1);
    return path;
}

int mospt_file_open(const char *path, uint64_t *size, mospt_err *err)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    struct stat status;
    if (fd < 0 || fstat(fd, &status) != 0) {
        mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be opened");
        if (fd >= 0) close(fd);
        return -1;
    }
    *size = (uint64_t)status.st_size;
    return fd;
}

bool mospt_file_read_at(int fd, const char *path, uint64_t offset, void *out, size_t size,
                        mospt_err *err)
{
    char *to = out;
    while (size > 0) {
        ssize_t n = pread(fd, to, size < TRANSFER_MAX ? size : TRANSFER_MAX, (off_t)offset);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0)
            return mospt_err_set(err, MOSPT_EIO, mospt_at_byte(path, offset), "cannot be read");
        if (n == 0)
            return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(path, offset),
                                 "the file ends here, %zu more bytes are missing", size);
        to += n, offset += (uint64_t)n, size -= (size_t)n;
    }
    return true;
}

bool mospt_file_write_at(int fd, const char *path, uint64_t offset, const void *bytes, size_t size,
                         mospt_err *err)
{
    const char *from = bytes;
    while (size > 0) {
        ssize_t n = pwrite(fd, from, size < TRANSFER_MAX ? size : TRANSFER_MAX, (off_t)offset);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0)
            return mospt_err_set(err, MOSPT_EIO, mospt_at_byte(path, offset), "cannot be written");
        from += n, offset += (uint64_t)n, size -= (size_t)n;
    }
    return true;
}

void mospt_file_start_flush(int fd)
{
#ifdef __linux__
    (void)!sync_file_range(fd, 0, 0, SYNC_FILE_RANGE_WRITE);
#else
    (void)fd;
#endif
}

bool mospt_file_read_whole(const char *path, size_t max_size, char **out, size_t *size,
                           mospt_err *err)
{
    uint64_t file_size;
    char *bytes = NULL;
    bool ok = false;
    int fd = mospt_file_open(path, &file_size, err);
    if (fd < 0) return false;
    if (file_size > max_size) {
        mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(path),
                      "has %llu bytes, at most %zu can be right", (unsigned long long)file_size,
                      max_size);
        goto done;
    }
    bytes = malloc((size_t)file_size + 1);
    if (bytes == NULL) {
        mospt_err_nomem(err, (size_t)file_size + 1);
        goto done;
    }
    if (!mospt_file_read_at(fd, path, 0, bytes, (size_t)file_size, err)) goto done;
    bytes[file_size] = '\0';
    *out = bytes;
    *size = (size_t)file_size;
    ok = true;
done:
    if (!ok) free(bytes);
    close(fd);
    return ok;
}

/* A rename is only on the disk when its folder is. */
static bool sync_folder_of(const char *path, mospt_err *err)
{
    char folder[4096];
    snprintf(folder, sizeof folder, "%s", path);
    char *slash = strrchr(folder, '/');
    if (slash == NULL) snprintf(folder, sizeof folder, ".");
    else slash[slash == folder] = '\0';
    int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) return mospt_err_set(err, MOSPT_EIO, mospt_at_file(folder), "cannot be opened");
    /* Some network file systems refuse to flush a folder; that is theirs to answer for. */
    bool ok = fsync(fd) == 0 || errno == EINVAL || errno == ENOTSUP;
    if (!ok) mospt_err_set(err, MOSPT_EIO, mospt_at_file(folder), "cannot be flushed to the disk");
    close(fd);
    return ok;
}

bool mospt_file_replace(const char *path, const void *bytes, size_t size, mospt_err *err)
{
    char fresh[4096];
    if (snprintf(fresh, sizeof fresh, "%s.new", path) >= (int)sizeof fresh)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_at_file(path), "is too long a path");
    int fd = open(fresh, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (fd < 0) return mospt_err_set(err, MOSPT_EIO, mospt_at_file(fresh), "cannot be created");
    bool ok = mospt_file_write_at(fd, fresh, 0, bytes, size, err);
    if (ok && fsync(fd) != 0)
        ok = mospt_err_set(err, MOSPT_EIO, mospt_at_file(fresh), "cannot be flushed to the disk");
    if (close(fd) != 0 && ok)
        ok = mospt_err_set(err, MOSPT_EIO, mospt_at_file(fresh), "cannot be closed");
    if (ok && rename(fresh, path) != 0)
        ok = mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be put in place");
    if (!ok) unlink(fresh);
    return ok && sync_folder_of(path, err);
}

static int remove_one(const char *path, const struct stat *status, int type, struct FTW *walk)
{
    (void)status, (void)type, (void)walk;
    return remove(path) == 0 || errno == ENOENT ? 0 : -1;
}

bool mospt_file_remove_tree(const char *path, mospt_err *err)
{
    if (nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS) == 0 || errno == ENOENT) return true;
    return mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot be removed");
}
