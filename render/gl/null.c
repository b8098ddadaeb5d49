/* A backend that draws nothing and forgets nothing: the arena is plain memory, and every vertex
 * drawn goes into a hash. */
#include "render/gl/driver.h"

#include "mospt/hash.h"

#include <stdlib.h>

typedef struct {
    rgl base;
    mospt_vertex *arena; /* [size], owned */
    uint64_t size;
    uint64_t room;
    float depth; /* of every pixel of a scene */
    uint64_t pixels;
    rgl_record record;
} null_rgl;

static void null_destroy(rgl *gl)
{
    free(((null_rgl *)gl)->arena);
    free(gl);
}

static const char *null_renderer(const rgl *gl)
{
    (void)gl;
    return "null";
}

static bool has_room(const null_rgl *n, uint64_t vertices, mospt_err *err)
{
    return vertices <= n->room ||
           mospt_err_set(err, MOSPT_ENOMEM, mospt_nowhere(), "the null backend is full");
}

static bool is_healthy(null_rgl *n, mospt_err *err)
{
    return !n->base.pretends || rgl_set_lost(&n->base, err);
}

static bool null_arena_create(rgl *gl, uint64_t vertex_count, mospt_err *err)
{
    null_rgl *n = (null_rgl *)gl;
    if (!is_healthy(n, err) || !has_room(n, vertex_count, err)) return false;
    mospt_vertex *arena = calloc(vertex_count + 1, sizeof *arena);
    if (arena == NULL) return mospt_err_nomem(err, vertex_count * sizeof *arena);
    free(n->arena);
    n->arena = arena, n->size = vertex_count;
    return true;
}

static bool null_arena_upload(rgl *gl, uint64_t first, const mospt_vertex *vertices, uint32_t count,
                              mospt_err *err)
{
    null_rgl *n = (null_rgl *)gl;
    if (!is_healthy(n, err) || !has_room(n, n->size, err)) return false;
    if (first > n->size || count > n->size - first) return n->record.overruns++, true;
    memcpy(n->arena + first, vertices, count * sizeof *vertices);
    n->record.points_uploaded += count;
    return true;
}

static uint64_t link_vertex(uint64_t before, const rgl_batch *batch, const mospt_vertex *vertex)
{
    struct {
        uint64_t before;
        mospt_vertex vertex;
        uint64_t shape;
    } link = {before, *vertex, (uint64_t)batch->shape};
    return mospt_hash(&link, sizeof link);
}

static void record_vertex(null_rgl *n, const rgl_batch *batch, const mospt_vertex *vertex)
{
    n->record.sequence_hash = link_vertex(n->record.sequence_hash, batch, vertex);
    n->record.picture_hash = link_vertex(n->record.picture_hash, batch, vertex);
    n->record.points_drawn++;
}

static bool is_inside(const rend_clip *clip, const mospt_vertex *v)
{
    const uint32_t at[3] = {v->x, v->y, v->z};
    bool inside = true;
    for (int a = 0; clip != NULL && a < 3; a++)
        inside = inside && at[a] >= clip->low[a] && at[a] <= clip->high[a];
    return inside;
}

static void record_vertex_again(null_rgl *n, const rgl_batch *batch, const mospt_vertex *vertex)
{
    n->record.again_hash = link_vertex(n->record.again_hash, batch, vertex);
    n->record.points_again++;
}

typedef void recorder(null_rgl *n, const rgl_batch *batch, const mospt_vertex *vertex);

static void record_batch(null_rgl *n, const rend_clip *clip, const rgl_batch *batch,
                         recorder *record)
{
    for (uint32_t r = 0; r < batch->range_count; r++) {
        uint64_t first = (uint64_t)batch->first[r], count = (uint64_t)batch->count[r];
        if (batch->first[r] < 0 || batch->count[r] < 0 || first + count > n->size) {
            n->record.overruns++;
            continue;
        }
        for (uint64_t v = 0; v < count; v++)
            if (is_inside(clip, &n->arena[first + v])) record(n, batch, &n->arena[first + v]);
    }
}

static bool null_draw(rgl *gl, const rgl_scene *scene, const rgl_batch *batches,
                      uint32_t batch_count, int parts, mospt_err *err)
{
    null_rgl *n = (null_rgl *)gl;
    if (!is_healthy(n, err)) return false;
    if (parts & RGL_BEGIN) {
        size_t size = 8 * sizeof *scene->octants * scene->octant_nodes;
        n->record.octants_hash = scene->octants != NULL ? mospt_hash(scene->octants, size) : 0;
        n->record.picture_hash = n->record.again_hash = 0;
        n->record.begins++;
        n->pixels = (uint64_t)scene->frame.width * scene->frame.height;
    }
    n->record.ends += (parts & RGL_END) != 0;
    for (uint32_t b = 0; b < batch_count; b++) {
        if (parts & RGL_AGAIN) record_batch(n, scene->clip, &batches[b], record_vertex_again);
        if (parts & RGL_AGAIN && !(parts & RGL_BEGIN)) continue;
        n->record.batches++;
        n->record.ranges += batches[b].range_count;
        record_batch(n, scene->clip, &batches[b], record_vertex);
    }
    return true;
}

static bool null_read_pixels(rgl *gl, bool from_window, uint32_t width, uint32_t height,
                             uint8_t *rgb, mospt_err *err)
{
    (void)from_window;
    memset(rgb, 0, (size_t)width * height * 3);
    return is_healthy((null_rgl *)gl, err);
}

static bool null_read_depth(rgl *gl, int x, int y, int radius, float *out, mospt_err *err)
{
    (void)x, (void)y;
    for (int i = 0; i < (2 * radius + 1) * (2 * radius + 1); i++)
        out[i] = ((null_rgl *)gl)->depth;
    return is_healthy((null_rgl *)gl, err);
}

static bool null_read_depths(rgl *gl, float *out, mospt_err *err)
{
    null_rgl *n = (null_rgl *)gl;
    for (uint64_t i = 0; i < n->pixels; i++)
        out[i] = n->depth;
    return is_healthy(n, err);
}

static bool null_restart(rgl *gl, mospt_err *err)
{
    (void)err;
    null_rgl *n = (null_rgl *)gl;
    free(n->arena);
    n->arena = NULL, n->size = 0;
    return true;
}

static const rgl_driver NULL_DRIVER = {
    .destroy = null_destroy,
    .renderer = null_renderer,
    .arena_create = null_arena_create,
    .arena_upload = null_arena_upload,
    .draw = null_draw,
    .read_pixels = null_read_pixels,
    .read_depth = null_read_depth,
    .read_depths = null_read_depths,
    .restart = null_restart,
};

bool rgl_null_create(rgl **out, mospt_err *err)
{
    null_rgl *n = calloc(1, sizeof *n);
    if (n == NULL) return mospt_err_nomem(err, sizeof *n);
    n->base.driver = &NULL_DRIVER;
    n->depth = 1;
    n->room = UINT64_MAX;
    *out = &n->base;
    return true;
}

rgl_record rgl_null_record(const rgl *gl)
{
    return ((const null_rgl *)gl)->record;
}

void rgl_null_set_depth(rgl *gl, float depth)
{
    ((null_rgl *)gl)->depth = depth;
}

void rgl_null_set_room(rgl *gl, uint64_t vertices)
{
    ((null_rgl *)gl)->room = vertices;
}
