#include "preprocess/pack.h"

#include "mospt/hash.h"

#include <math.h>
#include <string.h>

/* Records that are packed plane by plane while they are in the first cache. */
enum { BLOCK = 256 };

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

/* Nearest integer, halves to even. Below 2^51 a sum that leaves no room for a fraction does it, at
 * a fraction of the cost. */
static double nearest(double x)
{
    const double shift = 0x1.8p52;
    return fabs(x) < 0x1p51 ? (x + shift) - shift : nearbyint(x);
}

/* As mospt_grid_from_world(), with what is the same for all points kept out of the loop. */
static void pack_vertices(const prep_packer *p, const prep_batch *batch, uint32_t begin,
                          uint32_t end, uint8_t *records, size_t stride, prep_pack_sums *sums)
{
    const mospt_grid *grid = p->grid;
    double step = grid->step, width = ldexp(1, (int)grid->bits), worst = sums->position_error;
    double offset[3], first[3];
    for (int a = 0; a < 3; a++) {
        offset[a] = grid->offset[a];
        first[a] = (double)(grid->base[a] + (int64_t)grid->root[a]);
    }
    for (uint32_t i = begin; i < end; i++, records += stride) {
        const double *world = batch->xyz + 3 * (size_t)i;
        uint32_t g[3];
        for (int a = 0; a < 3; a++) {
            double steps = nearest((world[a] - offset[a]) / step), local = steps - first[a];
            if (!(local >= 0 && local < width)) {
                sums->outside = true;
                return;
            }
            g[a] = grid->root[a] + (uint32_t)local;
            double error = fabs(steps * step + offset[a] - world[a]);
            worst = error > worst ? error : worst;
            sums->low[a] = g[a] < sums->low[a] ? g[a] : sums->low[a];
            sums->high[a] = g[a] > sums->high[a] ? g[a] : sums->high[a];
        }
        mospt_vertex v = {.x = g[0], .y = g[1], .z = g[2]};
        memcpy(&v.r, batch->rgbi + 4 * (size_t)i, 4);
        memcpy(records, &v, sizeof v);
    }
    sums->position_error = worst;
}

/* The same value in every row. */
static void pack_constant(uint8_t *rows, size_t stride, uint32_t count, const void *value,
                          size_t size)
{
    for (uint32_t i = 0; i < count; i++)
        memcpy(rows + i * stride, value, size);
}

static void convert_plane(const uint8_t *plane, const mospt_attribute *from,
                          const mospt_attribute *to, uint32_t count, uint8_t *rows, size_t stride)
{
    size_t from_size = mospt_type_size(from->type), to_size = mospt_type_size(to->type);
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t c = 0; c < from->components; c++)
            mospt_type_write(
                to->type,
                mospt_type_read(from->type, plane + (i * from->components + c) * from_size),
                rows + i * stride + c * to_size);
}

static void copy_plane(const uint8_t *plane, size_t size, uint32_t count, uint8_t *rows,
                       size_t stride)
{
    switch (size) { /* constant sizes are one load and one store */
    case 1:
        for (uint32_t i = 0; i < count; i++)
            rows[i * stride] = plane[i];
        return;
    case 2:
        for (uint32_t i = 0; i < count; i++)
            memcpy(rows + i * stride, plane + 2 * (size_t)i, 2);
        return;
    case 6:
        for (uint32_t i = 0; i < count; i++)
            memcpy(rows + i * stride, plane + 6 * (size_t)i, 6);
        return;
    case 8:
        for (uint32_t i = 0; i < count; i++)
            memcpy(rows + i * stride, plane + 8 * (size_t)i, 8);
        return;
    default:
        for (uint32_t i = 0; i < count; i++)
            memcpy(rows + i * stride, plane + size * i, size);
    }
}

/* Where the planes of a dataset come from. */
typedef struct {
    int plane[MOSPT_ATTRIBUTES_MAX]; /* of the batch; -1: a constant */
    uint8_t scan[8];                 /* the value of the attribute of that name */
    int scan_attribute;
} origins;

static origins find_origins(const prep_packer *p)
{
    origins o = {.scan_attribute = mospt_schema_find(p->schema, "scan")};
    for (uint32_t k = 0; k < p->schema->count; k++)
        o.plane[k] = mospt_schema_find(p->planes, p->schema->at[k].name);
    if (o.scan_attribute >= 0)
        mospt_type_write(p->schema->at[o.scan_attribute].type, p->scan, o.scan);
    return o;
}

static void pack_attributes(const prep_packer *p, const origins *o, const prep_batch *batch,
                            uint32_t begin, uint32_t count, uint8_t *records, size_t stride)
{
    static const uint8_t zero[255 * 8];
    for (uint32_t k = 0; k < p->schema->count; k++) {
        const mospt_attribute *to = &p->schema->at[k];
        uint8_t *rows = records + sizeof(mospt_vertex) + to->offset;
        int from = o->plane[k];
        if (from < 0) {
            pack_constant(rows, stride, count, (int)k == o->scan_attribute ? o->scan : zero,
                          mospt_attribute_size(to));
            continue;
        }
        const uint8_t *plane = batch->plane[from] + begin * batch->plane_size[from];
        if (p->planes->at[from].type != to->type)
            convert_plane(plane, &p->planes->at[from], to, count, rows, stride);
        else copy_plane(plane, batch->plane_size[from], count, rows, stride);
    }
}

void prep_pack(const prep_packer *p, const prep_batch *batch, uint32_t begin, uint32_t end,
               uint8_t *records, prep_pack_sums *sums)
{
    size_t stride = mospt_record_size(p->schema);
    origins from = find_origins(p);
    for (uint32_t i = begin, n; i < end && !sums->outside; i += n, records += n * stride) {
        n = end - i < BLOCK ? end - i : BLOCK;
        pack_vertices(p, batch, i, i + n, records, stride, sums);
        pack_attributes(p, &from, batch, i, n, records, stride);
        sums->hash += mospt_hash_records(records, stride, n);
    }
}
