#include "tests/core_tools.h"

#include "mospt/file.h"
#include "mospt/hash.h"
#include "mospt/writer.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

void core_need(bool ok, const char *call, const mospt_err *err, const char *file, int line)
{
    char text[2048];
    if (ok) return;
    mospt_err_text(err, text, sizeof text);
    print_error("%s: %s\n", call, text);
    _fail(file, line);
}

void core_fails(bool ok, const char *call, const mospt_err *err, mospt_code wanted,
                const char *file, int line)
{
    char text[2048];
    mospt_err_text(err, text, sizeof text);
    if (!ok && err->code == wanted && err->message[0] != '\0') return;
    print_error("%s: %s, code %d: %s\n", call, ok ? "succeeded" : "failed", (int)err->code,
                ok ? "" : text);
    _fail(file, line);
}

uint64_t core_random(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

uint32_t core_below(uint64_t *state, uint32_t limit)
{
    return (uint32_t)((core_random(state) >> 32) * limit >> 32);
}

double core_unit(uint64_t *state)
{
    return (double)(core_random(state) >> 11) * 0x1p-53;
}

char *core_folder_make(void)
{
    const char *above = getenv("TMPDIR");
    if (above == NULL) above = access("/dev/shm", W_OK | X_OK) == 0 ? "/dev/shm" : "/tmp";
    char *path = core_path(above, "ipts-test-XXXXXX");
    assert_non_null(mkdtemp(path));
    return path;
}

void core_folder_remove(char *path)
{
    mospt_err err = {0};
    CORE_NEED(mospt_file_remove_tree(path, &err));
    free(path);
}

char *core_folder;

int core_folder_set_up(void **state)
{
    (void)state;
    core_folder = core_folder_make();
    return 0;
}

int core_folder_tear_down(void **state)
{
    (void)state;
    core_folder_remove(core_folder);
    return 0;
}

char *core_path(const char *folder, const char *format, ...)
{
    char name[1024];
    va_list args;
    va_start(args, format);
    vsnprintf(name, sizeof name, format, args);
    va_end(args);
    char *path = mospt_file_join(folder, name);
    assert_non_null(path);
    return path;
}

void core_file_write(const char *path, const void *bytes, size_t size)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
}

uint8_t *core_file_read(const char *path, size_t *size)
{
    char *bytes = NULL;
    mospt_err err = {0};
    CORE_NEED(mospt_file_read_whole(path, SIZE_MAX / 2, &bytes, size, &err));
    return (uint8_t *)bytes;
}

bool core_exists(const char *path)
{
    struct stat status;
    return lstat(path, &status) == 0;
}

uint32_t core_entries(const char *folder)
{
    uint32_t count = 0;
    DIR *dir = opendir(folder);
    assert_non_null(dir);
    for (struct dirent *e; (e = readdir(dir)) != NULL;)
        count += strcmp(e->d_name, ".") != 0 && strcmp(e->d_name, "..") != 0;
    closedir(dir);
    return count;
}

void core_assert_same_folders(const char *a, const char *b)
{
    DIR *dir = opendir(a);
    assert_non_null(dir);
    assert_int_equal(core_entries(a), core_entries(b));
    for (struct dirent *e; (e = readdir(dir)) != NULL;) {
        if (e->d_name[0] == '.') continue;
        size_t na, nb;
        char *pa = core_path(a, "%s", e->d_name), *pb = core_path(b, "%s", e->d_name);
        uint8_t *x = core_file_read(pa, &na), *y = core_file_read(pb, &nb);
        if (na != nb || memcmp(x, y, na) != 0) fail_msg("%s and %s differ", pa, pb);
        free(x), free(y), free(pa), free(pb);
    }
    closedir(dir);
}

static uint32_t mask_of(uint32_t bits)
{
    return bits < 32 ? (UINT32_C(1) << bits) - 1 : UINT32_MAX;
}

