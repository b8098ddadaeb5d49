#include "tests/write_e57.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    uint8_t *bytes;
    size_t size, capacity;
} buffer;

static void put(buffer *b, const void *bytes, size_t size)
{
    if (b->size + size > b->capacity) {
        b->capacity = 2 * (b->size + size);
        b->bytes = realloc(b->bytes, b->capacity);
        if (b->bytes == NULL) abort();
    }
    if (bytes != NULL) memcpy(b->bytes + b->size, bytes, size);
    else memset(b->bytes + b->size, 0, size);
    b->size += size;
}

static void put_number(buffer *b, uint64_t value, unsigned size)
{
    for (unsigned i = 0; i < size; i++)
        put(b, &(uint8_t){(uint8_t)(value >> 8 * i)}, 1);
}

__attribute__((format(printf, 2, 3))) static void put_text(buffer *b, const char *format, ...)
{
    char text[4096];
    va_list args;
    va_start(args, format);
    int n = vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (n < 0 || (size_t)n >= sizeof text) abort();
    put(b, text, (size_t)n);
}

typedef struct {
    buffer out;
    unsigned used; /* bits in the last byte */
} bits;

static void put_bits(bits *b, uint64_t value, unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        if (b->used == 0) put(&b->out, NULL, 1);
        if (value >> i & 1) b->out.bytes[b->out.size - 1] |= (uint8_t)(1u << b->used);
        b->used = (b->used + 1) % 8;
    }
}

static unsigned width_of(const write_e57_field *f)
{
    unsigned width = 0;
    for (uint64_t range = (uint64_t)f->high - (uint64_t)f->low; range > 0; range >>= 1)
        width++;
    return width;
}

static unsigned bits_of(const write_e57_field *f)
{
    if (f->kind == WRITE_E57_FLOAT) return 32;
    if (f->kind == WRITE_E57_DOUBLE) return 64;
    return f->kind == WRITE_E57_STRING ? 48 : width_of(f);
}

static void put_value(bits *b, const write_e57_field *f, uint32_t i)
{
    uint64_t raw = 0;
    if (f->kind == WRITE_E57_FLOAT) {
        float value = (float)f->values[i];
        memcpy(&raw, &value, sizeof value);
        put_bits(b, raw, 32);
    } else if (f->kind == WRITE_E57_DOUBLE) {
        memcpy(&raw, &f->values[i], 8);
        put_bits(b, raw, 64);
    } else if (f->kind == WRITE_E57_STRING) {
        put_bits(b, 2 * 5, 8); /* five letters */
        for (int k = 0; k < 5; k++)
            put_bits(b, (uint8_t)('a' + (i + (uint32_t)k) % 26), 8);
    } else {
        put_bits(b, (uint64_t)f->integers[i] - (uint64_t)f->low, width_of(f));
    }
}

static void put_other_packets(buffer *b)
{
    put_number(b, 0, 1); /* index packet with one entry */
    put_number(b, 0, 1);
    put_number(b, 32 - 1, 2);
    put_number(b, 1, 2);
    put(b, NULL, 10 + 16);
    put_number(b, 2, 1); /* ignored packet */
    put_number(b, 0, 1);
    put_number(b, 12 - 1, 2);
    put(b, NULL, 8);
}

static void put_data_packet(buffer *b, const bits *streams, const size_t *at, const size_t *piece,
                            uint32_t count)
{
    size_t size = 6 + 2 * (size_t)count;
    for (uint32_t k = 0; k < count; k++)
        size += piece[k];
    size_t padding = (4 - size % 4) % 4;
    if (size + padding > 65536) abort();
    put_number(b, 1, 1);
    put_number(b, 0, 1);
    put_number(b, size + padding - 1, 2);
    put_number(b, count, 2);
    for (uint32_t k = 0; k < count; k++)
        put_number(b, piece[k], 2);
    for (uint32_t k = 0; k < count; k++)
        put(b, streams[k].out.bytes + at[k], piece[k]);
    put(b, NULL, padding);
}

