/* mospt/payload.h - the bytes of one node: its vertices as the GPU wants them, then one plane per
 * attribute that is kept in planes. */
#pragma once
#include "mospt/hierarchy.h"
#include "mospt/point.h"
#include "mospt/schema.h"

/* Bytes of the record of a point, which is on its way to a payload: its vertex, and of its
 * attributes those that are kept in planes. */
static inline size_t mospt_record_size(const mospt_schema *schema)
{
    return sizeof(mospt_vertex) + schema->stored_size;
}

/* Bytes of a payload of `count` points. */
static inline uint64_t mospt_payload_size(const mospt_schema *schema, uint64_t count)
{
    return count * mospt_record_size(schema);
}

/* Packs the records order[0..count-1] of `records` into `out`, and sets the size and the hashes of
 * `node`.
 * records  [mospt_record_size()] of each point
 * out      [mospt_payload_size()]
 * returns  the sum of the hashes of the records that were taken, in their new order: what
 *          mospt_payload_points_hash() is of the payload */
uint64_t mospt_payload_pack(const mospt_schema *schema, const mospt_records *records,
                            const uint32_t *order, uint32_t count, uint8_t *out, mospt_node *node);

/* Makes planes of all attributes of those that a payload has.
 * vertices [count]
 * planes   in: [count * stored_size] bytes; out: [count * row_size] */
void mospt_payload_complete(const mospt_schema *schema, const mospt_vertex *vertices,
                            uint32_t count, uint8_t *planes);

/* Sum of the hashes of the points in a payload, each as mospt_hash_records() sees its record.
 * vertices [count], planes [count * stored_size] bytes */
uint64_t mospt_payload_points_hash(const mospt_schema *schema, const uint8_t *vertices,
                                   const uint8_t *planes, uint32_t count);
