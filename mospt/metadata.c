#include "mospt/dataset.h"
#include "mospt/file.h"
#include "mospt/hash.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>

/* The text ends in a line with the checksum of all bytes before it, so that no byte of the file is
 * unchecked. */
static const char TAIL_FORMAT[] = ",\n  \"checksum\": \"%016" PRIx64 "\"\n}\n";
enum { TAIL_SIZE = 37, TEXT_SIZE_MAX = 1 << 30 };

void mospt_metadata_fini(mospt_metadata *m)
{
    for (uint32_t i = 0; i < m->source_count; i++) {
        mospt_source *s = &m->sources[i];
        free(s->name), free(s->scan), free(s->format), free(s->crs), free(s->damage);
        for (uint32_t r = 0; r < s->reason_count; r++)
            free(s->drop_reason[r]);
    }
    for (uint32_t i = 0; i < m->file_count; i++)
        free(m->files[i].name);
    free(m->sources), free(m->files), free(m->crs);
    *m = (mospt_metadata){0};
}

/* Names of files may be any bytes; JSON wants UTF-8. */
static json_t *text_to_json(const char *text)
{
    json_t *json = json_string(text);
    char *copy;
    if (json != NULL || (copy = strdup(text)) == NULL) return json;
    for (char *c = copy; *c != '\0'; c++)
        if ((unsigned char)*c >= 0x80) *c = '?';
    json = json_string(copy);
    free(copy);
    return json;
}

static json_t *hash_to_json(uint64_t hash)
{
    char text[17];
    snprintf(text, sizeof text, "%016" PRIx64, hash);
    return json_string(text);
}

static json_t *bytes_to_json(const uint8_t *bytes, size_t size)
{
    char text[2 * MOSPT_CONSTANT_SIZE_MAX + 1];
    for (size_t i = 0; i < size; i++)
        snprintf(text + 2 * i, 3, "%02x", bytes[i]);
    return json_string(text);
}

static json_t *reals_to_json(const double *values, size_t count)
{
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++)
        json_array_append_new(array, json_real(values[i]));
    return array;
}

static json_t *grid_to_json(const mospt_grid *g)
{
    return json_pack("{s:o, s:[I,I,I], s:f, s:i, s:[I,I,I]}", "offset", reals_to_json(g->offset, 3),
                     "base", (json_int_t)g->base[0], (json_int_t)g->base[1], (json_int_t)g->base[2],
                     "step", g->step, "bits", (int)g->bits, "root", (json_int_t)g->root[0],
                     (json_int_t)g->root[1], (json_int_t)g->root[2]);
}

static json_t *attributes_to_json(const mospt_schema *schema)
{
    json_t *array = json_array();
    for (uint32_t i = 0; i < schema->count; i++) {
        const mospt_attribute *a = &schema->at[i];
        json_t *json = json_pack("{s:o, s:s, s:i}", "name", text_to_json(a->name), "type",
                                 mospt_type_name(a->type), "components", (int)a->components);
        if (a->storage == MOSPT_CONSTANT)
            json_object_set_new(json, "constant",
                                bytes_to_json(a->constant, mospt_attribute_size(a)));
        if (a->storage == MOSPT_OF_COLOUR) json_object_set_new(json, "of", json_string("colour"));
        json_array_append_new(array, json);
    }
    return array;
}

static json_t *source_to_json(const mospt_source *s)
{
    json_t *dropped = json_object();
    for (uint32_t r = 0; r < s->reason_count; r++)
        json_object_set_new(dropped, s->drop_reason[r], json_integer((json_int_t)s->drop_count[r]));
    json_t *json = json_pack("{s:o, s:o, s:o, s:I, s:o, s:b, s:b}", "name", text_to_json(s->name),
                             "scan", text_to_json(s->scan), "format", text_to_json(s->format),
                             "points", (json_int_t)s->points, "dropped", dropped, "rgb",
                             (int)s->has_rgb, "intensity", (int)s->has_intensity);
    if (json == NULL) return NULL;
    if (s->points > 0) {
        json_object_set_new(json, "min", reals_to_json(s->low, 3));
        json_object_set_new(json, "max", reals_to_json(s->high, 3));
    }
    if (s->crs != NULL) json_object_set_new(json, "crs", text_to_json(s->crs));
    if (s->damage != NULL) json_object_set_new(json, "damage", text_to_json(s->damage));
    if (s->has_pose) json_object_set_new(json, "pose", reals_to_json(s->pose, 16));
    return json;
}

