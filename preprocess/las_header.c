#include "preprocess/las.h"

#include "preprocess/bytes.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    HEADER_SIZE = 227,
    HEADER_SIZE_13 = 235,
    HEADER_SIZE_14 = 375,
    VLR_SIZE = 54,
    EVLR_SIZE = 60,
    EXTRA_SIZE = 192,
    EXTRA_RECORD = 4,
    LASZIP_RECORD = 22204,
    WKT_RECORD = 2112,
    GEOKEYS_RECORD = 34735,
    GEOTEXT_RECORD = 34737,
    GEOKEYS_SIZE_MAX = 4096,
};

static const uint8_t record_size[PREP_LAS_FORMATS] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};

uint32_t prep_las_record_size(uint8_t point_format)
{
    return record_size[point_format];
}

static bool fail(const prep_input *in, uint64_t byte, mospt_err *err, const char *sentence)
{
    return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(prep_input_path(in), byte), "%s",
                         sentence);
}

static bool parse_fixed_part(const prep_input *in, const uint8_t *p, prep_las_header *h,
                             mospt_err *err)
{
    mospt_where at = {.file = prep_input_path(in), .kind = MOSPT_AT_BYTE};
    h->version_minor = p[25];
    at.place = 24;
    if (p[24] != 1 || p[25] > 5)
        return mospt_err_set(err, MOSPT_EFORMAT, at, "LAS version %u.%u is not known", p[24],
                             p[25]);

    h->header_size = prep_le16(p + 94);
    h->data_offset = prep_le32(p + 96);
    h->vlr_count = prep_le32(p + 100);
    h->is_compressed = (p[104] & 0xc0) != 0;
    h->point_format = p[104] & 0x3f;
    h->record_length = prep_le16(p + 105);
    at.place = 94;
    if (h->header_size < HEADER_SIZE)
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "the header claims %u bytes, at least %d are needed", h->header_size,
                             HEADER_SIZE);
    at.place = 96;
    if (h->data_offset < h->header_size || h->data_offset > prep_input_size(in))
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "point data should begin at byte %" PRIu64
                             ", the header has %u bytes and the file %" PRIu64,
                             h->data_offset, h->header_size, prep_input_size(in));
    at.place = 104;
    if (h->point_format >= PREP_LAS_FORMATS)
        return mospt_err_set(err, MOSPT_EFORMAT, at, "point format %u is not known", p[104]);
    at.place = 105;
    if (h->record_length < record_size[h->point_format])
        return mospt_err_set(err, MOSPT_EFORMAT, at,
                             "records of %u bytes, point format %u needs %u", h->record_length,
                             h->point_format, record_size[h->point_format]);
    return true;
}

static bool parse_geometry(const prep_input *in, const uint8_t *p, prep_las_header *h,
                           mospt_err *err)
{
    mospt_where at = {.file = prep_input_path(in), .kind = MOSPT_AT_BYTE};
    h->has_bounds = true;
    for (uint32_t a = 0; a < 3; a++) {
        char axis = (char)('x' + a);
        h->scale[a] = prep_le_f64(p + 131 + 8 * a);
        h->offset[a] = prep_le_f64(p + 155 + 8 * a);
        h->high[a] = prep_le_f64(p + 179 + 16 * a);
        h->low[a] = prep_le_f64(p + 187 + 16 * a);
        at.place = 131 + 8 * a;
        if (!isfinite(h->scale[a]) || h->scale[a] <= 0)
            return mospt_err_set(err, MOSPT_EFORMAT, at, "the scale of axis %c is %g", axis,
                                 h->scale[a]);
        at.place = 155 + 8 * a;
        if (!isfinite(h->offset[a]))
            return mospt_err_set(err, MOSPT_EFORMAT, at, "the offset of axis %c is %g", axis,
                                 h->offset[a]);
        if (!isfinite(h->low[a]) || !isfinite(h->high[a]) || h->low[a] > h->high[a])
            h->has_bounds = false;
    }
    return true;
}

/* LAS 1.4 counts twice. The old field is 0 or stale where the new one is meant, but writers exist
 * that fill only the old one, so that the new one is believed only as far as the file agrees. */
static void choose_count(const prep_input *in, const uint8_t *p, bool has_14, prep_las_header *h)
{
    uint64_t room = (prep_input_size(in) - h->data_offset) / h->record_length;
    uint64_t legacy = prep_le32(p + 107);
    h->declared = legacy;
    if (has_14) {
        uint64_t count = prep_le64(p + 247);
        bool is_nonsense = !h->is_compressed && count > room && legacy != 0 && legacy <= room;
        if (count != 0 && !is_nonsense) h->declared = count;
    }
    h->present = h->is_compressed || h->declared < room ? h->declared : room;
}

