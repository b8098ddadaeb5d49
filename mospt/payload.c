#include "mospt/payload.h"

#include "mospt/hash.h"

/* Points whose records are packed plane by plane while they are still in the first cache. */
enum { BLOCK = 256 };

static void copy_strided(uint8_t *to, size_t to_stride, const uint8_t *from, size_t from_stride,
                         size_t size, uint32_t count)
{
    switch (size) { /* a constant size makes each copy one load and one store */
    case 1:
        for (uint32_t i = 0; i < count; i++)
            to[i * to_stride] = from[i * from_stride];
        return;
    case 2:
        for (uint32_t i = 0; i < count; i++)
            memcpy(to + i * to_stride, from + i * from_stride, 2);
        return;
    case 4:
        for (uint32_t i = 0; i < count; i++)
            memcpy(to + i * to_stride, from + i * from_stride, 4);
        return;
    case 8:
        for (uint32_t i = 0; i < count; i++)
            memcpy(to + i * to_stride, from + i * from_stride, 8);
        return;
    case 16:
        for (uint32_t i = 0; i < count; i++)
            memcpy(to + i * to_stride, from + i * from_stride, 16);
        return;
    default:
        for (uint32_t i = 0; i < count; i++)
            memcpy(to + i * to_stride, from + i * from_stride, size);
    }
}

void mospt_payload_pack(const mospt_schema *schema, const uint8_t *records, const uint32_t *order,
                        uint32_t count, uint8_t *out, mospt_node *node)
{
    size_t stride = mospt_record_size(schema), vertices_size = (size_t)count * sizeof(mospt_vertex);
    uint8_t *planes = out + vertices_size;
    for (uint32_t start = 0; start < count; start += BLOCK) {
        uint32_t n = count - start < BLOCK ? count - start : BLOCK;
        for (uint32_t i = start; i < start + n; i++)
            memcpy(out + (size_t)i * sizeof(mospt_vertex), records + order[i] * stride,
                   sizeof(mospt_vertex));
        for (uint32_t k = 0; k < schema->count; k++) {
            const mospt_attribute *a = &schema->at[k];
            size_t size = mospt_attribute_size(a);
            uint8_t *plane = planes + (size_t)count * a->offset;
            const uint8_t *from = records + sizeof(mospt_vertex) + a->offset;
            for (uint32_t i = start; i < start + n;
                 i++) /* gathers: the stride of `from` is no constant */
                copy_strided(plane + i * size, size, from + order[i] * stride, stride, size, 1);
        }
    }
    node->count = count;
    node->codec = MOSPT_CODEC_RAW;
    node->payload_size = (uint64_t)count * stride;
    node->vertices_hash = mospt_hash(out, vertices_size);
    node->attributes_hash = mospt_hash(planes, (size_t)count * schema->row_size);
}

uint64_t mospt_payload_points_hash(const mospt_schema *schema, const uint8_t *vertices,
                                   const uint8_t *planes, uint32_t count)
{
    uint8_t records[2 * MOSPT_ROW_SIZE_MAX];
    size_t stride = mospt_record_size(schema);
    uint32_t room = (uint32_t)(sizeof records / stride);
    uint64_t sum = 0;
    for (uint32_t start = 0, n; start < count; start += n) {
        n = count - start < room ? count - start : room;
        copy_strided(records, stride, vertices + start * sizeof(mospt_vertex), sizeof(mospt_vertex),
                     sizeof(mospt_vertex), n);
        for (uint32_t k = 0; k < schema->count; k++) {
            const mospt_attribute *a = &schema->at[k];
            size_t size = mospt_attribute_size(a);
            copy_strided(records + sizeof(mospt_vertex) + a->offset, stride,
                         planes + (size_t)count * a->offset + start * size, size, size, n);
        }
        sum += mospt_hash_records(records, stride, n);
    }
    return sum;
}
