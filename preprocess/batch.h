/* preprocess/batch.h - a few thousand points on their way from a scan reader to the builder. */
#pragma once
#include "mospt/schema.h"

enum { PREP_BATCH_CAPACITY = 65536 };

/* Where points are written, in planes as those of a batch. */
typedef struct {
    double *xyz; /* [count][3]; NULL: not wanted */
    uint8_t *rgbi;
    uint8_t *plane[MOSPT_ATTRIBUTES_MAX]; /* one per attribute of the scan; NULL: not wanted */
} prep_places;

/* Takes `count` records of a file apart.
 * layout   of the format's own type
 * threads  any */
typedef void prep_unpack(const void *layout, const uint8_t *records, uint32_t count,
                         const prep_places *to);

/* Points as they stand in their file, for whoever takes them apart on many threads where they are
 * needed, instead of on the one that reads. */
typedef struct {
    prep_unpack *unpack; /* NULL: the batch holds its points in planes */
    uint8_t *records;    /* [capacity of the batch][stride], owned, of prep_pages_take() */
    size_t size, stride; /* bytes that are taken, bytes of a record */
    void *layout;        /* owned */
    bool has_lattice; /* records begin with x, y, z as int32, little endian; x * scale + offset is
                         a world coordinate */
    double scale[3], offset[3];
} prep_packed;

typedef struct {
    uint32_t capacity, count;
    bool takes_packed; /* whoever uses the batch can unpack it */
    prep_packed packed;
    double *xyz;   /* [capacity][3], owned, metres, world coordinates */
    uint8_t *rgbi; /* [capacity][4], owned, display colour and intensity; without colour r = g = b =
                      i, without both 255 */
    uint8_t *plane[MOSPT_ATTRIBUTES_MAX];    /* owned, one per attribute of the scan:
                                                [capacity][components] of its type */
    size_t plane_size[MOSPT_ATTRIBUTES_MAX]; /* bytes of one point in that plane */
    uint32_t plane_count;
} prep_batch;

enum { PREP_BATCH_XYZ_SIZE = 3 * sizeof(double), PREP_BATCH_RGBI_SIZE = 4 };

/* Bytes of a point in all planes of a batch. */
size_t prep_batch_point_size(const mospt_schema *schema);

/* Allocates a batch for points with the attributes of `schema`. */
bool prep_batch_init(prep_batch *batch, const mospt_schema *schema, uint32_t capacity,
                     mospt_err *err);
void prep_batch_fini(prep_batch *batch);

/* True if points with these attributes fit the planes of the batch. */
bool prep_batch_suits(const prep_batch *batch, const mospt_schema *schema);

/* The places behind the points that a batch holds. */
prep_places prep_batch_places(const prep_batch *batch);

/* Makes room for packed records, and remembers how they are unpacked; `packed` is filled but for
 * `records`.
 * errors   MOSPT_ENOMEM */
bool prep_batch_take_packed(prep_batch *batch, prep_unpack *unpack, size_t stride,
                            const void *layout, size_t layout_size, mospt_err *err);

/* Removes the points for which keep[i] is 0, in place; the others keep their order. */
void prep_batch_compact(prep_batch *batch, const uint8_t *keep);
