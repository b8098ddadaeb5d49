/* metadata.json: what is said comes back, and no byte of it goes unchecked. */
#include "tests/core_tools.h"

#include "mospt/hash.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TAIL = 37 };

static char *folder, *path;

static int set_up(void **state)
{
    (void)state;
    folder = core_folder_make();
    path = core_path(folder, "metadata.json");
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    core_folder_remove(folder);
    free(path);
    return 0;
}

static mospt_metadata make(const char *name)
{
    mospt_metadata m = {
        .generation = INT64_MAX,
        .unfinished = {.commit = 3,
                       .points = UINT64_C(123456789012346),
                       .points_hash = UINT64_C(0x8000000000000001),
                       .build = UINT64_MAX},
        .inner_depth = 7,
        .add_threshold = 4096,
        .point_count = UINT64_C(123456789012345),
        .points_hash = UINT64_C(0xfedcba9876543210),
        .position_error = 0.1 + 0.2,
        .low = {-1e-300, -0.1, 1.0 / 3},
        .high = {1e15, 5, 1e7 + 0.001},
        .source_count = 3,
        .file_count = 2,
        .hierarchy_name = "hierarchy-000001.bin",
        .hierarchy_size = 12345,
        .hierarchy_hash = 1,
        .grid = {.offset = {500000.123, -1e7, 0},
                 .base = {INT64_MIN / 2, 5, INT64_MAX / 2},
                 .step = 0.001,
                 .bits = 31,
                 .root = {0x80000000, 0, 0}},
    };
    mospt_err err = {0};
    m.crs = strdup("EPSG:25833 \"quoted\" \\ \n end");
    m.sources = calloc(3, sizeof *m.sources);
    m.files = calloc(2, sizeof *m.files);
    CORE_NEED(mospt_schema_add(&m.schema, "scan", MOSPT_U16, 1, &err));
    CORE_NEED(mospt_schema_add(&m.schema, "normal", MOSPT_F32, 3, &err));
    CORE_NEED(mospt_schema_add(&m.schema, name, MOSPT_I64, 255, &err));
    CORE_NEED(mospt_schema_add(&m.schema, "rgb", MOSPT_U16, 3, &err));
    CORE_NEED(mospt_schema_add(&m.schema, "gps_time", MOSPT_F64, 1, &err));
    mospt_schema_keep(&m.schema, 3, MOSPT_OF_COLOUR, NULL);
    mospt_schema_keep(&m.schema, 4, MOSPT_CONSTANT,
                      (const uint8_t[]){0, 1, 2, 127, 128, 254, 255, 9});
    for (uint32_t i = 0; i < 3; i++) {
        mospt_source *s = &m.sources[i];
        s->name = strdup(name), s->scan = strdup(i ? name : ""),
        s->format = strdup("text, 7 columns");
        s->points = i * 1000, s->has_rgb = i & 1, s->has_intensity = !(i & 1);
        s->low[i] = -i / 3.0, s->high[i] = 1e9 / 7;
        if (i == 1) {
            s->crs = strdup("PROJCS[\"elsewhere\", ...]");
            s->damage = strdup("scan_07.las: byte 18234: \x01 record claims\t26 bytes");
            s->has_pose = true;
            for (int k = 0; k < 16; k++)
                s->pose[k] = sqrt(k) - 2;
            s->reason_count = 2;
            s->drop_reason[0] = strdup("not finite"), s->drop_count[0] = 17;
            s->drop_reason[1] = strdup("no return"), s->drop_count[1] = UINT64_C(1) << 40;
            s->dropped = 17 + (UINT64_C(1) << 40);
        }
    }
    m.files[0].name = strdup("points-00.bin"), m.files[0].size = 7;
    m.files[1].name = strdup("points-01.bin"), m.files[1].size = INT64_MAX;
    return m;
}

