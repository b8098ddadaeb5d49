/* A dataset that opens is consistent, and `check` finds whatever else is wrong with it: no byte can
 * be lost or changed. */
#include "tests/core_tools.h"

#include "mospt/hash.h"
#include "mospt/payload.h"
#include "mospt/writer.h"

#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { FILES_MAX = 16, DEPTH = 2, THRESHOLD = 6 };

static char *folder, *dataset_path;
static core_site site;
static struct {
    char *path;
    uint8_t *bytes;
    size_t size;
} files[FILES_MAX];
static size_t file_count;

static int set_up(void **state)
{
    mospt_err err;
    (void)state;
    folder = core_folder_make();
    dataset_path = core_path(folder, "small.ipts");
    core_site_make(CORE_CLUSTERED, 8, 60, 21, &site);
    core_dataset_make(&site, DEPTH, THRESHOLD, dataset_path);
    assert_int_equal(core_findings(dataset_path, &err), 0);
    DIR *dir = opendir(dataset_path);
    for (struct dirent *e; (e = readdir(dir)) != NULL;) {
        if (e->d_name[0] == '.') continue;
        assert_true(file_count < FILES_MAX);
        files[file_count].path = core_path(dataset_path, "%s", e->d_name);
        files[file_count].bytes = core_file_read(files[file_count].path, &files[file_count].size);
        file_count++;
    }
    closedir(dir);
    assert_true(file_count >= 4); /* metadata, hierarchy, two levels or more */
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    for (size_t f = 0; f < file_count; f++)
        free(files[f].path), free(files[f].bytes);
    core_site_fini(&site);
    core_folder_remove(folder);
    free(dataset_path);
    return 0;
}

static void restore(size_t f)
{
    core_file_write(files[f].path, files[f].bytes, files[f].size);
}

static void every_truncation_of_every_file_is_found(void **state)
{
    (void)state;
    for (size_t f = 0; f < file_count; f++) {
        for (size_t n = 0; n < files[f].size; n++) {
            mospt_err first;
            core_file_write(files[f].path, files[f].bytes, n);
            if (core_findings(dataset_path, &first) == 0)
                fail_msg("%s cut to %zu bytes is not found", files[f].path, n);
            assert_true(first.file[0] != '\0');
        }
        restore(f);
    }
    assert_int_equal(core_findings(dataset_path, NULL), 0);
}

static void every_changed_byte_of_every_file_is_found(void **state)
{
    uint64_t random = 2;
    (void)state;
    for (size_t f = 0; f < file_count; f++) {
        for (size_t i = 0; i < files[f].size; i++)
            for (int k = 0; k < 3; k++) {
                uint32_t bits =
                    k == 0 ? 1u << core_below(&random, 8) : 1 + core_below(&random, 255);
                uint8_t change = (uint8_t)bits, old = files[f].bytes[i];
                mospt_err first;
                files[f].bytes[i] ^= change;
                restore(f);
                if (core_findings(dataset_path, &first) == 0)
                    fail_msg("%s: byte %zu changed by %02x is not found", files[f].path, i, change);
                files[f].bytes[i] = old;
            }
        restore(f);
    }
    assert_int_equal(core_findings(dataset_path, NULL), 0);
}

static void every_deleted_file_is_found(void **state)
{
    (void)state;
    for (size_t f = 0; f < file_count; f++) {
        mospt_err first;
        unlink(files[f].path);
        assert_int_equal(core_findings(dataset_path, &first), 1);
        assert_string_equal(first.file, files[f].path);
        assert_int_equal(first.code, MOSPT_EIO);
        restore(f);
    }
}

static void every_appended_byte_is_found(void **state)
{
    (void)state;
    for (size_t f = 0; f < file_count; f++) {
        uint8_t *longer = calloc(1, files[f].size + 3);
        assert_non_null(longer);
        memcpy(longer, files[f].bytes, files[f].size);
        for (size_t more = 1; more <= 3; more++) {
            core_file_write(files[f].path, longer, files[f].size + more);
            if (core_findings(dataset_path, NULL) == 0)
                fail_msg("%zu bytes more in %s are not found", more, files[f].path);
        }
        free(longer);
        restore(f);
    }
}

