#include "preprocess/pack.h"

#include "mospt/hash.h"

#include <math.h>
#include <string.h>

const prep_pack_sums prep_pack_sums_empty = {.low = {UINT32_MAX, UINT32_MAX, UINT32_MAX}};

void prep_pack_sums_add(prep_pack_sums *sums, const prep_pack_sums *more)
{
    sums->hash += more->hash;
    sums->position_error = fmax(sums->position_error, more->position_error);
    sums->outside = sums->outside || more->outside;
    for (int a = 0; a < 3; a++) {
        if (more->low[a] < sums->low[a]) sums->low[a] = more->low[a];
        if (more->high[a] > sums->high[a]) sums->high[a] = more->high[a];
    }
}

static void pack_vertices(const prep_packer *p, const prep_batch *batch, uint32_t begin,
                          uint32_t end, uint8_t *records, size_t stride, prep_pack_sums *sums)
{
    for (uint32_t i = begin; i < end; i++) {
        const double *world = batch->xyz + 3 * (size_t)i;
        uint32_t g[3];
        mospt_vertex v;
        if (!mospt_grid_from_world(p->grid, world, g)) {
            sums->outside = true;
            return;
        }
        for (int a = 0; a < 3; a++) {
            double error = fabs(mospt_grid_axis_to_world(p->grid, a, g[a]) - world[a]);
            if (error > sums->position_error) sums->position_error = error;
            if (g[a] < sums->low[a]) sums->low[a] = g[a];
            if (g[a] > sums->high[a]) sums->high[a] = g[a];
        }
        v.x = g[0], v.y = g[1], v.z = g[2];
        memcpy(&v.r, batch->rgbi + 4 * (size_t)i, 4);
        memcpy(records + i * stride, &v, sizeof v);
    }
}

/* The same value in every row. */
static void pack_constant(uint8_t *rows, size_t stride, uint32_t begin, uint32_t end,
                          const void *value, size_t size)
{
    for (uint32_t i = begin; i < end; i++)
        memcpy(rows + i * stride, value, size);
}

static void pack_plane(const prep_batch *batch, uint32_t k, const mospt_attribute *from,
                       const mospt_attribute *to, uint32_t begin, uint32_t end, uint8_t *rows,
                       size_t stride)
{
    const uint8_t *plane = batch->plane[k];
    size_t size = batch->plane_size[k], from_size = mospt_type_size(from->type),
           to_size = mospt_type_size(to->type);
    if (from->type != to->type) {
        for (uint32_t i = begin; i < end; i++)
            for (uint32_t c = 0; c < from->components; c++)
                mospt_type_write(to->type,
                                 mospt_type_read(from->type, plane + i * size + c * from_size),
                                 rows + i * stride + c * to_size);
        return;
    }
    switch (size) { /* constant sizes are one load and one store */
    case 1:
        for (uint32_t i = begin; i < end; i++)
            rows[i * stride] = plane[i];
        return;
    case 2:
        for (uint32_t i = begin; i < end; i++)
            memcpy(rows + i * stride, plane + 2 * (size_t)i, 2);
        return;
    case 8:
        for (uint32_t i = begin; i < end; i++)
            memcpy(rows + i * stride, plane + 8 * (size_t)i, 8);
        return;
    default:
        for (uint32_t i = begin; i < end; i++)
            memcpy(rows + i * stride, plane + size * i, size);
    }
}

void prep_pack(const prep_packer *p, const prep_batch *batch, uint32_t begin, uint32_t end,
               uint8_t *records, prep_pack_sums *sums)
{
    static const uint8_t zero[255 * 8];
    size_t stride = mospt_record_size(p->schema);
    pack_vertices(p, batch, begin, end, records, stride, sums);
    if (sums->outside) return;
    for (uint32_t k = 0; k < p->schema->count; k++) {
        const mospt_attribute *to = &p->schema->at[k];
        uint8_t *rows = records + sizeof(mospt_vertex) + to->offset;
        int from = mospt_schema_find(p->planes, to->name);
        if (from >= 0) {
            pack_plane(batch, (uint32_t)from, &p->planes->at[from], to, begin, end, rows, stride);
        } else if (strcmp(to->name, "scan") == 0) {
            uint8_t value[8] = {0};
            mospt_type_write(to->type, p->scan, value);
            pack_constant(rows, stride, begin, end, value, mospt_attribute_size(to));
        } else {
            pack_constant(rows, stride, begin, end, zero, mospt_attribute_size(to));
        }
    }
    sums->hash += mospt_hash_records(records + begin * stride, stride, end - begin);
}