static void assert_same(const mospt_metadata *a, const mospt_metadata *b, const char *name)
{
    assert_true(a->generation == b->generation && a->point_count == b->point_count &&
                a->points_hash == b->points_hash);
    assert_memory_equal(&a->unfinished, &b->unfinished, sizeof a->unfinished);
    assert_memory_equal(&a->grid, &b->grid, sizeof a->grid);
    assert_int_equal(a->schema.count, b->schema.count);
    assert_int_equal(a->schema.row_size, b->schema.row_size);
    assert_int_equal(a->schema.stored_size, b->schema.stored_size);
    for (uint32_t k = 0; k < 2; k++)
        assert_string_equal(a->schema.at[k].name, b->schema.at[k].name);
    for (uint32_t k = 0; k < 5; k++) {
        assert_int_equal(a->schema.at[k].storage, b->schema.at[k].storage);
        assert_memory_equal(a->schema.at[k].constant, b->schema.at[k].constant,
                            sizeof a->schema.at[k].constant);
        assert_int_equal(a->schema.at[k].type, b->schema.at[k].type);
        assert_int_equal(a->schema.at[k].components, b->schema.at[k].components);
        assert_int_equal(a->schema.at[k].offset, b->schema.at[k].offset);
    }
    assert_int_equal(a->inner_depth, b->inner_depth);
    assert_int_equal(a->add_threshold, b->add_threshold);
    assert_true(a->position_error == b->position_error);
    assert_memory_equal(a->low, b->low, sizeof a->low);
    assert_memory_equal(a->high, b->high, sizeof a->high);
    assert_string_equal(a->crs, b->crs);
    assert_string_equal(a->hierarchy_name, b->hierarchy_name);
    assert_true(a->hierarchy_size == b->hierarchy_size && a->hierarchy_hash == b->hierarchy_hash);
    assert_int_equal(a->file_count, b->file_count);
    for (uint32_t i = 0; i < a->file_count; i++) {
        assert_string_equal(a->files[i].name, b->files[i].name);
        assert_true(a->files[i].size == b->files[i].size);
    }
    assert_int_equal(a->source_count, b->source_count);
    for (uint32_t i = 0; i < a->source_count; i++) {
        const mospt_source *s = &a->sources[i], *t = &b->sources[i];
        assert_string_equal(t->name, name);
        assert_string_equal(t->scan, i ? name : "");
        assert_string_equal(s->format, t->format);
        assert_true(s->points == t->points && s->dropped == t->dropped &&
                    s->reason_count == t->reason_count);
        for (uint32_t r = 0; r < s->reason_count; r++) {
            assert_string_equal(s->drop_reason[r], t->drop_reason[r]);
            assert_true(s->drop_count[r] == t->drop_count[r]);
        }
        assert_true(s->has_rgb == t->has_rgb && s->has_intensity == t->has_intensity &&
                    s->has_pose == t->has_pose);
        assert_true((s->crs == NULL) == (t->crs == NULL));
        if (s->crs != NULL) assert_string_equal(s->crs, t->crs);
        assert_true((s->damage == NULL) == (t->damage == NULL));
        if (s->damage != NULL) assert_string_equal(s->damage, t->damage);
        assert_memory_equal(s->pose, t->pose, sizeof s->pose);
        if (s->points == 0) continue; /* bounds of nothing are not said */
        assert_memory_equal(s->low, t->low, sizeof s->low);
        assert_memory_equal(s->high, t->high, sizeof s->high);
    }
}

static void check_name(const char *name, const char *wanted)
{
    mospt_err err = {0};
    mospt_metadata m = make(name), back;
    CORE_NEED(mospt_metadata_write(&m, folder, &err));
    CORE_NEED(mospt_metadata_read(folder, &back, &err));
    assert_same(&m, &back, wanted);
    mospt_metadata_fini(&m), mospt_metadata_fini(&back);
}

static void what_is_written_is_read(void **state)
{
    (void)state;
    check_name("a/b c.las", "a/b c.las");
    check_name("x", "x");
}