/* Chooses what the next packet takes of each stream; false if nothing is left. */
static bool deal(const write_e57_scan *s, const bits *streams, const size_t *at, size_t *piece)
{
    bool any = false;
    for (uint32_t k = 0; k < s->field_count; k++) {
        size_t left = streams[k].out.size - at[k];
        size_t want = s->piece > 0 ? s->piece : 1000;
        if (s->dealing == WRITE_E57_STAGGER) want += 3 * k;
        if (s->dealing == WRITE_E57_BALANCED) want = want * bits_of(&s->fields[k]) / 64 + 1;
        if (s->dealing == WRITE_E57_IN_TURN && any) want = 0;
        piece[k] = left < want ? left : want;
        any = any || piece[k] > 0;
    }
    return any;
}

static void put_packets(buffer *b, const write_e57_scan *s)
{
    bits *streams = calloc(s->field_count, sizeof *streams);
    size_t *at = calloc(s->field_count, sizeof *at), *piece = calloc(s->field_count, sizeof *piece);
    if (streams == NULL || at == NULL || piece == NULL) abort();
    for (uint32_t k = 0; k < s->field_count; k++)
        for (uint32_t i = 0; i < s->count; i++)
            put_value(&streams[k], &s->fields[k], i);
    while (deal(s, streams, at, piece)) {
        if (s->has_other_packets) put_other_packets(b);
        put_data_packet(b, streams, at, piece, s->field_count);
        for (uint32_t k = 0; k < s->field_count; k++)
            at[k] += piece[k];
    }
    if (s->has_other_packets) put_other_packets(b);
    for (uint32_t k = 0; k < s->field_count; k++)
        free(streams[k].out.bytes);
    free(streams);
    free(at);
    free(piece);
}

static uint64_t physical(size_t logical)
{
    return logical / 1020 * 1024 + logical % 1020;
}

static void set_number(buffer *b, size_t at, uint64_t value)
{
    for (unsigned i = 0; i < 8; i++)
        b->bytes[at + i] = (uint8_t)(value >> 8 * i);
}

static void put_section(buffer *b, const write_e57_scan *s)
{
    size_t begin = b->size;
    put_number(b, 1, 8);
    put(b, NULL, 24);
    put_packets(b, s);
    set_number(b, begin + 8, b->size - begin);
    set_number(b, begin + 16, physical(begin + 32));
}

static void put_field(buffer *x, const write_e57_field *f)
{
    static const char *const types[] = {"Float\" precision=\"single", "Float", "Integer",
                                        "ScaledInteger", "String"};
    bool is_integer = f->kind == WRITE_E57_INTEGER || f->kind == WRITE_E57_SCALED;
    put_text(x, "<%s type=\"%s\"", f->name, types[f->kind]);
    if (is_integer && f->low != INT64_MIN) put_text(x, " minimum=\"%" PRId64 "\"", f->low);
    if (is_integer && f->high != INT64_MAX) put_text(x, " maximum=\"%" PRId64 "\"", f->high);
    if (f->kind == WRITE_E57_SCALED)
        put_text(x, " scale=\"%.17g\" offset=\"%.17g\"", f->scale, f->offset);
    put_text(x, "/>\n");
}

static void put_scan(buffer *x, const write_e57_scan *s, size_t section)
{
    put_text(x, "<vectorChild type=\"Structure\">\n");
    if (s->guid != NULL) put_text(x, "<guid type=\"String\"><![CDATA[%s]]></guid>\n", s->guid);
    if (s->name != NULL) put_text(x, "<name type=\"String\"><![CDATA[%s]]></name>\n", s->name);
    if (s->xml != NULL) put(x, s->xml, strlen(s->xml));
    put_text(x,
             "<points type=\"CompressedVector\" fileOffset=\"%020" PRIu64
             "\" recordCount=\"%020" PRIu64 "\">\n",
             physical(section), s->declared > 0 ? s->declared : s->count);
    if (!s->lacks_prototype) put_text(x, "<prototype type=\"Structure\">\n");
    for (uint32_t k = 0; k < s->field_count && !s->lacks_prototype; k++)
        put_field(x, &s->fields[k]);
    if (!s->lacks_prototype) put_text(x, "</prototype>\n");
    put_text(
        x,
        "<codecs type=\"Vector\" allowHeterogeneousChildren=\"1\"/>\n</points>\n</vectorChild>\n");
}

