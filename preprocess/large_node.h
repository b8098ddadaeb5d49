/* preprocess/large_node.h - one node with more points than there is memory for.
 *
 * Its inner octree is cut some levels below its root. Each of the cells there is made into a MOSPT
 * of its own, which shows how many points it has in each level; then all are made once more, and
 * their levels written to where those of the whole node are. The levels above the cut come of the
 * points that stand for the cells. */
#pragma once
#include "preprocess/finish.h"

/* Makes and writes the node of a part. Takes what it needs of env->arena, in which nobody else has
 * anything now. */
bool prep_large_node(const prep_pass_env *env, const prep_finish_part *part, mospt_err *err);
