#include "preprocess/bytes.h"
#include "preprocess/laz.h"
#include "tests/laz_twins.h"
#include "tests/scan_points.h"
#include "tests/write_las.h"
#include "tests/write_laz.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { COUNT = 1200 };

typedef struct {
    uint8_t *bytes;
    size_t size;
} image;

/* Changes a value a little, now and then a lot, often not at all. */
static uint32_t vary(uint64_t *seed, uint32_t value)
{
    uint32_t dice = scan_points_random(seed) % 64,
             r = scan_points_random(seed) << 1 ^ scan_points_random(seed);
    if (dice == 0) return r;
    if (dice < 4) return value + (uint32_t)((int32_t)r >> 12);
    if (dice < 40) return value + r % 9 - 4;
    return value;
}

static bool one_in(uint64_t *seed, uint32_t n)
{
    return scan_points_random(seed) % n == 0;
}

/* Times of several pulses that take turns: the same, one step on, several, backwards, elsewhere. */
static uint64_t next_time(uint64_t *seed, uint64_t time, uint64_t clocks[6])
{
    static const int32_t steps[16] = {1, 1, 1, 1, 1, 1, 2, 7, 11, 300, 499, 501, 900, -1, -4, -30};
    uint32_t dice = scan_points_random(seed) % 32;
    if (dice < 8) return time;
    uint64_t *clock = &clocks[dice < 28 ? 0 : dice % 6];
    uint64_t jitter = one_in(seed, 2) ? 0 : scan_points_random(seed) % 40;
    *clock += (uint64_t)((int64_t)steps[scan_points_random(seed) % 16] * 100000) + jitter;
    if (one_in(seed, 200)) *clock ^= (uint64_t)scan_points_random(seed) << 31;
    return *clock;
}

typedef struct {
    uint64_t seed, clocks[6];
    uint8_t format;
    uint32_t length;
} maker;

static void make_colours(maker *m, uint8_t *p)
{
    static const uint8_t rgb[11] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};
    uint32_t at = rgb[m->format];
    if (at == 0) return;
    bool is_grey = one_in(&m->seed, 3);
    for (uint32_t c = 0; c < 3; c++)
        write_las_u16(p + at + 2 * c, is_grey && c > 0 ? prep_le16(p + at)
                                                       : vary(&m->seed, prep_le16(p + at + 2 * c)));
    if (m->format >= 8) write_las_u16(p + 36, vary(&m->seed, prep_le16(p + 36)));
}

static void make_wave(maker *m, uint8_t *p)
{
    static const uint8_t wave[11] = {0, 0, 0, 0, 28, 34, 0, 0, 0, 30, 38};
    uint32_t at = wave[m->format];
    if (at == 0) return;
    uint64_t offset = prep_le64(p + at + 1);
    uint32_t dice = scan_points_random(&m->seed) % 8;
    if (dice < 4) offset += prep_le32(p + at + 9);
    if (dice == 4) offset += scan_points_random(&m->seed) % 1000;
    if (dice == 5) offset = offset * 2654435761u + 12345;
    p[at] = (uint8_t)vary(&m->seed, p[at]);
    write_las_u64(p + at + 1, offset);
    for (uint32_t k = 9; k < 29; k += 4)
        write_las_u32(p + at + k, vary(&m->seed, prep_le32(p + at + k)));
}

static void make_point(maker *m, uint8_t *p)
{
    bool is_new = m->format >= 6;
    for (uint32_t k = 0; k < 12; k += 4)
        write_las_u32(p + k, vary(&m->seed, prep_le32(p + k)));
    write_las_u16(p + 12, vary(&m->seed, prep_le16(p + 12)));
    if (one_in(&m->seed, 3)) p[14] = (uint8_t)scan_points_random(&m->seed);
    if (one_in(&m->seed, 3)) p[14] = is_new ? 0x11 : 9;
    if (one_in(&m->seed, 6)) p[15] = (uint8_t)scan_points_random(&m->seed);
    if (one_in(&m->seed, 6)) p[16] = (uint8_t)vary(&m->seed, p[16]);
    if (one_in(&m->seed, 6)) p[17] = (uint8_t)scan_points_random(&m->seed);
    if (one_in(&m->seed, 6)) write_las_u16(p + 18, vary(&m->seed, prep_le16(p + 18)));
    if (is_new && one_in(&m->seed, 6)) write_las_u16(p + 20, vary(&m->seed, prep_le16(p + 20)));
    uint32_t gps = is_new ? 22 : m->format == 0 || m->format == 2 ? 0 : 20;
    if (gps != 0) write_las_u64(p + gps, next_time(&m->seed, prep_le64(p + gps), m->clocks));
}

