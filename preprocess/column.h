/* preprocess/column.h - one field of many equal records, as found in PLY and its relatives. */
#pragma once
#include "mospt/schema.h"

typedef struct {
    uint8_t *at;   /* first value, borrowed */
    size_t stride; /* bytes from record to record */
    mospt_type type;
} prep_column;

/* Reverses the bytes of each value in place. */
void prep_column_swap(const prep_column *column, uint32_t count);

/* Writes values as doubles to out[0], out[out_step], out[2 * out_step]... */
void prep_column_to_f64(const prep_column *column, uint32_t count, double *out, size_t out_step);

/* Copies values as they are, `out_stride` bytes apart. */
void prep_column_copy(const prep_column *column, uint32_t count, uint8_t *out, size_t out_stride);