static json_t *unfinished_to_json(const mospt_unfinished *u)
{
    return json_pack("{s:I, s:I, s:o, s:o}", "commit", (json_int_t)u->commit, "points",
                     (json_int_t)u->points, "points_hash", hash_to_json(u->points_hash), "build",
                     hash_to_json(u->build));
}

static json_t *metadata_to_json(const mospt_metadata *m)
{
    json_t *payloads = json_array(), *sources = json_array();
    for (uint32_t i = 0; i < m->file_count; i++)
        json_array_append_new(payloads, json_pack("{s:s, s:I}", "file", m->files[i].name, "size",
                                                  (json_int_t)m->files[i].size));
    for (uint32_t i = 0; i < m->source_count; i++)
        json_array_append_new(sources, source_to_json(&m->sources[i]));
    json_t *unfinished = m->unfinished.commit > 0 ? unfinished_to_json(&m->unfinished) : NULL;
    return json_pack("{s:s, s:i, s:I, s:o*, s:I, s:o, s:f, s:{s:o, s:o}, s:o, s:s, s:i, s:i, s:o, "
                     "s:o, s:{s:s, s:I, s:o}, s:o, s:o}",
                     "format", "instantpoints dataset", "version", MOSPT_DATASET_VERSION,
                     "generation", (json_int_t)m->generation, "unfinished", unfinished, "points",
                     (json_int_t)m->point_count, "points_hash", hash_to_json(m->points_hash),
                     "position_error", m->position_error, "bounds", "min", reals_to_json(m->low, 3),
                     "max", reals_to_json(m->high, 3), "grid", grid_to_json(&m->grid), "refinement",
                     "additive", "inner_depth", (int)m->inner_depth, "add_threshold",
                     (int)m->add_threshold, "crs", text_to_json(m->crs != NULL ? m->crs : ""),
                     "attributes", attributes_to_json(&m->schema), "hierarchy", "file",
                     m->hierarchy_name, "size", (json_int_t)m->hierarchy_size, "hash",
                     hash_to_json(m->hierarchy_hash), "payloads", payloads, "sources", sources);
}

bool mospt_metadata_write(const mospt_metadata *metadata, const char *dataset_path, mospt_err *err)
{
    bool ok = false;
    char *path = mospt_file_join(dataset_path, "metadata.json"), *text = NULL, *whole = NULL;
    json_t *json = metadata_to_json(metadata);
    if (json != NULL) text = json_dumps(json, JSON_INDENT(2) | JSON_REAL_PRECISION(17));
    size_t size = text != NULL ? strlen(text) : 0;
    if (path == NULL || size < 3 || (whole = malloc(size + TAIL_SIZE + 1)) == NULL) {
        mospt_err_nomem(err, size + TAIL_SIZE);
        goto done;
    }
    size -= 2; /* the closing brace and the line end before it: the checksum comes in between */
    memcpy(whole, text, size);
    snprintf(whole + size, TAIL_SIZE + 1, TAIL_FORMAT, mospt_hash(whole, size));
    ok = mospt_file_replace(path, whole, size + TAIL_SIZE, err);
done:
    json_decref(json);
    free(whole), free(text), free(path);
    return ok;
}

/* What is read from; the first thing that is missing or of the wrong kind is remembered and the
 * rest falls through. */
typedef struct {
    const char *path;
    bool ok;
    mospt_err *err;
} parse;

static json_t *get(parse *p, json_t *object, const char *key)
{
    json_t *value = json_object_get(object, key);
    if (value == NULL && p->ok)
        p->ok =
            mospt_err_set(p->err, MOSPT_EFORMAT, mospt_at_file(p->path), "\"%s\" is missing", key);
    return value;
}