/* A LAS file whose records wander about. */
static image make_las(uint8_t format, uint32_t count, uint32_t extra_size, uint64_t seed)
{
    image las;
    write_las_options o = {.minor = 4,
                           .format = format,
                           .count = count,
                           .scale = {1, 1, 1},
                           .extra_size = extra_size,
                           .rgb_step = 1,
                           .intensity_step = 1};
    las.bytes = write_las(&o, &las.size);
    const double far[2] = {1e12, -1e12}; /* bounds that all points are inside of */
    for (int a = 0; a < 3; a++)
        memcpy(las.bytes + 179 + 16 * a, far, sizeof far);
    uint32_t begin = prep_le32(las.bytes + 96);
    maker m = {.seed = seed, .format = format, .length = prep_le16(las.bytes + 105)};
    for (int i = 0; i < 6; i++)
        m.clocks[i] = 0x40f8000000000000u + (uint64_t)i * 0x1234567890u;
    for (uint32_t i = 1; i < count; i++) {
        uint8_t *p = las.bytes + begin + (size_t)i * m.length;
        memcpy(p, p - m.length, m.length);
        make_point(&m, p);
        make_colours(&m, p);
        make_wave(&m, p);
        for (uint32_t k = write_las_record_size(format); k < m.length; k++)
            p[k] = (uint8_t)vary(&m.seed, p[k]);
    }
    return las;
}

static image pack(image las, write_laz_options o)
{
    image laz;
    laz.bytes = write_laz(las.bytes, las.size, &o, &laz.size);
    return laz;
}

static const uint8_t *records_of(image las)
{
    return las.bytes + prep_le32(las.bytes + 96);
}

typedef struct {
    prep_input *input;
    prep_las_header header;
    prep_laz *laz;
} opened;

static bool open_image(image file, uint32_t threads, opened *out, mospt_err *err)
{
    *out = (opened){0};
    const char *path = scan_points_file("a.laz", file.bytes, file.size);
    if (prep_input_open(path, &out->input, err) &&
        prep_las_header_read(out->input, &out->header, err) &&
        prep_laz_open(out->input, &out->header, threads, &out->laz, err))
        return true;
    prep_input_close(out->input);
    return false;
}

static void close_image(opened *o)
{
    prep_laz_close(o->laz);
    prep_input_close(o->input);
}

/* Reads all that comes, `most` at a time; returns how many were like those of the twin, which is
 * less than `count` if one was not. */
static uint64_t read_like(opened *o, size_t most, image las, size_t compared, uint64_t *count)
{
    uint64_t alike = 0;
    const uint8_t *twin = records_of(las), *records;
    size_t got, length = o->header.record_length;
    mospt_err err;
    for (*count = 0;; *count += got) {
        if (!prep_laz_read(o->laz, most, &records, &got, &err)) fail_msg("%s", err.message);
        if (got == 0) return alike;
        assert_true(got <= most);
        for (size_t i = 0; i < got; i++) {
            uint64_t n = *count + i;
            if (n * length >= las.size - prep_le32(las.bytes + 96)) continue;
            bool same = memcmp(records + i * length, twin + n * length,
                               compared < length ? compared : length) == 0;
            if (same && alike == n) alike++;
        }
    }
}

static void check_same(image las, image laz, uint32_t threads, size_t most)
{
    opened o;
    mospt_err err;
    uint64_t count;
    if (!open_image(laz, threads, &o, &err)) fail_msg("%s", err.message);
    uint64_t alike = read_like(&o, most, las, SIZE_MAX, &count);
    if (prep_laz_damage(o.laz) != NULL) fail_msg("damage: %s", prep_laz_damage(o.laz)->message);
    assert_int_equal(count, prep_laz_point_count(o.laz));
    assert_int_equal(alike, count);
    assert_int_equal(count, o.header.declared);
    close_image(&o);
}

