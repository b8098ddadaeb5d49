/* mospt/point.h - one point as the GPU, the file and the builder hold it.
 *
 * A vertex is 16 bytes; a record is a vertex followed by the point's attributes, one packed row
 * (see mospt/schema.h). */
#pragma once
#include <stdint.h>
#include <string.h>

typedef struct {
    uint32_t x, y, z;   /* grid coordinates, see mospt/grid.h */
    uint8_t r, g, b, i; /* colour and display intensity; a scan without colour has r = g = b = i */
} mospt_vertex;

_Static_assert(sizeof(mospt_vertex) == 16, "the vertex is stored and drawn as 16 bytes");

/* Reads the vertex of a record, which may stand at any address. */
static inline mospt_vertex mospt_vertex_of(const void *record)
{
    mospt_vertex v;
    memcpy(&v, record, sizeof v);
    return v;
}
