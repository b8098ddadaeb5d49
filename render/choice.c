#include "render/choice.h"

#include <stdio.h>
#include <string.h>

static const struct {
    const char *name;
    const char *attributes[5]; /* the first that there is, is shown */
} colours[REND_COLOUR_COUNT] = {
    [REND_COLOUR_RGB] = {"rgb", {"rgb"}},
    [REND_COLOUR_INTENSITY] = {"intensity", {"intensity"}},
    [REND_COLOUR_ELEVATION] = {"elevation", {NULL}},
    [REND_COLOUR_CLASSIFICATION] = {"classification", {"classification"}},
    [REND_COLOUR_RETURN] = {"return", {"return_number"}},
    [REND_COLOUR_TIME] = {"time", {"gps_time", "time", "timestamp", "t"}},
    [REND_COLOUR_SCAN] = {"scan", {"scan"}},
    [REND_COLOUR_DENSITY] = {"density", {NULL}},
    [REND_COLOUR_DISTANCE] = {"distance", {NULL}},
};

const char *rend_choice_name(rend_colour colour)
{
    return colours[colour].name;
}

static void name_attribute(const char *name, rend_look *look)
{
    memset(look->attribute, 0, sizeof look->attribute);
    snprintf(look->attribute, sizeof look->attribute, "%s", name);
}

void rend_choice_read(const char *name, rend_look *look)
{
    look->colour = REND_COLOUR_ATTRIBUTE;
    name_attribute(name, look);
    for (int c = 0; c < REND_COLOUR_ATTRIBUTE; c++)
        if (strcmp(name, colours[c].name) == 0) look->colour = (rend_colour)c;
}

int rend_choice_attribute(const mospt_schema *schema, rend_colour colour)
{
    for (const char *const *name = colours[colour].attributes; *name != NULL; name++) {
        int at = mospt_schema_find(schema, *name);
        if (at >= 0) return at;
    }
    return -1;
}

static bool has_intensity(const mospt_metadata *m)
{
    for (uint32_t s = 0; s < m->source_count; s++)
        if (m->sources[s].has_intensity) return true;
    return mospt_schema_find(&m->schema, "intensity") >= 0;
}

static bool has_pose(const mospt_metadata *m)
{
    for (uint32_t s = 0; s < m->source_count; s++)
        if (m->sources[s].has_pose) return true;
    return false;
}

bool rend_choice_is_offered(const mospt_metadata *metadata, rend_colour colour)
{
    switch (colour) {
    case REND_COLOUR_RGB:
    case REND_COLOUR_ELEVATION:
    case REND_COLOUR_DENSITY:
        return true;
    case REND_COLOUR_INTENSITY:
        return has_intensity(metadata);
    case REND_COLOUR_DISTANCE: /* of several scans, each point must know its own */
        return has_pose(metadata) &&
               (metadata->source_count == 1 || mospt_schema_find(&metadata->schema, "scan") >= 0);
    default:
        return rend_choice_attribute(&metadata->schema, colour) >= 0;
    }
}

static bool is_shown_by_name(const mospt_schema *schema, int attribute)
{
    for (int c = 0; c < REND_COLOUR_ATTRIBUTE; c++)
        if (rend_choice_attribute(schema, (rend_colour)c) == attribute) return true;
    return false;
}

uint32_t rend_choice_list(const mospt_metadata *metadata, rend_choice *out)
{
    uint32_t count = 0;
    for (int c = 0; c < REND_COLOUR_ATTRIBUTE; c++)
        if (rend_choice_is_offered(metadata, (rend_colour)c))
            out[count++] = (rend_choice){.colour = (rend_colour)c};
    for (uint32_t a = 0; a < metadata->schema.count; a++) {
        if (is_shown_by_name(&metadata->schema, (int)a)) continue;
        out[count] = (rend_choice){.colour = REND_COLOUR_ATTRIBUTE};
        memcpy(out[count++].attribute, metadata->schema.at[a].name, sizeof out->attribute);
    }
    return count;
}

const char *rend_choice_text(const rend_choice *choice)
{
    return choice->colour == REND_COLOUR_ATTRIBUTE ? choice->attribute
                                                   : colours[choice->colour].name;
}

const char *rend_choice_shown(const rend_look *look)
{
    return look->colour == REND_COLOUR_ATTRIBUTE ? look->attribute : rend_choice_name(look->colour);
}

bool rend_choice_same(const rend_look *a, const rend_look *b)
{
    return a->colour == b->colour &&
           (a->colour != REND_COLOUR_ATTRIBUTE || strcmp(a->attribute, b->attribute) == 0);
}

void rend_choice_recall(const char *name, const rend_look *given, rend_look *look)
{
    rend_look other = *look;
    rend_choice_read(name, &other);
    if (rend_choice_same(&other, look)) return;
    bool is_given = rend_choice_same(&other, given);
    other.has_range = is_given && given->has_range;
    memcpy(other.range, given->range, sizeof other.range);
    other.map = is_given ? given->map : REND_MAP_USUAL;
    *look = other;
}

static bool is_chosen(const rend_choice *choice, const rend_look *look)
{
    return choice->colour == look->colour && (choice->colour != REND_COLOUR_ATTRIBUTE ||
                                              strcmp(choice->attribute, look->attribute) == 0);
}

void rend_choice_use(const rend_choice *choice, rend_look *look)
{
    look->colour = choice->colour;
    name_attribute(choice->attribute, look);
    look->has_range = false;
    look->map = REND_MAP_USUAL;
}

void rend_choice_step(const rend_choice *choices, uint32_t count, int step, rend_look *look)
{
    uint32_t at = 0;
    while (at < count && !is_chosen(&choices[at], look))
        at++;
    at = at == count ? 0 : (uint32_t)((int)(at + count) + step) % count;
    rend_choice_use(&choices[at], look);
}

rend_map rend_choice_map(const rend_look *look)
{
    if (look->map != REND_MAP_USUAL) return look->map;
    return look->colour == REND_COLOUR_INTENSITY ? REND_MAP_GREY : REND_MAP_VIRIDIS;
}
