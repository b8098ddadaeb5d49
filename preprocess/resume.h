/* preprocess/resume.h - what an interrupted build has left, which the next one need not make again.
 *
 * A committed node is what it will be in the finished dataset, in its bytes and in its place. So
 * the points that it keeps are passed over when the scans are read again, and its payload stays.
 * Nothing is taken on trust: a node whose payload does not have its checksum is made again. */
#pragma once
#include "mospt/dataset.h"
#include "preprocess/solve.h"
#include "preprocess/workers.h"

typedef struct prep_resume prep_resume;

/* Opens the unfinished dataset at `path` if it is of this very build, and reads all of it; `*out`
 * is NULL if there is none.
 * build    see mospt_unfinished
 * out      released by prep_resume_close()
 * errors   MOSPT_ENOMEM */
bool prep_resume_open(const char *path, uint64_t build, prep_workers *workers, prep_resume **out,
                      mospt_err *err);
void prep_resume_close(prep_resume *resume);

const mospt_metadata *prep_resume_metadata(const prep_resume *resume);

/* The node with this corner and level, by its index; MOSPT_NO_NODE if it is not there, or if
 * `resume` is NULL. */
uint32_t prep_resume_find(const prep_resume *resume, const uint32_t corner[3], uint32_t level);

/* True if the node has a child in an octant when all is finished. */
bool prep_resume_has_child(const prep_resume *resume, uint32_t node, uint32_t octant);

/* True if the node is there with all below it. */
bool prep_resume_is_whole(const prep_resume *resume, uint32_t node);

/* Points of the node, or of it and all below it. */
uint64_t prep_resume_points(const prep_resume *resume, uint32_t node, bool and_below);

/* Lists the node, or it and all below it, as prep_solve() and prep_solve_emit() would; of each,
 * `first` is the index that prep_resume_points_hash() takes.
 * out      released by prep_subtree_fini() */
bool prep_resume_list(const prep_resume *resume, uint32_t node, bool and_below, prep_subtree *out,
                      mospt_err *err);

/* Sum of the hashes of the points of a node. */
uint64_t prep_resume_points_hash(const prep_resume *resume, uint32_t node);
