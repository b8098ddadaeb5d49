/* mospt/point.h - one point as the GPU, the file and the builder hold it.
 *
 * A vertex is 16 bytes; a record is a vertex followed by the point's attributes, one packed row
 * (see mospt/schema.h). */
#pragma once
#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef struct {
    uint32_t x, y, z;   /* grid coordinates, see mospt/grid.h */
    uint8_t r, g, b, i; /* colour and display intensity; a scan without colour has r = g = b = i */
} mospt_vertex;

_Static_assert(sizeof(mospt_vertex) == 16, "the vertex is stored and drawn as 16 bytes");

/* Records in blocks of 2^shift each. Those of one array are one block, with a shift of 31. */
typedef struct {
    const uint8_t *const *blocks; /* borrowed, each [2^shift][stride] */
    size_t stride;
    uint32_t shift;
} mospt_records;

enum { MOSPT_RECORDS_ONE_BLOCK = 31 };

static inline const uint8_t *mospt_records_at(const mospt_records *records, uint32_t i)
{
    uint32_t in_block = i & ((UINT32_C(1) << records->shift) - 1);
    return records->blocks[i >> records->shift] + in_block * records->stride;
}

/* Copies a record. Its size is no constant: this is still a handful of wide loads and stores, the
 * last of which may overlap the one before it. */
static inline void mospt_record_copy(uint8_t *to, const uint8_t *from, size_t size)
{
    for (size_t i = 0; i + sizeof(mospt_vertex) <= size; i += sizeof(mospt_vertex))
        memcpy(to + i, from + i, sizeof(mospt_vertex));
    memcpy(to + size - sizeof(mospt_vertex), from + size - sizeof(mospt_vertex),
           sizeof(mospt_vertex));
}

/* Reads the vertex of a record, which may stand at any address. */
static inline mospt_vertex mospt_vertex_of(const void *record)
{
    mospt_vertex v;
    memcpy(&v, record, sizeof v);
    return v;
}
