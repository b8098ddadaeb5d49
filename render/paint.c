#include "render/paint.h"

#include <math.h>

/* Distinct from every colour of the maps, as light as most of them. */
static const uint8_t NO_VALUE[3] = {128, 128, 128};

bool rend_paint_needs_attributes(const rend_paint *paint)
{
    return paint->attribute >= 0;
}

static double read_component(const rend_paint *p, uint32_t node, const uint8_t *planes, uint32_t i,
                             uint32_t component)
{
    const mospt_attribute *a = &p->dataset->metadata.schema.at[p->attribute];
    size_t count = p->dataset->hierarchy.nodes[node].count, size = mospt_type_size(a->type);
    const uint8_t *plane = planes + a->offset * count;
    return mospt_type_read(a->type, plane + ((size_t)i * a->components + component) * size);
}

static double deepest_level(const mospt_hierarchy *h, const mospt_grid *grid, uint32_t node,
                            const mospt_vertex *v)
{
    while (h->nodes[node].child_mask != 0) {
        /* Cells one step wide have their only child in octant 0. */
        uint32_t bits = mospt_cell_bits(grid, h->nodes[node].level), octant = 0;
        if (bits > 0)
            octant = (v->x >> (bits - 1) & 1) | (v->y >> (bits - 1) & 1) << 1 |
                     (v->z >> (bits - 1) & 1) << 2;
        uint32_t child = mospt_hierarchy_child(h, node, octant);
        if (child == MOSPT_NO_NODE) break;
        node = child;
    }
    return h->nodes[node].level;
}

static double distance_to_scanner(const rend_paint *p, uint32_t node, const mospt_vertex *v,
                                  const uint8_t *planes, uint32_t i)
{
    const mospt_metadata *m = &p->dataset->metadata;
    double scan = p->attribute >= 0 ? read_component(p, node, planes, i, 0) : 0, world[3];
    if (!(scan >= 0 && scan < m->source_count)) return NAN;
    const mospt_source *source = &m->sources[(uint32_t)scan];
    if (!source->has_pose) return NAN;
    mospt_grid_to_world(&m->grid, (const uint32_t[3]){v->x, v->y, v->z}, world);
    double dx = world[0] - source->pose[3], dy = world[1] - source->pose[7],
           dz = world[2] - source->pose[11];
    return sqrt(dx * dx + dy * dy + dz * dz);
}

double rend_paint_value(const rend_paint *paint, uint32_t node, const mospt_vertex *vertices,
                        const uint8_t *planes, uint32_t i)
{
    const mospt_dataset *d = paint->dataset;
    double value = NAN;
    switch (paint->source) {
    case REND_PAINT_INTENSITY:
        return vertices[i].i;
    case REND_PAINT_HEIGHT:
        return mospt_grid_axis_to_world(&d->metadata.grid, 2, vertices[i].z);
    case REND_PAINT_LEVEL:
        return deepest_level(&d->hierarchy, &d->metadata.grid, node, &vertices[i]);
    case REND_PAINT_DISTANCE:
        return distance_to_scanner(paint, node, &vertices[i], planes, i);
    case REND_PAINT_VALUE:
        value = read_component(paint, node, planes, i, paint->component);
        return paint->zero_is_none && value == 0 ? NAN : value;
    case REND_PAINT_STORED:
    case REND_PAINT_RGB:
    case REND_PAINT_DIRECTION:
        break;
    }
    return value;
}

const uint8_t *rend_paint_colour(const rend_paint *paint, double value)
{
    if (isnan(value)) return NO_VALUE;
    if (paint->classes)
        return value >= 0 && value < 0x1p32 ? paint->ramp.rgb[(uint32_t)value & 0xff] : NO_VALUE;
    double span = paint->high - paint->low;
    double place = span > 0 ? (value - paint->low) / span * (REND_RAMP_STEPS - 1) + 0.5
                            : REND_RAMP_STEPS / 2.0; /* all alike */
    int step = place < REND_RAMP_STEPS ? (int)fmax(place, 0) : REND_RAMP_STEPS - 1;
    return paint->ramp.rgb[step];
}

static void apply_curve(const rend_paint *p, uint32_t count, mospt_vertex *v)
{
    for (uint32_t i = 0; i < count; i++) {
        v[i].r = p->ramp.rgb[v[i].r][0];
        v[i].g = p->ramp.rgb[v[i].g][1];
        v[i].b = p->ramp.rgb[v[i].b][2];
    }
}

static uint8_t direction_byte(double value)
{
    double shown = 127.5 + 127.5 * value + 0.5;
    return shown >= 255 ? 255 : shown > 0 ? (uint8_t)shown : 0; /* NaN is 0 */
}

static void apply_direction(const rend_paint *p, uint32_t node, const uint8_t *planes,
                            mospt_vertex *v)
{
    for (uint32_t i = 0; i < p->dataset->hierarchy.nodes[node].count; i++) {
        v[i].r = direction_byte(read_component(p, node, planes, i, 0));
        v[i].g = direction_byte(read_component(p, node, planes, i, 1));
        v[i].b = direction_byte(read_component(p, node, planes, i, 2));
    }
}

void rend_paint_apply(const rend_paint *paint, uint32_t node, const uint8_t *planes,
                      mospt_vertex *vertices)
{
    uint32_t count =
        paint->source == REND_PAINT_STORED ? 0 : paint->dataset->hierarchy.nodes[node].count;
    if (paint->source == REND_PAINT_RGB) {
        apply_curve(paint, count, vertices);
        return;
    }
    if (paint->source == REND_PAINT_DIRECTION) {
        apply_direction(paint, node, planes, vertices);
        return;
    }
    for (uint32_t i = 0; i < count; i++) {
        const uint8_t *rgb =
            rend_paint_colour(paint, rend_paint_value(paint, node, vertices, planes, i));
        vertices[i].r = rgb[0], vertices[i].g = rgb[1], vertices[i].b = rgb[2];
    }
}