static void every_format_and_version_comes_back(void **state)
{
    (void)state;
    for (uint8_t format = 0; format <= 10; format++) {
        for (uint16_t version = format < 6 ? 1 : 3; version <= (format < 6 ? 2 : 4); version++) {
            for (uint32_t extra = 0; extra <= 7; extra += 7) {
                image las = make_las(format, COUNT, extra, 7u * format + version);
                image laz = pack(las, (write_laz_options){.version = version, .chunk_points = 500});
                check_same(las, laz, 1, 333);
                free(laz.bytes);
                laz = pack(
                    las, (write_laz_options){.version = version, .compressor = format < 6 ? 1 : 3});
                check_same(las, laz, 1, 10000);
                free(laz.bytes);
                free(las.bytes);
            }
        }
    }
}

static void long_chunks_leave_no_trace_of_windows(void **state)
{
    (void)state;
    static const uint8_t formats[4] = {3, 5, 8, 10};
    for (uint32_t i = 0; i < 4; i++) {
        image las = make_las(formats[i], 40000, 5, i);
        image laz = pack(las, (write_laz_options){0});
        assert_true(laz.size > 256 * 1024); /* several times what a window holds */
        check_same(las, laz, 2, 4096);
        free(laz.bytes);
        free(las.bytes);
    }
}

/* Chunks that are larger than what is decoded of them ahead, with one that is not behind them. */
static void large_chunks_come_in_parts(void **state)
{
    (void)state;
    image las = make_las(3, 20000, 500, 17);
    image laz = pack(las, (write_laz_options){.chunk_points = 9000});
    for (uint32_t threads = 1; threads <= 3; threads++)
        check_same(las, laz, threads, 1000);
    free(laz.bytes);
    free(las.bytes);
}

static void chunks_of_every_kind_come_in_order(void **state)
{
    (void)state;
    static const write_laz_options kinds[] = {
        {.chunk_points = 1},
        {.chunk_points = 7, .table = WRITE_LAZ_TABLE_AT_END},
        {.chunk_points = 7, .varies = true},
        {.chunk_points = 50, .varies = true, .table = WRITE_LAZ_TABLE_AT_END},
        {.chunk_points = COUNT},
        {.chunk_points = COUNT + 1},
    };
    for (uint8_t format = 3; format <= 7; format += 4) {
        image las = make_las(format, COUNT, 2, format);
        for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; k++) {
            image laz = pack(las, kinds[k]);
            for (uint32_t threads = 1; threads <= 5; threads += 2)
                check_same(las, laz, threads, 100);
            free(laz.bytes);
        }
        free(las.bytes);
    }
}

static void a_file_can_be_read_again_from_any_place(void **state)
{
    (void)state;
    image las = make_las(7, COUNT, 0, 1), laz = pack(las, (write_laz_options){.chunk_points = 100});
    for (uint32_t threads = 1; threads <= 3; threads += 2) {
        opened o;
        mospt_err err;
        uint64_t count;
        assert_true(open_image(laz, threads, &o, &err));
        for (int part = 0; part < 5; part++) {
            const uint8_t *records;
            size_t got;
            for (int i = 0; i < 90 * part; i++)
                assert_true(prep_laz_read(o.laz, 3, &records, &got, &err));
            prep_laz_rewind(o.laz);
        }
        assert_int_equal(read_like(&o, 77, las, SIZE_MAX, &count), COUNT);
        prep_laz_rewind(o.laz);
        assert_int_equal(read_like(&o, 5000, las, SIZE_MAX, &count), COUNT);
        close_image(&o);
    }
    free(laz.bytes);
    free(las.bytes);
}