static void odd_names_survive(void **state)
{
    (void)state;
    check_name("quote \" backslash \\ tab \t line\nend \x7f",
               "quote \" backslash \\ tab \t line\nend \x7f");
    check_name("\x01\x02\x1f", "\x01\x02\x1f");
    check_name("\xc3\xa4\xe6\xbc\xa2\xf0\x9f\x98\x80.las",
               "\xc3\xa4\xe6\xbc\xa2\xf0\x9f\x98\x80.las");
    check_name("</script>{\"}],", "</script>{\"}],");
}

static void names_that_are_no_text_are_told_with_question_marks(void **state)
{
    (void)state;
    check_name("caf\xe9.las", "caf?.las");
    check_name("\xff\xfe", "??");
    check_name("\xc3", "?");
    check_name("\xed\xa0\x80", "???"); /* half of a surrogate pair */
}

static void every_truncation_is_a_format_error(void **state)
{
    mospt_err err = {0};
    mospt_metadata m = make("n"), back;
    size_t size;
    (void)state;
    CORE_NEED(mospt_metadata_write(&m, folder, &err));
    uint8_t *bytes = core_file_read(path, &size);
    for (size_t n = 0; n < size; n++) {
        core_file_write(path, bytes, n);
        CORE_FAILS(mospt_metadata_read(folder, &back, &err), MOSPT_EFORMAT);
    }
    bytes[size] = ' ';
    core_file_write(path, bytes, size + 1);
    CORE_FAILS(mospt_metadata_read(folder, &back, &err), MOSPT_EFORMAT);
    free(bytes);
    mospt_metadata_fini(&m);
}

static void every_bit_is_checked(void **state)
{
    mospt_err err = {0};
    mospt_metadata m = make("n"), back;
    size_t size;
    (void)state;
    CORE_NEED(mospt_metadata_write(&m, folder, &err));
    uint8_t *bytes = core_file_read(path, &size);
    for (size_t i = 0; i < size; i++)
        for (int bit = 0; bit < 8; bit++) {
            bytes[i] ^= (uint8_t)(1 << bit);
            core_file_write(path, bytes, size);
            CORE_FAILS(mospt_metadata_read(folder, &back, &err), MOSPT_EFORMAT);
            bytes[i] ^= (uint8_t)(1 << bit);
        }
    free(bytes);
    mospt_metadata_fini(&m);
}

/* Writes a text whose own checksum is put right. */
static void write_signed(const char *text, size_t size)
{
    char *whole = malloc(size + TAIL + 1);
    assert_non_null(whole);
    memcpy(whole, text, size);
    snprintf(whole + size, TAIL + 1, ",\n  \"checksum\": \"%016" PRIx64 "\"\n}\n",
             mospt_hash(text, size));
    core_file_write(path, whole, size + TAIL);
    free(whole);
}

static char *replaced(const char *text, size_t size, const char *what, const char *with,
                      size_t *new_size)
{
    const char *at = memmem(text, size, what, strlen(what));
    if (at == NULL) fail_msg("no %s in the text", what);
    char *out = malloc(size + strlen(with) + 1);
    assert_non_null(out);
    size_t before = (size_t)(at - text), after = before + strlen(what);
    memcpy(out, text, before);
    memcpy(out + before, with, strlen(with));
    memcpy(out + before + strlen(with), text + after, size - after);
    *new_size = size - strlen(what) + strlen(with);
    return out;
}

