/* tests/write_laz_coder.h - the arithmetic coder of LAZ, its models and integers, by the book. */
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint8_t *p;
    size_t size, capacity;
} write_laz_bytes;

/* Models live until the next chunk begins. */
typedef struct write_laz_model {
    struct write_laz_model *next;
    uint32_t symbols, total, cycle, left;
    uint32_t count[516], low[516];
} write_laz_model;

typedef struct {
    write_laz_bytes out;
    uint32_t base, length;
    bool is_needed; /* layers: some value differs from the first */
} write_laz_coder;

typedef struct {
    uint32_t k;
    bool is_begun;
    uint32_t zeros, total, part, cycle, left; /* of the one bit */
    write_laz_model *value[33];
} write_laz_number;

void write_laz_append(write_laz_bytes *b, const void *p, size_t size);
void write_laz_append_u32(write_laz_bytes *b, uint32_t v);
/* Models are made at their first use, and freed all at once. */
void write_laz_free_models(void);

void write_laz_begin(write_laz_coder *c);
void write_laz_end(write_laz_coder *c);
void write_laz_symbol(write_laz_coder *c, write_laz_model **slot, uint32_t symbols,
                      uint32_t symbol);
void write_laz_bits(write_laz_coder *c, uint32_t bits, uint32_t value);
void write_laz_bits_64(write_laz_coder *c, uint64_t value);
void write_laz_integer(write_laz_coder *c, write_laz_number *n, uint32_t bits,
                       write_laz_model **context, uint32_t predicted, uint32_t real);