static bool wrong(parse *p, const char *key)
{
    if (p->ok)
        p->ok = mospt_err_set(p->err, MOSPT_EFORMAT, mospt_at_file(p->path),
                              "\"%s\" is not what it should be", key);
    return false;
}

static int64_t get_integer(parse *p, json_t *object, const char *key, int64_t low, int64_t high)
{
    json_t *value = get(p, object, key);
    int64_t v = json_integer_value(value);
    if (!json_is_integer(value) || v < low || v > high) wrong(p, key);
    return v;
}

static uint64_t get_hash(parse *p, json_t *object, const char *key)
{
    uint64_t hash = 0;
    const char *text = json_string_value(get(p, object, key));
    if (text == NULL || strlen(text) != 16 || sscanf(text, "%16" SCNx64, &hash) != 1) wrong(p, key);
    return hash;
}

static char *get_text(parse *p, json_t *object, const char *key)
{
    const char *text = json_string_value(get(p, object, key));
    char *copy = text != NULL ? strdup(text) : NULL;
    if (copy == NULL) wrong(p, key);
    return copy;
}

static void get_reals(parse *p, json_t *object, const char *key, double *out, size_t count)
{
    json_t *array = get(p, object, key);
    if (json_array_size(array) != count) {
        wrong(p, key);
        return;
    }
    for (size_t i = 0; i < count; i++) {
        json_t *value = json_array_get(array, i);
        if (!json_is_number(value)) wrong(p, key);
        out[i] = json_number_value(value);
    }
}

static void get_integers(parse *p, json_t *object, const char *key, int64_t *out, size_t count)
{
    json_t *array = get(p, object, key);
    if (json_array_size(array) != count) {
        wrong(p, key);
        return;
    }
    for (size_t i = 0; i < count; i++) {
        json_t *value = json_array_get(array, i);
        if (!json_is_integer(value)) wrong(p, key);
        out[i] = json_integer_value(value);
    }
}

static void grid_from_json(parse *p, json_t *json, mospt_grid *g)
{
    int64_t root[3] = {0};
    get_reals(p, json, "offset", g->offset, 3);
    get_integers(p, json, "base", g->base, 3);
    g->step = json_number_value(get(p, json, "step"));
    g->bits = (uint32_t)get_integer(p, json, "bits", 0, MOSPT_GRID_BITS_MAX);
    get_integers(p, json, "root", root, 3);
    for (int a = 0; a < 3; a++) {
        if (root[a] < 0 || root[a] > UINT32_MAX) wrong(p, "root");
        g->root[a] = (uint32_t)root[a];
    }
    if (p->ok && !mospt_grid_is_valid(g)) wrong(p, "grid");
}

static bool bytes_from_json(const json_t *json, size_t size, uint8_t *out)
{
    const char *text = json_string_value(json);
    if (text == NULL || strlen(text) != 2 * size) return false;
    for (size_t i = 0; i < size; i++)
        if (strspn(text + 2 * i, "0123456789abcdef") < 2 ||
            sscanf(text + 2 * i, "%2hhx", &out[i]) != 1)
            return false;
    return true;
}

/* How the last attribute is kept; in planes, unless something is said. */
static void storage_from_json(parse *p, json_t *item, mospt_schema *schema)
{
    uint32_t k = schema->count - 1;
    const mospt_attribute *a = &schema->at[k];
    uint8_t constant[MOSPT_CONSTANT_SIZE_MAX];
    json_t *same = json_object_get(item, "constant"), *of = json_object_get(item, "of");
    const char *source = json_string_value(of);
    if (same != NULL) {
        if (of != NULL || !mospt_attribute_can_be(a, MOSPT_CONSTANT) ||
            !bytes_from_json(same, mospt_attribute_size(a), constant))
            wrong(p, "constant");
        else mospt_schema_keep(schema, k, MOSPT_CONSTANT, constant);
    } else if (of != NULL) {
        if (source == NULL || strcmp(source, "colour") != 0 ||
            !mospt_attribute_can_be(a, MOSPT_OF_COLOUR))
            wrong(p, "of");
        else mospt_schema_keep(schema, k, MOSPT_OF_COLOUR, NULL);
    }
}

