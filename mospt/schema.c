#include "mospt/schema.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const struct {
    const char *name;
    size_t size;
    bool is_float, is_signed;
} types[MOSPT_TYPE_COUNT] = {
    [MOSPT_U8] = {"u8", 1, false, false},   [MOSPT_I8] = {"i8", 1, false, true},
    [MOSPT_U16] = {"u16", 2, false, false}, [MOSPT_I16] = {"i16", 2, false, true},
    [MOSPT_U32] = {"u32", 4, false, false}, [MOSPT_I32] = {"i32", 4, false, true},
    [MOSPT_U64] = {"u64", 8, false, false}, [MOSPT_I64] = {"i64", 8, false, true},
    [MOSPT_F32] = {"f32", 4, true, true},   [MOSPT_F64] = {"f64", 8, true, true},
};

size_t mospt_type_size(mospt_type type)
{
    return types[type].size;
}

const char *mospt_type_name(mospt_type type)
{
    return types[type].name;
}

bool mospt_type_from_name(const char *name, mospt_type *out)
{
    for (int i = 0; i < MOSPT_TYPE_COUNT; i++) {
        if (strcmp(types[i].name, name) != 0) continue;
        *out = (mospt_type)i;
        return true;
    }
    return false;
}

/* Bits that an integer type needs to be held exactly: f32 has 24 of them, f64 has 53. */
static unsigned value_bits(mospt_type t)
{
    if (t == MOSPT_F32) return 24;
    if (t == MOSPT_F64) return 53;
    return (unsigned)types[t].size * 8;
}

mospt_type mospt_type_common(mospt_type a, mospt_type b)
{
    if (a == b) return a;
    if (types[a].is_float || types[b].is_float) {
        bool fits = value_bits(a) <= 24 && value_bits(b) <= 24;
        return fits ? MOSPT_F32 : MOSPT_F64;
    }
    if (types[a].is_signed == types[b].is_signed) return types[a].size > types[b].size ? a : b;
    mospt_type with_sign = types[a].is_signed ? a : b, without = types[a].is_signed ? b : a;
    if (types[with_sign].size > types[without].size) return with_sign;
    switch (types[without].size) {
    case 1:
        return MOSPT_I16;
    case 2:
        return MOSPT_I32;
    case 4:
        return MOSPT_I64;
    default:
        return MOSPT_F64;
    }
}

double mospt_type_read(mospt_type type, const void *value)
{
    union {
        uint8_t u8;
        int8_t i8;
        uint16_t u16;
        int16_t i16;
        uint32_t u32;
        int32_t i32;
        uint64_t u64;
        int64_t i64;
        float f32;
        double f64;
    } v;
    memcpy(&v, value, types[type].size);
    switch (type) {
    case MOSPT_U8:
        return v.u8;
    case MOSPT_I8:
        return v.i8;
    case MOSPT_U16:
        return v.u16;
    case MOSPT_I16:
        return v.i16;
    case MOSPT_U32:
        return v.u32;
    case MOSPT_I32:
        return v.i32;
    case MOSPT_U64:
        return (double)v.u64;
    case MOSPT_I64:
        return (double)v.i64;
    case MOSPT_F32:
        return (double)v.f32;
    default:
        return v.f64;
    }
}

/* `high` is exclusive where the type's largest value is not a double. NaN becomes 0. */
static double clamp_round(double value, double low, double high)
{
    if (!(value > low)) return value <= low ? low : 0;
    return value < high ? nearbyint(value) : high;
}

