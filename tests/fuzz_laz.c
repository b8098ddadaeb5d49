/* tests/fuzz_laz.c - any bytes as a LAZ file: an error, or points and an end. */
#include "preprocess/laz.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* A few bytes may well stand for millions of points that are all alike; so many are enough. */
enum { POINTS_MAX = 200000 };

static void look_at_some(prep_laz *laz, size_t length)
{
    uint8_t *records = malloc(16 * length);
    uint32_t count = prep_laz_chunk_count(laz);
    size_t got;
    mospt_err err;
    for (uint32_t i = 0; records != NULL && i < count && i < 4; i++)
        prep_laz_look(laz, prep_laz_chunk_first(laz, count - 1 - i) + i, records, 16, &got, &err);
    free(records);
}

static void read_some(prep_laz *laz, size_t length)
{
    const uint8_t *records;
    size_t got;
    mospt_err err = {0};
    uint64_t count = 0;
    volatile uint32_t sum = 0;
    do {
        if (!prep_laz_read(laz, 5000, &records, &got, &err)) abort();
        for (size_t i = 0; i < got * length; i++)
            sum += records[i];
        count += got;
    } while (got > 0 && count < POINTS_MAX);
    if (got == 0 && count < prep_laz_point_count(laz) && prep_laz_damage(laz) == NULL) abort();
}

static void check(const char *path, uint32_t threads)
{
    prep_input *input = NULL;
    prep_las_header header;
    prep_laz *laz;
    mospt_err err = {0};
    if (!prep_input_open(path, &input, &err)) abort();
    if (prep_las_header_read(input, &header, &err) && header.is_compressed &&
        prep_laz_open(input, &header, threads, &laz, &err)) {
        read_some(laz, header.record_length);
        look_at_some(laz, header.record_length);
        prep_laz_rewind(laz);
        prep_laz_close(laz);
    } else if (err.code != MOSPT_OK && err.code != MOSPT_EFORMAT) {
        abort();
    }
    prep_input_close(input);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char path[64];
    int fd = memfd_create("fuzz_laz", MFD_CLOEXEC);
    if (fd < 0 || write(fd, data, size) != (ssize_t)size) abort();
    snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
    check(path, size % 8 == 0 ? 3 : 1);
    close(fd);
    return 0;
}