static void any_place_can_be_looked_at(void **state)
{
    (void)state;
    image las = make_las(8, COUNT, 3, 2), laz = pack(las, (write_laz_options){.chunk_points = 100});
    opened o;
    mospt_err err;
    uint8_t records[60 * 250];
    assert_true(open_image(laz, 2, &o, &err));
    assert_int_equal(prep_laz_chunk_count(o.laz), 12);
    size_t length = o.header.record_length, got;
    assert_true(sizeof records >= 250 * length);
    for (uint32_t first = 0; first < COUNT; first += 37) {
        size_t want = first % 250 + 1, there = COUNT - first < want ? COUNT - first : want;
        assert_int_equal(prep_laz_lead(o.laz, first), first % 100);
        assert_true(prep_laz_look(o.laz, first, records, want, &got, &err));
        assert_int_equal(got, there);
        assert_memory_equal(records, records_of(las) + first * length, got * length);
    }
    assert_int_equal(prep_laz_chunk_first(o.laz, 11), 1100);
    assert_int_equal(prep_laz_lead(o.laz, COUNT), UINT64_MAX);
    assert_true(prep_laz_look(o.laz, COUNT, records, 1, &got, &err));
    assert_int_equal(got, 0);
    assert_null(prep_laz_damage(o.laz));
    close_image(&o);
    free(laz.bytes);
    free(las.bytes);
}

static void a_chunk_in_memory_is_decoded_alone(void **state)
{
    (void)state;
    for (uint8_t format = 1; format <= 8; format += 7) {
        image las = make_las(format, COUNT, 0, 3), laz = pack(las, (write_laz_options){0});
        opened o;
        mospt_err err;
        uint64_t got;
        assert_true(open_image(laz, 1, &o, &err));
        size_t length = o.header.record_length, begin = prep_le32(laz.bytes + 96) + 8;
        size_t end = (size_t)prep_le64(laz.bytes + begin - 8);
        uint8_t *records = malloc(COUNT * length);
        assert_non_null(records);
        const prep_laz_format *f = prep_laz_format_of(o.laz);
        assert_true(
            prep_laz_chunk_decode(f, laz.bytes + begin, end - begin, COUNT, records, &got, &err));
        assert_int_equal(got, COUNT);
        assert_memory_equal(records, records_of(las), COUNT * length);
        assert_true(prep_laz_chunk_decode(f, laz.bytes + begin, (end - begin) / 2, COUNT, records,
                                          &got, &err));
        assert_true(got > 0 &&
                    (got < COUNT || format > 5)); /* layers of x, y and z may be complete */
        for (size_t i = 0; i < got; i++)
            assert_memory_equal(records + i * length, records_of(las) + i * length, 12);
        assert_true(prep_laz_chunk_decode(f, laz.bytes + begin, 3, COUNT, records, &got, &err));
        assert_int_equal(got, 0);
        free(records);
        close_image(&o);
        free(laz.bytes);
        free(las.bytes);
    }
}

static void wave_packets_can_be_left_out_of_layers(void **state)
{
    (void)state;
    image las = make_las(10, COUNT, 4, 4),
          laz = pack(las, (write_laz_options){.chunk_points = 300});
    opened o;
    mospt_err err;
    const uint8_t *records;
    assert_true(open_image(laz, 2, &o, &err));
    prep_laz_leave_out_waves(o.laz);
    size_t got, length = o.header.record_length;
    for (uint64_t n = 0; n < COUNT; n += got) {
        assert_true(prep_laz_read(o.laz, 50, &records, &got, &err) && got > 0);
        for (size_t i = 0; i < got; i++) {
            const uint8_t *a = records + i * length, *b = records_of(las) + (n + i) * length;
            assert_memory_equal(a, b, 38);
            assert_memory_equal(a + 67, b + 67, 4);
            assert_memory_equal(a + 38, records_of(las) + (n + i) / 300 * 300 * length + 38, 29);
        }
    }
    assert_true(prep_laz_read(o.laz, 50, &records, &got, &err) && got == 0);
    assert_null(prep_laz_damage(o.laz));
    close_image(&o);
    free(laz.bytes);
    free(las.bytes);
}