static void add_extra(const uint8_t *p, prep_las_header *h)
{
    static const mospt_type types[10] = {MOSPT_U8,  MOSPT_I8,  MOSPT_U16, MOSPT_I16, MOSPT_U32,
                                         MOSPT_I32, MOSPT_U64, MOSPT_I64, MOSPT_F32, MOSPT_F64};
    uint8_t type = p[2];
    prep_las_extra extra = {.type = MOSPT_U8, .components = p[3]};
    if (type > 30 || (type == 0 && p[3] == 0) || h->extra_count == PREP_LAS_EXTRA_MAX) return;
    if (type > 0) {
        extra.type = types[(type - 1) % 10];
        extra.components = 1 + (uint32_t)(type - 1) / 10;
    }
    for (int i = 0; i < 32 && p[4 + i] != 0; i++)
        extra.name[i] = p[4 + i] >= ' ' && p[4 + i] < 127 ? (char)p[4 + i] : '_';
    h->extra[h->extra_count++] = extra;
}

/* The payload of a record with a description of extra bytes. An entry that does not fit ends the
 * list: the bytes after it could not be placed. */
static bool read_extra(prep_input *in, uint64_t offset, uint64_t size, prep_las_header *h,
                       mospt_err *err)
{
    uint32_t room = h->record_length - record_size[h->point_format];
    for (uint64_t done = 0; done + EXTRA_SIZE <= size && h->extra_count < PREP_LAS_EXTRA_MAX;
         done += EXTRA_SIZE) {
        uint8_t entry[EXTRA_SIZE];
        size_t got;
        if (!prep_input_read_at(in, offset + done, entry, sizeof entry, &got, err)) return false;
        if (got < sizeof entry) break;
        uint32_t before = h->extra_count;
        add_extra(entry, h);
        if (h->extra_count == before) break;
        const prep_las_extra *e = &h->extra[before];
        uint32_t bytes = e->components * (uint32_t)mospt_type_size(e->type);
        if (bytes > room) {
            h->extra_count = before;
            break;
        }
        room -= bytes;
    }
    return true;
}

/* Coordinate reference system as text (LAS 1.4, OGC WKT). */
static bool read_wkt(prep_input *in, uint64_t offset, uint64_t size, prep_las_header *h,
                     mospt_err *err)
{
    size_t got;
    if (size >= sizeof h->crs) size = sizeof h->crs - 1;
    if (!prep_input_read_at(in, offset, h->crs, size, &got, err)) return false;
    h->crs[got] = '\0';
    return true;
}

/* GeoTIFF keys: an array of four 16-bit numbers each, after a head of the same shape. Of them, the
 * code of the projected, else of the geographic system, and that of the heights; and where the text
 * that names a system without a code stands. */
static bool read_geokeys(prep_input *in, uint64_t offset, uint64_t size, prep_las_header *h,
                         mospt_err *err)
{
    enum { GEOGRAPHIC = 2048, PROJECTED = 3072, VERTICAL = 4096, PRIVATE_FROM = 32767 };
    static const uint16_t citations[3] = {2049, 1026, 3073}; /* the last one tells most */
    int best = -1;
    uint8_t keys[GEOKEYS_SIZE_MAX];
    size_t got;
    uint16_t code[3] = {0};
    if (size > sizeof keys) size = sizeof keys;
    if (!prep_input_read_at(in, offset, keys, size, &got, err)) return false;
    for (size_t at = 8; at + 8 <= got; at += 8) {
        uint16_t id = prep_le16(keys + at), place = prep_le16(keys + at + 2);
        uint16_t value = prep_le16(keys + at + 6);
        for (int i = best + 1; i < 3 && place == GEOTEXT_RECORD; i++) {
            if (id != citations[i]) continue;
            best = i;
            h->citation_at = value;
            h->citation_size = prep_le16(keys + at + 4);
        }
        if (place != 0 || value == 0 || value >= PRIVATE_FROM) continue;
        if (id == GEOGRAPHIC) code[0] = value;
        if (id == PROJECTED) code[1] = value;
        if (id == VERTICAL) code[2] = value;
    }
    uint16_t plane = code[1] != 0 ? code[1] : code[0];
    if (plane != 0 && code[2] != 0) snprintf(h->crs, sizeof h->crs, "EPSG:%u+%u", plane, code[2]);
    else if (plane != 0) snprintf(h->crs, sizeof h->crs, "EPSG:%u", plane);
    return true;
}

