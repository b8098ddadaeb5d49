#include "preprocess/e57_index.h"

#include "preprocess/bytes.h"

#include <ctype.h>
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    HEADER_SIZE = 48,
    EMPTY_RECORDS_MAX = 1 << 20,    /* records without a single bit need no file to hold them; no
                                       scanner writes more than one */
    REMEMBERED_SIZE_MAX = 64 << 20, /* a description is 2 KiB; the XML is read again for the rest */
};

typedef struct {
    uint32_t major, minor;
    uint64_t file_size, xml_offset, xml_size, page_size;
} header;

/* What the XML of a file says. */
typedef struct {
    void **descs; /* [usable], owned: a prep_e57_scan without the room behind its last field; NULL:
                     not remembered */
    uint32_t capacity;
    size_t size;                   /* of all that are remembered */
    uint32_t seen, usable, broken; /* scans */
    uint32_t images;
    mospt_err fault;  /* of the first broken one */
    mospt_err damage; /* of the XML behind the scans; MOSPT_OK: none */
    char *crs;        /* owned, NULL if the file is silent */
} file_index;

/* Goes through the scans of a file. */
typedef struct {
    const char *path;
    prep_e57_pages *pages;
    prep_e57_points *points; /* for a look at each scan */
    uint32_t wanted;
    file_index *index;
} search;

static bool read_header(const prep_scan *scan, prep_e57_pages *pages, header *h, mospt_err *err)
{
    uint8_t bytes[HEADER_SIZE];
    size_t got;
    if (!prep_e57_pages_read(pages, 0, bytes, sizeof bytes, &got, err)) return false;
    if (got < sizeof bytes) {
        uint64_t place;
        const char *why = prep_e57_pages_fault(pages, 0, &place);
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, place),
                             "%s, in the file's header", why);
    }
    if (memcmp(bytes, "ASTM-E57", 8) != 0)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, 0),
                             "the file does not begin with ASTM-E57");
    h->major = prep_le32(bytes + 8);
    h->minor = prep_le32(bytes + 12);
    h->file_size = prep_le64(bytes + 16);
    h->xml_offset = prep_le64(bytes + 24);
    h->xml_size = prep_le64(bytes + 32);
    h->page_size = prep_le64(bytes + 40);
    if (h->major == 1 && h->page_size == PREP_E57_PAGE_SIZE) return true;
    return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, 8),
                         "version %" PRIu32 ".%" PRIu32 " with pages of %" PRIu64
                         " bytes; known is 1.0 with 1024",
                         h->major, h->minor, h->page_size);
}

/* Finds the XML section. That a file was cut is told even if the section is still there. */
static bool locate_xml(prep_scan *scan, const prep_e57_pages *pages, const header *h,
                       prep_e57_xml *xml, mospt_err *err)
{
    uint64_t size = prep_input_size(scan->input), end = pages->page_count * PREP_E57_PAGE_DATA;
    bool is_there = prep_e57_pages_locate(pages, h->xml_offset, &xml->offset) && h->xml_size > 0 &&
                    h->xml_size <= end - xml->offset;
    xml->size = h->xml_size;
    if (!is_there && size < h->file_size)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, size),
                             "the file is cut: %" PRIu64 " of %" PRIu64
                             " bytes are there, and without the description of "
                             "the scans (XML), which is missing, no point can be read",
                             size, h->file_size);
    if (!is_there)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(scan->path, 24),
                             "the description of the scans (XML), %" PRIu64 " bytes at %" PRIu64
                             ", does not lie in the file",
                             h->xml_size, h->xml_offset);
    if (size < h->file_size)
        prep_scan_set_damage(scan, mospt_at_byte(scan->path, size),
                             "the file is cut: %" PRIu64 " of %" PRIu64 " bytes are there", size,
                             h->file_size);
    return true;
}

/* Why the points of a scan cannot be read; MOSPT_OK in err->code if they can. */
static void judge(const search *s, const prep_e57_scan *desc, mospt_err *err)
{
    char why[256];
    if (!prep_e57_points_are_possible(desc, why, sizeof why)) {
        mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(s->path), "%s", why);
        return;
    }
    prep_e57_vector vector;
    if (!prep_e57_vector_open(s->pages, desc->offset, desc->field_count, &vector, err)) return;
    prep_e57_points_init(s->points, desc);
    if (prep_e57_points_bits(s->points) == 0 && desc->record_count > EMPTY_RECORDS_MAX)
        mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(s->path),
                      "it claims %" PRIu64 " records of 0 bits", desc->record_count);
}

static size_t used_size(const prep_e57_scan *desc)
{
    return offsetof(prep_e57_scan, field) + desc->field_count * sizeof desc->field[0];
}

static bool add_scan(file_index *index, const prep_e57_scan *desc, bool is_wanted, mospt_err *err)
{
    size_t size = used_size(desc);
    void *kept = NULL;
    if (index->usable == index->capacity) {
        uint32_t capacity = index->capacity > 0 ? 2 * index->capacity : 16;
        void **grown = realloc(index->descs, capacity * sizeof *grown);
        if (grown == NULL) return mospt_err_nomem(err, capacity * sizeof *grown);
        index->descs = grown;
        index->capacity = capacity;
    }
    if (is_wanted || index->size + size <= REMEMBERED_SIZE_MAX) {
        kept = malloc(size);
        if (kept == NULL) return mospt_err_nomem(err, size);
        memcpy(kept, desc, size);
        index->size += size;
    }
    index->descs[index->usable++] = kept;
    return true;
}

