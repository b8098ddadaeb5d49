/* render/paint.h - the colours that points are shown in, made of what they carry.
 *
 * A node's vertices are painted once, on their way from the disk to the caches: the colour of each
 * is replaced by the one that stands for its value. Whatever draws them knows nothing but r, g, b.
 * What a paint shows is put together by render/scheme.h.
 * threads  any; a paint is plain data, and copied freely */
#pragma once
#include "mospt/dataset.h"
#include "render/ramp.h"

typedef enum {
    REND_PAINT_STORED,    /* nothing to do */
    REND_PAINT_RGB,       /* stored colours through the ramp, each channel by itself */
    REND_PAINT_INTENSITY, /* the value is the stored display intensity */
    REND_PAINT_HEIGHT,    /* world z */
    REND_PAINT_LEVEL,     /* level of the deepest node of the outer octree at that place */
    REND_PAINT_DISTANCE,  /* to where the point's scanner stood */
    REND_PAINT_VALUE,     /* one component of an attribute */
    REND_PAINT_DIRECTION, /* three components of an attribute, -1 to 1, are red, green and blue */
} rend_paint_source;

typedef struct {
    rend_paint_source source;
    const mospt_dataset *dataset; /* borrowed */
    int attribute;                /* index in the schema: of VALUE and DIRECTION, and for DISTANCE
                                     the scan of each point; -1: none */
    uint32_t component;
    bool zero_is_none; /* as in files that have a field and nothing to write into it */
    bool classes;      /* values are numbers of colours, the lower 8 bits of them */
    double low, high;  /* else: values at the ends of the ramp */
    rend_ramp ramp;
} rend_paint;

bool rend_paint_needs_attributes(const rend_paint *paint);

/* The value of point `i` of a node; NaN where it has none.
 * vertices [nodes[node].count] as they are stored
 * planes   the node's attribute planes; not looked at unless the paint needs them */
double rend_paint_value(const rend_paint *paint, uint32_t node, const mospt_vertex *vertices,
                        const uint8_t *planes, uint32_t i);

/* The colour of a value; a middle grey for NaN. */
const uint8_t *rend_paint_colour(const rend_paint *paint, double value);

/* Replaces the colours of a node's vertices. */
void rend_paint_apply(const rend_paint *paint, uint32_t node, const uint8_t *planes,
                      mospt_vertex *vertices);