static void swapped_files_are_found(void **state)
{
    (void)state;
    for (size_t a = 0; a < file_count; a++)
        for (size_t b = a + 1; b < file_count; b++) {
            core_file_write(files[a].path, files[b].bytes, files[b].size);
            core_file_write(files[b].path, files[a].bytes, files[a].size);
            assert_true(core_findings(dataset_path, NULL) > 0);
            restore(a), restore(b);
        }
    assert_int_equal(core_findings(dataset_path, NULL), 0);
}

static void what_is_read_is_what_was_put_in(void **state)
{
    mospt_dataset *d = NULL;
    mospt_err err = {0};
    uint64_t hash = 0;
    (void)state;
    CORE_NEED(mospt_dataset_open(dataset_path, &d, &err));
    assert_true(d->hierarchy.count > 3);
    for (uint32_t i = 0; i < d->hierarchy.count; i++) {
        uint32_t count = d->hierarchy.nodes[i].count;
        mospt_vertex *v = malloc(count * sizeof *v);
        uint8_t *planes = malloc(count * site.schema.row_size);
        assert_true(v != NULL && planes != NULL);
        CORE_NEED(mospt_dataset_read_vertices(d, i, v, &err));
        CORE_NEED(mospt_dataset_read_attributes(d, i, v, planes, &err));
        hash += mospt_payload_points_hash(&site.schema, (const uint8_t *)v, planes, count);
        free(v), free(planes);
    }
    assert_true(hash == mospt_hash_records(site.records, site.stride, site.count));
    assert_true(hash == d->metadata.points_hash);
    mospt_dataset_close(d);
    mospt_dataset_close(NULL);
}

/* Writes the small dataset with something wrong in what the writer is told: all checksums of files
 * are right then. */
typedef struct {
    void (*node)(mospt_node *node, uint32_t index);
    void (*payload)(uint8_t *payload, mospt_node *node, uint32_t index);
    void (*metadata)(mospt_metadata *metadata);
    bool refused; /* the commit itself sees it */
} liar;

static uint64_t findings_of(const liar *l, mospt_err *first)
{
    char *path = core_path(folder, "liar.ipts");
    prep_shape shape = core_shape(&site, DEPTH, THRESHOLD);
    core_subtree made = core_solve(&shape, &site);
    mospt_writer *writer = NULL;
    mospt_metadata metadata;
    mospt_err err = {0};
    uint64_t findings = 0;
    CORE_NEED(mospt_writer_create(path, DEPTH, &writer, &err));
    uint8_t *payload = made.payload;
    for (uint32_t i = 0; i < made.node_count; i++) {
        mospt_node *n = &made.nodes[i];
        const uint64_t size = n->payload_size; /* of what stands here, whatever is told of it */
        if (l->payload != NULL) {
            l->payload(payload, n, i);
            n->vertices_hash = mospt_hash(payload, n->count * sizeof(mospt_vertex));
            n->attributes_hash = mospt_hash(payload + n->count * sizeof(mospt_vertex),
                                            n->count * (size_t)site.schema.row_size);
        }
        if (l->node != NULL) l->node(n, i);
        payload += size;
    }
    core_write(writer, &made);
    core_metadata_make(&site, THRESHOLD, &metadata);
    if (l->metadata != NULL) l->metadata(&metadata);
    bool committed = mospt_writer_commit(writer, &metadata, &err);
    assert_int_equal(committed, !l->refused);
    mospt_metadata_fini(&metadata);
    mospt_writer_destroy(writer);
    if (committed) findings = core_findings(path, first);
    if (committed) core_folder_remove(path);
    else free(path);
    core_subtree_fini(&made);
    return findings;
}