static void schema_from_json(parse *p, json_t *array, mospt_schema *schema)
{
    size_t i;
    json_t *item;
    json_array_foreach(array, i, item)
    {
        const char *name = json_string_value(get(p, item, "name"));
        const char *type_name = json_string_value(get(p, item, "type"));
        mospt_type type;
        uint32_t components = (uint32_t)get_integer(p, item, "components", 1, 255);
        if (!p->ok) return;
        if (name == NULL || type_name == NULL || !mospt_type_from_name(type_name, &type) ||
            mospt_schema_find(schema, name) >= 0 ||
            !mospt_schema_add(schema, name, type, components, NULL)) {
            wrong(p, "attributes");
            return;
        }
        storage_from_json(p, item, schema);
    }
}

static void source_from_json(parse *p, json_t *json, mospt_source *s)
{
    s->name = get_text(p, json, "name");
    s->scan = get_text(p, json, "scan");
    s->format = get_text(p, json, "format");
    s->points = (uint64_t)get_integer(p, json, "points", 0, INT64_MAX);
    s->has_rgb = json_is_true(get(p, json, "rgb"));
    s->has_intensity = json_is_true(get(p, json, "intensity"));
    if (s->points > 0) {
        get_reals(p, json, "min", s->low, 3);
        get_reals(p, json, "max", s->high, 3);
    }
    const char *reason;
    json_t *value;
    json_object_foreach(get(p, json, "dropped"), reason, value)
    {
        if (s->reason_count == 8 || !json_is_integer(value) || json_integer_value(value) < 0) {
            wrong(p, "dropped");
            return;
        }
        s->drop_reason[s->reason_count] = strdup(reason);
        s->drop_count[s->reason_count++] = (uint64_t)json_integer_value(value);
        s->dropped += (uint64_t)json_integer_value(value);
    }
    if (json_object_get(json, "crs") != NULL) s->crs = get_text(p, json, "crs");
    if (json_object_get(json, "damage") != NULL) s->damage = get_text(p, json, "damage");
    if (json_object_get(json, "pose") != NULL) {
        get_reals(p, json, "pose", s->pose, 16);
        s->has_pose = true;
    }
}

static void lists_from_json(parse *p, json_t *json, mospt_metadata *m)
{
    json_t *payloads = get(p, json, "payloads"), *sources = get(p, json, "sources");
    m->files = calloc(json_array_size(payloads) + 1, sizeof *m->files);
    m->sources = calloc(json_array_size(sources) + 1, sizeof *m->sources);
    if (m->files == NULL || m->sources == NULL) {
        p->ok = mospt_err_nomem(p->err, json_array_size(sources) * sizeof *m->sources);
        return;
    }
    for (size_t i = 0; p->ok && i < json_array_size(payloads); i++) {
        json_t *item = json_array_get(payloads, i);
        mospt_payload_file *f = &m->files[m->file_count++];
        f->name = get_text(p, item, "file");
        f->size = (uint64_t)get_integer(p, item, "size", 0, INT64_MAX);
        if (f->name != NULL && strchr(f->name, '/') != NULL) wrong(p, "file");
    }
    for (size_t i = 0; p->ok && i < json_array_size(sources); i++)
        source_from_json(p, json_array_get(sources, i), &m->sources[m->source_count++]);
}

static void unfinished_from_json(parse *p, json_t *json, mospt_unfinished *u)
{
    u->commit = (uint64_t)get_integer(p, json, "commit", 1, INT64_MAX);
    u->points = (uint64_t)get_integer(p, json, "points", 1, INT64_MAX);
    u->points_hash = get_hash(p, json, "points_hash");
    u->build = get_hash(p, json, "build");
}

