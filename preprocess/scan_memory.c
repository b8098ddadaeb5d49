#include "preprocess/scan_memory.h"

#include <stdlib.h>

struct prep_scan_memory {
    struct stat file;
    void *index; /* owned; NULL: nothing is known */
    prep_scan_memory_free *free_index;
};

bool prep_scan_memory_create(prep_scan_memory **out, mospt_err *err)
{
    *out = calloc(1, sizeof **out);
    return *out != NULL || mospt_err_nomem(err, sizeof **out);
}

static void forget(prep_scan_memory *memory)
{
    if (memory->index != NULL) memory->free_index(memory->index);
    memory->index = NULL;
}

void prep_scan_memory_destroy(prep_scan_memory *memory)
{
    if (memory == NULL) return;
    forget(memory);
    free(memory);
}

static bool is_same(const struct stat *a, const struct stat *b)
{
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino && a->st_size == b->st_size &&
           a->st_mtim.tv_sec == b->st_mtim.tv_sec && a->st_mtim.tv_nsec == b->st_mtim.tv_nsec;
}

const void *prep_scan_memory_recall(const prep_scan_memory *memory, const prep_input *input,
                                    prep_scan_memory_free *free_index)
{
    if (memory == NULL || memory->index == NULL || memory->free_index != free_index) return NULL;
    return is_same(&memory->file, prep_input_status(input)) ? memory->index : NULL;
}

void prep_scan_memory_keep(prep_scan_memory *memory, const prep_input *input, void *index,
                           prep_scan_memory_free *free_index)
{
    if (memory == NULL) {
        free_index(index);
        return;
    }
    forget(memory);
    memory->file = *prep_input_status(input);
    memory->index = index;
    memory->free_index = free_index;
}