static void node_vertices_hash(mospt_node *n, uint32_t i)
{
    n->vertices_hash += i == 1;
}
static void node_attributes_hash(mospt_node *n, uint32_t i)
{
    n->attributes_hash += i == 1;
}
static void node_payload_size(mospt_node *n, uint32_t i)
{
    n->payload_size -= i == 0;
}
static void node_level_end(mospt_node *n, uint32_t i)
{
    n->level_end[1] -= i == 0;
}
static void node_count(mospt_node *n, uint32_t i)
{
    n->count += i == 2, n->level_end[DEPTH + 1] += i == 2;
}
static void payload_colour(uint8_t *p, mospt_node *n, uint32_t i)
{
    (void)n, p[12] ^= i == 1;
}
static void payload_place(uint8_t *p, mospt_node *n, uint32_t i)
{
    (void)n, p[2] ^= i == 1 ? 1 : 0;
}
static void payload_scan(uint8_t *p, mospt_node *n, uint32_t i)
{
    p[n->count * sizeof(mospt_vertex) + 1] ^= i == 1;
}
static void payload_swap(uint8_t *p, mospt_node *n, uint32_t i)
{
    uint8_t swap[16], *a = p + 16 * (n->level_end[0]), *b = p + 16 * (n->level_end[1] - 1);
    if (i > 0) return;
    memcpy(swap, a, 16), memcpy(a, b, 16), memcpy(b, swap, 16);
}
static void payload_swap_first(uint8_t *p, mospt_node *n, uint32_t i)
{
    uint8_t swap[16], *b = p + 16 * (n->count - 1);
    if (i > 0) return;
    memcpy(swap, p, 16), memcpy(p, b, 16), memcpy(b, swap, 16);
}
static void metadata_hash(mospt_metadata *m)
{
    m->points_hash++;
}
static void metadata_low(mospt_metadata *m)
{
    m->low[1] -= 0.001;
}
static void metadata_high(mospt_metadata *m)
{
    m->high[2] += 0.001;
}
static void metadata_source(mospt_metadata *m)
{
    m->sources[0].points--, m->sources[1].points++;
}
static void metadata_fewer_sources(mospt_metadata *m)
{
    mospt_source *s = &m->sources[--m->source_count];
    free(s->name), free(s->scan), free(s->format);
}
static void metadata_threshold(mospt_metadata *m)
{
    m->add_threshold += 1000;
}
static void metadata_low_threshold(mospt_metadata *m)
{
    m->add_threshold = 2;
}
static void metadata_root(mospt_metadata *m)
{
    m->grid.root[0] ^= 1u << m->grid.bits;
}
static void metadata_schema(mospt_metadata *m)
{
    m->schema.at[1].type = MOSPT_U16, m->schema.row_size -= 2, m->schema.stored_size -= 2;
}

static void a_liar_with_the_right_checksums_is_found(void **state)
{
    static const liar truth = {0};
    static const struct {
        const char *name;
        liar lie;
    } lies[] = {
        {"vertices_hash", {.node = node_vertices_hash}},
        {"attributes_hash", {.node = node_attributes_hash}},
        {"payload_size", {.node = node_payload_size}},
        {"level_end", {.node = node_level_end}},
        {"count", {.node = node_count}},
        {"colour", {.payload = payload_colour}},
        {"place", {.payload = payload_place}},
        {"scan", {.payload = payload_scan}},
        {"order in a level", {.payload = payload_swap}},
        {"order of levels", {.payload = payload_swap_first}},
        {"points_hash", {.metadata = metadata_hash}},
        {"low", {.metadata = metadata_low}},
        {"high", {.metadata = metadata_high}},
        {"points of a source", {.metadata = metadata_source}},
        {"sources", {.metadata = metadata_fewer_sources}},
        {"threshold too high for the tree", {.metadata = metadata_threshold}},
        {"threshold too low for the tree", {.metadata = metadata_low_threshold}},
        {"root", {.metadata = metadata_root, .refused = true}},
        {"schema", {.metadata = metadata_schema}},
    };
    (void)state;
    assert_int_equal(findings_of(&truth, NULL), 0);
    for (size_t k = 0; k < sizeof lies / sizeof lies[0]; k++) {
        uint64_t findings = findings_of(&lies[k].lie, NULL);
        if (findings == 0 && !lies[k].lie.refused)
            fail_msg("a wrong %s is not found", lies[k].name);
    }
}

/* Into the cube beside that of its node: what is looked at inside the node stays as it was. */
static void payload_beside(uint8_t *p, mospt_node *n, uint32_t i)
{
    uint32_t x;
    if (i != 1) return;
    memcpy(&x, p, sizeof x);
    x ^= UINT32_C(1) << (site.grid.bits - n->level);
    memcpy(p, &x, sizeof x);
}