static void a_liar_with_the_right_checksum_is_refused(void **state)
{
    static const char *const lies[][2] = {
        {"\"version\": 4", "\"version\": 1"},
        {"\"version\": 4", "\"version\": 3"},
        {"\"version\": 4", "\"version\": 5"},
        {"\"version\": 4", "\"version\": \"4\""},
        {"\"0001027f80feff09\"", "\"0001027f80feff\""},
        {"\"0001027f80feff09\"", "\"0001027f80feff0900\""},
        {"\"0001027f80feff09\"", "\"0001027f80feff0x\""},
        {"\"0001027f80feff09\"", "\"0001027f80feff 9\""},
        {"\"0001027f80feff09\"", "1"},
        {"\"0001027f80feff09\"", "\"0001027f80feff09\", \"of\": \"colour\""},
        {"\"components\": 255", "\"components\": 255, \"constant\": \"00\""},
        {"\"components\": 255", "\"components\": 255, \"of\": \"colour\""},
        {"\"of\": \"colour\"", "\"of\": \"color\""},
        {"\"of\": \"colour\"", "\"of\": 1"},
        {"\"instantpoints dataset\"", "\"another dataset\""},
        {"\"additive\"", "\"replacing\""},
        {"\"additive\"", "7"},
        {"\"inner_depth\": 7", "\"inner_depth\": 0"},
        {"\"inner_depth\": 7", "\"inner_depth\": 10"},
        {"\"inner_depth\": 7", "\"inner_depth\": -1"},
        {"\"inner_depth\": 7", "\"inner_depth\": 7.5"},
        {"\"inner_depth\": 7", "\"inner_depth\": null"},
        {"\"points\": 123456789012345", "\"points\": 0"},
        {"\"points\": 123456789012345", "\"points\": -1"},
        {"\"points\": 123456789012345", "\"points\": 1e30"},
        {"\"fedcba9876543210\"", "\"fedcba987654321\""},
        {"\"fedcba9876543210\"", "\"gedcba9876543210\""},
        {"\"fedcba9876543210\"", "5"},
        {"\"add_threshold\": 4096", "\"add_threshold\": -4096"},
        {"\"bits\": 31", "\"bits\": 33"},
        {"\"bits\": 31", "\"bits\": 32"},
        {"\"step\": 0.001", "\"step\": 0"},
        {"\"step\": 0.001", "\"step\": -1.0"},
        {"\"step\": 0.001", "\"step\": \"x\""},
        {"2147483648", "4294967296"},
        {"2147483648", "-1"},
        {"2147483648", "1"},
        {"\"points-00.bin\"", "\"../points-00.bin\""},
        {"\"points-00.bin\"", "\"/etc/passwd\""},
        {"\"points-00.bin\"", "null"},
        {"\"hierarchy-000001.bin\"", "\"../h.bin\""},
        {"\"hierarchy-000001.bin\"", "3"},
        {"\"u16\"", "\"u17\""},
        {"\"normal\"", "\"scan\""},
        {"\"components\": 3", "\"components\": 0"},
        {"\"components\": 3", "\"components\": 256"},
        {"\"size\": 7", "\"size\": -7"},
        {"\"size\": 12345", "\"size\": \"12345\""},
        {"\"text, 7 columns\"", "[]"},
        {"\"not finite\": 17", "\"not finite\": -1"},
        {"\"not finite\": 17", "\"not finite\": \"many\""},
        {"\"points\": 1000", "\"points\": -1000"},
        {"\"generation\": 9223372036854775807", "\"generation\": 0"},
        {"\"commit\": 3", "\"commit\": 0"},
        {"\"build\": \"f", "\"build\": \""},
        {"\"unfinished\": {", "\"unfinished\": {}, \"old\": {"},
        {"\"attributes\"", "\"attributed\""},
        {"\"sources\"", "\"source\""},
        {"\"payloads\"", "\"payload\""},
        {"\"bounds\"", "\"bound\""},
        {"\"grid\"", "\"grids\""},
        {"\"crs\"", "\"csr\""},
        {"\"position_error\"", "\"error\""},
    };
    mospt_err err = {0};
    mospt_metadata m = make("n"), back;
    size_t size, lie_size;
    (void)state;
    CORE_NEED(mospt_metadata_write(&m, folder, &err));
    char *text = (char *)core_file_read(path, &size);
    write_signed(text, size - TAIL);
    CORE_NEED(mospt_metadata_read(folder, &back, &err)); /* the truth, signed by this test */
    mospt_metadata_fini(&back);
    for (size_t k = 0; k < sizeof lies / sizeof lies[0]; k++) {
        char *lie = replaced(text, size - TAIL, lies[k][0], lies[k][1], &lie_size);
        write_signed(lie, lie_size);
        free(lie);
        if (mospt_metadata_read(folder, &back, &err))
            fail_msg("%s instead of %s is believed", lies[k][1], lies[k][0]);
        assert_int_equal(err.code, MOSPT_EFORMAT);
        assert_string_equal(err.file, path);
    }
    free(text);
    mospt_metadata_fini(&m);
}