static bool take_record(prep_input *in, const uint8_t *head, uint64_t payload, uint64_t size,
                        prep_las_header *h, mospt_err *err)
{
    char user[17] = {0};
    memcpy(user, head + 2, 16);
    uint16_t record = prep_le16(head + 18);
    if (strcmp(user, "laszip encoded") == 0 && record == LASZIP_RECORD) h->is_compressed = true;
    if (strcmp(user, "LASF_Spec") == 0 && record == EXTRA_RECORD && h->extra_count == 0)
        return read_extra(in, payload, size, h, err);
    if (strcmp(user, "LASF_Projection") != 0) return true;
    if (record == WKT_RECORD) return read_wkt(in, payload, size, h, err);
    if (record == GEOKEYS_RECORD && h->crs[0] == '\0')
        return read_geokeys(in, payload, size, h, err);
    if (record == GEOTEXT_RECORD) h->geotext_at = payload, h->geotext_size = size;
    return true;
}

/* A system without a code still has a name, which ends with a bar. */
static bool read_citation(prep_input *in, prep_las_header *h, mospt_err *err)
{
    size_t size = h->citation_size, got;
    if (h->crs[0] != '\0' || h->citation_at >= h->geotext_size) return true;
    if (size > h->geotext_size - h->citation_at) size = h->geotext_size - h->citation_at;
    if (size >= sizeof h->crs) size = sizeof h->crs - 1;
    if (!prep_input_read_at(in, h->geotext_at + h->citation_at, h->crs, size, &got, err))
        return false;
    h->crs[got] = '\0';
    h->crs[strcspn(h->crs, "|")] = '\0';
    return true;
}

/* Walks the variable length records between header and points. A count that cannot be true is
 * refused; one that is merely wrong ends where the points begin. */
static bool walk_vlrs(prep_input *in, prep_las_header *h, mospt_err *err)
{
    uint64_t at = h->header_size;
    if (h->vlr_count > (h->data_offset - at) / VLR_SIZE + 1)
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(prep_input_path(in), 100),
                             "the header claims %" PRIu32
                             " variable length records, there is room for %" PRIu64
                             " bytes of them",
                             h->vlr_count, h->data_offset - at);
    for (uint32_t i = 0; i < h->vlr_count && at + VLR_SIZE <= h->data_offset; i++) {
        uint8_t head[VLR_SIZE];
        size_t got;
        if (!prep_input_read_at(in, at, head, sizeof head, &got, err)) return false;
        uint64_t payload = at + VLR_SIZE, size = prep_le16(head + 20);
        if (got < sizeof head || payload + size > h->data_offset) break;
        if (!take_record(in, head, payload, size, h, err)) return false;
        at = payload + size;
    }
    return true;
}

/* Extended records, behind the points of LAS 1.4, may describe extra bytes too. They are a
 * supplement: if their place or number is wrong, the points can be read all the same. */
static bool walk_evlrs(prep_input *in, const uint8_t *p, prep_las_header *h, mospt_err *err)
{
    uint64_t at = prep_le64(p + 235), file = prep_input_size(in);
    uint32_t count = prep_le32(p + 243);
    for (uint32_t i = 0; i < count && at >= h->data_offset && at < file && file - at >= EVLR_SIZE;
         i++) {
        uint8_t head[EVLR_SIZE];
        size_t got;
        if (!prep_input_read_at(in, at, head, sizeof head, &got, err)) return false;
        uint64_t payload = at + EVLR_SIZE, size = prep_le64(head + 20);
        if (got < sizeof head || size > file - payload) break;
        if (!take_record(in, head, payload, size, h, err)) return false;
        at = payload + size;
    }
    return true;
}

bool prep_las_header_read(prep_input *input, prep_las_header *out, mospt_err *err)
{
    prep_las_header h = {0};
    uint8_t p[HEADER_SIZE_14] = {0};
    size_t got;
    if (prep_input_is_gzip(input))
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(prep_input_path(input)),
                             "LAS inside gzip is not read; unpack it first");
    if (!prep_input_read_at(input, 0, p, sizeof p, &got, err)) return false;
    if (got < 4 || memcmp(p, "LASF", 4) != 0)
        return fail(input, 0, err, "no LAS file: the signature is missing");
    if (got < HEADER_SIZE) return fail(input, got, err, "the file ends inside the LAS header");
    if (!parse_fixed_part(input, p, &h, err)) return false;
    if (!parse_geometry(input, p, &h, err)) return false;

    bool has_14 = h.version_minor >= 4 && h.header_size >= HEADER_SIZE_14 && got == HEADER_SIZE_14;
    if (!walk_vlrs(input, &h, err)) return false;
    choose_count(input, p, has_14, &h);
    if (has_14 && !h.is_compressed && !walk_evlrs(input, p, &h, err)) return false;
    if (!read_citation(input, &h, err)) return false;
    bool has_waves =
        h.version_minor >= 3 && h.header_size >= HEADER_SIZE_13 && prep_le64(p + HEADER_SIZE) != 0;
    h.has_tail = has_waves || (has_14 && prep_le32(p + 243) > 0);
    *out = h;
    return true;
}