static void place(core_kind kind, uint32_t bits, uint64_t *state, uint32_t centres[8][3],
                  uint32_t g[3])
{
    uint32_t mask = mask_of(bits), which = core_below(state, 8);
    for (int a = 0; a < 3; a++)
        g[a] = (uint32_t)core_random(state) & mask;
    switch (kind) {
    case CORE_CLUSTERED: { /* clusters of very different densities: what a scanner sees near and far
                            */
        uint32_t drop = which * 3 + 2;
        for (int a = 0; a < 3; a++)
            g[a] = (centres[which][a] + (bits > drop ? g[a] >> drop : g[a] & 1)) & mask;
        return;
    }
    case CORE_PLANE:
        g[2] = mask / 3;
        return;
    case CORE_LINE:
        g[1] = g[2] = mask / 2 + mask / 5;
        return;
    case CORE_COPIES:
        memcpy(g, centres[which], sizeof centres[which]);
        return;
    case CORE_ONE_POSITION:
    case CORE_IDENTICAL:
        memcpy(g, centres[0], sizeof centres[0]);
        return;
    default:
        return;
    }
}

void core_site_make(core_kind kind, uint32_t bits, uint32_t count, uint64_t seed, core_site *out)
{
    mospt_err err = {0};
    uint32_t root = bits < 32 ? UINT32_C(1) << bits : 0, centres[8][3];
    uint64_t state = seed;
    *out = (core_site){
        .grid = {.step = 0.001, .bits = bits, .base = {-500000, 7, 0}, .root = {root, 0, root}},
        .count = count};
    CORE_NEED(mospt_schema_add(&out->schema, "scan", MOSPT_U16, 1, &err));
    CORE_NEED(mospt_schema_add(&out->schema, "tag", MOSPT_U32, 1, &err));
    out->stride = mospt_record_size(&out->schema);
    out->records = calloc(count + 1, out->stride);
    assert_non_null(out->records);
    for (int c = 0; c < 8; c++)
        for (int a = 0; a < 3; a++)
            centres[c][a] = (uint32_t)core_random(&state) & mask_of(bits);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t g[3], colour = (uint32_t)core_random(&state);
        uint8_t *record = out->records + i * out->stride;
        place(kind, bits, &state, centres, g);
        for (int a = 0; a < 3; a++)
            g[a] += out->grid.root[a];
        memcpy(record, g, sizeof g);
        if (kind == CORE_IDENTICAL) continue;
        if (kind != CORE_EQUAL_COLOUR) colour &= 0xff3f1f0f; /* few shades, so that distances tie */
        else colour = 0x80402010;
        memcpy(record + 12, &colour, 4);
        memcpy(record + 16, &(uint16_t){(uint16_t)(i & 1)}, 2);
        memcpy(record + 18, &i, 4);
    }
}

void core_site_fini(core_site *site)
{
    free(site->records);
    *site = (core_site){0};
}

prep_shape core_shape(const core_site *site, uint32_t inner_depth, uint32_t add_threshold)
{
    return (prep_shape){.grid = &site->grid,
                        .schema = &site->schema,
                        .inner_depth = inner_depth,
                        .add_threshold = add_threshold};
}

void core_metadata_make(const core_site *site, uint32_t add_threshold, mospt_metadata *out)
{
    uint32_t low[3] = {UINT32_MAX, UINT32_MAX, UINT32_MAX}, high[3] = {0};
    *out = (mospt_metadata){.grid = site->grid,
                            .schema = site->schema,
                            .add_threshold = add_threshold,
                            .source_count = 2};
    out->points_hash = mospt_hash_records(site->records, site->stride, site->count);
    out->sources = calloc(2, sizeof *out->sources);
    assert_non_null(out->sources);
    for (uint32_t i = 0; i < 2; i++) {
        out->sources[i].name = strdup(i == 0 ? "a.las" : "b/c.ply");
        out->sources[i].scan = strdup("");
        out->sources[i].format = strdup("LAS 1.2, point format 3");
    }
    for (uint32_t i = 0; i < site->count; i++) {
        uint32_t g[3];
        uint16_t scan;
        memcpy(g, site->records + i * site->stride, sizeof g);
        memcpy(&scan, site->records + i * site->stride + 16, sizeof scan);
        out->sources[scan].points++;
        for (int a = 0; a < 3; a++) {
            if (g[a] < low[a]) low[a] = g[a];
            if (g[a] > high[a]) high[a] = g[a];
        }
    }
    mospt_grid_to_world(&site->grid, low, out->low);
    mospt_grid_to_world(&site->grid, high, out->high);
    for (int i = 0; i < 2; i++)
        memcpy(out->sources[i].low, out->low, sizeof out->low),
            memcpy(out->sources[i].high, out->high, sizeof out->high);
}

