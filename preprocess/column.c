#include "preprocess/column.h"

#include "preprocess/bytes.h"

#include <string.h>

void prep_column_swap(const prep_column *column, uint32_t count)
{
    uint8_t *p = column->at;
    size_t size = mospt_type_size(column->type), stride = column->stride;
    for (uint32_t i = 0; i < count && size == 2; i++, p += stride) {
        uint16_t v;
        memcpy(&v, p, 2);
        v = prep_swap16(v);
        memcpy(p, &v, 2);
    }
    for (uint32_t i = 0; i < count && size == 4; i++, p += stride) {
        uint32_t v;
        memcpy(&v, p, 4);
        v = prep_swap32(v);
        memcpy(p, &v, 4);
    }
    for (uint32_t i = 0; i < count && size == 8; i++, p += stride) {
        uint64_t v;
        memcpy(&v, p, 8);
        v = prep_swap64(v);
        memcpy(p, &v, 8);
    }
}

/* One loop per type: a call per value would cost more than the conversion. */
#define TO_F64(ENUM, T)                                                                            \
    case ENUM:                                                                                     \
        for (uint32_t i = 0; i < count; i++, p += stride, out += out_step) {                       \
            T v;                                                                                   \
            memcpy(&v, p, sizeof v);                                                               \
            *out = (double)v;                                                                      \
        }                                                                                          \
        break

void prep_column_to_f64(const prep_column *column, uint32_t count, double *out, size_t out_step)
{
    const uint8_t *p = column->at;
    size_t stride = column->stride;
    switch (column->type) {
        TO_F64(MOSPT_U8, uint8_t);
        TO_F64(MOSPT_I8, int8_t);
        TO_F64(MOSPT_U16, uint16_t);
        TO_F64(MOSPT_I16, int16_t);
        TO_F64(MOSPT_U32, uint32_t);
        TO_F64(MOSPT_I32, int32_t);
        TO_F64(MOSPT_U64, uint64_t);
        TO_F64(MOSPT_I64, int64_t);
        TO_F64(MOSPT_F32, float);
        TO_F64(MOSPT_F64, double);
    case MOSPT_TYPE_COUNT:
        break;
    }
}
#undef TO_F64

#define COPY(SIZE)                                                                                 \
    case SIZE:                                                                                     \
        for (uint32_t i = 0; i < count; i++, p += stride, out += out_stride)                       \
            memcpy(out, p, SIZE);                                                                  \
        break

void prep_column_copy(const prep_column *column, uint32_t count, uint8_t *out, size_t out_stride)
{
    const uint8_t *p = column->at;
    size_t stride = column->stride;
    switch (mospt_type_size(column->type)) {
        COPY(1);
        COPY(2);
        COPY(4);
        COPY(8);
    default:
        break;
    }
}
#undef COPY