/* Reads a file without a usable table; all points must come. */
static void check_without_table(image las, image laz)
{
    for (uint32_t threads = 1; threads <= 3; threads += 2) {
        opened o;
        mospt_err err;
        uint64_t count;
        if (!open_image(laz, threads, &o, &err)) fail_msg("%s", err.message);
        assert_int_equal(read_like(&o, 100, las, SIZE_MAX, &count), COUNT);
        assert_int_equal(count, COUNT);
        assert_non_null(prep_laz_damage(o.laz));
        prep_laz_rewind(o.laz);
        assert_int_equal(read_like(&o, 100, las, SIZE_MAX, &count), COUNT);
        close_image(&o);
    }
}

static void a_missing_or_bogus_table_costs_no_points(void **state)
{
    (void)state;
    static const uint64_t bogus[] = {
        0, 1, UINT64_MAX, UINT64_MAX - 1, UINT64_C(1) << 40, UINT64_C(1) << 63};
    for (uint8_t format = 2; format <= 8; format += 6) {
        image las = make_las(format, COUNT, 0, format);
        for (uint32_t each = 170; each <= 3000; each += 2000) {
            image laz =
                pack(las, (write_laz_options){.chunk_points = each, .table = WRITE_LAZ_NO_TABLE});
            check_without_table(las, laz);
            free(laz.bytes);
            laz = pack(las, (write_laz_options){.chunk_points = each});
            size_t begin = prep_le32(laz.bytes + 96), at = (size_t)prep_le64(laz.bytes + begin);
            for (size_t i = 0; i < sizeof bogus / sizeof bogus[0]; i++) {
                write_las_u64(laz.bytes + begin, bogus[i]);
                check_without_table(las, laz);
            }
            write_las_u64(laz.bytes + begin, at);
            for (uint32_t k = 0; k < 6; k++) { /* version, number of chunks, an entry */
                static const uint8_t place[6] = {0, 4, 5, 7, 8, 9};
                laz.bytes[at + place[k]] ^= 0x55;
                check_without_table(las, laz);
                laz.bytes[at + place[k]] ^= 0x55;
            }
            free(laz.bytes);
        }
        free(las.bytes);
    }
}

static void rows_of_varying_chunks_need_their_table(void **state)
{
    (void)state;
    image las = make_las(1, COUNT, 0, 1);
    image laz = pack(
        las, (write_laz_options){.chunk_points = 100, .varies = true, .table = WRITE_LAZ_NO_TABLE});
    opened o;
    mospt_err err;
    assert_false(open_image(laz, 1, &o, &err));
    assert_int_equal(err.code, MOSPT_EFORMAT);
    assert_int_equal(err.place, prep_le32(laz.bytes + 96));
    free(laz.bytes);
    free(las.bytes);
}

/* Of a file that was cut, what comes is what was there, and that something is missing is said. */
static void check_cut(image las, image laz, size_t size)
{
    opened o;
    mospt_err err = {0};
    uint64_t count;
    image cut = {laz.bytes, size};
    if (!open_image(cut, size % 2 != 0 ? 3 : 1, &o, &err)) {
        assert_int_equal(err.code, MOSPT_EFORMAT);
        return;
    }
    uint64_t alike = read_like(&o, 1000, las, 12, &count);
    assert_int_equal(alike, count);
    assert_true(count <= COUNT);
    assert_non_null(prep_laz_damage(o.laz));
    close_image(&o);
}

static void every_truncation_keeps_what_is_there(void **state)
{
    (void)state;
    for (uint8_t format = 3; format <= 8; format += 5) {
        image las = make_las(format, COUNT, 1, 9);
        for (uint32_t each = 0; each <= 400; each += 400) {
            image laz = pack(las, (write_laz_options){.chunk_points = each});
            for (size_t size = 0; size < laz.size; size += size % 41 == 0 ? 1 : 37)
                check_cut(las, laz, size);
            for (size_t size = laz.size - 40; size < laz.size; size++)
                check_cut(las, laz, size);
            free(laz.bytes);
        }
        free(las.bytes);
    }
}

