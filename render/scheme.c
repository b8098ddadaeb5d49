#include "render/scheme.h"

#include "render/asprs.h"
#include "render/sample.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* An attribute of integers that takes no more values than this is a list of classes. */
enum { CLASSES_MAX = 16 };

static const struct {
    rend_paint_source source;
    bool classes;
    const char *title;
} modes[REND_COLOUR_COUNT] = {
    [REND_COLOUR_RGB] = {REND_PAINT_STORED, true, ""},
    [REND_COLOUR_INTENSITY] = {REND_PAINT_INTENSITY, false, "Intensity"},
    [REND_COLOUR_ELEVATION] = {REND_PAINT_HEIGHT, false, "Elevation, m"},
    [REND_COLOUR_CLASSIFICATION] = {REND_PAINT_VALUE, true, "Classification"},
    [REND_COLOUR_RETURN] = {REND_PAINT_VALUE, true, "Return"},
    [REND_COLOUR_TIME] = {REND_PAINT_VALUE, false, "Time"},
    [REND_COLOUR_SCAN] = {REND_PAINT_VALUE, true, "Scans"},
    [REND_COLOUR_DENSITY] = {REND_PAINT_LEVEL, false, "Density: spacing of points, about"},
    [REND_COLOUR_DISTANCE] = {REND_PAINT_DISTANCE, false, "Distance to the scanner, m"},
};

struct rend_scheme {
    const mospt_dataset *dataset;
    rend_sample *sample; /* owned; NULL: not read yet */
};

rend_scheme *rend_scheme_create(const mospt_dataset *dataset)
{
    rend_scheme *s = calloc(1, sizeof *s);
    if (s != NULL) s->dataset = dataset;
    return s;
}

void rend_scheme_destroy(rend_scheme *scheme)
{
    if (scheme == NULL) return;
    rend_sample_destroy(scheme->sample);
    free(scheme);
}

bool rend_scheme_same(const rend_look *a, const rend_look *b)
{
    bool same_range = a->has_range == b->has_range &&
                      (!a->has_range || memcmp(a->range, b->range, sizeof a->range) == 0);
    return rend_choice_same(a, b) && same_range && a->map == b->map &&
           a->brightness == b->brightness && a->gamma == b->gamma;
}

/* ---- what to show ---- */

static bool not_offered(const mospt_dataset *dataset, const char *what, mospt_err *err)
{
    rend_choice choices[REND_CHOICES_MAX];
    char list[400] = "";
    uint32_t count = rend_choice_list(&dataset->metadata, choices);
    for (uint32_t i = 0; i < count; i++) {
        size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%s", i > 0 ? ", " : "",
                 rend_choice_text(&choices[i]));
    }
    return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                         "the points have no %.60s; colours can show %s", what, list);
}

/* "NAME" or "NAME:2". */
static bool find_attribute(const mospt_dataset *dataset, const char *text, rend_paint *paint,
                           mospt_err *err)
{
    const mospt_schema *schema = &dataset->metadata.schema;
    char name[MOSPT_ATTRIBUTE_NAME_MAX];
    const char *colon = strrchr(text, ':');
    paint->attribute = mospt_schema_find(schema, text);
    if (paint->attribute < 0 && colon != NULL) {
        snprintf(name, sizeof name, "%.*s", (int)(colon - text), text);
        char *end;
        unsigned long component = strtoul(colon + 1, &end, 10);
        paint->attribute = mospt_schema_find(schema, name);
        if (paint->attribute < 0 || *end != '\0' || component < 1 ||
            component > schema->at[paint->attribute].components)
            return not_offered(dataset, text, err);
        paint->component = (uint32_t)(component - 1);
        paint->source = REND_PAINT_VALUE;
        return true;
    }
    if (paint->attribute < 0) return not_offered(dataset, text, err);
    const mospt_attribute *a = &schema->at[paint->attribute];
    bool is_direction = a->components == 3 && (a->type == MOSPT_F32 || a->type == MOSPT_F64);
    paint->source = is_direction ? REND_PAINT_DIRECTION : REND_PAINT_VALUE;
    return true;
}

