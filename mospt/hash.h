/* mospt/hash.h - the one hash of all files and points: XXH3, 64 bits, seed 0. */
#pragma once
#include <stddef.h>
#include <stdint.h>

uint64_t mospt_hash(const void *bytes, size_t size);

/* Goes on from the hash of what came before (0: nothing) to that of several pieces in their order.
 */
uint64_t mospt_hash_more(uint64_t before, const void *bytes, size_t size);

/* The hash of bytes that come in pieces. */
typedef struct mospt_hasher mospt_hasher;
mospt_hasher *mospt_hasher_create(void); /* NULL without memory */
void mospt_hasher_add(mospt_hasher *hasher, const void *bytes, size_t size);
uint64_t mospt_hasher_hash(const mospt_hasher *hasher);
void mospt_hasher_destroy(mospt_hasher *hasher);

/* Sum modulo 2^64 of the hash of each record: does not depend on their order. */
uint64_t mospt_hash_records(const uint8_t *records, size_t stride, size_t count);
