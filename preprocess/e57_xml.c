#include "preprocess/e57_xml.h"

#include "preprocess/number.h"

#include <errno.h>
#include <expat.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    DEPTH_MAX = 64, /* real files need a dozen */
    PATH_SIZE = 1024,
    CHUNK_SIZE = 16 * 1024,
    TOKEN_MAX = 1024 * 1024 /* bytes without anything complete in them: one tag or comment, which
                               expat must hold */
};

#define SCAN "e57Root/data3D/scan/"
#define PROTOTYPE "points/prototype/"

typedef struct {
    XML_Parser parser;
    const prep_e57_xml *xml;
    prep_e57_file *file;
    prep_e57_scan *scan; /* owned, the one being read */
    char path[PATH_SIZE];
    size_t path_size;
    size_t parent[DEPTH_MAX]; /* size of the path of each open element's parent */
    uint32_t depth;
    char text[PREP_E57_CRS_MAX];
    size_t text_size;
    bool is_scaled; /* the element whose text is being read */
    double scale, offset;
    size_t since_event; /* bytes fed since the parser last reported anything */
    const char *fault;  /* static: why reading was stopped */
    bool has_err;       /* err was filled by on_scan */
    mospt_err *err;
} reader;

const char *prep_e57_local_name(const char *name)
{
    const char *colon = strrchr(name, ':');
    return colon != NULL && colon[1] != '\0' ? colon + 1 : name;
}

static void stop(reader *r, const char *why)
{
    if (r->fault == NULL) r->fault = why;
    XML_StopParser(r->parser, XML_FALSE);
}

static void clear_scan(prep_e57_scan *s)
{
    *s = (prep_e57_scan){
        .range_max = (double)NAN, .elevation_low = (double)NAN, .elevation_high = (double)NAN};
    for (int i = 0; i < 4; i++)
        s->rotation[i] = (double)NAN;
    for (int a = 0; a < 3; a++)
        s->translation[a] = s->low[a] = s->high[a] = s->rgb_low[a] = s->rgb_high[a] = (double)NAN;
}

static const char *find(const char **attributes, const char *name)
{
    for (; attributes[0] != NULL; attributes += 2)
        if (strcmp(attributes[0], name) == 0) return attributes[1];
    return NULL;
}

static double to_double(const char *text, double otherwise)
{
    double value;
    if (text == NULL) return otherwise;
    text += strspn(text, " \t\r\n");
    return prep_number_parse(text, text + strlen(text), &value) != NULL ? value : otherwise;
}

static bool to_int64(const char *text, int64_t otherwise, int64_t *out)
{
    *out = otherwise;
    if (text == NULL) return true;
    char *end;
    errno = 0;
    *out = strtoll(text, &end, 10);
    return errno == 0 && end != text && end[strspn(end, " \t\r\n")] == '\0';
}

static bool to_uint64(const char *text, uint64_t *out)
{
    char *end;
    errno = 0;
    *out = text != NULL ? strtoull(text, &end, 10) : 0;
    return text != NULL && errno == 0 && end != text && *end == '\0' && strchr(text, '-') == NULL;
}

static bool is(const char *text, const char *expected)
{
    return text != NULL && strcmp(text, expected) == 0;
}

static void set_fault(prep_e57_scan *s, const char *why, const char *name)
{
    if (s->fault[0] == '\0') snprintf(s->fault, sizeof s->fault, why, name);
}

static prep_e57_kind kind_of(const char *type, const char **attributes)
{
    if (is(type, "Integer")) return PREP_E57_INTEGER;
    if (is(type, "ScaledInteger")) return PREP_E57_SCALED;
    if (is(type, "Float"))
        return is(find(attributes, "precision"), "single") ? PREP_E57_FLOAT : PREP_E57_DOUBLE;
    return PREP_E57_UNREAD;
}

