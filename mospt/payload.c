#include "mospt/payload.h"

#include "mospt/hash.h"
#include "mospt/strided.h"
#include "mospt/turn.h"

/* Points whose records are packed plane by plane while they are still in the first cache. */
enum { BLOCK = 256 };

/* from     [count] records; what is copied stands at `offset` in each of them */
static void gather(uint8_t *to, const uint8_t *const *from, size_t offset, size_t size,
                   uint32_t count)
{
#define COPY(size)                                                                                 \
    for (uint32_t i = 0; i < count; i++)                                                           \
    memcpy(to + i * (size), from[i] + offset, size)
    MOSPT_WITH_CONSTANT_SIZE(size, COPY)
#undef COPY
}

/* from     [count] records, at most BLOCK
 * columns  out, of MOSPT_TURN bytes of each from `offset` on */
static void turn(const uint8_t *const *from, size_t offset, uint32_t count,
                 uint8_t columns[MOSPT_TURN][BLOCK])
{
    mospt_row rows[MOSPT_TURN];
    for (uint32_t start = 0; start < count; start += MOSPT_TURN) {
        for (uint32_t i = 0; i < MOSPT_TURN; i++) /* what is behind the last one does not matter */
            memcpy(&rows[i], from[start + i < count ? start + i : start] + offset, MOSPT_TURN);
        mospt_turn(rows, columns[0] + start, BLOCK);
    }
}

static void join_columns(uint8_t *restrict to, const uint8_t *restrict first,
                         const uint8_t *restrict second, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        to[2 * i] = first[i], to[2 * i + 1] = second[i];
}

/* The planes of a block of points. Of attributes of one or two bytes, of which records have many, a
 * byte at a time would be most of the work: these are taken from columns.
 * planes   of all `count` points; out: those from `start` on
 * from     [n] records, at most BLOCK */
static void pack_planes(const mospt_schema *schema, uint8_t *planes, uint32_t count, uint32_t start,
                        const uint8_t *const *from, uint32_t n)
{
    uint8_t columns[MOSPT_TURN][BLOCK];
    size_t stride = mospt_record_size(schema), begin = stride; /* of the columns; none yet */
    for (uint32_t k = 0; k < schema->count; k++) {
        const mospt_attribute *a = &schema->at[k];
        size_t size = mospt_attribute_size(a), offset = sizeof(mospt_vertex) + a->stored_offset;
        uint8_t *to = planes + (size_t)count * a->stored_offset + start * size;
        if (a->storage != MOSPT_IN_PLANE) continue;
        if (size > 2) {
            gather(to, from, offset, size, n);
            continue;
        }
        if (offset < begin || offset + size > begin + MOSPT_TURN) {
            begin = offset + MOSPT_TURN <= stride ? offset : stride - MOSPT_TURN;
            turn(from, begin, n, columns);
        }
        if (size == 1) memcpy(to, columns[offset - begin], n);
        else join_columns(to, columns[offset - begin], columns[offset - begin + 1], n);
    }
}

/* Of points [start, start + n) of a payload; at most BLOCK. */
static uint64_t hash_block(const mospt_schema *schema, const uint8_t *vertices,
                           const uint8_t *planes, uint32_t count, uint32_t start, uint32_t n)
{
    uint8_t records[2 * MOSPT_ROW_SIZE_MAX];
    size_t stride = mospt_record_size(schema);
    uint32_t room = (uint32_t)(sizeof records / stride), end = start + n;
    uint64_t sum = 0;
    for (; start < end; start += n) {
        n = end - start < room ? end - start : room;
        mospt_copy_strided(records, stride, vertices + start * sizeof(mospt_vertex),
                           sizeof(mospt_vertex), sizeof(mospt_vertex), n);
        for (uint32_t k = 0; k < schema->count; k++) {
            const mospt_attribute *a = &schema->at[k];
            size_t size = mospt_attribute_size(a);
            if (a->storage != MOSPT_IN_PLANE) continue;
            mospt_copy_strided(records + sizeof(mospt_vertex) + a->stored_offset, stride,
                               planes + (size_t)count * a->stored_offset + start * size, size, size,
                               n);
        }
        sum += mospt_hash_records(records, stride, n);
    }
    return sum;
}

static uint64_t hash_records(const uint8_t *const *from, size_t stride, uint32_t count)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < count; i++)
        sum += mospt_hash(from[i], stride);
    return sum;
}

uint64_t mospt_payload_pack(const mospt_schema *schema, const mospt_records *records,
                            const uint32_t *order, uint32_t count, uint8_t *out, mospt_node *node)
{
    size_t vertices_size = (size_t)count * sizeof(mospt_vertex);
    uint8_t *planes = out + vertices_size;
    const uint8_t *from[BLOCK];
    uint64_t points_hash = 0;
    for (uint32_t start = 0; start < count; start += BLOCK) {
        uint32_t n = count - start < BLOCK ? count - start : BLOCK;
        for (uint32_t i = 0; i < n; i++) {
            from[i] = mospt_records_at(records, order[start + i]);
            __builtin_prefetch(from[i]); /* they lie anywhere in memory */
            __builtin_prefetch(from[i] + records->stride - 1);
        }
        points_hash += hash_records(from, records->stride, n);
        gather(out + start * sizeof(mospt_vertex), from, 0, sizeof(mospt_vertex), n);
        pack_planes(schema, planes, count, start, from, n);
    }
    node->count = count;
    node->codec = MOSPT_CODEC_RAW;
    node->payload_size = mospt_payload_size(schema, count);
    node->vertices_hash = mospt_hash(out, vertices_size);
    node->attributes_hash = mospt_hash(planes, (size_t)count * schema->stored_size);
    return points_hash;
}

static void fill_constant(const mospt_attribute *a, uint32_t count, uint8_t *plane)
{
    size_t size = mospt_attribute_size(a);
    mospt_copy_strided(plane, size, a->constant, 0, size, count);
}

static void fill_of_colour(const mospt_vertex *vertices, uint32_t count, uint8_t *plane)
{
    for (uint32_t i = 0; i < count; i++) {
        const mospt_vertex *v = &vertices[i];
        const uint8_t rgb[] = {v->r, v->r, v->g, v->g, v->b, v->b};
        memcpy(plane + i * sizeof rgb, rgb, sizeof rgb);
    }
}

void mospt_payload_complete(const mospt_schema *schema, const mospt_vertex *vertices,
                            uint32_t count, uint8_t *planes)
{
    for (uint32_t k = schema->count; k-- > 0;) {
        const mospt_attribute *a = &schema->at[k];
        uint8_t *plane = planes + (size_t)count * a->offset;
        switch (a->storage) {
        case MOSPT_CONSTANT:
            fill_constant(a, count, plane);
            break;
        case MOSPT_OF_COLOUR:
            fill_of_colour(vertices, count, plane);
            break;
        default: /* those before it stand in front of both places */
            memmove(plane, planes + (size_t)count * a->stored_offset,
                    count * mospt_attribute_size(a));
        }
    }
}

uint64_t mospt_payload_points_hash(const mospt_schema *schema, const uint8_t *vertices,
                                   const uint8_t *planes, uint32_t count)
{
    uint64_t sum = 0;
    for (uint32_t start = 0; start < count; start += BLOCK)
        sum += hash_block(schema, vertices, planes, count, start,
                          count - start < BLOCK ? count - start : BLOCK);
    return sum;
}
