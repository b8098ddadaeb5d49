#include "preprocess/attributes.h"

#include <stdio.h>
#include <string.h>

/* True if a list of names, separated by commas, has this one. */
static bool list_has(const char *list, const char *name)
{
    size_t length = strlen(name);
    for (const char *at = list; at != NULL; at = strchr(at, ',')) {
        at += *at == ',';
        if (strncmp(at, name, length) == 0 && (at[length] == ',' || at[length] == '\0'))
            return true;
    }
    return false;
}

static bool some_scan_has(const prep_source *source, const char *name)
{
    for (uint32_t i = 0; i < source->scan_count; i++)
        if (mospt_schema_find(&source->scans[i].info.attributes, name) >= 0) return true;
    return false;
}

/* A name that is in the list and in no scan is a slip of the pen. */
static bool check_wanted(const prep_source *source, const char *wanted, mospt_err *err)
{
    const char *at = wanted;
    while (at != NULL && strcmp(at, "none") != 0) {
        char name[MOSPT_ATTRIBUTE_NAME_MAX];
        size_t length = strcspn(at, ",");
        snprintf(name, sizeof name, "%.*s", (int)length, at);
        if (strcmp(name, "scan") != 0 && !some_scan_has(source, name))
            return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                                 "no scan has an attribute \"%.*s\"; `instantpoints info SCAN` "
                                 "lists those that there are",
                                 (int)length, at);
        at = at[length] == ',' ? at + length + 1 : NULL;
    }
    return true;
}

/* What the points of a scan that were looked at have in common. */
typedef struct {
    bool is_constant, is_colour;
    uint8_t constant[MOSPT_CONSTANT_SIZE_MAX]; /* of the type of the dataset */
} common;

static common common_of(const prep_source_scan *scan, uint32_t number, const mospt_attribute *to)
{
    int k = mospt_schema_find(&scan->info.attributes, to->name);
    common c = {.is_constant = true};
    if (k < 0) { /* zero, as all that a scan does not have */
        if (strcmp(to->name, "scan") == 0) mospt_type_write(to->type, number, c.constant);
        return c;
    }
    const mospt_attribute *from = &scan->info.attributes.at[k];
    size_t from_size = mospt_type_size(from->type), to_size = mospt_type_size(to->type);
    c.is_colour = from->type == to->type && !(scan->info.differs.from_colour >> k & 1);
    c.is_constant = from->storage == MOSPT_CONSTANT && !(scan->info.differs.in_value >> k & 1) &&
                    mospt_attribute_can_be(to, MOSPT_CONSTANT);
    for (uint32_t i = 0; c.is_constant && i < to->components; i++)
        mospt_type_write(to->type, mospt_type_read(from->type, from->constant + i * from_size),
                         c.constant + i * to_size);
    return c;
}

/* Says of an attribute what all scans have in common. */
static void keep_common(const prep_source *source, mospt_schema *schema, uint32_t k)
{
    const mospt_attribute *a = &schema->at[k];
    bool is_constant = mospt_attribute_can_be(a, MOSPT_CONSTANT),
         is_colour = mospt_attribute_can_be(a, MOSPT_OF_COLOUR), is_first = true;
    common first = {0};
    for (uint32_t i = 0; i < source->scan_count; i++) {
        if (!source->scans[i].info.was_looked_at) continue;
        common c = common_of(&source->scans[i], i, a);
        if (is_first) first = c;
        is_first = false;
        is_colour = is_colour && c.is_colour;
        is_constant = is_constant && c.is_constant &&
                      memcmp(c.constant, first.constant, sizeof c.constant) == 0;
    }
    if (is_first) return;
    if (is_constant) mospt_schema_keep(schema, k, MOSPT_CONSTANT, first.constant);
    else if (is_colour) mospt_schema_keep(schema, k, MOSPT_OF_COLOUR, NULL);
}

bool prep_attributes_choose(const prep_source *source, const char *wanted, mospt_schema *out,
                            mospt_err *err)
{
    *out = (mospt_schema){0};
    if (!check_wanted(source, wanted, err)) return false;
    if (!mospt_schema_add(out, "scan", source->scan_count > UINT16_MAX ? MOSPT_U32 : MOSPT_U16, 1,
                          err))
        return false;
    for (uint32_t i = 0; i < source->scan_count; i++) {
        const mospt_schema *planes = &source->scans[i].info.attributes;
        for (uint32_t k = 0; k < planes->count; k++) {
            const mospt_attribute *a = &planes->at[k];
            if (wanted != NULL && !list_has(wanted, a->name)) continue;
            if (mospt_schema_add(out, a->name, a->type, a->components, err)) continue;
            if (err != NULL && err->file[0] == '\0')
                snprintf(err->file, sizeof err->file, "%s", source->scans[i].path);
            return false;
        }
    }
    for (uint32_t k = 0; k < out->count; k++)
        keep_common(source, out, k);
    return true;
}
