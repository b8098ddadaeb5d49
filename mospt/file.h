/* mospt/file.h - whole reads and whole writes, with errors that name the file and the byte. */
#pragma once
#include "mospt/err.h"

/* Joins a folder and a name into an owned string; NULL without memory. */
char *mospt_file_join(const char *folder, const char *name);

/* Opens a file for reading, and tells its size. Returns -1 on errors: MOSPT_EIO. */
int mospt_file_open(const char *path, uint64_t *size, mospt_err *err);

/* Reads exactly `size` bytes at `offset`. errors: MOSPT_EIO; MOSPT_EFORMAT where the file ends too
 * early */
bool mospt_file_read_at(int fd, const char *path, uint64_t offset, void *out, size_t size,
                        mospt_err *err);

/* Writes all of it at `offset`. errors: MOSPT_EIO */
bool mospt_file_write_at(int fd, const char *path, uint64_t offset, const void *bytes, size_t size,
                         mospt_err *err);

/* Asks for what was written to go to the disk soon, so that flushing the file later finds little
 * left to do. */
void mospt_file_start_flush(int fd);

/* Reads a whole file of at most `max_size` bytes; `*out` is owned by the caller and ends in a zero
 * byte beyond `*size`. */
bool mospt_file_read_whole(const char *path, size_t max_size, char **out, size_t *size,
                           mospt_err *err);

/* Puts bytes where `path` is, all or nothing: written to a new file, flushed to the disk, renamed.
 */
bool mospt_file_replace(const char *path, const void *bytes, size_t size, mospt_err *err);

/* Removes a folder and all in it; what is not there is no error. */
bool mospt_file_remove_tree(const char *path, mospt_err *err);