static core_subtree solve(const prep_shape *shape, const core_site *site, bool node)
{
    mospt_err err = {0};
    prep_subtree solved = {0};
    const uint8_t *blocks[] = {site->records};
    const mospt_records records = {
        .blocks = blocks, .stride = site->stride, .shift = MOSPT_RECORDS_ONE_BLOCK};
    void *work = malloc(prep_solve_work_size(site->count)),
         *memory = malloc(prep_solve_emit_size(shape, site->count));
    core_subtree made = {.payload = malloc(site->count * site->stride)};
    assert_true(work != NULL && memory != NULL && made.payload != NULL);
    if (node)
        CORE_NEED(prep_solve_node(shape, site->grid.root, 0, 0, &records, site->count, work,
                                  &solved, &err));
    else
        CORE_NEED(
            prep_solve(shape, site->grid.root, 0, &records, site->count, work, &solved, &err));
    made.nodes = malloc(solved.node_count * sizeof *made.nodes);
    assert_non_null(made.nodes);
    for (uint32_t n = 0; n < solved.node_count; n++) {
        uint32_t count = solved.nodes[n].node.count;
        assert_int_equal(solved.nodes[n].node.payload_size, count * site->stride);
        made.points_hash += prep_solve_emit(shape, &records, &solved, n, memory);
        memcpy(made.payload + made.point_count * site->stride, memory, count * site->stride);
        made.point_count += count;
        made.nodes[made.node_count++] = solved.nodes[n].node;
    }
    prep_subtree_fini(&solved);
    free(work), free(memory);
    return made;
}

core_subtree core_solve(const prep_shape *shape, const core_site *site)
{
    return solve(shape, site, false);
}

core_subtree core_solve_node(const prep_shape *shape, const core_site *site)
{
    return solve(shape, site, true);
}

void core_subtree_fini(core_subtree *subtree)
{
    free(subtree->nodes), free(subtree->payload);
    *subtree = (core_subtree){0};
}

void core_write(mospt_writer *writer, core_subtree *made)
{
    mospt_err err = {0};
    const uint8_t *payload = made->payload;
    for (uint32_t i = 0; i < made->node_count; i++) {
        const uint64_t size = made->nodes[i].payload_size;
        uint32_t index;
        CORE_NEED(mospt_writer_place(writer, &made->nodes[i], &index, &err));
        CORE_NEED(mospt_writer_write(writer, &made->nodes[i], payload, &err));
        mospt_writer_complete(writer, index, &made->nodes[i], 0);
        payload += size;
    }
}

void core_dataset_make(const core_site *site, uint32_t inner_depth, uint32_t add_threshold,
                       const char *path)
{
    prep_shape shape = core_shape(site, inner_depth, add_threshold);
    core_subtree made = core_solve(&shape, site);
    mospt_writer *writer = NULL;
    mospt_metadata metadata;
    mospt_err err = {0};
    CORE_NEED(mospt_writer_create(path, inner_depth, &writer, &err));
    core_write(writer, &made);
    core_metadata_make(site, add_threshold, &metadata);
    CORE_NEED(mospt_writer_commit(writer, &metadata, &err));
    mospt_metadata_fini(&metadata);
    mospt_writer_destroy(writer);
    core_subtree_fini(&made);
}

static void remember_first(void *context, const mospt_err *what)
{
    mospt_err *first = context;
    if (first != NULL && first->code == MOSPT_OK) *first = *what;
}

uint64_t core_findings(const char *path, mospt_err *first)
{
    mospt_dataset *dataset = NULL;
    mospt_check_result result;
    mospt_err err = {0};
    const mospt_check_options options = {.found = remember_first, .context = first};
    if (first != NULL) *first = (mospt_err){0};
    if (!mospt_dataset_open(path, &dataset, &err)) {
        assert_int_not_equal(err.code, MOSPT_OK);
        remember_first(first, &err);
        return 1;
    }
    CORE_NEED(mospt_check(dataset, &options, &result, &err));
    mospt_dataset_close(dataset);
    return result.findings;
}