static void add_field(prep_e57_scan *s, const char *name, const char *type, const char **attributes)
{
    if (s->field_count == PREP_E57_FIELDS_MAX) {
        set_fault(s,
                  "its records have more fields than this program reads; the first one too many is "
                  "`%.64s`",
                  name);
        return;
    }
    prep_e57_field *f = &s->field[s->field_count++];
    *f = (prep_e57_field){.kind = kind_of(type, attributes), .scale = 1};
    snprintf(f->name, sizeof f->name, "%s", name);
    if (f->kind == PREP_E57_FLOAT || f->kind == PREP_E57_DOUBLE) {
        f->least = to_double(find(attributes, "minimum"), (double)NAN);
        f->most = to_double(find(attributes, "maximum"), (double)NAN);
        return;
    }
    if (f->kind == PREP_E57_UNREAD) return;
    if (!to_int64(find(attributes, "minimum"), INT64_MIN, &f->low) ||
        !to_int64(find(attributes, "maximum"), INT64_MAX, &f->high) || f->low > f->high)
        set_fault(s, "the range of its field `%.64s` is none", name);
    if (f->kind != PREP_E57_SCALED) return;
    f->scale = to_double(find(attributes, "scale"), 1);
    f->offset = to_double(find(attributes, "offset"), 0);
    if (!isfinite(f->scale) || f->scale == 0 || !isfinite(f->offset))
        set_fault(s, "the scale of its field `%.64s` is none", name);
}

static void start_points(prep_e57_scan *s, const char **attributes)
{
    if (!is(find(attributes, "type"), "CompressedVector") || s->has_points) return;
    s->has_points = true;
    if (!to_uint64(find(attributes, "fileOffset"), &s->offset) ||
        !to_uint64(find(attributes, "recordCount"), &s->record_count))
        set_fault(s, "%s", "its points have no fileOffset or no recordCount");
}

static void start_in_scan(prep_e57_scan *s, const char *path, const char *name,
                          const char **attributes)
{
    const char *type = find(attributes, "type");
    if (strcmp(path, "points") == 0) start_points(s, attributes);
    if (strcmp(path, "points/prototype") == 0) s->has_prototype = true;
    if (strncmp(path, PROTOTYPE, strlen(PROTOTYPE)) != 0) return;
    if (!is(type, "Structure") && !is(type, "Vector")) add_field(s, name, type, attributes);
}

/* Appends a name to the path; one that is longer than any we know becomes "?". */
static void push(reader *r, const char *name)
{
    r->parent[r->depth++] = r->path_size;
    if (strlen(name) > PREP_E57_FIELD_NAME_MAX) name = "?";
    size_t n = strlen(name);
    if (r->path_size + 1 + n >= sizeof r->path) {
        stop(r, "its elements are nested too deeply");
        return;
    }
    if (r->path_size > 0) r->path[r->path_size++] = '/';
    memcpy(r->path + r->path_size, name, n + 1);
    r->path_size += n;
}

static void XMLCALL on_start(void *user, const XML_Char *name, const XML_Char **attributes)
{
    reader *r = user;
    r->since_event = 0;
    if (r->depth == DEPTH_MAX) {
        stop(r, "its elements are nested too deeply");
        return;
    }
    bool is_scan = r->depth == 2 && strcmp(r->path, "e57Root/data3D") == 0;
    bool is_image = r->depth == 2 && strcmp(r->path, "e57Root/images2D") == 0;
    push(r, is_scan ? "scan"
                    : name); /* they are called vectorChild, but what counts is where they stand */
    if (is_scan) clear_scan(r->scan);
    r->file->image_count += is_image;
    r->text_size = 0;
    r->is_scaled = is(find(attributes, "type"), "ScaledInteger");
    r->scale = r->is_scaled ? to_double(find(attributes, "scale"), 1) : 1;
    r->offset = r->is_scaled ? to_double(find(attributes, "offset"), 0) : 0;
    if (strncmp(r->path, SCAN, strlen(SCAN)) == 0)
        start_in_scan(r->scan, r->path + strlen(SCAN), name, attributes);
}

static void XMLCALL on_text(void *user, const XML_Char *text, int size)
{
    reader *r = user;
    r->since_event = 0;
    size_t room = sizeof r->text - 1 - r->text_size, n = (size_t)size < room ? (size_t)size : room;
    memcpy(r->text + r->text_size, text, n);
    r->text_size += n;
}