void mospt_type_write(mospt_type type, double value, void *out)
{
    switch (type) {
    case MOSPT_U8:
        *(uint8_t *)out = (uint8_t)clamp_round(value, 0, UINT8_MAX);
        return;
    case MOSPT_I8:
        *(int8_t *)out = (int8_t)clamp_round(value, INT8_MIN, INT8_MAX);
        return;
    case MOSPT_U16:
        memcpy(out, &(uint16_t){(uint16_t)clamp_round(value, 0, UINT16_MAX)}, 2);
        return;
    case MOSPT_I16:
        memcpy(out, &(int16_t){(int16_t)clamp_round(value, INT16_MIN, INT16_MAX)}, 2);
        return;
    case MOSPT_U32:
        memcpy(out, &(uint32_t){(uint32_t)clamp_round(value, 0, UINT32_MAX)}, 4);
        return;
    case MOSPT_I32:
        memcpy(out, &(int32_t){(int32_t)clamp_round(value, INT32_MIN, INT32_MAX)}, 4);
        return;
    case MOSPT_U64: {
        uint64_t v = value >= 0x1p64 ? UINT64_MAX : (uint64_t)clamp_round(value, 0, 0x1p64);
        memcpy(out, &v, 8);
        return;
    }
    case MOSPT_I64: {
        int64_t v = value >= 0x1p63 ? INT64_MAX : (int64_t)clamp_round(value, -0x1p63, 0x1p63);
        memcpy(out, &v, 8);
        return;
    }
    case MOSPT_F32:
        memcpy(out, &(float){(float)value}, 4);
        return;
    default:
        memcpy(out, &value, 8);
        return;
    }
}

int mospt_schema_find(const mospt_schema *schema, const char *name)
{
    for (uint32_t i = 0; i < schema->count; i++)
        if (strcmp(schema->at[i].name, name) == 0) return (int)i;
    return -1;
}

static void lay_out(mospt_schema *schema)
{
    schema->row_size = schema->stored_size = 0;
    for (uint32_t i = 0; i < schema->count; i++) {
        mospt_attribute *a = &schema->at[i];
        uint32_t size = (uint32_t)mospt_attribute_size(a);
        a->offset = schema->row_size;
        a->stored_offset = schema->stored_size;
        schema->row_size += size;
        schema->stored_size += a->storage == MOSPT_IN_PLANE ? size : 0;
    }
}

static bool row_is_too_wide(const char *name, mospt_err *err)
{
    return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                         "more than %d bytes of attributes per point, the first one too many is %s",
                         MOSPT_ROW_SIZE_MAX, name);
}

bool mospt_schema_add(mospt_schema *schema, const char *name, mospt_type type, uint32_t components,
                      mospt_err *err)
{
    int found = mospt_schema_find(schema, name);
    if (found >= 0) {
        mospt_attribute *a = &schema->at[found];
        if (a->components != components)
            return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                                 "attribute %s has %u values per point here and %u elsewhere", name,
                                 components, a->components);
        mospt_type common = mospt_type_common(a->type, type);
        size_t wider = (mospt_type_size(common) - mospt_type_size(a->type)) * components;
        if (schema->row_size + wider > MOSPT_ROW_SIZE_MAX) return row_is_too_wide(name, err);
        a->type = common;
    } else {
        if (schema->count == MOSPT_ATTRIBUTES_MAX)
            return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                                 "more than %d attributes, the first one too many is %s",
                                 MOSPT_ATTRIBUTES_MAX, name);
        if (components < 1 || components > 255)
            return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                                 "attribute %s has %u values per point, 1 to 255 are possible",
                                 name, components);
        if (schema->row_size + mospt_type_size(type) * components > MOSPT_ROW_SIZE_MAX)
            return row_is_too_wide(name, err);
        mospt_attribute *a = &schema->at[schema->count++];
        *a = (mospt_attribute){.type = type, .components = components};
        snprintf(a->name, sizeof a->name, "%s", name);
    }
    lay_out(schema);
    return true;
}

bool mospt_attribute_can_be(const mospt_attribute *a, mospt_storage storage)
{
    if (storage == MOSPT_CONSTANT) return mospt_attribute_size(a) <= MOSPT_CONSTANT_SIZE_MAX;
    return storage == MOSPT_IN_PLANE || (a->type == MOSPT_U16 && a->components == 3);
}

void mospt_schema_keep(mospt_schema *schema, uint32_t attribute, mospt_storage storage,
                       const uint8_t *constant)
{
    mospt_attribute *a = &schema->at[attribute];
    assert(mospt_attribute_can_be(a, storage));
    a->storage = storage;
    if (storage == MOSPT_CONSTANT) memcpy(a->constant, constant, mospt_attribute_size(a));
    lay_out(schema);
}
