#include "preprocess/spool.h"

#include "mospt/file.h"
#include "preprocess/pages.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <lz4.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Memory for blocks comes from the system in slabs of so many bytes, of which only what is touched
 * counts. */
enum { SLAB_SIZE = 64 << 20, RECORDS_MIN_SHIFT = 4 };
static_assert(PREP_BLOCK_RECORDS_MIN == 1 << RECORDS_MIN_SHIFT, "a power of two");

/* What a file system keeps a file in. */
enum { DISK_UNIT = 4096 };

typedef struct slab {
    struct slab *next;
    size_t size;
} slab;

struct prep_store {
    size_t record_size, block_size;
    uint32_t block_shift; /* log2 of its records */
    char *folder;         /* owned */
    int fd;               /* of the scratch file, -1 before the first block goes there */
    bool compresses;

    pthread_mutex_t lock;
    /* Under the lock: */
    size_t full_in_memory, full_limit; /* sealed blocks in memory, and how many may be */
    uint64_t *free_slots;              /* [free_count], owned */
    size_t free_count, free_capacity;
    uint64_t slot_count; /* the scratch file is so many blocks long, which may have holes */
    uint64_t in_use, in_use_peak; /* bytes of it */
    slab *slabs;                  /* owned */
    uint8_t *fresh, *fresh_end;   /* of the newest slab */
    uint8_t *touched;             /* up to here all of that has been touched, or will be */
    uint8_t *free_blocks;         /* each begins with a pointer to the next */
};

/* Memory of a block; the one that was given back last, which is the warmest, comes first. NULL:
 * none is left. */
static uint8_t *take_memory(prep_store *s)
{
    pthread_mutex_lock(&s->lock);
    uint8_t *memory = s->free_blocks;
    if (memory != NULL) {
        memcpy(&s->free_blocks, memory, sizeof s->free_blocks);
    } else {
        if ((size_t)(s->fresh_end - s->fresh) < s->block_size) {
            size_t size = sizeof(mospt_vertex) + s->block_size;
            if (size < SLAB_SIZE) size = SLAB_SIZE;
            void *fresh = prep_pages_take(size);
            if (fresh != NULL) {
                *(slab *)fresh = (slab){.next = s->slabs, .size = size};
                s->slabs = fresh;
                s->fresh = (uint8_t *)fresh + sizeof(mospt_vertex);
                s->fresh_end = (uint8_t *)fresh + size;
                s->touched = fresh;
            }
        }
        if ((size_t)(s->fresh_end - s->fresh) >= s->block_size) {
            memory = s->fresh;
            s->fresh += s->block_size;
        }
    }
    pthread_mutex_unlock(&s->lock);
    return memory;
}

uint8_t *prep_store_untouched(prep_store *s, size_t ahead, size_t unit, size_t *size)
{
    pthread_mutex_lock(&s->lock);
    uint8_t *begin = s->touched > s->fresh ? s->touched : s->fresh;
    size_t there = (size_t)(begin - s->fresh), left = (size_t)(s->fresh_end - begin);
    /* Where there is little memory, none of it is for later. */
    bool is_little = unit > s->full_limit * s->block_size / 8;
    *size = 0;
    if (s->free_blocks == NULL && there < ahead && !is_little)
        *size = (ahead - there + unit - 1) / unit * unit;
    if (*size > left) *size = left;
    s->touched = begin + *size;
    pthread_mutex_unlock(&s->lock);
    return begin;
}

static void give_memory(prep_store *s, uint8_t *memory)
{
    if (memory == NULL) return;
    pthread_mutex_lock(&s->lock);
    memcpy(memory, &s->free_blocks, sizeof s->free_blocks);
    s->free_blocks = memory;
    pthread_mutex_unlock(&s->lock);
}

bool prep_store_create(const char *folder, size_t record_size, size_t block_size,
                       size_t memory_size, prep_store **out, mospt_err *err)
{
    prep_store *s = calloc(1, sizeof *s);
    if (s != NULL) s->folder = strdup(folder);
    if (s == NULL || s->folder == NULL) {
        free(s);
        return mospt_err_nomem(err, sizeof *s);
    }
    s->record_size = record_size;
    s->block_shift = RECORDS_MIN_SHIFT;
    while (record_size << (s->block_shift + 1) <= block_size)
        s->block_shift++;
    s->block_size = record_size << s->block_shift;
    s->full_limit = memory_size / s->block_size;
    s->fd = -1;
    pthread_mutex_init(&s->lock, NULL);
    *out = s;
    return true;
}

void prep_store_destroy(prep_store *s)
{
    if (s == NULL) return;
    if (s->fd >= 0) close(s->fd);
    while (s->slabs != NULL) {
        slab *next = s->slabs->next;
        prep_pages_give(s->slabs, s->slabs->size);
        s->slabs = next;
    }
    pthread_mutex_destroy(&s->lock);
    free(s->free_slots);
    free(s->folder);
    free(s);
}

void prep_store_compress(prep_store *store)
{
    store->compresses = true;
}

