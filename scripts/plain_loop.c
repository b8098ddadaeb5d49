#include "scripts/plain_loop.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

enum { BLOCK = 64, THREADS_MAX = 256 };

typedef struct {
    plain_loop *loop;
    uint64_t *pixels; /* [width * height + 1] */
    const mospt_vertex *vertices;
    uint32_t count;
} part;

struct plain_loop {
    uint32_t width, height, threads;
    rend_frame frame;
    part parts[THREADS_MAX];
};

static size_t size_of(const plain_loop *loop)
{
    return ((size_t)loop->width * loop->height + 1) * sizeof(uint64_t);
}

plain_loop *plain_loop_create(uint32_t width, uint32_t height, uint32_t threads)
{
    plain_loop *loop = calloc(1, sizeof *loop);
    if (loop == NULL) return NULL;
    long processors = sysconf(_SC_NPROCESSORS_ONLN);
    *loop = (plain_loop){.width = width, .height = height, .threads = threads};
    if (threads == 0) loop->threads = (uint32_t)processors;
    if (loop->threads > THREADS_MAX) loop->threads = THREADS_MAX;
    for (uint32_t t = 0; t < loop->threads; t++) {
        void *pixels =
            mmap(NULL, size_of(loop), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (pixels == MAP_FAILED) return plain_loop_destroy(loop), NULL;
        madvise(pixels, size_of(loop), MADV_HUGEPAGE);
        loop->parts[t] = (part){.loop = loop, .pixels = pixels};
    }
    return loop;
}

void plain_loop_destroy(plain_loop *loop)
{
    for (uint32_t t = 0; loop != NULL && t < loop->threads; t++)
        if (loop->parts[t].pixels != NULL) munmap(loop->parts[t].pixels, size_of(loop));
    free(loop);
}

#ifdef __x86_64__
__attribute__((target_clones("avx512f", "avx2", "default")))
#endif
static void
draw_block(const rend_frame *f, const mospt_vertex *restrict v, float width, float height,
           uint32_t nowhere, uint64_t *restrict pixels)
{
    const float *m = f->rotation;
    float sx = 0.5f * width / f->tan_half[0], sy = 0.5f * height / f->tan_half[1];
    uint32_t at[BLOCK];
    uint64_t keys[BLOCK];
    for (int i = 0; i < BLOCK; i++) {
        float x = (float)(int32_t)(v[i].x - f->anchor[0]) + f->offset[0];
        float y = (float)(int32_t)(v[i].y - f->anchor[1]) + f->offset[1];
        float z = (float)(int32_t)(v[i].z - f->anchor[2]) + f->offset[2];
        float w = -(m[2] * x + m[5] * y + m[8] * z), each = 1 / w;
        float px = (m[0] * x + m[3] * y + m[6] * z) * sx * each + 0.5f * width;
        float py = 0.5f * height - (m[1] * x + m[4] * y + m[7] * z) * sy * each;
        bool shown = w >= f->near_w && px >= 0 && px < width && py >= 0 && py < height;
        uint32_t bits, colour;
        memcpy(&bits, &w, sizeof bits);
        memcpy(&colour, &v[i].r, sizeof colour);
        int32_t pixel = (int32_t)py * (int32_t)width + (int32_t)px;
        at[i] = shown ? (uint32_t)pixel : nowhere;
        keys[i] = (uint64_t)bits << 32 | colour;
    }
    for (int i = 0; i < BLOCK; i++)
        if (keys[i] < pixels[at[i]]) pixels[at[i]] = keys[i];
}

static void *draw_part(void *argument)
{
    part *p = argument;
    const plain_loop *loop = p->loop;
    uint32_t i = 0, nowhere = loop->width * loop->height;
    float width = (float)loop->width, height = (float)loop->height;
    memset(p->pixels, 0xff, size_of(loop));
    for (; i + BLOCK <= p->count; i += BLOCK)
        draw_block(&loop->frame, p->vertices + i, width, height, nowhere, p->pixels);
    mospt_vertex last[BLOCK];
    for (uint32_t k = 0; i < p->count && k < BLOCK; k++)
        last[k] = p->vertices[i + k < p->count ? i + k : i];
    if (i < p->count) draw_block(&loop->frame, last, width, height, nowhere, p->pixels);
    return NULL;
}

void plain_loop_draw(plain_loop *loop, const rend_frame *frame, const mospt_vertex *vertices,
                     uint32_t count)
{
    pthread_t threads[THREADS_MAX];
    bool made[THREADS_MAX] = {false};
    uint32_t share = count / loop->threads;
    loop->frame = *frame;
    for (uint32_t t = 0; t < loop->threads; t++) {
        part *p = &loop->parts[t];
        p->vertices = vertices + (size_t)t * share;
        p->count = t + 1 < loop->threads ? share : count - t * share;
        made[t] = t > 0 && pthread_create(&threads[t], NULL, draw_part, p) == 0;
        if (t > 0 && !made[t]) draw_part(p);
    }
    draw_part(&loop->parts[0]);
    for (uint32_t t = 1; t < loop->threads; t++)
        if (made[t]) pthread_join(threads[t], NULL);
}

float plain_loop_distance(const plain_loop *loop, uint32_t x, uint32_t y)
{
    uint64_t nearest = UINT64_MAX;
    for (uint32_t t = 0; t < loop->threads; t++) {
        uint64_t key = loop->parts[t].pixels[(size_t)y * loop->width + x];
        if (key < nearest) nearest = key;
    }
    uint32_t bits = (uint32_t)(nearest >> 32);
    float w;
    memcpy(&w, &bits, sizeof w);
    return nearest == UINT64_MAX ? INFINITY : w;
}