/* Opens and reads whatever it is; an error or points, and not more of them than `most`. */
static void check_survives(image laz, uint32_t threads, uint64_t most)
{
    opened o;
    mospt_err err = {0};
    const uint8_t *records;
    size_t got;
    if (!open_image(laz, threads, &o, &err)) {
        assert_int_equal(err.code, MOSPT_EFORMAT);
        assert_true(err.message[0] != '\0');
        return;
    }
    uint64_t count = 0, sum = 0;
    do {
        assert_true(prep_laz_read(o.laz, 1000, &records, &got, &err));
        for (size_t i = 0; i < got * o.header.record_length; i++)
            sum += records[i];
        count += got;
        assert_true(count <= most);
    } while (got > 0);
    assert_true(sum != 1);
    close_image(&o);
}

static void every_header_byte_may_lie(void **state)
{
    (void)state;
    static const uint8_t values[] = {0, 1, 127, 255};
    for (uint8_t format = 1; format <= 7; format += 6) {
        image las = make_las(format, 120, 1, 5),
              laz = pack(las, (write_laz_options){.chunk_points = 50});
        size_t end = prep_le32(laz.bytes + 96) + 8, record = prep_le16(laz.bytes + 94);
        for (size_t at = 94; at < end; at++) {
            if (at == 111) at = 247; /* what is between does not matter here */
            if (at == 255) at = record;
            for (size_t v = 0; v < sizeof values; v++) {
                uint8_t before = laz.bytes[at];
                laz.bytes[at] = values[v];
                check_survives(laz, 1, UINT64_MAX);
                laz.bytes[at] = before;
            }
        }
        free(laz.bytes);
        free(las.bytes);
    }
}

static void flipped_bits_lose_no_more_than_they_must(void **state)
{
    (void)state;
    uint64_t seed = 11;
    for (uint8_t format = 0; format <= 10; format++) {
        image las = make_las(format, COUNT, 2, format);
        image laz =
            pack(las, (write_laz_options){.chunk_points = 200, .version = format == 4 ? 1 : 0});
        size_t begin = prep_le32(laz.bytes + 96);
        for (int k = 0; k < 60; k++) {
            size_t at = begin + scan_points_random(&seed) % (laz.size - begin);
            uint8_t bit = (uint8_t)(1 << scan_points_random(&seed) % 8);
            laz.bytes[at] ^= bit;
            check_survives(laz, 1 + (uint32_t)k % 3, COUNT);
            laz.bytes[at] ^= bit;
        }
        free(laz.bytes);
        free(las.bytes);
    }
}

/* A header that claims 4e9 points gets those that are there, soon. */
static void hostile_counts_end_with_the_bytes(void **state)
{
    (void)state;
    for (uint8_t format = 0; format <= 6; format += 6) {
        image las = make_las(format, 300, 0, 6);
        for (uint32_t each = 0; each <= 100; each += 100) {
            image laz =
                pack(las, (write_laz_options){.chunk_points = each, .table = WRITE_LAZ_NO_TABLE});
            size_t vlr = prep_le16(laz.bytes + 94) + 54;
            write_las_u32(laz.bytes + 107, format == 0 ? 4000000000u : 0);
            write_las_u64(laz.bytes + 247, format == 0 ? 4000000000u : UINT64_C(1) << 60);
            check_survives(laz, 2, 1000000);
            write_las_u32(laz.bytes + vlr + 12, 4000000000u); /* and chunks of as many */
            check_survives(laz, 2, 1000000);
            free(laz.bytes);
        }
        free(las.bytes);
    }
}

static void what_is_not_known_is_refused_with_its_place(void **state)
{
    (void)state;
    static const struct {
        uint32_t at; /* byte in the payload of the record */
        uint8_t value;
    } changes[] = {{0, 0},  {0, 4},   {0, 3},  {2, 1},  {32, 1}, {32, 200},
                   {34, 7}, {36, 21}, {38, 3}, {38, 0}, {44, 1}};
    image las = make_las(3, 10, 0, 5), laz = pack(las, (write_laz_options){0});
    size_t record = prep_le16(laz.bytes + 94) + 54;
    for (size_t i = 0; i < sizeof changes / sizeof changes[0]; i++) {
        opened o;
        mospt_err err = {0};
        uint8_t *p = laz.bytes + record + changes[i].at, before = *p;
        *p = changes[i].value;
        assert_false(open_image(laz, 1, &o, &err));
        assert_int_equal(err.code, MOSPT_EFORMAT);
        assert_true(err.place >= record && err.place <= record + changes[i].at);
        *p = before;
    }
    memset(laz.bytes + record - 52, 'x', 5);
    opened o;
    mospt_err err;
    assert_false(open_image(laz, 1, &o, &err));
    assert_non_null(strstr(err.message, "missing"));
    free(laz.bytes);
    free(las.bytes);
}