static void a_point_outside_the_cube_of_its_node_is_found(void **state)
{
    static const liar lie = {.payload = payload_beside};
    mospt_err first;
    (void)state;
    assert_true(findings_of(&lie, &first) > 0);
    assert_non_null(strstr(first.message, "outside the cube"));
}

static bool stop_at_two(void *context, uint32_t done, uint32_t total)
{
    (void)context, (void)total;
    return done < 2;
}

static void ignore(void *context, const mospt_err *what)
{
    (void)context, (void)what;
}

static void a_check_can_be_stopped(void **state)
{
    mospt_dataset *d = NULL;
    mospt_err err = {0};
    mospt_check_result result;
    const mospt_check_options options = {.found = ignore, .progress = stop_at_two};
    (void)state;
    CORE_NEED(mospt_dataset_open(dataset_path, &d, &err));
    CORE_FAILS(mospt_check(d, &options, &result, &err), MOSPT_ECANCELLED);
    mospt_dataset_close(d);
}

static void a_writer_refuses_what_it_must_not_overwrite(void **state)
{
    mospt_writer *writer = NULL;
    mospt_err err = {0};
    (void)state;
    CORE_FAILS(mospt_writer_create(dataset_path, DEPTH, &writer, &err), MOSPT_EINVAL);
    assert_int_equal(core_findings(dataset_path, NULL), 0);

    /* A folder with somebody's things: nothing in it is touched, in whatever order they are listed.
     */
    static const char *const theirs[] = {
        "notes.txt",    "hierarchy-1.jpg",   "hierarchy-000001.bin.bak", "points-3.binary",
        "points-1.bin", "points-00.bin.old", "metadata.json.old",        ".hidden"};
    for (size_t k = 0; k < 2 * sizeof theirs / sizeof theirs[0]; k++) {
        const char *names[3] = {"points-00.bin", "hierarchy-000001.bin", theirs[k / 2]};
        char *other = core_path(folder, "other");
        assert_int_equal(mkdir(other, 0777), 0);
        for (int i = 0; i < 3; i++) {
            char *path = core_path(other, "%s", names[k % 2 ? i : 2 - i]);
            core_file_write(path, "x", 1);
            free(path);
        }
        CORE_FAILS(mospt_writer_create(other, DEPTH, &writer, &err), MOSPT_EINVAL);
        assert_int_equal(core_entries(other), 3);
        core_folder_remove(other);
    }
}

static void a_writer_takes_over_what_a_killed_build_left(void **state)
{
    static const char *const names[] = {"points-00.bin", "points-17.bin", "hierarchy-000001.bin",
                                        "hierarchy-000001.bin.new", "metadata.json.new"};
    char *left = core_path(folder, "left.ipts");
    mospt_writer *writer = NULL;
    mospt_err err = {0};
    (void)state;
    assert_int_equal(mkdir(left, 0777), 0);
    for (size_t k = 0; k < sizeof names / sizeof names[0]; k++) {
        char *path = core_path(left, "%s", names[k]);
        core_file_write(path, "x", 1);
        free(path);
    }
    CORE_NEED(mospt_writer_create(left, DEPTH, &writer, &err));
    assert_int_equal(core_entries(left), 0);
    mospt_writer_destroy(writer); /* without a commit: nothing is left */
    assert_false(core_exists(left));
    free(left);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_truncation_of_every_file_is_found),
        cmocka_unit_test(every_changed_byte_of_every_file_is_found),
        cmocka_unit_test(every_deleted_file_is_found),
        cmocka_unit_test(every_appended_byte_is_found),
        cmocka_unit_test(swapped_files_are_found),
        cmocka_unit_test(what_is_read_is_what_was_put_in),
        cmocka_unit_test(a_liar_with_the_right_checksums_is_found),
        cmocka_unit_test(a_point_outside_the_cube_of_its_node_is_found),
        cmocka_unit_test(a_check_can_be_stopped),
        cmocka_unit_test(a_writer_refuses_what_it_must_not_overwrite),
        cmocka_unit_test(a_writer_takes_over_what_a_killed_build_left),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
