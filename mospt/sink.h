/* mospt/sink.h - files that are written past the page cache.
 *
 * What is larger than the memory that a build may take would push everything else out of the
 * machine's page cache, and entering it there costs more than bringing it to the disk. Here files
 * are written in large aligned chunks by a thread of its own; a chunk waits in memory until all of
 * it is there. Where a file system knows no such writing, it is written in the usual way. */
#pragma once
#include "mospt/err.h"

enum {
    MOSPT_SINK_CHUNK_MIN = 64 << 10, /* bytes; a chunk is a power of two */
    MOSPT_SINK_CHUNK_MAX = 2 << 20,
    MOSPT_SINK_FILES_MAX = 64,
    MOSPT_SINK_CHUNKS =
        48, /* that are usually in memory: one or two a file, and those on their way */
};

typedef struct mospt_sink mospt_sink;

/* chunk_size  bytes, a power of two within the limits above */
bool mospt_sink_create(size_t chunk_size, mospt_sink **out, mospt_err *err);

/* Files are numbered from 0 in the order in which they are added.
 * path     of a file that is there
 * size     bytes of it that stay as they are, and are passed over in writing: everything from there
 *          on will be written */
bool mospt_sink_add_file(mospt_sink *sink, const char *path, uint64_t size, mospt_err *err);

/* Each byte is written once, in any order.
 * threads  any, also while files are added
 * errors   those of any write before, MOSPT_EIO, MOSPT_ENOMEM */
bool mospt_sink_write(mospt_sink *sink, uint32_t file, uint64_t offset, const void *bytes,
                      size_t size, mospt_err *err);

/* All that was written before is then in the files, which may for now end in up to a chunk of
 * anything.
 * threads  any, also while others write */
bool mospt_sink_flush(mospt_sink *sink, mospt_err *err);

/* What was not flushed is lost; NULL is fine. */
void mospt_sink_destroy(mospt_sink *sink);
