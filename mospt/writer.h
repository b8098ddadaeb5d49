/* mospt/writer.h - a dataset folder, being written.
 *
 * Payloads are appended to one file per outer level, in the order in which nodes are given their
 * places; nothing is a dataset before a commit, which is one rename of metadata.json after all that
 * it names is on the disk. While a build goes on, what is complete so far may be committed as an
 * unfinished dataset: readers see each commit as a whole, and an interrupted build goes on from the
 * last one. The places of nodes depend on their order alone, so whoever goes on, and names the same
 * nodes in the same order, finds those that are there already where they belong. */
#pragma once
#include "mospt/dataset.h"

typedef struct mospt_writer mospt_writer;

typedef struct {
    uint64_t points, points_hash; /* the latter a sum of the hashes of all points */
} mospt_written;

/* Makes the folder, or takes over one in which an unfinished build was left. An unfinished dataset
 * there stays as it is until the first node has its place.
 * errors   MOSPT_EIO; MOSPT_EINVAL: there is a finished dataset, or a folder with other things */
bool mospt_writer_create(const char *path, uint32_t inner_depth, mospt_writer **out,
                         mospt_err *err);

/* Goes on from the unfinished dataset in the folder instead of removing it. What is written now
 * must agree with it wherever both have something.
 * kept     its metadata */
void mospt_writer_keep(mospt_writer *writer, const mospt_metadata *kept);

/* Has payloads written past the page cache, see mospt/sink.h. Before the first node has its place.
 */
bool mospt_writer_bypass_cache(mospt_writer *writer, size_t chunk_size, mospt_err *err);

/* Gives a node its place, in the order in which nodes come: parents before their children, those of
 * a level in Morton order.
 * node     corner, level, child_mask, count and payload_size; out: place and index of its file
 * index    out, of the node in the writer
 * threads  any */
bool mospt_writer_place(mospt_writer *writer, mospt_node *node, uint32_t *index, mospt_err *err);

/* Writes the payload of a node that has its place.
 * threads  any, also while others get their places */
bool mospt_writer_write(mospt_writer *writer, const mospt_node *node, const uint8_t *payload,
                        mospt_err *err);

/* Writes some of the payload of a node that is written in pieces, `skip` bytes into it. threads: as
 * above */
bool mospt_writer_write_part(mospt_writer *writer, const mospt_node *node, uint64_t skip,
                             const uint8_t *bytes, size_t size, mospt_err *err);

/* Sets the hashes of a node whose payload was written in pieces, by reading it back. */
bool mospt_writer_hash(mospt_writer *writer, mospt_node *node, mospt_err *err);

/* Says that a node is written, and the rest of it: level_end, and what mospt_payload_pack() sets.
 * points_hash  sum of the hashes of its points
 * threads      any */
void mospt_writer_complete(mospt_writer *writer, uint32_t index, const mospt_node *node,
                           uint64_t points_hash);

/* Gives the disk all that waits in the page cache, and waits until it has that file which most was
 * written to. Called again and again, it leaves little for the commits.
 * threads  one at a time, as for mospt_writer_commit_part() */
bool mospt_writer_flush(mospt_writer *writer, mospt_err *err);

/* Bytes of payload that have their place, and nodes. */
uint64_t mospt_writer_bytes(const mospt_writer *writer);
uint32_t mospt_writer_nodes(const mospt_writer *writer);

/* All nodes that are complete. threads: any */
mospt_written mospt_writer_written(mospt_writer *writer);

/* Flushes and commits the nodes before the first that is not complete, if these are more points
 * than at the last commit.
 * metadata  of the finished dataset, all but files, hierarchy_* and generation
 * build     see mospt_unfinished
 * threads   one at a time, while others place, write and complete */
bool mospt_writer_commit_part(mospt_writer *writer, const mospt_metadata *metadata, uint64_t build,
                              mospt_err *err);

/* Flushes, writes hierarchy and metadata, and commits the finished dataset; every node is complete.
 * metadata  all but files, hierarchy_* and generation, which are filled in here; files become owned
 *           by it */
bool mospt_writer_commit(mospt_writer *writer, mospt_metadata *metadata, mospt_err *err);

/* Frees the writer; without any commit, what it wrote is removed. */
void mospt_writer_destroy(mospt_writer *writer);
