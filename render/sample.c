#include "render/sample.h"

#include <math.h>
#include <stdlib.h>

typedef struct {
    mospt_vertex *vertices; /* owned; NULL: damaged */
    uint8_t *planes;        /* owned */
} block;

struct rend_sample {
    const mospt_dataset *dataset;
    block *blocks; /* [count] of the nodes 0 to count - 1, owned */
    uint32_t count;
    uint64_t point_count;
};

static uint32_t count_nodes(const mospt_hierarchy *h)
{
    uint64_t points = 0;
    uint32_t level_start = 0;
    for (uint32_t n = 0; n < h->count; n++) {
        if (h->nodes[n].level != h->nodes[level_start].level) level_start = n;
        points += h->nodes[n].count;
        if (level_start > 0 && points > REND_SAMPLE_POINTS) return level_start;
    }
    return h->count;
}

static bool read_block(const mospt_dataset *d, uint32_t node, block *out, mospt_err *err)
{
    size_t size = mospt_dataset_vertices_size(d, node),
           planes_size = (size_t)d->hierarchy.nodes[node].count * d->metadata.schema.row_size;
    block b = {malloc(size + 1), malloc(planes_size + 1)};
    if (b.vertices == NULL || b.planes == NULL) {
        free(b.vertices);
        free(b.planes);
        return mospt_err_nomem(err, size + planes_size);
    }
    if (!mospt_dataset_read_vertices(d, node, b.vertices, NULL) ||
        !mospt_dataset_read_attributes(d, node, b.vertices, b.planes, NULL)) {
        free(b.vertices);
        free(b.planes);
        b = (block){0};
    }
    *out = b;
    return true;
}

bool rend_sample_read(const mospt_dataset *dataset, rend_sample **out, mospt_err *err)
{
    uint32_t wanted = count_nodes(&dataset->hierarchy);
    rend_sample *s = calloc(1, sizeof *s);
    if (s == NULL) return mospt_err_nomem(err, sizeof *s);
    s->dataset = dataset;
    s->blocks = calloc((size_t)wanted + 1, sizeof *s->blocks);
    bool ok = s->blocks != NULL || mospt_err_nomem(err, wanted * sizeof *s->blocks);
    for (; ok && s->count < wanted; s->count++) {
        ok = read_block(dataset, s->count, &s->blocks[s->count], err);
        if (s->blocks[s->count].vertices != NULL)
            s->point_count += dataset->hierarchy.nodes[s->count].count;
    }
    if (ok) *out = s;
    else rend_sample_destroy(s);
    return ok;
}

void rend_sample_destroy(rend_sample *sample)
{
    if (sample == NULL) return;
    for (uint32_t n = 0; n < sample->count; n++) {
        free(sample->blocks[n].vertices);
        free(sample->blocks[n].planes);
    }
    free(sample->blocks);
    free(sample);
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

bool rend_sample_values(const rend_sample *sample, const rend_paint *paint, rend_values *out,
                        mospt_err *err)
{
    rend_values values = {.at = malloc((sample->point_count + 1) * sizeof *values.at)};
    if (values.at == NULL) return mospt_err_nomem(err, sample->point_count * sizeof *values.at);
    for (uint32_t n = 0; n < sample->count; n++) {
        const block *b = &sample->blocks[n];
        for (uint32_t i = 0; b->vertices != NULL && i < sample->dataset->hierarchy.nodes[n].count;
             i++) {
            double value = rend_paint_value(paint, n, b->vertices, b->planes, i);
            if (!isfinite(value)) values.some_missing = true;
            else values.at[values.count++] = value;
        }
    }
    qsort(values.at, values.count, sizeof *values.at, compare);
    *out = values;
    return true;
}
