#include "mospt/survey.h"

#include "mospt/payload.h"

#include <math.h>
#include <stdlib.h>

enum { OCTANTS = 8, COMPONENTS = 3 };

static int compare_counts(const void *a, const void *b)
{
    uint32_t m = *(const uint32_t *)a, n = *(const uint32_t *)b;
    return m < n ? -1 : m > n;
}

bool mospt_survey_tree(const mospt_dataset *d, mospt_tree_figures *out, mospt_err *err)
{
    const mospt_hierarchy *h = &d->hierarchy;
    mospt_tree_figures f = {.nodes = h->count};
    uint64_t parents = 0, cells_above = 0, cells_below = 0;
    uint32_t *counts = malloc(h->count * sizeof *counts);
    if (counts == NULL) return mospt_err_nomem(err, h->count * sizeof *counts);
    for (uint32_t i = 0; i < h->count; i++) {
        const mospt_node *n = &h->nodes[i];
        counts[i] = n->count;
        if (n->child_count > 0) parents++;
        if (n->count > n->level_end[h->inner_depth]) f.added++;
        if (n->level + 1u > f.levels) f.levels = n->level + 1u;
        for (uint32_t l = 0; l < h->inner_depth; l++)
            cells_above += n->level_end[l], cells_below += n->level_end[l + 1];
    }
    qsort(counts, h->count, sizeof *counts, compare_counts);
    f.leaves = h->count - (uint32_t)parents;
    f.points_min = counts[0];
    f.points_median = counts[h->count / 2];
    f.points_max = counts[h->count - 1];
    f.points_mean = (double)h->point_count / h->count;
    f.branching = parents > 0 ? (double)(h->count - 1) / (double)parents : 0;
    f.cell_branching = cells_above > 0 ? (double)cells_below / (double)cells_above : 0;
    free(counts);
    *out = f;
    return true;
}

typedef struct {
    uint32_t at[3];
} place;

typedef struct {
    const mospt_dataset *dataset;
    mospt_point_figures *points;
    mospt_spt_figures *spt;
    /* Sums of grid coordinates relative to the root are below 2^32 times 2^64. */
    unsigned __int128 sum[3];
    uint32_t low[3], high[3];
    double rgb[3];
    uint64_t rgb_count;
    double attribute_sum[MOSPT_ATTRIBUTES_MAX][COMPONENTS];
} surveyor;

static void add_attributes(surveyor *s, uint32_t count, const uint8_t *planes)
{
    const mospt_schema *schema = &s->dataset->metadata.schema;
    for (uint32_t k = 0; k < schema->count; k++) {
        const mospt_attribute *a = &schema->at[k];
        const uint8_t *plane = planes + (size_t)count * a->offset;
        size_t size = mospt_attribute_size(a), component_size = mospt_type_size(a->type);
        for (uint32_t c = 0; c < a->components && c < COMPONENTS; c++)
            for (uint32_t i = 0; i < count; i++) {
                double v = mospt_type_read(a->type, plane + i * size + c * component_size);
                s->points->attribute_min[k][c] = fmin(s->points->attribute_min[k][c], v);
                s->points->attribute_max[k][c] = fmax(s->points->attribute_max[k][c], v);
                s->attribute_sum[k][c] += v;
            }
    }
}

static void add_colours(surveyor *s, uint32_t count, const mospt_vertex *v, const uint8_t *planes)
{
    const mospt_metadata *m = &s->dataset->metadata;
    int k = mospt_schema_find(&m->schema, "scan");
    if (k < 0) return;
    const mospt_attribute *a = &m->schema.at[k];
    const uint8_t *plane = planes + (size_t)count * a->offset;
    size_t size = mospt_type_size(a->type);
    for (uint32_t i = 0; i < count; i++) {
        double scan = mospt_type_read(a->type, plane + i * size);
        if (scan >= m->source_count || !m->sources[(uint32_t)scan].has_rgb) continue;
        s->rgb[0] += v[i].r, s->rgb[1] += v[i].g, s->rgb[2] += v[i].b;
        s->rgb_count++;
    }
}

static void add_places(surveyor *s, uint32_t count, const mospt_vertex *v)
{
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t g[3] = {v[i].x, v[i].y, v[i].z};
        for (int a = 0; a < 3; a++) {
            s->sum[a] += g[a];
            if (g[a] < s->low[a]) s->low[a] = g[a];
            if (g[a] > s->high[a]) s->high[a] = g[a];
        }
    }
}

/* Radix sort of codes of at most 27 bits. */
static void sort_codes(uint32_t *codes, uint32_t *spare, size_t count)
{
    for (uint32_t shift = 0; shift < 27; shift += 9) {
        size_t place_of[512] = {0};
        for (size_t i = 0; i < count; i++)
            place_of[codes[i] >> shift & 511]++;
        for (size_t v = 0, at = 0; v < 512; v++) {
            size_t n = place_of[v];
            place_of[v] = at;
            at += n;
        }
        for (size_t i = 0; i < count; i++)
            spare[place_of[codes[i] >> shift & 511]++] = codes[i];
        uint32_t *swap = codes;
        codes = spare, spare = swap;
    }
    memcpy(spare, codes, count * sizeof *codes); /* three turns end in the other array */
}

/* Cells from depth 1 to the one above the finest that hold at least two of the points, all of one
 * octant. */