uint64_t prep_store_scratch_peak(const prep_store *store)
{
    return store->in_use_peak;
}

uint32_t prep_store_block_shift(const prep_store *store)
{
    return store->block_shift;
}

size_t prep_store_block_size(const prep_store *store)
{
    return store->block_size;
}

/* Under the lock. The file has no name, so that it goes with the process, however that ends. */
static bool open_scratch(prep_store *s, mospt_err *err)
{
    if (s->fd >= 0) return true;
    s->fd = open(s->folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (s->fd < 0) { /* not every file system has that */
        char path[4096];
        snprintf(path, sizeof path, "%s/instantpoints-scratch-XXXXXX", s->folder);
        s->fd = mkostemp(path, O_CLOEXEC);
        if (s->fd >= 0) unlink(path);
    }
    if (s->fd < 0)
        return mospt_err_set(err, MOSPT_EIO, mospt_at_file(s->folder),
                             "no scratch file can be made there");
    return true;
}

/* What a slot with so many bytes takes of the disk. */
static uint64_t disk_size(const prep_store *s, uint32_t stored)
{
    uint64_t size = ((uint64_t)stored + DISK_UNIT - 1) / DISK_UNIT * DISK_UNIT;
    return s->compresses && size < s->block_size ? size : s->block_size;
}

static bool take_slot(prep_store *s, uint32_t stored, uint64_t *slot, mospt_err *err)
{
    pthread_mutex_lock(&s->lock);
    bool ok = open_scratch(s, err);
    if (ok) {
        *slot = s->free_count > 0 ? s->free_slots[--s->free_count] : s->slot_count++;
        s->in_use += disk_size(s, stored);
        if (s->in_use > s->in_use_peak) s->in_use_peak = s->in_use;
    }
    pthread_mutex_unlock(&s->lock);
    return ok;
}

static void free_slot(prep_store *s, const prep_block *block)
{
    pthread_mutex_lock(&s->lock);
    s->in_use -= disk_size(s, block->stored);
    if (s->free_count == s->free_capacity) {
        size_t capacity = s->free_capacity > 0 ? 2 * s->free_capacity : 256;
        uint64_t *slots = realloc(s->free_slots, capacity * sizeof *slots);
        if (slots != NULL) s->free_slots = slots, s->free_capacity = capacity;
    }
    /* Without memory for the list the slot is lost, and the file longer than it need be. */
    if (s->free_count < s->free_capacity) s->free_slots[s->free_count++] = block->slot;
    pthread_mutex_unlock(&s->lock);
}

/* Decides whether a block that takes no more records stays in memory. */
static bool may_stay(prep_store *s)
{
    pthread_mutex_lock(&s->lock);
    bool stays = s->full_in_memory < s->full_limit;
    if (stays) s->full_in_memory++;
    pthread_mutex_unlock(&s->lock);
    return stays;
}

static size_t records_size(const prep_store *s, const prep_block *block)
{
    return block->count * s->record_size;
}

/* Columns of bytes out of rows; with `height` and `width` exchanged, rows out of columns. */
static void turn(const uint8_t *from, size_t height, size_t width, uint8_t *to)
{
    for (size_t c = 0; c < width; c++)
        for (size_t r = 0; r < height; r++)
            to[c * height + r] = from[r * width + c];
}

/* Writes a block to a slot of its own. Compressed, it is byte after byte of all records, most of
 * which are like those before them. Without memory for that, it is written as it is. */
static bool write_block(prep_store *s, prep_block *block, mospt_err *err)
{
    size_t size = records_size(s, block);
    uint8_t *columns = s->compresses ? malloc(2 * size) : NULL, *shorter = columns;
    int stored = 0;
    if (columns != NULL) {
        shorter += size;
        turn(block->memory, block->count, s->record_size, columns);
        stored =
            LZ4_compress_default((const char *)columns, (char *)shorter, (int)size, (int)size - 1);
    }
    const uint8_t *from = stored > 0 ? shorter : block->memory;
    block->stored = stored > 0 ? (uint32_t)stored : (uint32_t)size;
    bool ok = take_slot(s, block->stored, &block->slot, err) &&
              mospt_file_write_at(s->fd, s->folder, block->slot * s->block_size, from,
                                  block->stored, err);
    free(columns);
    return ok;
}

/* Ends the filling of the last block. */
static bool seal_last(prep_store *s, prep_spool *spool, mospt_err *err)
{
    prep_block *block = &spool->blocks[spool->block_count - 1];
    block->count =
        (uint32_t)(spool->count - ((uint64_t)(spool->block_count - 1) << s->block_shift));
    spool->next = spool->end = NULL;
    if (may_stay(s)) return true;
    bool ok = write_block(s, block, err);
    if (!ok) spool->count -= block->count, block->count = 0;
    give_memory(s, block->memory);
    block->memory = NULL;
    return ok;
}

bool prep_spool_grow(prep_store *s, prep_spool *spool, mospt_err *err)
{
    if (spool->next != NULL && !seal_last(s, spool, err)) return false;
    if (spool->block_count == spool->capacity) {
        uint32_t capacity = spool->capacity > 0 ? 2 * spool->capacity : 4;
        prep_block *blocks = realloc(spool->blocks, capacity * sizeof *blocks);
        if (blocks == NULL) return mospt_err_nomem(err, capacity * sizeof *blocks);
        spool->blocks = blocks;
        spool->capacity = capacity;
    }
    uint8_t *memory = take_memory(s);
    if (memory == NULL) return mospt_err_nomem(err, s->block_size);
    spool->blocks[spool->block_count++] = (prep_block){.memory = memory};
    spool->next = memory;
    spool->end = memory + s->block_size;
    return true;
}

bool prep_spool_seal(prep_store *s, prep_spool *spool, mospt_err *err)
{
    return spool->next == NULL || seal_last(s, spool, err);
}

static void release(prep_store *s, prep_block *block, bool sealed)
{
    if (block->memory != NULL) {
        give_memory(s, block->memory);
        block->memory = NULL;
        if (sealed) {
            pthread_mutex_lock(&s->lock);
            s->full_in_memory--;
            pthread_mutex_unlock(&s->lock);
        }
    } else if (block->count > 0) {
        free_slot(s, block);
    }
    block->count = 0;
}

static bool read_block(const prep_store *s, const prep_block *block, uint8_t *out, mospt_err *err)
{
    size_t size = records_size(s, block);
    uint64_t offset = block->slot * s->block_size;
    if (block->stored == size) return mospt_file_read_at(s->fd, s->folder, offset, out, size, err);
    uint8_t *columns = malloc(size + block->stored), *shorter = columns;
    if (columns == NULL) return mospt_err_nomem(err, size + block->stored);
    shorter += size;
    bool ok = mospt_file_read_at(s->fd, s->folder, offset, shorter, block->stored, err);
    if (ok && LZ4_decompress_safe((const char *)shorter, (char *)columns, (int)block->stored,
                                  (int)size) != (int)size)
        ok = mospt_err_set(err, MOSPT_EIO, mospt_at_byte(s->folder, offset),
                           "the scratch file there does not hold what was written");
    if (ok) turn(columns, s->record_size, block->count, out);
    free(columns);
    return ok;
}

size_t prep_spool_size_on_disk(const prep_store *s, const prep_spool *spool)
{
    size_t sum = 0;
    for (uint32_t i = 0; i < spool->block_count; i++)
        if (spool->blocks[i].memory == NULL) sum += s->block_size;
    return sum;
}

/* How many more blocks may stay in memory. */
static size_t room(prep_store *s)
{
    pthread_mutex_lock(&s->lock);
    size_t blocks = s->full_limit > s->full_in_memory ? s->full_limit - s->full_in_memory : 0;
    pthread_mutex_unlock(&s->lock);
    return blocks;
}

bool prep_spool_make_room(prep_store *s, prep_spool *spool, size_t size, mospt_err *err)
{
    for (uint32_t i = 0; i < spool->block_count && room(s) * s->block_size < size; i++) {
        prep_block *block = &spool->blocks[i], written = *block;
        if (block->memory == NULL || block->count >> s->block_shift == 0) continue;
        if (!write_block(s, &written, err)) return false;
        written.memory = NULL;
        release(s, block, true);
        *block = written;
    }
    return true;
}

bool prep_spool_view(prep_store *s, const prep_spool *spool, uint8_t *buffer,
                     const uint8_t **blocks, mospt_err *err)
{
    for (uint32_t i = 0; i < spool->block_count; i++) {
        blocks[i] = spool->blocks[i].memory;
        if (blocks[i] != NULL) continue;
        if (!read_block(s, &spool->blocks[i], buffer, err)) return false;
        blocks[i] = buffer;
        buffer += s->block_size;
    }
    return true;
}

bool prep_spool_take_block(prep_store *s, prep_spool *spool, uint32_t i, uint8_t *out,
                           uint32_t *count, mospt_err *err)
{
    prep_block *block = &spool->blocks[i];
    *count = block->count;
    if (block->memory != NULL) memcpy(out, block->memory, block->count * s->record_size);
    else if (!read_block(s, block, out, err)) return false;
    release(s, block, true);
    return true;
}

bool prep_spool_take(prep_store *s, prep_spool *spool, uint8_t *out, mospt_err *err)
{
    uint32_t count;
    if (!prep_spool_seal(s, spool, err)) return false;
    for (uint32_t i = 0; i < spool->block_count; i++) {
        if (!prep_spool_take_block(s, spool, i, out, &count, err)) return false;
        out += count * s->record_size;
    }
    prep_spool_drop(s, spool);
    return true;
}

void prep_spool_drop(prep_store *s, prep_spool *spool)
{
    for (uint32_t i = 0; i < spool->block_count; i++)
        release(s, &spool->blocks[i], !(i + 1 == spool->block_count && spool->next != NULL));
    free(spool->blocks);
    *spool = (prep_spool){0};
}