#define AT(MEMBER) offsetof(prep_e57_scan, MEMBER)
static const struct {
    const char *path;
    size_t at;
} numbers[] = {
    {"pose/rotation/w", AT(rotation[0])},
    {"pose/rotation/x", AT(rotation[1])},
    {"pose/rotation/y", AT(rotation[2])},
    {"pose/rotation/z", AT(rotation[3])},
    {"pose/translation/x", AT(translation[0])},
    {"pose/translation/y", AT(translation[1])},
    {"pose/translation/z", AT(translation[2])},
    {"cartesianBounds/xMinimum", AT(low[0])},
    {"cartesianBounds/xMaximum", AT(high[0])},
    {"cartesianBounds/yMinimum", AT(low[1])},
    {"cartesianBounds/yMaximum", AT(high[1])},
    {"cartesianBounds/zMinimum", AT(low[2])},
    {"cartesianBounds/zMaximum", AT(high[2])},
    {"sphericalBounds/rangeMaximum", AT(range_max)},
    {"sphericalBounds/elevationMinimum", AT(elevation_low)},
    {"sphericalBounds/elevationMaximum", AT(elevation_high)},
    {"colorLimits/colorRedMinimum", AT(rgb_low[0])},
    {"colorLimits/colorRedMaximum", AT(rgb_high[0])},
    {"colorLimits/colorGreenMinimum", AT(rgb_low[1])},
    {"colorLimits/colorGreenMaximum", AT(rgb_high[1])},
    {"colorLimits/colorBlueMinimum", AT(rgb_low[2])},
    {"colorLimits/colorBlueMaximum", AT(rgb_high[2])},
};
#undef AT

/* Copies as much of a text as fits, without cutting a character of UTF-8 in two, and without
 * control characters. */
static void copy_text(char *out, size_t size, const char *text)
{
    text += strspn(text, " \t\r\n");
    size_t n = strlen(text);
    if (n >= size) {
        n = size - 1;
        while (n > 0 && ((uint8_t)text[n] & 0xc0) == 0x80)
            n--;
    }
    while (n > 0 && (uint8_t)text[n - 1] <= ' ')
        n--;
    for (size_t i = 0; i < n; i++)
        out[i] = (uint8_t)text[i] < ' ' || text[i] == 127 ? ' ' : text[i];
    out[n] = '\0';
}

static void end_in_scan(reader *r, const char *path)
{
    prep_e57_scan *s = r->scan;
    if (strcmp(path, "name") == 0) copy_text(s->name, sizeof s->name, r->text);
    if (strcmp(path, "guid") == 0) copy_text(s->guid, sizeof s->guid, r->text);
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        if (strcmp(path, numbers[i].path) != 0) continue;
        /* an element without text is the number zero */
        double value = to_double(r->text, 0) * r->scale + r->offset;
        memcpy((uint8_t *)s + numbers[i].at, &value, sizeof value);
    }
}

static void end_scan(reader *r)
{
    prep_e57_scan *s = r->scan;
    if (s->has_points && !s->has_prototype)
        set_fault(s, "%s", "its points have no prototype that says what they hold");
    if (r->xml->on_scan(r->xml->context, s, r->err)) return;
    r->has_err = true;
    stop(r, "");
}

static void XMLCALL on_end(void *user, const XML_Char *name)
{
    reader *r = user;
    (void)name;
    r->since_event = 0;
    r->text[r->text_size] = '\0';
    if (strncmp(r->path, SCAN, strlen(SCAN)) == 0) end_in_scan(r, r->path + strlen(SCAN));
    if (r->depth == 3 && strcmp(r->path, "e57Root/data3D/scan") == 0) end_scan(r);
    if (strcmp(r->path, "e57Root/data3D") == 0) r->file->has_all_scans = true;
    if (strcmp(r->path, "e57Root/coordinateMetadata") == 0 && r->text_size > 0 &&
        r->file->crs == NULL)
        r->file->crs = strdup(r->text);
    r->text_size = 0;
    r->path_size = r->parent[--r->depth];
    r->path[r->path_size] = '\0';
}

