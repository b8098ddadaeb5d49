/* Files written past the page cache hold what was written, in whatever order it came. */
#include "tests/core_tools.h"

#include "mospt/file.h"
#include "mospt/sink.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { CHUNK = MOSPT_SINK_CHUNK_MIN, FILES = 3, THREADS = 4, PIECES = 400 };

/* On the disk that the tests run on: memory knows no page cache to pass by. */
static char folder[] = "test_sink_XXXXXX";
static char paths[FILES][512];

/* What stands at a place of a file. */
static uint8_t byte_at(uint32_t file, uint64_t offset)
{
    return (uint8_t)((offset * 2654435761u >> 13) + file * 77);
}

static void fill(uint8_t *to, uint32_t file, uint64_t offset, size_t size)
{
    for (size_t i = 0; i < size; i++)
        to[i] = byte_at(file, offset + i);
}

static void make_file(uint32_t file, uint64_t kept)
{
    uint8_t *bytes = malloc(kept + 1);
    assert_non_null(bytes);
    fill(bytes, file, 0, kept);
    snprintf(paths[file], sizeof paths[file], "%s/file-%u", folder, file);
    int fd = open(paths[file], O_RDWR | O_CREAT | O_TRUNC, 0666);
    assert_true(fd >= 0 && mospt_file_write_at(fd, paths[file], 0, bytes, kept, NULL));
    close(fd);
    free(bytes);
}

static void assert_file(uint32_t file, uint64_t size)
{
    char *bytes;
    size_t found;
    assert_true(mospt_file_read_whole(paths[file], 1 << 30, &bytes, &found, NULL));
    assert_in_range(found, size, size + CHUNK);
    for (uint64_t i = 0; i < size; i++)
        if ((uint8_t)bytes[i] != byte_at(file, i))
            fail_msg("file %u, byte %lu", file, (unsigned long)i);
    free(bytes);
}

typedef struct {
    uint32_t file;
    uint64_t offset;
    size_t size;
} piece;

typedef struct {
    mospt_sink *sink;
    const piece *pieces;
    uint32_t count;
} share;

static void *write_share(void *argument)
{
    const share *s = argument;
    mospt_err err;
    for (uint32_t i = 0; i < s->count; i++) {
        const piece *p = &s->pieces[i];
        uint8_t *bytes = malloc(p->size);
        if (bytes == NULL) return argument;
        fill(bytes, p->file, p->offset, p->size);
        bool ok = mospt_sink_write(s->sink, p->file, p->offset, bytes, p->size, &err);
        free(bytes);
        if (!ok) return argument;
    }
    return NULL;
}

/* Pieces of random sizes that cover the files from what is kept of each, in some disorder. */
static void cut_pieces(const uint64_t *kept, piece *pieces, uint64_t *size)
{
    uint64_t random = 3;
    memcpy(size, kept, FILES * sizeof *size);
    for (uint32_t i = 0; i < PIECES; i++) {
        uint32_t file = (uint32_t)(core_random(&random) % FILES);
        size_t n = 1 + (size_t)(core_random(&random) % (i % 9 == 0 ? 5 * CHUNK : 20000));
        pieces[i] = (piece){.file = file, .offset = size[file], .size = n};
        size[file] += n;
    }
    for (uint32_t i = 0; i + 8 < PIECES; i++) {
        uint32_t other = i + (uint32_t)(core_random(&random) % 8);
        piece swap = pieces[i];
        pieces[i] = pieces[other], pieces[other] = swap;
    }
}

