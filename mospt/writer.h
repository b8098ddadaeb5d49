/* mospt/writer.h - a dataset folder, being written.
 *
 * Payloads are appended to one file per outer level, in the order in which they come; nothing is a
 * dataset before the commit, which is one rename of metadata.json after all that it names is on the
 * disk. */
#pragma once
#include "mospt/dataset.h"

typedef struct mospt_writer mospt_writer;

/* Makes the folder, or takes over one in which an unfinished build was left.
 * errors   MOSPT_EIO; MOSPT_EINVAL: there is a dataset already, or a folder with other things */
bool mospt_writer_create(const char *path, uint32_t inner_depth, mospt_writer **out,
                         mospt_err *err);

/* Gives a node its place, in the order in which nodes come.
 * node     corner, level, child_mask, count and payload_size; out: place and index of its file
 * index    out, of the node in the writer
 * threads  one at a time */
bool mospt_writer_place(mospt_writer *writer, mospt_node *node, uint32_t *index, mospt_err *err);

/* Writes the payload of a node that has its place.
 * threads  any, also while others get their places */
bool mospt_writer_write(mospt_writer *writer, const mospt_node *node, const uint8_t *payload,
                        mospt_err *err);

/* Says the rest of a node: level_end, and what mospt_payload_pack() sets.
 * threads  one at a time, also with mospt_writer_place() */
void mospt_writer_complete(mospt_writer *writer, uint32_t index, const mospt_node *node);

/* Bytes of payload so far, and nodes. */
uint64_t mospt_writer_bytes(const mospt_writer *writer);
uint32_t mospt_writer_nodes(const mospt_writer *writer);

/* Flushes, writes hierarchy and metadata, and commits.
 * metadata  all but files, hierarchy_* and generation, which are filled in here; files become owned
 * by it */
bool mospt_writer_commit(mospt_writer *writer, mospt_metadata *metadata, mospt_err *err);

/* Frees the writer; without a commit, what it wrote is removed. */
void mospt_writer_destroy(mospt_writer *writer);
