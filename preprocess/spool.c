#include "preprocess/spool.h"

#include "mospt/file.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

struct prep_store {
    size_t record_size, block_size;
    uint32_t block_capacity; /* records */
    char *folder;            /* owned */
    int fd;                  /* of the scratch file, -1 before the first block goes there */

    pthread_mutex_t lock;
    /* Under the lock: */
    size_t full_in_memory, full_limit; /* sealed blocks in memory, and how many may be */
    uint64_t *free_slots;              /* [free_count], owned */
    size_t free_count, free_capacity;
    uint64_t slot_count; /* the scratch file is so many blocks long */
};

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
    s->block_capacity = (uint32_t)(block_size / record_size);
    if (s->block_capacity < 16) s->block_capacity = 16;
    s->block_size = s->block_capacity * record_size;
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
    pthread_mutex_destroy(&s->lock);
    free(s->free_slots);
    free(s->folder);
    free(s);
}

uint64_t prep_store_scratch_peak(const prep_store *store)
{
    return store->slot_count * store->block_size;
}

uint32_t prep_store_block_capacity(const prep_store *store)
{
    return store->block_capacity;
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

static bool take_slot(prep_store *s, uint64_t *slot, mospt_err *err)
{
    pthread_mutex_lock(&s->lock);
    bool ok = open_scratch(s, err);
    if (ok) *slot = s->free_count > 0 ? s->free_slots[--s->free_count] : s->slot_count++;
    pthread_mutex_unlock(&s->lock);
    return ok;
}

static void free_slot(prep_store *s, uint64_t slot)
{
    pthread_mutex_lock(&s->lock);
    if (s->free_count == s->free_capacity) {
        size_t capacity = s->free_capacity > 0 ? 2 * s->free_capacity : 256;
        uint64_t *slots = realloc(s->free_slots, capacity * sizeof *slots);
        if (slots != NULL) s->free_slots = slots, s->free_capacity = capacity;
    }
    /* Without memory for the list the slot is lost, and the file longer than it need be. */
    if (s->free_count < s->free_capacity) s->free_slots[s->free_count++] = slot;
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

/* `*reuse` gets the memory of the block if that went to the disk. */
static bool seal_last(prep_store *s, prep_spool *spool, uint8_t **reuse, mospt_err *err)
{
    prep_block *block = &spool->blocks[spool->block_count - 1];
    *reuse = NULL;
    spool->open = false;
    if (may_stay(s)) {
        if (block->count < s->block_capacity) {
            uint8_t *smaller = realloc(block->memory, block->count * s->record_size);
            if (smaller != NULL) block->memory = smaller;
        }
        return true;
    }
    if (!take_slot(s, &block->slot, err) ||
        !mospt_file_write_at(s->fd, s->folder, block->slot * s->block_size, block->memory,
                             block->count * s->record_size, err)) {
        free(block->memory);
        block->memory = NULL;
        block->count = 0;
        return false;
    }
    *reuse = block->memory;
    block->memory = NULL;
    return true;
}

static bool add_block(prep_store *s, prep_spool *spool, uint8_t *memory, mospt_err *err)
{
    if (spool->block_count == spool->capacity) {
        uint32_t capacity = spool->capacity > 0 ? 2 * spool->capacity : 4;
        prep_block *blocks = realloc(spool->blocks, capacity * sizeof *blocks);
        if (blocks == NULL) {
            free(memory);
            return mospt_err_nomem(err, capacity * sizeof *blocks);
        }
        spool->blocks = blocks;
        spool->capacity = capacity;
    }
    if (memory == NULL) memory = malloc(s->block_size);
    if (memory == NULL) return mospt_err_nomem(err, s->block_size);
    spool->blocks[spool->block_count++] = (prep_block){.memory = memory};
    spool->open = true;
    return true;
}

bool prep_spool_append(prep_store *s, prep_spool *spool, const uint8_t *record, mospt_err *err)
{
    if (!spool->open || spool->blocks[spool->block_count - 1].count == s->block_capacity) {
        uint8_t *memory = NULL;
        if (spool->open && !seal_last(s, spool, &memory, err)) return false;
        if (!add_block(s, spool, memory, err)) return false;
    }
    prep_block *last = &spool->blocks[spool->block_count - 1];
    memcpy(last->memory + last->count * s->record_size, record, s->record_size);
    last->count++;
    spool->count++;
    return true;
}

bool prep_spool_seal(prep_store *s, prep_spool *spool, mospt_err *err)
{
    uint8_t *memory = NULL;
    bool ok = !spool->open || seal_last(s, spool, &memory, err);
    free(memory);
    return ok;
}

static void release(prep_store *s, prep_block *block, bool sealed)
{
    if (block->memory != NULL) {
        free(block->memory);
        block->memory = NULL;
        if (sealed) {
            pthread_mutex_lock(&s->lock);
            s->full_in_memory--;
            pthread_mutex_unlock(&s->lock);
        }
    } else if (block->count > 0) {
        free_slot(s, block->slot);
    }
    block->count = 0;
}

bool prep_spool_take_block(prep_store *s, prep_spool *spool, uint32_t i, uint8_t *out,
                           uint32_t *count, mospt_err *err)
{
    prep_block *block = &spool->blocks[i];
    size_t size = block->count * s->record_size;
    bool last = i + 1 == spool->block_count;
    *count = block->count;
    if (block->memory != NULL) memcpy(out, block->memory, size);
    else if (!mospt_file_read_at(s->fd, s->folder, block->slot * s->block_size, out, size, err))
        return false;
    spool->count -= block->count;
    release(s, block, !(last && spool->open));
    if (last) prep_spool_drop(s, spool);
    return true;
}

bool prep_spool_take(prep_store *s, prep_spool *spool, uint8_t *out, mospt_err *err)
{
    uint32_t block_count = spool->block_count, count;
    for (uint32_t i = 0; i < block_count; i++) {
        if (!prep_spool_take_block(s, spool, i, out, &count, err)) return false;
        out += count * s->record_size;
    }
    return true;
}

void prep_spool_drop(prep_store *s, prep_spool *spool)
{
    for (uint32_t i = 0; i < spool->block_count; i++)
        release(s, &spool->blocks[i], !(i + 1 == spool->block_count && spool->open));
    free(spool->blocks);
    *spool = (prep_spool){0};
}