static void files_hold_what_several_threads_write_in_any_order(void **state)
{
    static const uint64_t kept[FILES] = {0, 1234, 3 * CHUNK + 17};
    piece pieces[PIECES];
    uint64_t size[FILES];
    mospt_sink *sink = NULL;
    mospt_err err = {0};
    pthread_t threads[THREADS];
    share shares[THREADS];
    (void)state;
    CORE_NEED(mospt_sink_create(CHUNK, &sink, &err));
    for (uint32_t f = 0; f < FILES; f++) {
        make_file(f, kept[f]);
        CORE_NEED(mospt_sink_add_file(sink, paths[f], kept[f], &err));
    }
    cut_pieces(kept, pieces, size);
    for (uint32_t t = 0; t < THREADS; t++) {
        shares[t] = (share){sink, pieces + t * (PIECES / THREADS), PIECES / THREADS};
        assert_int_equal(pthread_create(&threads[t], NULL, write_share, &shares[t]), 0);
    }
    for (int i = 0; i < 5; i++)
        CORE_NEED(mospt_sink_flush(sink, &err));
    for (uint32_t t = 0; t < THREADS; t++) {
        void *failed;
        pthread_join(threads[t], &failed);
        assert_null(failed);
    }
    CORE_NEED(mospt_sink_flush(sink, &err));
    for (uint32_t f = 0; f < FILES; f++)
        assert_file(f, size[f]);
    mospt_sink_destroy(sink);
}

static void a_flush_brings_what_was_written_before_it(void **state)
{
    mospt_sink *sink = NULL;
    mospt_err err = {0};
    uint8_t bytes[1000];
    (void)state;
    make_file(0, 0);
    CORE_NEED(mospt_sink_create(CHUNK, &sink, &err));
    CORE_NEED(mospt_sink_add_file(sink, paths[0], 0, &err));
    for (uint64_t at = 0; at < 3 * CHUNK; at += sizeof bytes) {
        fill(bytes, 0, at, sizeof bytes);
        CORE_NEED(mospt_sink_write(sink, 0, at, bytes, sizeof bytes, &err));
        if (at % 7000 != 0) continue;
        CORE_NEED(mospt_sink_flush(sink, &err));
        assert_file(0, at + sizeof bytes);
    }
    mospt_sink_destroy(sink);
}

static void what_is_kept_stays(void **state)
{
    mospt_sink *sink = NULL;
    mospt_err err = {0};
    const uint64_t kept = 2 * CHUNK + 100, size = 5 * CHUNK + 3;
    uint8_t *bytes = malloc(size);
    (void)state;
    assert_non_null(bytes);
    make_file(0, kept);
    CORE_NEED(mospt_sink_create(CHUNK, &sink, &err));
    CORE_NEED(mospt_sink_add_file(sink, paths[0], kept, &err));
    fill(bytes, 0, 0, size);
    memset(bytes, 0, kept);
    for (uint64_t at = 0, n; at < size; at += n) {
        n = size - at < 30000 ? size - at : 30000;
        CORE_NEED(mospt_sink_write(sink, 0, at, bytes + at, n, &err));
    }
    CORE_NEED(mospt_sink_flush(sink, &err));
    assert_file(0, size);
    mospt_sink_destroy(sink);
    free(bytes);
}

static void a_full_disk_is_told_to_whoever_writes_or_flushes(void **state)
{
    mospt_sink *sink = NULL;
    mospt_err err = {0};
    uint8_t *bytes = calloc(1, CHUNK);
    (void)state;
    assert_non_null(bytes);
    if (access("/dev/full", W_OK) != 0) skip();
    CORE_NEED(mospt_sink_create(CHUNK, &sink, &err));
    CORE_NEED(mospt_sink_add_file(sink, "/dev/full", 0, &err));
    CORE_NEED(mospt_sink_write(sink, 0, 0, bytes, CHUNK, &err));
    CORE_FAILS(mospt_sink_flush(sink, &err), MOSPT_EIO);
    CORE_FAILS(mospt_sink_write(sink, 0, CHUNK, bytes, CHUNK, &err), MOSPT_EIO);
    assert_string_equal(err.file, "/dev/full");
    mospt_sink_destroy(sink);
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(files_hold_what_several_threads_write_in_any_order),
        cmocka_unit_test(a_flush_brings_what_was_written_before_it),
        cmocka_unit_test(what_is_kept_stays),
        cmocka_unit_test(a_full_disk_is_told_to_whoever_writes_or_flushes),
    };
    if (mkdtemp(folder) == NULL) return 1;
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    return mospt_file_remove_tree(folder, NULL) ? failed : 1;
}