static void metadata_from_json(parse *p, json_t *json, mospt_metadata *m)
{
    const char *format = json_string_value(json_object_get(json, "format"));
    if (format == NULL || strcmp(format, "instantpoints dataset") != 0) {
        p->ok = mospt_err_set(p->err, MOSPT_EFORMAT, mospt_at_file(p->path),
                              "is not that of a dataset");
        return;
    }
    json_int_t version = json_integer_value(json_object_get(json, "version"));
    if (version != MOSPT_DATASET_VERSION && version != MOSPT_DATASET_VERSION_OLD) {
        p->ok = mospt_err_set(p->err, MOSPT_EFORMAT, mospt_at_file(p->path),
                              "has version %lld, this program reads versions %d and %d",
                              (long long)version, MOSPT_DATASET_VERSION_OLD, MOSPT_DATASET_VERSION);
        return;
    }
    json_t *bounds = get(p, json, "bounds"), *hierarchy = get(p, json, "hierarchy");
    const char *refinement = json_string_value(get(p, json, "refinement"));
    if (refinement == NULL || strcmp(refinement, "additive") != 0) wrong(p, "refinement");
    m->generation = (uint64_t)get_integer(p, json, "generation", 1, INT64_MAX);
    json_t *unfinished = json_object_get(json, "unfinished");
    if (unfinished != NULL) unfinished_from_json(p, unfinished, &m->unfinished);
    m->point_count = (uint64_t)get_integer(p, json, "points", 1, INT64_MAX);
    m->points_hash = get_hash(p, json, "points_hash");
    m->position_error = json_number_value(get(p, json, "position_error"));
    get_reals(p, bounds, "min", m->low, 3);
    get_reals(p, bounds, "max", m->high, 3);
    grid_from_json(p, get(p, json, "grid"), &m->grid);
    m->inner_depth =
        (uint32_t)get_integer(p, json, "inner_depth", MOSPT_DEPTH_MIN, MOSPT_DEPTH_MAX);
    m->add_threshold = (uint32_t)get_integer(p, json, "add_threshold", 0, INT32_MAX);
    m->crs = get_text(p, json, "crs");
    schema_from_json(p, get(p, json, "attributes"), &m->schema);
    const char *name = json_string_value(get(p, hierarchy, "file"));
    if (name == NULL || strchr(name, '/') != NULL || strlen(name) >= sizeof m->hierarchy_name)
        wrong(p, "file");
    else snprintf(m->hierarchy_name, sizeof m->hierarchy_name, "%s", name);
    m->hierarchy_size = (uint64_t)get_integer(p, hierarchy, "size", 0, INT64_MAX);
    m->hierarchy_hash = get_hash(p, hierarchy, "hash");
    if (p->ok) lists_from_json(p, json, m);
}

static bool tail_is_right(const char *text, size_t size)
{
    char tail[TAIL_SIZE + 1];
    if (size < TAIL_SIZE) return false;
    size -= TAIL_SIZE;
    snprintf(tail, sizeof tail, TAIL_FORMAT, mospt_hash(text, size));
    return memcmp(text + size, tail, TAIL_SIZE) == 0;
}

bool mospt_metadata_read(const char *dataset_path, mospt_metadata *out, mospt_err *err)
{
    char *path = mospt_file_join(dataset_path, "metadata.json"), *text = NULL;
    size_t size = 0;
    json_t *json = NULL;
    json_error_t at;
    mospt_metadata m = {0};
    parse p = {.path = path, .ok = false, .err = err};

    if (path == NULL) {
        mospt_err_nomem(err, strlen(dataset_path));
        goto done;
    }
    if (!mospt_file_read_whole(path, TEXT_SIZE_MAX, &text, &size, err)) goto done;
    json = json_loadb(text, size, JSON_REJECT_DUPLICATES, &at);
    if (json == NULL) {
        mospt_err_set(err, MOSPT_EFORMAT, mospt_at_line(path, at.line > 0 ? (uint64_t)at.line : 1),
                      "%s", at.text);
        goto done;
    }
    if (!tail_is_right(text, size)) {
        mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(path), "is damaged: its checksum is wrong");
        goto done;
    }
    p.ok = true;
    metadata_from_json(&p, json, &m);
    if (p.ok) *out = m;
    else mospt_metadata_fini(&m);
done:
    json_decref(json);
    free(text), free(path);
    return p.ok;
}
