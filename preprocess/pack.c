#include "preprocess/pack.h"

#include "mospt/hash.h"
#include "mospt/strided.h"
#include "mospt/wide.h"
#include "preprocess/bytes.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Records that are packed plane by plane while they are in the first cache. */
enum { BLOCK = 256 };

/* Bytes for planes of a block. */
enum { SPARE_SIZE = 2 * MOSPT_ROW_SIZE_MAX };

const prep_pack_sums prep_pack_sums_empty = {.low = {UINT32_MAX, UINT32_MAX, UINT32_MAX}};

void prep_pack_sums_add(prep_pack_sums *sums, const prep_pack_sums *more)
{
    sums->hash += more->hash;
    sums->position_error = fmax(sums->position_error, more->position_error);
    sums->outside = sums->outside || more->outside;
    sums->differs.in_value |= more->differs.in_value;
    sums->differs.from_colour |= more->differs.from_colour;
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

/* As mospt_grid_from_world(), with what is the same for all points kept out of the loop.
 * xyz      [count][3] */
static void pack_positions(const mospt_grid *grid, const double *xyz, uint32_t count,
                           uint8_t *records, size_t stride, prep_pack_sums *sums)
{
    double step = grid->step, width = ldexp(1, (int)grid->bits), worst = sums->position_error;
    double offset[3], first[3];
    for (int a = 0; a < 3; a++) {
        offset[a] = grid->offset[a];
        first[a] = (double)(grid->base[a] + (int64_t)grid->root[a]);
    }
    for (uint32_t i = 0; i < count; i++, records += stride, xyz += 3) {
        uint32_t g[3];
        for (int a = 0; a < 3; a++) {
            double steps = nearest((xyz[a] - offset[a]) / step), local = steps - first[a];
            if (!(local >= 0 && local < width)) {
                sums->outside = true;
                return;
            }
            g[a] = grid->root[a] + (uint32_t)local;
            double error = fabs(steps * step + offset[a] - xyz[a]);
            worst = error > worst ? error : worst;
            sums->low[a] = g[a] < sums->low[a] ? g[a] : sums->low[a];
            sums->high[a] = g[a] > sums->high[a] ? g[a] : sums->high[a];
        }
        memcpy(records, g, sizeof g);
    }
    sums->position_error = worst;
}

/* True if the positions of packed records are those of the grid, so that its world coordinates are
 * theirs bit for bit: only whole steps lie between the two, and the doubles between are exact to
 * far less than half of one. */
static bool is_same_lattice(const prep_packed *packed, const mospt_grid *grid)
{
    bool same = packed->has_lattice;
    for (int a = 0; a < 3; a++)
        same = same && packed->scale[a] == grid->step && packed->offset[a] == grid->offset[a] &&
               fabs(grid->offset[a]) < 0x1p46 * grid->step;
    return same;
}

/* Three coordinates and one lane to spare, as a vector unit takes them. */
typedef int32_t lanes __attribute__((vector_size(16)));
typedef uint32_t cells __attribute__((vector_size(16)));

static lanes load_lanes(const uint8_t *from)
{
    lanes v;
    memcpy(&v, from, sizeof v);
    if (prep_host_is_big_endian())
        for (int a = 0; a < 4; a++)
            v[a] = (int32_t)prep_swap32((uint32_t)v[a]);
    return v;
}

static lanes pick(lanes mask, lanes yes, lanes no)
{
    return (mask & yes) | (~mask & no);
}

/* Takes the range of the file's own coordinates into the sums. */
static void add_range(const mospt_grid *grid, lanes low, lanes high, prep_pack_sums *sums)
{
    uint64_t width = UINT64_C(1) << grid->bits;
    for (int a = 0; a < 3; a++) {
        int64_t first = low[a] - grid->base[a], last = high[a] - grid->base[a];
        if ((uint64_t)first - grid->root[a] >= width || (uint64_t)last - grid->root[a] >= width)
            sums->outside = true;
        if ((uint32_t)first < sums->low[a]) sums->low[a] = (uint32_t)first;
        if ((uint32_t)last > sums->high[a]) sums->high[a] = (uint32_t)last;
    }
}

/* The vertices of records of the same lattice, which are 16 bytes at least.
 * rgbi     [count][4] */
MOSPT_WIDE static void pack_lattice(const mospt_grid *grid, const prep_packed *packed,
                                    const uint8_t *from, const uint8_t *rgbi, uint32_t count,
                                    uint8_t *records, size_t stride, prep_pack_sums *sums)
{
    cells base = {(uint32_t)grid->base[0], (uint32_t)grid->base[1], (uint32_t)grid->base[2]};
    lanes low = load_lanes(from), high = low;
    for (uint32_t i = 0; i < count; i++, from += packed->stride, records += stride) {
        lanes v = load_lanes(from);
        cells cell = (cells)v - base;
        uint32_t colour;
        low = pick(v < low, v, low);
        high = pick(v > high, v, high);
        memcpy(&colour, rgbi + 4 * (size_t)i, sizeof colour);
        cell[3] = colour;
        memcpy(records, &cell, sizeof cell);
    }
    add_range(grid, low, high, sums);
}

/* The same value for every point.
 * out      [count] values */
static void fill_plane(const uint8_t *value, size_t size, uint32_t count, uint8_t *out)
{
    mospt_copy_strided(out, size, value, 0, size, count);
}

static void convert_plane(const uint8_t *plane, const mospt_attribute *from,
                          const mospt_attribute *to, uint32_t count, uint8_t *out)
{
    size_t from_size = mospt_type_size(from->type), to_size = mospt_type_size(to->type);
    for (uint32_t i = 0; i < count * from->components; i++)
        mospt_type_write(to->type, mospt_type_read(from->type, plane + i * from_size),
                         out + i * to_size);
}

static void copy_plane(const uint8_t *plane, size_t size, uint32_t count, uint8_t *rows,
                       size_t stride)
{
    mospt_copy_strided(rows, stride, plane, size, size, count);
}

/* Where the attributes of a dataset come from. */
typedef struct {
    int plane[MOSPT_ATTRIBUTES_MAX]; /* of the scan; -1: it has none of that name */
    int scan;                        /* the attribute that is the number of the scan; -1: none */
    uint8_t scan_value[8];
} origins;

static origins find_origins(const prep_packer *p)
{
    origins o = {.scan = mospt_schema_find(p->schema, "scan")};
    for (uint32_t k = 0; k < p->schema->count; k++)
        o.plane[k] = mospt_schema_find(p->planes, p->schema->at[k].name);
    if (o.scan >= 0) mospt_type_write(p->schema->at[o.scan].type, p->scan, o.scan_value);
    return o;
}

/* A block of points in planes. */
typedef struct {
    const uint8_t *rgbi;
    const uint8_t *plane[MOSPT_ATTRIBUTES_MAX]; /* of the scan */
    uint8_t *spare; /* room for the planes of one attribute of the dataset */
} block;

/* The plane of an attribute of the dataset: that of the scan, or one made in the room for it. */
static const uint8_t *plane_of(const prep_packer *p, const origins *o, const block *b, uint32_t k,
                               uint32_t count)
{
    static const uint8_t zero[255 * 8];
    const mospt_attribute *to = &p->schema->at[k];
    if (o->plane[k] < 0) {
        fill_plane((int)k == o->scan ? o->scan_value : zero, mospt_attribute_size(to), count,
                   b->spare);
        return b->spare;
    }
    const mospt_attribute *from = &p->planes->at[o->plane[k]];
    if (from->type == to->type) return b->plane[o->plane[k]];
    convert_plane(b->plane[o->plane[k]], from, to, count, b->spare);
    return b->spare;
}

/* Attributes that are kept go into the records; the others are only looked at. */
static void pack_attributes(const prep_packer *p, const origins *o, const block *b, uint32_t count,
                            uint8_t *records, prep_pack_sums *sums)
{
    size_t stride = mospt_record_size(p->schema);
    for (uint32_t k = 0; k < p->schema->count; k++) {
        const mospt_attribute *a = &p->schema->at[k];
        const uint8_t *plane = plane_of(p, o, b, k, count);
        if (a->storage == MOSPT_IN_PLANE)
            copy_plane(plane, mospt_attribute_size(a), count,
                       records + sizeof(mospt_vertex) + a->stored_offset, stride);
        else prep_implied_look(a, k, plane, b->rgbi, count, &sums->differs);
    }
}

/* A block of a batch in planes. */
static void pack_planes(const prep_packer *p, const origins *o, const prep_batch *batch,
                        uint32_t begin, uint32_t count, uint8_t *spare, uint8_t *records,
                        prep_pack_sums *sums)
{
    size_t stride = mospt_record_size(p->schema);
    block b = {.rgbi = batch->rgbi + 4 * (size_t)begin, .spare = spare};
    for (uint32_t k = 0; k < batch->plane_count; k++)
        b.plane[k] = batch->plane[k] + begin * batch->plane_size[k];
    pack_positions(p->grid, batch->xyz + 3 * (size_t)begin, count, records, stride, sums);
    copy_plane(b.rgbi, 4, count, records + offsetof(mospt_vertex, r), stride);
    pack_attributes(p, o, &b, count, records, sums);
}

/* A block of a batch as its file has it, which is unpacked first. */
static void pack_packed(const prep_packer *p, const origins *o, const prep_batch *batch,
                        uint32_t begin, uint32_t count, uint8_t *spare, uint8_t *records,
                        prep_pack_sums *sums)
{
    const prep_packed *packed = &batch->packed;
    const uint8_t *from = packed->records + begin * packed->stride;
    bool same_lattice = is_same_lattice(packed, p->grid);
    size_t stride = mospt_record_size(p->schema);
    double xyz[3 * BLOCK];
    uint8_t rgbi[4 * BLOCK];
    prep_places to = {.xyz = same_lattice ? NULL : xyz, .rgbi = rgbi};
    block b = {.rgbi = rgbi};
    for (uint32_t k = 0; k < p->schema->count; k++) {
        int plane = o->plane[k];
        if (plane < 0) continue;
        b.plane[plane] = to.plane[plane] = spare;
        spare += count * batch->plane_size[plane];
    }
    b.spare = spare;
    packed->unpack(packed->layout, from, count, &to);
    if (same_lattice) {
        pack_lattice(p->grid, packed, from, rgbi, count, records, stride, sums);
    } else {
        pack_positions(p->grid, xyz, count, records, stride, sums);
        copy_plane(rgbi, 4, count, records + offsetof(mospt_vertex, r), stride);
    }
    pack_attributes(p, o, &b, count, records, sums);
}

/* As many points as have room for all planes of the scan, and one of the dataset. */
static uint32_t block_size(const prep_packer *p)
{
    size_t size = p->planes->row_size, widest = 1;
    for (uint32_t k = 0; k < p->schema->count; k++)
        if (mospt_attribute_size(&p->schema->at[k]) > widest)
            widest = mospt_attribute_size(&p->schema->at[k]);
    size += widest;
    return size * BLOCK <= SPARE_SIZE ? BLOCK : (uint32_t)(SPARE_SIZE / size);
}

void prep_pack(const prep_packer *p, const prep_batch *batch, uint32_t begin, uint32_t end,
               uint8_t *records, prep_pack_sums *sums)
{
    uint8_t spare[SPARE_SIZE];
    size_t stride = mospt_record_size(p->schema);
    origins from = find_origins(p);
    uint32_t most = block_size(p);
    for (uint32_t i = begin, n; i < end && !sums->outside; i += n, records += n * stride) {
        n = end - i < most ? end - i : most;
        if (batch->packed.unpack != NULL) pack_packed(p, &from, batch, i, n, spare, records, sums);
        else pack_planes(p, &from, batch, i, n, spare, records, sums);
        sums->hash += mospt_hash_records(records, stride, n);
    }
}