/* It knows nothing of attributes that are not stored. */
static void what_the_version_before_wrote_is_read(void **state)
{
    mospt_err err = {0};
    mospt_metadata m = make("n"), back;
    size_t size, new_size;
    (void)state;
    for (uint32_t k = 0; k < m.schema.count; k++)
        mospt_schema_keep(&m.schema, k, MOSPT_IN_PLANE, NULL);
    CORE_NEED(mospt_metadata_write(&m, folder, &err));
    char *text = (char *)core_file_read(path, &size);
    char *old = replaced(text, size - TAIL, "\"version\": 4", "\"version\": 2", &new_size);
    write_signed(old, new_size);
    CORE_NEED(mospt_metadata_read(folder, &back, &err));
    assert_int_equal(back.schema.stored_size, back.schema.row_size);
    assert_int_equal(back.schema.row_size, m.schema.row_size);
    free(text), free(old);
    mospt_metadata_fini(&m), mospt_metadata_fini(&back);
}

static void every_line_that_is_missing_or_changed_is_an_error_or_good_metadata(void **state)
{
    mospt_err err = {0};
    mospt_metadata m = make("n"), back;
    size_t size;
    uint32_t refused = 0;
    (void)state;
    CORE_NEED(mospt_metadata_write(&m, folder, &err));
    char *text = (char *)core_file_read(path, &size), *copy = malloc(size);
    assert_non_null(copy);
    for (size_t a = 0, b; a < size - TAIL; a = b) {
        for (b = a; b < size - TAIL && text[b] != '\n';)
            b++;
        b += b < size - TAIL;
        memcpy(copy, text, a);
        memcpy(copy + a, text + b, size - TAIL - b);
        write_signed(copy, size - TAIL - (b - a));
        if (mospt_metadata_read(folder, &back, &err)) {
            assert_true(mospt_grid_is_valid(&back.grid));
            mospt_metadata_fini(&back);
        } else {
            assert_int_equal(err.code, MOSPT_EFORMAT);
            refused++;
        }
    }
    assert_true(refused > 50);
    free(text), free(copy);
    mospt_metadata_fini(&m);
}

static void no_metadata_is_no_dataset(void **state)
{
    mospt_err err = {0};
    mospt_metadata back;
    (void)state;
    remove(path);
    CORE_FAILS(mospt_metadata_read(folder, &back, &err), MOSPT_EIO);
    assert_false(mospt_dataset_exists(folder));
    core_file_write(path, "", 0);
    CORE_FAILS(mospt_metadata_read(folder, &back, &err), MOSPT_EFORMAT);
    core_file_write(path, "{}", 2);
    CORE_FAILS(mospt_metadata_read(folder, &back, &err), MOSPT_EFORMAT);
    core_file_write(path, "[[[[", 4);
    CORE_FAILS(mospt_metadata_read(folder, &back, &err), MOSPT_EFORMAT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_written_is_read),
        cmocka_unit_test(odd_names_survive),
        cmocka_unit_test(names_that_are_no_text_are_told_with_question_marks),
        cmocka_unit_test(every_truncation_is_a_format_error),
        cmocka_unit_test(every_bit_is_checked),
        cmocka_unit_test(a_liar_with_the_right_checksum_is_refused),
        cmocka_unit_test(what_the_version_before_wrote_is_read),
        cmocka_unit_test(every_line_that_is_missing_or_changed_is_an_error_or_good_metadata),
        cmocka_unit_test(no_metadata_is_no_dataset),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
