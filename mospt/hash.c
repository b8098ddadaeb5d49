#include "mospt/hash.h"

#define XXH_INLINE_ALL
#include <stdlib.h>
#include <xxhash.h>

uint64_t mospt_hash(const void *bytes, size_t size)
{
    return XXH3_64bits(bytes, size);
}

uint64_t mospt_hash_more(uint64_t before, const void *bytes, size_t size)
{
    return XXH3_64bits_withSeed(bytes, size, before);
}

struct mospt_hasher {
    XXH3_state_t state;
};

mospt_hasher *mospt_hasher_create(void)
{
    mospt_hasher *hasher = aligned_alloc(64, (sizeof *hasher + 63) / 64 * 64);
    if (hasher != NULL) XXH3_64bits_reset(&hasher->state);
    return hasher;
}

void mospt_hasher_add(mospt_hasher *hasher, const void *bytes, size_t size)
{
    XXH3_64bits_update(&hasher->state, bytes, size);
}

uint64_t mospt_hasher_hash(const mospt_hasher *hasher)
{
    return XXH3_64bits_digest(&hasher->state);
}

void mospt_hasher_destroy(mospt_hasher *hasher)
{
    free(hasher);
}

uint64_t mospt_hash_records(const uint8_t *records, size_t stride, size_t count)
{
    uint64_t sum = 0;
    for (size_t i = 0; i < count; i++)
        sum += XXH3_64bits(records + i * stride, stride);
    return sum;
}
