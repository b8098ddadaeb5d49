/* mospt/schema.h - which attributes every point of a scan or a dataset carries besides position and
 * display colour.
 *
 * Names are those of the field: intensity, rgb (raw 16-bit colour), classification, return_number,
 * number_of_returns, flags, scan_angle, user_data, point_source, gps_time, nir, normal, scan (index
 * into the dataset's sources); anything else keeps the name that its file gives it. */
#pragma once
#include "mospt/err.h"

enum {
    MOSPT_ATTRIBUTES_MAX = 64,
    MOSPT_ATTRIBUTE_NAME_MAX = 48,
    MOSPT_ROW_SIZE_MAX = 16384,
    MOSPT_CONSTANT_SIZE_MAX = 8,
};

typedef enum {
    MOSPT_U8,
    MOSPT_I8,
    MOSPT_U16,
    MOSPT_I16,
    MOSPT_U32,
    MOSPT_I32,
    MOSPT_U64,
    MOSPT_I64,
    MOSPT_F32,
    MOSPT_F64,
    MOSPT_TYPE_COUNT,
} mospt_type;

/* How the payloads of a dataset keep an attribute. */
typedef enum {
    MOSPT_IN_PLANE,  /* of each point */
    MOSPT_CONSTANT,  /* not at all: all points have the same */
    MOSPT_OF_COLOUR, /* not at all: three u16, of which each is its display colour times 257, so
                        that both bytes are that */
} mospt_storage;

typedef struct {
    char name[MOSPT_ATTRIBUTE_NAME_MAX];
    mospt_type type;
    uint32_t components; /* 1 to 255 values of `type` per point */
    uint32_t offset;     /* bytes from the start of a row; rows are packed, nothing is aligned */
    mospt_storage storage;
    uint32_t stored_offset; /* with MOSPT_IN_PLANE: bytes of a point in the planes before it */
    uint8_t constant[MOSPT_CONSTANT_SIZE_MAX]; /* with MOSPT_CONSTANT: as in a row */
} mospt_attribute;

typedef struct {
    uint32_t count;
    uint32_t row_size;    /* bytes of one point's attributes */
    uint32_t stored_size; /* of these, bytes in planes */
    mospt_attribute at[MOSPT_ATTRIBUTES_MAX];
} mospt_schema;

size_t mospt_type_size(mospt_type type);
const char *mospt_type_name(mospt_type type); /* "u8" ... "f64" */
bool mospt_type_from_name(const char *name, mospt_type *out);

/* The narrowest type that holds every value of both, as far as any does (u64 and i64 meet in f64).
 */
mospt_type mospt_type_common(mospt_type a, mospt_type b);

/* Value of one component at `value`, whatever its type. */
double mospt_type_read(mospt_type type, const void *value);

/* Writes `value` at `out`, clamped to the range of an integer type, rounded to nearest. */
void mospt_type_write(mospt_type type, double value, void *out);

static inline size_t mospt_attribute_size(const mospt_attribute *a)
{
    return mospt_type_size(a->type) * a->components;
}

/* Index of an attribute by name, -1 if there is none. */
int mospt_schema_find(const mospt_schema *schema, const char *name);

/* Appends an attribute, or widens the type of the one that has this name already.
 * errors   MOSPT_EINVAL: too many attributes, or bytes in a row, or the same name with another
 * number of components */
bool mospt_schema_add(mospt_schema *schema, const char *name, mospt_type type, uint32_t components,
                      mospt_err *err);

/* True if an attribute is one that may be kept so. */
bool mospt_attribute_can_be(const mospt_attribute *a, mospt_storage storage);

/* Says how an attribute is kept, which can be so.
 * constant [size of the attribute], as in a row; only for MOSPT_CONSTANT */
void mospt_schema_keep(mospt_schema *schema, uint32_t attribute, mospt_storage storage,
                       const uint8_t *constant);
