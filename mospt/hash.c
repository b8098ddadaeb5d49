#include "mospt/hash.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

uint64_t mospt_hash(const void *bytes, size_t size)
{
    return XXH3_64bits(bytes, size);
}

uint64_t mospt_hash_more(uint64_t before, const void *bytes, size_t size)
{
    return XXH3_64bits_withSeed(bytes, size, before);
}

uint64_t mospt_hash_records(const uint8_t *records, size_t stride, size_t count)
{
    uint64_t sum = 0;
    for (size_t i = 0; i < count; i++)
        sum += XXH3_64bits(records + i * stride, stride);
    return sum;
}
