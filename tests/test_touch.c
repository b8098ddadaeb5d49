#include "render/cpu/memory.h"
#include "render/cpu/touch.h"
#include "tests/core_tools.h"

#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { SIZE = 96 << 20, PART = 4 << 20, MS_MAX = 10000, WOULD_COME_US = 300000 };

/* Bytes of [PART] at `from` that have memory. */
static size_t present(const uint8_t *memory, size_t from)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE), count = 0;
    unsigned char pages[PART / 4096];
    assert_int_equal(mincore((void *)(memory + from), PART, pages), 0);
    for (size_t i = 0; i < PART / page; i++)
        count += pages[i] & 1u;
    return count * page;
}

/* Not every system can, or tells. */
static bool can_be_seen(void)
{
    uint8_t *memory = rcpu_memory_take(PART);
    size_t before = present(memory, 0);
    rcpu_memory_touch(memory, PART);
    bool can = before == 0 && present(memory, 0) == PART;
    rcpu_memory_release(memory, PART);
    return can;
}

static bool comes(const uint8_t *memory, size_t from)
{
    for (int ms = 0; ms < MS_MAX; ms++) {
        if (present(memory, from) == PART) return true;
        usleep(1000);
    }
    return false;
}

static void memory_is_there_a_little_ahead(void **state)
{
    (void)state;
    if (!can_be_seen()) skip();
    uint8_t *memory = rcpu_memory_take(SIZE);
    rcpu_touch *t = rcpu_touch_create(memory, SIZE);
    assert_non_null(t);
    assert_true(comes(memory, 0));
    assert_true(comes(memory, PART));
    usleep(WOULD_COME_US);
    assert_int_equal(present(memory, SIZE / 2 + PART), 0);
    rcpu_touch_filled(t, SIZE / 2);
    assert_true(comes(memory, SIZE / 2 + PART));
    usleep(WOULD_COME_US);
    assert_int_equal(present(memory, SIZE - PART), 0);
    rcpu_touch_destroy(t);
    rcpu_memory_release(memory, SIZE);
}

static void what_is_there_stays(void **state)
{
    (void)state;
    uint8_t *memory = rcpu_memory_take(SIZE);
    rcpu_touch *t = rcpu_touch_create(memory, SIZE);
    for (size_t at = 0; at < SIZE; at += PART) {
        memset(memory + at, (int)(at / PART) + 1, PART);
        rcpu_touch_filled(t, at + PART);
    }
    rcpu_touch_destroy(t);
    for (size_t at = 0; at < SIZE; at += 997)
        assert_int_equal(memory[at], at / PART + 1);
    rcpu_memory_release(memory, SIZE);
}

static void it_ends_before_its_time(void **state)
{
    (void)state;
    uint8_t *memory = rcpu_memory_take(SIZE);
    rcpu_touch_destroy(rcpu_touch_create(memory, SIZE));
    rcpu_touch_destroy(rcpu_touch_create(memory, 1));
    rcpu_touch_destroy(NULL);
    rcpu_touch_filled(NULL, 1);
    rcpu_memory_release(memory, SIZE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(memory_is_there_a_little_ahead),
        cmocka_unit_test(what_is_there_stays),
        cmocka_unit_test(it_ends_before_its_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
