/* preprocess/sort.h - points of a node in Morton order. */
#pragma once
#include "mospt/linear.h"

/* Sorts keys by rising code; keys of the same code keep their order.
 * spare    [count], holds nothing before and after */
void prep_sort_keys(mospt_linear_key *keys, mospt_linear_key *spare, uint32_t count);
