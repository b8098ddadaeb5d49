/* preprocess/sort.h - points of a node in Morton order.
 *
 * A key holds the cell of a point, as many levels of it as there is room for, above the index of
 * its record. */
#pragma once
#include "mospt/cell.h"
#include "mospt/linear.h"
#include "preprocess/workers.h"

typedef struct {
    const mospt_grid *grid;       /* borrowed */
    const mospt_records *records; /* borrowed */
    uint32_t index_bits;          /* of a key */
    uint32_t code_levels;         /* of a key, above the index */
} prep_sorter;

/* Chooses index_bits and code_levels for so many records. */
void prep_sort_begin(prep_sorter *sorter, uint32_t count);

/* Makes the keys of all records, for the cells of the levels below the node at `level`, in which
 * their points lie, in rising order; points of one cell in that of the records.
 * keys     out, [count]
 * spare    [count], holds nothing before and after */
void prep_sort_all(const prep_sorter *sorter, uint32_t level, uint64_t *keys, uint64_t *spare,
                   uint32_t count);

/* The same by all workers.
 * errors   MOSPT_ENOMEM
 * threads  that of the workers */
bool prep_sort_all_shared(const prep_sorter *sorter, prep_workers *workers, uint32_t level,
                          uint64_t *keys, uint64_t *spare, uint32_t count, mospt_err *err);

/* Gives keys the cells of the levels below the node at `level`, in which their points lie, and puts
 * them in rising order; points of one cell keep theirs.
 * spare    [count], holds nothing before and after */
void prep_sort_below(const prep_sorter *sorter, uint32_t level, uint64_t *keys, uint64_t *spare,
                     uint32_t count);

/* Sorts keys by their bits from `low_bit` up; keys alike in these keep their order.
 * spare    [count], holds nothing before and after */
void prep_sort_keys(uint64_t *keys, uint64_t *spare, uint32_t count, uint32_t low_bit);