/* Why a colouring with a name is not offered. */
static bool name_lack(const mospt_dataset *dataset, rend_colour colour, mospt_err *err)
{
    if (colour != REND_COLOUR_DISTANCE) return not_offered(dataset, rend_choice_name(colour), err);
    return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                         "no scan says where its scanner stood, so there is no distance to it; a "
                         "build with --poses can say it");
}

/* Ranges and maps belong to values. */
static bool fits_colours(const rend_look *look, const rend_paint *p, mospt_err *err)
{
    bool own = look->colour == REND_COLOUR_ATTRIBUTE ? p->source == REND_PAINT_DIRECTION
                                                     : modes[look->colour].classes;
    const char *name = rend_choice_shown(look);
    if (own && look->map != REND_MAP_USUAL)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "%s has colours of its own, a colour map is for values", name);
    if ((own || look->colour == REND_COLOUR_DENSITY) && look->has_range)
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "%s has no range, only values have one", name);
    return true;
}

static bool resolve(const mospt_dataset *dataset, const rend_look *look, rend_paint *out,
                    mospt_err *err)
{
    const mospt_metadata *m = &dataset->metadata;
    rend_paint p = {.dataset = dataset, .attribute = -1};
    if (look->colour == REND_COLOUR_ATTRIBUTE) {
        if (!find_attribute(dataset, look->attribute, &p, err)) return false;
    } else if (!rend_choice_is_offered(m, look->colour)) {
        return name_lack(dataset, look->colour, err);
    } else {
        p.source = modes[look->colour].source;
        p.classes = modes[look->colour].classes;
        p.zero_is_none = look->colour == REND_COLOUR_TIME;
        if (p.source == REND_PAINT_VALUE)
            p.attribute = rend_choice_attribute(&m->schema, look->colour);
        if (p.source == REND_PAINT_DISTANCE && m->source_count > 1)
            p.attribute = mospt_schema_find(&m->schema, "scan");
    }
    if (look->colour == REND_COLOUR_INTENSITY && look->has_range) {
        p.attribute = mospt_schema_find(&m->schema, "intensity");
        p.source = REND_PAINT_VALUE;
        if (p.attribute < 0)
            return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                                 "raw intensities were not kept, so they have no range");
    }
    if (look->has_range && !(look->range[0] < look->range[1]))
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(), "a range from %g to %g is empty",
                             look->range[0], look->range[1]);
    *out = p;
    return fits_colours(look, &p, err);
}

bool rend_scheme_fits(const mospt_dataset *dataset, const rend_look *look, mospt_err *err)
{
    rend_paint ignored;
    return resolve(dataset, look, &ignored, err);
}

/* ---- colours and their names ---- */

static void add_row(rend_legend *l, const uint8_t rgb[3], const char *format, ...)
    __attribute__((format(printf, 3, 4)));