static bool count_interior(surveyor *s, const uint32_t corner_bits, const place *places,
                           size_t count, mospt_err *err)
{
    uint32_t depth = s->dataset->hierarchy.inner_depth;
    uint32_t *codes = malloc(2 * count * sizeof *codes + 1);
    if (codes == NULL) return mospt_err_nomem(err, 2 * count * sizeof *codes);
    for (size_t i = 0; i < count; i++)
        codes[i] = (uint32_t)mospt_cell_code(places[i].at[0], places[i].at[1], places[i].at[2],
                                             corner_bits, depth);
    sort_codes(codes, codes + count, count);
    for (uint32_t d = 1; d < depth; d++) {
        uint32_t shift = 3 * (depth - d);
        for (size_t a = 0, b; a < count; a = b) {
            for (b = a + 1; b < count && codes[b] >> shift == codes[a] >> shift;)
                b++;
            if (b - a > 1) s->spt->interior++;
        }
    }
    free(codes);
    return true;
}

/* Visits a node with all points of its ancestors that lie in it. */
static bool visit(surveyor *s, uint32_t node, const place *above, size_t above_count,
                  mospt_err *err);

static bool visit_octants(surveyor *s, uint32_t node, const place *places, size_t count,
                          mospt_err *err)
{
    const mospt_hierarchy *h = &s->dataset->hierarchy;
    uint32_t bits = mospt_cell_bits(&s->dataset->metadata.grid, h->nodes[node].level);
    bool ok = true;
    if (count > 1) s->spt->interior++;
    for (uint32_t o = 0; ok && o < OCTANTS; o++) {
        place *inside = malloc(count * sizeof *inside + 1);
        size_t n = 0;
        if (inside == NULL) return mospt_err_nomem(err, count * sizeof *inside);
        for (size_t i = 0; i < count; i++)
            if (mospt_cell_code(places[i].at[0], places[i].at[1], places[i].at[2], bits, 1) == o)
                inside[n++] = places[i];
        place *shrunk = realloc(inside, n * sizeof *inside + 1);
        if (shrunk != NULL) inside = shrunk;
        uint32_t child = mospt_hierarchy_child(h, node, o);
        ok = child != MOSPT_NO_NODE ? visit(s, child, inside, n, err)
                                    : count_interior(s, bits, inside, n, err);
        free(inside);
    }
    return ok;
}

static bool visit(surveyor *s, uint32_t node, const place *above, size_t above_count,
                  mospt_err *err)
{
    const mospt_dataset *d = s->dataset;
    uint32_t count = d->hierarchy.nodes[node].count;
    size_t vertices_size = mospt_dataset_vertices_size(d, node),
           row_size = d->metadata.schema.row_size;
    bool ok = false;
    mospt_vertex *v = malloc(vertices_size);
    uint8_t *planes = malloc(count * row_size + 1);
    place *places = malloc((above_count + count) * sizeof *places);
    if (v == NULL || planes == NULL || places == NULL) {
        mospt_err_nomem(err, vertices_size + count * row_size);
        goto done;
    }
    if (!mospt_dataset_read_vertices(d, node, v, err)) goto done;
    if (s->points != NULL) {
        if (!mospt_dataset_read_attributes(d, node, v, planes, err)) goto done;
        add_attributes(s, count, planes);
        add_colours(s, count, v, planes);
    }
    add_places(s, count, v);
    if (above_count > 0) memcpy(places, above, above_count * sizeof *places);
    for (uint32_t i = 0; i < count; i++)
        places[above_count + i] = (place){{v[i].x, v[i].y, v[i].z}};
    free(v), free(planes);
    v = NULL, planes = NULL;
    ok = visit_octants(s, node, places, above_count + count, err);
done:
    free(v), free(planes), free(places);
    return ok;
}

static void finish_points(surveyor *s)
{
    const mospt_metadata *m = &s->dataset->metadata;
    mospt_point_figures *f = s->points;
    double n = (double)m->point_count;
    for (int a = 0; a < 3; a++) {
        uint64_t whole = (uint64_t)(s->sum[a] / m->point_count);
        double rest = (double)(uint64_t)(s->sum[a] % m->point_count) / n;
        f->low[a] = mospt_grid_axis_to_world(&m->grid, a, s->low[a]);
        f->high[a] = mospt_grid_axis_to_world(&m->grid, a, s->high[a]);
        f->mean[a] = mospt_grid_axis_to_world(&m->grid, a, (uint32_t)whole) + rest * m->grid.step;
        f->mean_rgb[a] = s->rgb_count > 0 ? s->rgb[a] / (double)s->rgb_count : 0;
    }
    f->has_rgb = s->rgb_count > 0;
    for (uint32_t k = 0; k < m->schema.count; k++)
        for (int c = 0; c < COMPONENTS; c++)
            f->attribute_mean[k][c] = s->attribute_sum[k][c] / n;
}

bool mospt_survey_points(const mospt_dataset *d, mospt_point_figures *points,
                         mospt_spt_figures *spt, mospt_err *err)
{
    mospt_spt_figures unused = {0}, *figures = spt != NULL ? spt : &unused;
    surveyor s = {.dataset = d,
                  .points = points,
                  .spt = figures,
                  .low = {UINT32_MAX, UINT32_MAX, UINT32_MAX}};
    *figures = (mospt_spt_figures){.points = d->metadata.point_count};
    if (points != NULL) {
        *points = (mospt_point_figures){0};
        for (uint32_t k = 0; k < MOSPT_ATTRIBUTES_MAX; k++)
            for (int c = 0; c < COMPONENTS; c++)
                points->attribute_min[k][c] = INFINITY, points->attribute_max[k][c] = -INFINITY;
    }
    if (!visit(&s, 0, NULL, 0, err)) return false;
    if (points != NULL) finish_points(&s);
    figures->classic_bytes = (figures->points + figures->interior) * MOSPT_SPT_POINT_SIZE;
    figures->mospt_bytes = figures->points * sizeof(mospt_vertex);
    figures->branching =
        figures->interior > 0 ? 1 + (double)figures->points / (double)figures->interior : 0;
    return true;
}