static void check_same_points(const scan_points *a, const scan_points *b)
{
    assert_int_equal(a->count, b->count);
    assert_memory_equal(a->xyz, b->xyz, a->count * 3 * sizeof *a->xyz);
    assert_int_equal(a->info.attributes.count, b->info.attributes.count);
    for (uint32_t k = 0; k < a->info.attributes.count; k++)
        assert_memory_equal(a->plane[k], b->plane[k],
                            a->count * mospt_attribute_size(&a->info.attributes.at[k]));
    assert_int_equal(a->info.has_rgb, b->info.has_rgb);
    assert_false(a->is_damaged || b->is_damaged);
}

static void a_scan_reads_like_its_uncompressed_twin(void **state)
{
    (void)state;
    for (uint8_t format = 0; format <= 10; format++) {
        image las = make_las(format, COUNT, 3, format),
              laz = pack(las, (write_laz_options){.chunk_points = 350});
        scan_points a, b;
        mospt_err err;
        if (!scan_points_read(scan_points_file("a.laz", laz.bytes, laz.size), NULL, 100, &a, &err))
            fail_msg("%s", err.message);
        assert_true(
            scan_points_read(scan_points_file("a.las", las.bytes, las.size), NULL, 100, &b, &err));
        check_same_points(&a, &b);
        scan_points_fini(&a);
        scan_points_fini(&b);
        free(laz.bytes);
        free(las.bytes);
    }
}

/* Files made by other programs, beside the LAS that they were made from. */
static void real_files_read_like_their_twins(void **state)
{
    (void)state;
    char path[2048];
    if (!laz_twins_path(0, 0, path, sizeof path)) skip();
    for (size_t i = 0; i < laz_twins_count; i++) {
        image file[2];
        for (int k = 0; k < 2; k++) {
            assert_true(laz_twins_path(i, k, path, sizeof path));
            FILE *f = fopen(path, "rb");
            if (f == NULL) fail_msg("cannot open %s", path);
            fseek(f, 0, SEEK_END);
            file[k].size = (size_t)ftell(f);
            file[k].bytes = malloc(file[k].size);
            rewind(f);
            assert_true(fread(file[k].bytes, 1, file[k].size, f) == file[k].size);
            fclose(f);
        }
        for (uint32_t threads = 1; threads <= 3; threads += 2)
            check_same(file[1], file[0], threads, 1000);
        free(file[0].bytes);
        free(file[1].bytes);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_format_and_version_comes_back),
        cmocka_unit_test(long_chunks_leave_no_trace_of_windows),
        cmocka_unit_test(large_chunks_come_in_parts),
        cmocka_unit_test(chunks_of_every_kind_come_in_order),
        cmocka_unit_test(a_file_can_be_read_again_from_any_place),
        cmocka_unit_test(any_place_can_be_looked_at),
        cmocka_unit_test(a_chunk_in_memory_is_decoded_alone),
        cmocka_unit_test(wave_packets_can_be_left_out_of_layers),
        cmocka_unit_test(a_missing_or_bogus_table_costs_no_points),
        cmocka_unit_test(rows_of_varying_chunks_need_their_table),
        cmocka_unit_test(every_truncation_keeps_what_is_there),
        cmocka_unit_test(every_header_byte_may_lie),
        cmocka_unit_test(flipped_bits_lose_no_more_than_they_must),
        cmocka_unit_test(hostile_counts_end_with_the_bytes),
        cmocka_unit_test(what_is_not_known_is_refused_with_its_place),
        cmocka_unit_test(a_scan_reads_like_its_uncompressed_twin),
        cmocka_unit_test(real_files_read_like_their_twins),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