static void add_row(rend_legend *l, const uint8_t rgb[3], const char *format, ...)
{
    if (l->row_count == REND_LEGEND_ROWS_MAX) {
        l->rows_left_out++;
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(l->rows[l->row_count].words, sizeof l->rows->words, format, arguments);
    va_end(arguments);
    memcpy(l->rows[l->row_count++].rgb, rgb, 3);
}

/* Two more digits than the distance between ticks asks for. */
static void tick_text(double value, double step, char out[32])
{
    double digits = step > 0 ? 1 - floor(log10(step)) : 6;
    if (!(digits <= 9) || fabs(value) >= 1e12) snprintf(out, 32, "%.6g", value);
    else snprintf(out, 32, "%.*f", digits > 0 ? (int)digits : 0, value + 0.0);
}

static void name_ticks(const rend_paint *p, double from, double unit, rend_legend *l)
{
    double step = (p->high - p->low) / (REND_LEGEND_TICKS - 1);
    bool alike = !(step > 0);
    for (int t = 0; t < REND_LEGEND_TICKS; t++)
        if (!alike || t == REND_LEGEND_TICKS / 2)
            tick_text((p->low + t * step - from) / unit, step / unit, l->ticks[t]);
}

/* Time counts from the start of what is shown, in the unit that suits its length. */
static void name_time(const rend_paint *p, rend_legend *l)
{
    static const struct {
        const char *name;
        double seconds;
    } units[] = {{"days", 86400}, {"h", 3600}, {"min", 60}, {"s", 1}};
    int u = 0;
    while (u < 3 && p->high - p->low < 2 * units[u].seconds)
        u++;
    snprintf(l->title, sizeof l->title, "Time since %.3f, %s", p->low, units[u].name);
    name_ticks(p, p->low, units[u].seconds, l);
}

static void make_bar(const rend_look *look, const rend_values *values, rend_paint *p,
                     rend_legend *l)
{
    if (look->has_range) {
        p->low = look->range[0], p->high = look->range[1];
    } else if (values->count > 0) {
        uint32_t tail = values->count / 100;
        if (!(values->at[tail] < values->at[values->count - 1 - tail])) tail = 0;
        p->low = values->at[tail], p->high = values->at[values->count - 1 - tail];
    }
    rend_ramp_fill(rend_choice_map(look), &p->ramp);
    l->has_bar = true;
    l->ramp = p->ramp;
    if (look->colour == REND_COLOUR_TIME) name_time(p, l);
    else name_ticks(p, 0, 1, l);
    if (values->some_missing)
        snprintf(l->note, sizeof l->note, "grey: %s",
                 look->colour == REND_COLOUR_DISTANCE ? "scanner unknown" : "no value");
}

/* The stored byte was stretched scan by scan: it has no unit. */
static void make_stretched_intensity(const rend_look *look, rend_paint *p, rend_legend *l)
{
    p->low = 0, p->high = REND_RAMP_STEPS - 1;
    rend_ramp_fill(rend_choice_map(look), &p->ramp);
    l->has_bar = true;
    l->ramp = p->ramp;
    snprintf(l->ticks[0], sizeof *l->ticks, "low");
    snprintf(l->ticks[REND_LEGEND_TICKS - 1], sizeof *l->ticks, "high");
    snprintf(l->note, sizeof l->note, "stretched scan by scan");
}

static void make_directions(rend_legend *l)
{
    static const uint8_t colours[3][3] = {{255, 128, 128}, {128, 255, 128}, {128, 128, 255}};
    for (int a = 0; a < 3; a++)
        add_row(l, colours[a], "towards %c", "xyz"[a]);
}

static void make_scans(const mospt_metadata *m, const rend_paint *p, rend_legend *l)
{
    for (uint32_t s = 0; s < m->source_count; s++) {
        const mospt_source *source = &m->sources[s];
        add_row(l, rend_paint_colour(p, s), "%s%s%s", source->name,
                source->scan[0] != '\0' ? ": " : "", source->scan);
    }
}

/* A node exists because cells of its parent, twice as wide as its own, held more than one point. */
static void make_density(const rend_look *look, const mospt_dataset *d, const rend_values *values,
                         rend_paint *p, rend_legend *l)
{
    uint32_t tail = values->count / 100;
    int low = values->count > 0 ? (int)values->at[tail] : 0;
    int high = values->count > 0 ? (int)values->at[values->count - 1 - tail] : 0;
    rend_ramp map;
    rend_ramp_fill(rend_choice_map(look), &map);
    for (int i = 0; i < REND_RAMP_STEPS; i++) {
        int level = i < low ? low : i > high ? high : i;
        int step =
            high > low ? (REND_RAMP_STEPS - 1) * (level - low) / (high - low) : REND_RAMP_STEPS / 2;
        memcpy(p->ramp.rgb[i], map.rgb[step], 3);
    }
    p->classes = true;
    for (int level = low; level <= high; level++) {
        double spacing = ldexp(d->metadata.grid.step, (int)d->metadata.grid.bits - level + 1 -
                                                          (int)d->hierarchy.inner_depth);
        const char *unit = spacing < 1 ? "mm" : "m";
        add_row(l, p->ramp.rgb[level], "%.3g %s%s", spacing < 1 ? 1000 * spacing : spacing, unit,
                level == low    ? " and wider"
                : level == high ? " and closer"
                                : "");
    }
}

static void name_class(const rend_look *look, const rend_paint *p, double value, rend_legend *l)
{
    const char *name = NULL;
    if (look->colour == REND_COLOUR_CLASSIFICATION) name = rend_asprs_name((uint32_t)value);
    add_row(l, rend_paint_colour(p, value), "%.0f%s%s", value, name != NULL ? "  " : "",
            name != NULL ? name : "");
}

static void make_classes(const rend_look *look, const rend_values *values, rend_paint *p,
                         rend_legend *l)
{
    for (uint32_t i = 0; i < REND_RAMP_STEPS; i++) {
        if (look->colour == REND_COLOUR_CLASSIFICATION) rend_asprs_colour(i, p->ramp.rgb[i]);
        else rend_ramp_hue(look->colour == REND_COLOUR_RETURN ? i - 1 : i, p->ramp.rgb[i]);
    }
    p->classes = true;
    if (look->colour == REND_COLOUR_SCAN) {
        make_scans(&p->dataset->metadata, p, l);
        return;
    }
    for (uint32_t i = 0; i < values->count; i++)
        if (i == 0 || values->at[i] != values->at[i - 1]) name_class(look, p, values->at[i], l);
}

static bool looks_like_classes(const rend_look *look, const rend_paint *p,
                               const rend_values *values)
{
    if (p->classes) return true;
    if (look->colour != REND_COLOUR_ATTRIBUTE || look->has_range || look->map != REND_MAP_USUAL)
        return false;
    mospt_type type = p->dataset->metadata.schema.at[p->attribute].type;
    uint32_t distinct = 1;
    for (uint32_t i = 1; i < values->count && distinct <= CLASSES_MAX; i++)
        distinct += values->at[i] != values->at[i - 1];
    bool below_zero = values->count > 0 && values->at[0] < 0;
    return type != MOSPT_F32 && type != MOSPT_F64 && distinct <= CLASSES_MAX && !below_zero;
}

/* Colours of whatever has values. */
static bool make_of_values(rend_scheme *s, const rend_look *look, rend_paint *p, rend_legend *l,
                           mospt_err *err)
{
    rend_values values;
    if (s->sample == NULL && !rend_sample_read(s->dataset, &s->sample, err)) return false;
    if (!rend_sample_values(s->sample, p, &values, err)) return false;
    if (p->source == REND_PAINT_LEVEL) make_density(look, s->dataset, &values, p, l);
    else if (looks_like_classes(look, p, &values)) make_classes(look, &values, p, l);
    else make_bar(look, &values, p, l);
    free(values.at);
    return true;
}

bool rend_scheme_make(rend_scheme *scheme, const rend_look *look, rend_paint *paint,
                      rend_legend *legend, mospt_err *err)
{
    rend_paint p;
    rend_legend l = {.has_bar = false};
    if (!resolve(scheme->dataset, look, &p, err)) return false;
    double brightness = look->brightness > 0 ? look->brightness : 1;
    double gamma = look->gamma > 0 ? look->gamma : 1;
    snprintf(l.title, sizeof l.title, "%s",
             look->colour == REND_COLOUR_ATTRIBUTE ? look->attribute : modes[look->colour].title);
    if (p.source == REND_PAINT_STORED) {
        if (brightness != 1 || gamma != 1) p.source = REND_PAINT_RGB;
        rend_ramp_curve(brightness, gamma, &p.ramp);
    } else if (p.source == REND_PAINT_INTENSITY) {
        make_stretched_intensity(look, &p, &l);
    } else if (p.source == REND_PAINT_DIRECTION) {
        make_directions(&l);
    } else if (!make_of_values(scheme, look, &p, &l, err)) {
        return false;
    }
    *paint = p;
    *legend = l;
    return true;
}