static buffer make_xml(const write_e57_file *f, const size_t *sections)
{
    buffer x = {0};
    put_text(&x, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    if (f->doctype != NULL) put(&x, f->doctype, strlen(f->doctype));
    put_text(
        &x, "<e57Root type=\"Structure\" xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\">\n"
            "<formatName type=\"String\"><![CDATA[ASTM E57 3D Imaging Data File]]></formatName>\n");
    if (f->crs != NULL)
        put_text(&x, "<coordinateMetadata type=\"String\"><![CDATA[%s]]></coordinateMetadata>\n",
                 f->crs);
    put_text(&x, "<data3D type=\"Vector\" allowHeterogeneousChildren=\"1\">\n");
    for (uint32_t i = 0; i < f->scan_count; i++)
        put_scan(&x, &f->scans[i], sections[i]);
    put_text(&x, "</data3D>\n");
    if (f->xml != NULL) put(&x, f->xml, strlen(f->xml));
    put_text(&x, "</e57Root>\n");
    return x;
}

static uint32_t crc(const uint8_t *bytes, size_t size)
{
    uint32_t r = UINT32_MAX;
    for (size_t i = 0; i < size; i++) {
        r ^= bytes[i];
        for (int k = 0; k < 8; k++)
            r = r & 1 ? r >> 1 ^ 0x82f63b78u : r >> 1;
    }
    return ~r;
}

void write_e57_seal(uint8_t *bytes, size_t size)
{
    for (size_t at = 0; at + 1024 <= size; at += 1024) {
        uint32_t sum = crc(bytes + at, 1020);
        for (size_t i = 0; i < 4; i++)
            bytes[at + 1020 + i] = (uint8_t)(sum >> (24 - 8 * i));
    }
}

static uint8_t *paginate(const buffer *b, size_t *size)
{
    size_t pages = (b->size + 1019) / 1020;
    uint8_t *bytes = calloc(pages, 1024);
    if (bytes == NULL) abort();
    for (size_t i = 0; i < pages; i++) {
        size_t left = b->size - 1020 * i;
        memcpy(bytes + 1024 * i, b->bytes + 1020 * i, left < 1020 ? left : 1020);
    }
    *size = 1024 * pages;
    write_e57_seal(bytes, *size);
    return bytes;
}

uint8_t *write_e57(const write_e57_file *file, size_t *size)
{
    buffer b = {0};
    size_t *sections = calloc(file->scan_count + 1, sizeof *sections), xml_at = 48;
    if (sections == NULL) abort();
    put(&b, "ASTM-E57", 8);
    put(&b, NULL, 40);
    buffer xml = make_xml(file, sections); /* as long as it will be in the end */
    if (file->is_xml_first) put(&b, NULL, (xml.size + 3) / 4 * 4);
    for (uint32_t i = 0; i < file->scan_count; i++) {
        sections[i] = b.size;
        put_section(&b, &file->scans[i]);
    }
    free(xml.bytes);
    xml = make_xml(file, sections);
    if (file->is_xml_first) memcpy(b.bytes + xml_at, xml.bytes, xml.size);
    else xml_at = b.size, put(&b, xml.bytes, xml.size);
    b.bytes[8] = 1;
    set_number(&b, 16, (b.size + 1019) / 1020 * 1024);
    set_number(&b, 24, physical(xml_at));
    set_number(&b, 32, xml.size);
    set_number(&b, 40, 1024);
    uint8_t *bytes = paginate(&b, size);
    free(xml.bytes);
    free(b.bytes);
    free(sections);
    return bytes;
}