static void XMLCALL on_doctype(void *user, const XML_Char *name, const XML_Char *system,
                               const XML_Char *public, int has_internal)
{
    (void)name, (void)system, (void)public, (void)has_internal;
    stop(user, "it has a document type declaration, which no E57 file needs");
}

static void XMLCALL on_other(void *user, const XML_Char *text, int size)
{
    reader *r = user;
    (void)text, (void)size;
    r->since_event = 0;
}

static bool parse_chunk(reader *r, const char *bytes, size_t size, bool is_last)
{
    r->since_event += size;
    if (XML_Parse(r->parser, bytes, (int)size, is_last) != XML_STATUS_OK) return false;
    if (r->since_event <= TOKEN_MAX) return true;
    r->fault = "one of its elements is too long";
    return false;
}

/* Turns what the parser has to say into an error, unless on_scan has filled it already. */
static bool fail(reader *r, const char *path, uint64_t logical)
{
    enum XML_Error code = XML_GetErrorCode(r->parser);
    if (r->has_err) return false;
    if (code == XML_ERROR_NO_MEMORY) return mospt_err_nomem(r->err, CHUNK_SIZE);
    r->file->is_not_utf8 = r->fault == NULL && code == XML_ERROR_INVALID_TOKEN;
    XML_Index at = XML_GetCurrentByteIndex(r->parser);
    return mospt_err_set(
        r->err, MOSPT_EFORMAT,
        mospt_at_byte(path, prep_e57_physical(at < 0 ? logical : r->xml->offset + (uint64_t)at)),
        "the description of the scans (XML, line %lu) cannot be read: %s",
        (unsigned long)XML_GetCurrentLineNumber(r->parser),
        r->fault != NULL ? r->fault : XML_ErrorString(code));
}

static bool parse(reader *r, prep_e57_pages *pages)
{
    const char *path = prep_input_path(pages->input);
    char chunk[CHUNK_SIZE];
    for (uint64_t done = 0; done < r->xml->size;) {
        uint64_t left = r->xml->size - done, at = r->xml->offset + done;
        size_t want = left < sizeof chunk ? (size_t)left : sizeof chunk, got;
        if (!prep_e57_pages_read(pages, at, chunk, want, &got, r->err)) return false;
        bool is_last = done + got == r->xml->size;
        if (!parse_chunk(r, chunk, got, is_last)) return fail(r, path, at);
        if (got < want) {
            uint64_t place;
            const char *why = prep_e57_pages_fault(pages, at + got, &place);
            return mospt_err_set(r->err, MOSPT_EFORMAT, mospt_at_byte(path, place),
                                 "%s, in the description of the scans (XML)", why);
        }
        done += got;
    }
    return true;
}

static void set_handlers(reader *r)
{
    XML_SetUserData(r->parser, r);
    XML_SetElementHandler(r->parser, on_start, on_end);
    XML_SetCharacterDataHandler(r->parser, on_text);
    XML_SetStartDoctypeDeclHandler(r->parser, on_doctype);
    XML_SetDefaultHandler(r->parser, on_other);
}

bool prep_e57_xml_read(prep_e57_pages *pages, const prep_e57_xml *xml, prep_e57_file *out,
                       mospt_err *err)
{
    *out = (prep_e57_file){0};
    mospt_err ignored;
    bool ok = false;
    reader *r = calloc(1, sizeof *r);
    prep_e57_scan *scan = malloc(sizeof *scan);
    XML_Parser parser = XML_ParserCreate(xml->as_latin1 ? "ISO-8859-1" : NULL);
    if (r == NULL || scan == NULL || parser == NULL) {
        mospt_err_nomem(err, sizeof *r + sizeof *scan);
        goto done;
    }
    *r = (reader){.parser = parser,
                  .xml = xml,
                  .file = out,
                  .scan = scan,
                  .err = err != NULL ? err : &ignored};
    clear_scan(scan);
    set_handlers(r);
    ok = parse(r, pages);
    if (ok) out->has_all_scans = true;
done:
    if (parser != NULL) XML_ParserFree(parser);
    free(scan);
    free(r);
    return ok;
}
