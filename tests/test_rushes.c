#include "render/rushes.h"
#include "tests/core_tools.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { SIZE = 1000, RECORD = SIZE + 8 };

static void write_frames(const char *path, int count)
{
    rend_rushes *r;
    mospt_err err = {0};
    uint8_t frame[SIZE];
    CORE_NEED(rend_rushes_open(path, SIZE, &r, &err));
    for (int i = 0; i < count; i++) {
        memset(frame, i, SIZE);
        CORE_NEED(rend_rushes_add(r, frame, &err));
    }
    rend_rushes_close(r);
}

static void every_truncation_keeps_the_whole_frames(void **unused)
{
    (void)unused;
    mospt_err err = {0};
    char *folder = core_folder_make(), *path = core_path(folder, "rushes");
    write_frames(path, 3);
    for (long size = 3 * RECORD; size >= 0; size -= 97) {
        rend_rushes *r;
        uint8_t frame[SIZE];
        assert_int_equal(truncate(path, size), 0);
        CORE_NEED(rend_rushes_open(path, SIZE, &r, &err));
        assert_int_equal(rend_rushes_count(r), size / RECORD);
        for (uint32_t i = 0; i < rend_rushes_count(r); i++) {
            CORE_NEED(rend_rushes_read(r, i, frame, &err));
            assert_true(frame[0] == i && frame[SIZE - 1] == i);
        }
        memset(frame, 9, SIZE); /* goes on behind them */
        CORE_NEED(rend_rushes_add(r, frame, &err));
        CORE_NEED(rend_rushes_read(r, rend_rushes_count(r) - 1, frame, &err));
        assert_true(frame[7] == 9);
        rend_rushes_close(r);
        assert_int_equal(truncate(path, 0), 0);
        write_frames(path, 3);
    }
    free(path);
    core_folder_remove(folder);
}

static void a_changed_byte_ends_the_whole_frames(void **unused)
{
    (void)unused;
    mospt_err err = {0};
    char *folder = core_folder_make(), *path = core_path(folder, "rushes");
    for (size_t place = 5; place < 3 * RECORD; place += 331) {
        size_t size;
        rend_rushes *r;
        write_frames(path, 3);
        uint8_t *bytes = core_file_read(path, &size);
        bytes[place] ^= 1;
        core_file_write(path, bytes, 3 * RECORD);
        free(bytes);
        CORE_NEED(rend_rushes_open(path, SIZE, &r, &err));
        assert_int_equal(rend_rushes_count(r), place / RECORD);
        rend_rushes_close(r);
        unlink(path);
    }
    free(path);
    core_folder_remove(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_truncation_keeps_the_whole_frames),
        cmocka_unit_test(a_changed_byte_ends_the_whole_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