static bool on_scan(void *context, const prep_e57_scan *desc, mospt_err *err)
{
    search *s = context;
    file_index *index = s->index;
    mospt_err fault = {0};
    index->seen++;
    if (!desc->has_points || (desc->record_count == 0 && desc->fault[0] == '\0')) return true;
    judge(s, desc, &fault);
    if (fault.code == MOSPT_OK) return add_scan(index, desc, index->usable == s->wanted, err);
    if (fault.code != MOSPT_EFORMAT) {
        *err = fault;
        return false;
    }
    if (index->broken++ == 0) {
        mospt_where where = {.file = s->path, .kind = fault.place_kind, .place = fault.place};
        mospt_err_set(&index->fault, MOSPT_EFORMAT, where,
                      "scan %" PRIu32 " (%.64s) cannot be read: %.256s", index->seen,
                      desc->name[0] != '\0' ? desc->name : "without a name", fault.message);
    }
    return true;
}

static void clear_index(file_index *index)
{
    for (uint32_t i = 0; i < index->usable; i++)
        free(index->descs[i]);
    free(index->descs);
    free(index->crs);
    *index = (file_index){0};
}

static void free_index(void *index)
{
    clear_index(index);
    free(index);
}

static bool read_xml(search *s, prep_e57_xml *xml, mospt_err *err)
{
    prep_e57_file file = {0};
    mospt_err why = {0};
    file_index *index = s->index;
    bool ok = prep_e57_xml_read(s->pages, xml, &file, &why);
    if (!ok && file.is_not_utf8 && !file.has_all_scans) {
        free(file.crs);
        clear_index(index);
        xml->as_latin1 = true; /* some writers name scans in the code page of their machine */
        ok = prep_e57_xml_read(s->pages, xml, &file, &why);
    }
    index->crs = file.crs;
    index->images = file.image_count;
    if (!ok && (why.code != MOSPT_EFORMAT || !file.has_all_scans)) {
        if (err != NULL) *err = why;
        return false;
    }
    if (!ok) index->damage = why; /* behind the scans there are only pictures */
    return true;
}

static file_index *search_scans(const prep_scan *scan, prep_e57_pages *pages, uint32_t wanted,
                                prep_e57_xml *xml, mospt_err *err)
{
    search s = {.path = scan->path,
                .pages = pages,
                .points = malloc(sizeof *s.points),
                .wanted = wanted,
                .index = calloc(1, sizeof *s.index)};
    xml->on_scan = on_scan;
    xml->context = &s;
    bool ok = s.points != NULL && s.index != NULL;
    if (!ok) mospt_err_nomem(err, sizeof *s.points);
    ok = ok && read_xml(&s, xml, err);
    free(s.points);
    if (ok) return s.index;
    if (s.index != NULL) free_index(s.index);
    return NULL;
}

static void note(prep_scan *scan, const mospt_err *err)
{
    mospt_where where = {.file = scan->path, .kind = err->place_kind, .place = err->place};
    if (err->code != MOSPT_OK) prep_scan_set_damage(scan, where, "%s", err->message);
}

/* Some writers put a pair of quotes where nothing is known. */
static bool is_word(const char *text)
{
    while (*text != '\0' && !isalnum((unsigned char)*text))
        text++;
    return *text != '\0';
}

static bool pick(prep_scan *scan, const file_index *index, uint32_t wanted, prep_e57_found *out,
                 mospt_err *err)
{
    if (index->crs != NULL && is_word(index->crs))
        snprintf(scan->info.crs, sizeof scan->info.crs, "%s", index->crs);
    note(scan, &index->damage);
    if (index->usable == 0 && index->broken > 0) {
        if (err != NULL) *err = index->fault;
        return false;
    }
    if (index->usable == 0)
        return mospt_err_set(
            err, MOSPT_EEMPTY, mospt_at_file(scan->path),
            "the E57 file holds %" PRIu32 " scan%s and %" PRIu32 " image%s, but no points",
            index->seen, index->seen == 1 ? "" : "s", index->images, index->images == 1 ? "" : "s");
    out->scan_count = index->usable;
    scan->info.image_count = index->images;
    if (wanted >= index->usable) return true;
    if (wanted == 0) note(scan, &index->fault);
    out->desc = calloc(1, sizeof *out->desc);
    if (out->desc == NULL) return mospt_err_nomem(err, sizeof *out->desc);
    const prep_e57_scan *desc = index->descs[wanted];
    memcpy(out->desc, desc, used_size(desc));
    return true;
}

static bool has(const file_index *index, uint32_t wanted)
{
    return index != NULL && (wanted >= index->usable || index->descs[wanted] != NULL);
}

bool prep_e57_find(prep_scan *scan, prep_e57_pages *pages, prep_scan_memory *memory,
                   uint32_t wanted, prep_e57_found *out, mospt_err *err)
{
    header h = {0};
    prep_e57_xml xml = {0};
    if (!read_header(scan, pages, &h, err) || !locate_xml(scan, pages, &h, &xml, err)) return false;
    const file_index *index = prep_scan_memory_recall(memory, scan->input, free_index);
    file_index *searched = NULL;
    if (!has(index, wanted)) {
        searched = search_scans(scan, pages, wanted, &xml, err);
        if (searched == NULL) return false;
        index = searched;
    }
    prep_e57_found found = {.major = h.major, .minor = h.minor};
    bool ok = pick(scan, index, wanted, &found, err);
    if (searched != NULL) prep_scan_memory_keep(memory, scan->input, searched, free_index);
    if (ok) *out = found;
    return ok;
}
