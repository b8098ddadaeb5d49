#include "preprocess/batch.h"

#include "preprocess/pages.h"

#include <stdlib.h>
#include <string.h>

size_t prep_batch_point_size(const mospt_schema *schema)
{
    return PREP_BATCH_XYZ_SIZE + PREP_BATCH_RGBI_SIZE + schema->row_size;
}

bool prep_batch_init(prep_batch *batch, const mospt_schema *schema, uint32_t capacity,
                     mospt_err *err)
{
    prep_batch b = {.capacity = capacity, .plane_count = schema->count};
    bool ok = true;
    b.xyz = malloc((size_t)capacity * PREP_BATCH_XYZ_SIZE);
    b.rgbi = malloc((size_t)capacity * PREP_BATCH_RGBI_SIZE);
    ok = b.xyz != NULL && b.rgbi != NULL;
    for (uint32_t k = 0; k < schema->count; k++) {
        b.plane_size[k] = mospt_attribute_size(&schema->at[k]);
        b.plane[k] = malloc(capacity * b.plane_size[k]);
        ok = ok && b.plane[k] != NULL;
    }
    if (!ok) {
        prep_batch_fini(&b);
        return mospt_err_nomem(err, (size_t)capacity * prep_batch_point_size(schema));
    }
    *batch = b;
    return true;
}

void prep_batch_fini(prep_batch *batch)
{
    free(batch->xyz);
    free(batch->rgbi);
    for (uint32_t k = 0; k < batch->plane_count; k++)
        free(batch->plane[k]);
    prep_pages_give(batch->packed.records, batch->packed.size);
    free(batch->packed.layout);
    *batch = (prep_batch){0};
}

prep_places prep_batch_places(const prep_batch *batch)
{
    size_t first = batch->count;
    prep_places places = {.xyz = batch->xyz + 3 * first, .rgbi = batch->rgbi + 4 * first};
    for (uint32_t k = 0; k < batch->plane_count; k++)
        places.plane[k] = batch->plane[k] + first * batch->plane_size[k];
    return places;
}

static bool reserve_records(prep_packed *p, size_t wanted, mospt_err *err)
{
    if (p->size >= wanted) return true;
    prep_pages_give(p->records, p->size);
    p->records = prep_pages_take(wanted);
    p->size = p->records != NULL ? wanted : 0;
    return p->records != NULL || mospt_err_nomem(err, wanted);
}

bool prep_batch_take_packed(prep_batch *batch, prep_unpack *unpack, size_t stride,
                            const void *layout, size_t layout_size, mospt_err *err)
{
    prep_packed *p = &batch->packed;
    void *copy = realloc(p->layout, layout_size);
    if (copy == NULL) return mospt_err_nomem(err, layout_size);
    p->layout = copy;
    memcpy(copy, layout, layout_size);
    if (!reserve_records(p, batch->capacity * stride, err)) return false;
    p->stride = stride;
    p->unpack = unpack;
    p->has_lattice = false;
    return true;
}

void prep_batch_compact(prep_batch *batch, const uint8_t *keep)
{
    uint32_t out = 0;
    for (uint32_t i = 0; i < batch->count; i++) {
        if (!keep[i]) continue;
        if (out != i) {
            memcpy(batch->xyz + 3 * (size_t)out, batch->xyz + 3 * (size_t)i,
                   3 * sizeof *batch->xyz);
            memcpy(batch->rgbi + 4 * (size_t)out, batch->rgbi + 4 * (size_t)i, 4);
            for (uint32_t k = 0; k < batch->plane_count; k++) {
                size_t s = batch->plane_size[k];
                memcpy(batch->plane[k] + out * s, batch->plane[k] + i * s, s);
            }
        }
        out++;
    }
    batch->count = out;
}

bool prep_batch_suits(const prep_batch *batch, const mospt_schema *schema)
{
    if (batch->plane_count != schema->count) return false;
    for (uint32_t k = 0; k < schema->count; k++)
        if (batch->plane_size[k] != mospt_attribute_size(&schema->at[k])) return false;
    return true;
}
