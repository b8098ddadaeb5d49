/* preprocess/bytes.h - numbers from the bytes of a file, whatever the order of the machine's own.
 */
#pragma once
#include <stdint.h>
#include <string.h>

static inline uint16_t prep_le16(const uint8_t *p)
{
    return (uint16_t)(p[0] | p[1] << 8);
}
static inline uint32_t prep_le32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}
static inline uint64_t prep_le64(const uint8_t *p)
{
    return (uint64_t)prep_le32(p) | (uint64_t)prep_le32(p + 4) << 32;
}
static inline double prep_le_f64(const uint8_t *p)
{
    uint64_t bits = prep_le64(p);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}
static inline void prep_put_le16(uint8_t *p, uint32_t v)
{
    p[0] = (uint8_t)v;
    p[1] = (uint8_t)(v >> 8);
}
static inline void prep_put_le32(uint8_t *p, uint32_t v)
{
    prep_put_le16(p, v);
    prep_put_le16(p + 2, v >> 16);
}
static inline void prep_put_le64(uint8_t *p, uint64_t v)
{
    prep_put_le32(p, (uint32_t)v);
    prep_put_le32(p + 4, (uint32_t)(v >> 32));
}
static inline uint16_t prep_swap16(uint16_t v)
{
    return (uint16_t)(v << 8 | v >> 8);
}
static inline uint32_t prep_swap32(uint32_t v)
{
    return v << 24 | (v & 0xff00u) << 8 | (v >> 8 & 0xff00u) | v >> 24;
}
static inline uint64_t prep_swap64(uint64_t v)
{
    return (uint64_t)prep_swap32((uint32_t)v) << 32 | prep_swap32((uint32_t)(v >> 32));
}
static inline int prep_host_is_big_endian(void)
{
    return __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__;
}
