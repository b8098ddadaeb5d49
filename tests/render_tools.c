#include "tests/render_tools.h"

#include "mospt/file.h"

#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

mospt_grid render_grid(uint32_t bits)
{
    mospt_grid grid = {
        .offset = {1000, -2000, 50}, .base = {7, -9, 11}, .step = 0x1p-10, .bits = bits};
    /* Not at zero: the upper bits are what the root cube may grow into. */
    for (int a = 0; a < 3; a++)
        grid.root[a] = bits < 31 ? UINT32_C(1) << (bits + (a == 1)) : 0;
    if (bits == 31) grid.root[0] = UINT32_C(1) << 31;
    return grid;
}

static void fill_node(mospt_node *n, uint32_t inner_depth, uint64_t *state)
{
    uint32_t end = 1;
    for (uint32_t level = 0; level < inner_depth + 2; level++) {
        n->level_end[level] = end;
        end += core_below(state, 3 * end + 1);
        if (end > 5000) end = 5000;
    }
    n->count = n->level_end[inner_depth + 1];
    n->parent = n->first_child = MOSPT_NO_NODE;
}

void render_tree_make(const mospt_grid *grid, uint32_t inner_depth, uint32_t most, uint64_t seed,
                      mospt_hierarchy *out)
{
    uint64_t state = seed;
    mospt_err err = {0};
    mospt_hierarchy h = {.inner_depth = inner_depth, .refinement = MOSPT_REFINE_ADD};
    h.nodes = calloc((size_t)most + 8, sizeof *h.nodes);
    assert_non_null(h.nodes);
    for (int a = 0; a < 3; a++)
        h.nodes[0].corner[a] = grid->root[a];
    h.count = 1;
    for (uint32_t n = 0; n < h.count; n++) {
        mospt_node *node = &h.nodes[n];
        fill_node(node, inner_depth, &state);
        for (uint32_t o = 0; o < 8 && h.count < most && node->level < grid->bits; o++) {
            if (n > 0 && core_below(&state, 100) < 60) continue;
            mospt_node *child = &h.nodes[h.count++];
            child->level = (uint16_t)(node->level + 1);
            mospt_cell_child(grid, node->corner, node->level, o, child->corner);
            node->child_mask = (uint8_t)(node->child_mask | 1u << o);
            node->child_count++;
        }
        h.point_count += node->count;
    }
    CORE_NEED(mospt_hierarchy_link(&h, grid, &err));
    *out = h;
}

rend_camera render_camera_random(const mospt_grid *grid, uint64_t *state)
{
    rend_camera c = {.fov_rad = 0.3 + 1.2 * core_unit(state), .up = {0, 0, 1}};
    double width = ldexp(grid->step, (int)grid->bits), far = core_below(state, 3) == 0 ? 4 : 1;
    for (int a = 0; a < 3; a++) {
        double low = mospt_grid_axis_to_world(grid, a, grid->root[a]);
        c.eye[a] = low + width * (0.5 + far * (1.5 * core_unit(state) - 0.75));
        c.target[a] = low + width * core_unit(state);
    }
    return c;
}

void render_frame_make(const rend_camera *camera, const mospt_grid *grid, rend_frame *out)
{
    uint32_t high[3];
    for (int a = 0; a < 3; a++)
        high[a] = (uint32_t)(grid->root[a] + (mospt_cell_width(grid, 0) - 1));
    rend_frame_make(camera, grid, grid->root, high, 640, 360, out);
}

/* Builds what is in `site`. */
static void build(render_site *site, uint32_t count)
{
    mospt_err err = {0};
    site->folder = core_folder_make();
    site->path = core_path(site->folder, "site.ipts");
    core_dataset_make(&site->site, 4, 50, site->path);
    CORE_NEED(mospt_dataset_open(site->path, &site->dataset, &err));
    assert_true(site->dataset->hierarchy.count > 4 || count < 1000);
}

void render_site_make(core_kind kind, uint32_t count, const int64_t shift[3], render_site *out)
{
    *out = (render_site){0};
    core_site_make(kind, 16, count, 7, &out->site);
    for (int a = 0; a < 3 && shift != NULL; a++)
        out->site.grid.base[a] += shift[a];
    build(out, count);
}

void render_more_make(uint32_t count, render_site *out)
{
    *out = (render_site){0};
    core_site_make(CORE_CLUSTERED, 16, 2 * count, 7, &out->site);
    for (uint32_t i = count; i < 2 * count; i++) {
        uint32_t x;
        uint8_t *record = out->site.records + i * out->site.stride;
        memcpy(&x, record, sizeof x);
        x |= UINT32_C(1) << 15;
        memcpy(record, &x, sizeof x);
    }
    build(out, 2 * count);
}

void render_marked_make(uint32_t count, render_site *out)
{
    mospt_err err = {0};
    core_site plain, *marked = &out->site;
    core_site_make(CORE_CLUSTERED, 16, count, 7, &plain);
    *out = (render_site){.site = {.grid = plain.grid, .count = count}};
    CORE_NEED(mospt_schema_add(&marked->schema, "scan", MOSPT_U16, 1, &err));
    CORE_NEED(mospt_schema_add(&marked->schema, "mark", MOSPT_U16, 1, &err));
    CORE_NEED(mospt_schema_add(&marked->schema, "tag", MOSPT_U32, 1, &err));
    marked->stride = mospt_record_size(&marked->schema);
    marked->records = calloc(count + 1, marked->stride);
    assert_non_null(marked->records);
    size_t tag = plain.stride - 4;
    for (uint32_t i = 0; i < count; i++) {
        const uint8_t *from = plain.records + i * plain.stride;
        uint8_t *to = marked->records + i * marked->stride;
        memcpy(to, from, tag);
        memcpy(to + tag, &(uint16_t){(uint16_t)(7 * i)}, 2);
        memcpy(to + tag + 2, from + tag, 4);
    }
    core_site_fini(&plain);
    build(out, count);
}

void render_rooms_make(uint32_t count, render_site *out)
{
    enum { ROOM = 1 << 13 };
    *out = (render_site){0};
    core_site_make(CORE_UNIFORM, 16, count, 7, &out->site);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t g[3], *axis = &g[i % 2]; /* of walls across x, and across y */
        uint8_t *record = out->site.records + i * out->site.stride;
        memcpy(g, record, sizeof g);
        *axis = *axis / ROOM * ROOM;
        g[2] = out->site.grid.root[2] + g[2] % ROOM;
        memcpy(record, g, sizeof g);
    }
    build(out, count);
}

void render_site_fini(render_site *site)
{
    mospt_dataset_close(site->dataset);
    core_site_fini(&site->site);
    free(site->path);
    core_folder_remove(site->folder);
}

void render_site_damage(const render_site *site, uint32_t node)
{
    const mospt_node *n = &site->dataset->hierarchy.nodes[node];
    char *path = mospt_file_join(site->path, site->dataset->metadata.files[n->payload_file].name);
    int fd = open(path, O_RDWR);
    uint8_t byte;
    assert_true(fd >= 0);
    assert_int_equal(pread(fd, &byte, 1, (off_t)n->payload_offset), 1);
    byte ^= 0x40;
    assert_int_equal(pwrite(fd, &byte, 1, (off_t)n->payload_offset), 1);
    close(fd);
    free(path);
}
