#include "preprocess/e57_vector.h"

#include "preprocess/bytes.h"

#include <inttypes.h>
#include <stdlib.h>

enum { SECTION_VECTOR = 1, SECTION_HEADER_SIZE = 32 };
enum { PACKET_INDEX, PACKET_DATA, PACKET_IGNORED };
enum { PACKET_HEADER_MAX = 6 + 2 * PREP_E57_STREAMS_MAX };

/* A packet as far as its header tells. Bit 0 of the flags says that the bytestreams restart here;
 * no writer is known to set it, and no reader to heed it, because where values do not end with a
 * byte the flag alone does not say how many of the bits before it were padding. */
typedef struct {
    uint8_t type;
    uint64_t size;  /* whole */
    uint64_t first; /* logical offset of the first piece */
    uint8_t header[PACKET_HEADER_MAX];
} packet;

static bool refuse(const prep_e57_vector *v, uint64_t physical, const char *why, uint64_t value,
                   mospt_err *err)
{
    return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(v->path, physical), "%s (%" PRIu64 ")",
                         why, value);
}

bool prep_e57_vector_open(prep_e57_pages *pages, uint64_t offset, uint32_t stream_count,
                          prep_e57_vector *out, mospt_err *err)
{
    prep_e57_vector v = {
        .pages = pages, .path = prep_input_path(pages->input), .stream_count = stream_count};
    uint8_t header[SECTION_HEADER_SIZE];
    uint64_t at, place;
    size_t got;
    if (!prep_e57_pages_locate(pages, offset, &at))
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_file(v.path),
                             "a scan's points are said to begin at byte %" PRIu64
                             ", which is not in the file",
                             offset);
    if (!prep_e57_pages_read(pages, at, header, sizeof header, &got, err)) return false;
    if (got < sizeof header) {
        const char *why = prep_e57_pages_fault(pages, at + got, &place);
        return mospt_err_set(err, MOSPT_EFORMAT, mospt_at_byte(v.path, place),
                             "%s, in the header of a scan's points", why);
    }
    uint64_t size = prep_le64(header + 8), first = prep_le64(header + 16);
    if (header[0] != SECTION_VECTOR)
        return refuse(&v, offset, "no section of points begins here", header[0], err);
    if (size < SECTION_HEADER_SIZE || size % 4 != 0)
        return refuse(&v, offset + 8, "the section of points has an impossible size", size, err);
    if (!prep_e57_pages_locate(pages, first, &v.begin) || v.begin < at)
        return refuse(&v, offset + 16,
                      "the first packet of a section of points is said to lie elsewhere", first,
                      err);
    uint64_t file_end = pages->page_count * PREP_E57_PAGE_DATA;
    v.end = size < file_end - at ? at + size : file_end;
    *out = v;
    return true;
}

uint64_t prep_e57_vector_room(const prep_e57_vector *vector, uint64_t bits)
{
    uint64_t size = vector->end > vector->begin ? vector->end - vector->begin : 0;
    if (bits == 0) return UINT64_MAX;
    return size > UINT64_MAX / 8 ? UINT64_MAX : size * 8 / bits;
}

void prep_e57_stream_start(prep_e57_stream *stream, const prep_e57_vector *vector, uint32_t index,
                           unsigned width)
{
    *stream = (prep_e57_stream){
        .index = index, .width = width, .packet = vector->begin, .bytes = stream->bytes};
}

void prep_e57_stream_release(prep_e57_stream *stream)
{
    free(stream->bytes);
    *stream = (prep_e57_stream){0};
}

/* Streams meet damage in any order; the first in the file is the one to tell. */
static void note_fault(prep_e57_vector *v, uint64_t place, const char *why)
{
    if (v->fault != NULL && v->fault_place <= place) return;
    v->fault = why;
    v->fault_place = place;
}

static void note_unreadable(prep_e57_vector *v, uint64_t logical)
{
    uint64_t place;
    const char *why = prep_e57_pages_fault(v->pages, logical, &place);
    note_fault(v, place, why);
}

static const char *check_data(const prep_e57_vector *v, packet *p, uint64_t at)
{
    uint32_t count = prep_le16(p->header + 4);
    if (count != v->stream_count)
        return "the data packet has not as many bytestreams as the scan has fields";
    uint64_t used = 6 + 2 * (uint64_t)count;
    p->first = at + used;
    for (uint32_t i = 0; i < count; i++)
        used += prep_le16(p->header + 6 + 2 * i);
    return used > p->size ? "the bytestreams of the data packet are longer than the packet" : NULL;
}

static const char *check_packet(const prep_e57_vector *v, packet *p, uint64_t at, size_t got)
{
    p->type = p->header[0];
    p->size = (uint64_t)prep_le16(p->header + 2) + 1;
    if (p->type > PACKET_IGNORED) return "no packet of a known type begins here";
    if (p->size % 4 != 0) return "the packet has an impossible size";
    if (p->size > v->end - at)
        return "the packet that begins here reaches beyond the end of the points";
    if (p->type != PACKET_DATA) return NULL;
    if (got < 6 + 2 * (size_t)v->stream_count || p->size < 6 + 2 * (uint64_t)v->stream_count)
        return "the data packet has no room for its header";
    return check_data(v, p, at);
}

/* Reads the packet at `at`; `more` is false at the end of the section and in front of damage, which
 * is noted. */
static bool read_packet(prep_e57_vector *v, uint64_t at, packet *p, bool *more, mospt_err *err)
{
    size_t got, want = 6 + 2 * (size_t)v->stream_count;
    *more = false;
    if (at >= v->end) return true;
    if (want > v->end - at) want = (size_t)(v->end - at);
    if (!prep_e57_pages_read(v->pages, at, p->header, want, &got, err)) return false;
    if (got < 4 || (got < want && p->header[0] == PACKET_DATA)) {
        note_unreadable(v, at + got);
        return true;
    }
    const char *why = check_packet(v, p, at, got);
    if (why != NULL) note_fault(v, prep_e57_physical(at), why);
    *more = why == NULL;
    return true;
}

/* Goes on to the stream's piece in the next data packet. */
static bool next_piece(prep_e57_stream *s, prep_e57_vector *v, bool *more, mospt_err *err)
{
    packet p;
    do {
        if (!read_packet(v, s->packet, &p, more, err)) return false;
        if (!*more) {
            s->packet = v->end; /* do not ask again */
            return true;
        }
        s->packet += p.size;
    } while (p.type != PACKET_DATA);
    s->at = p.first;
    for (uint32_t i = 0; i < s->index; i++)
        s->at += prep_le16(p.header + 6 + 2 * i);
    s->left = prep_le16(p.header + 6 + 2 * s->index);
    return true;
}

/* Moves what was not taken yet to the front of the buffer. */
static void drop_taken(prep_e57_stream *s)
{
    size_t drop = s->bit / 8 < s->size ? s->bit / 8 : s->size;
    uint32_t holes = 0;
    memmove(s->bytes, s->bytes + drop, s->size - drop);
    s->size -= drop;
    s->bit -= 8 * drop;
    for (uint32_t i = 0; i < s->hole_count; i++) {
        prep_e57_hole h = s->hole[i];
        if (h.to > drop)
            s->hole[holes++] = (prep_e57_hole){h.from > drop ? h.from - drop : 0, h.to - drop};
    }
    s->hole_count = holes;
}

/* Stands zeros in for the rest of a damaged page, or of the piece. */
static void add_hole(prep_e57_stream *s, size_t want)
{
    size_t page_left = PREP_E57_PAGE_DATA - (size_t)(s->at % PREP_E57_PAGE_DATA),
           n = want < page_left ? want : page_left;
    prep_e57_hole *last = s->hole_count > 0 ? &s->hole[s->hole_count - 1] : NULL;
    memset(s->bytes + s->size, 0, n);
    if (last != NULL && (last->to == s->size || s->hole_count == PREP_E57_HOLES_MAX))
        last->to = s->size + n;
    else s->hole[s->hole_count++] = (prep_e57_hole){s->size, s->size + n};
    s->size += n;
    s->at += n;
    s->left -= n;
}

static bool fetch(prep_e57_stream *s, prep_e57_vector *v, size_t need, mospt_err *err)
{
    while (s->size < need) {
        bool more = true;
        if (s->left == 0 && !next_piece(s, v, &more, err)) return false;
        if (!more) return true;
        size_t n = s->left < need - s->size ? (size_t)s->left : need - s->size, got;
        if (!prep_e57_pages_read(v->pages, s->at, s->bytes + s->size, n, &got, err)) return false;
        s->size += got;
        s->at += got;
        s->left -= got;
        if (got == n) continue;
        note_unreadable(
            v, s->at); /* a page in the middle: next_piece() saw that the packet lies in the file */
        add_hole(s, n - got);
    }
    return true;
}

bool prep_e57_stream_mark_holes(const prep_e57_stream *s, uint32_t count, uint8_t *out)
{
    bool any = false;
    for (uint32_t i = 0; i < s->hole_count && s->width > 0; i++) {
        size_t from = 8 * s->hole[i].from, to = 8 * s->hole[i].to;
        if (to <= s->bit) continue;
        size_t first = from > s->bit ? (from - s->bit) / s->width : 0,
               end = (to - s->bit + s->width - 1) / s->width;
        if (end > count) end = count;
        if (first >= end) continue;
        memset(out + first, 1, end - first);
        any = true;
    }
    return any;
}

bool prep_e57_stream_fill(prep_e57_stream *s, prep_e57_vector *v, uint32_t count,
                          uint32_t *available, mospt_err *err)
{
    *available = count;
    if (s->bytes == NULL) s->bytes = calloc(PREP_E57_STREAM_SIZE, 1);
    if (s->bytes == NULL) return mospt_err_nomem(err, PREP_E57_STREAM_SIZE);
    if (s->width == 0) return true;
    drop_taken(s);
    if (!fetch(s, v, (s->bit + (size_t)count * s->width + 7) / 8, err)) return false;
    size_t whole = s->size * 8 > s->bit ? (s->size * 8 - s->bit) / s->width : 0;
    if (whole < count) *available = (uint32_t)whole;
    return true;
}

bool prep_e57_walk_on(prep_e57_walk *walk, prep_e57_vector *v, uint32_t packets)
{
    packet p;
    bool more;
    while (packets > 0) {
        if (!read_packet(v, walk->packet, &p, &more, NULL) || !more) return false;
        walk->packet += p.size;
        if (p.type != PACKET_DATA) continue;
        for (uint32_t i = 0; i < v->stream_count; i++)
            walk->before[i] += prep_le16(p.header + 6 + 2 * i);
        packets--;
    }
    return walk->packet < v->end;
}

bool prep_e57_walk_enter(const prep_e57_walk *walk, prep_e57_stream *const *streams, uint32_t count)
{
    uint64_t record = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint64_t bits = 8 * walk->before[streams[i]->index], width = streams[i]->width;
        if (width > 0 && (bits + width - 1) / width > record) record = (bits + width - 1) / width;
    }
    for (uint32_t i = 0; i < count; i++) {
        uint64_t bits = 8 * walk->before[streams[i]->index], width = streams[i]->width;
        if (width > 0 && (record > (bits + 8 * PREP_E57_JUMP_MAX) / width || record * width < bits))
            return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        prep_e57_stream *s = streams[i];
        s->packet = walk->packet;
        s->left = s->size = s->bit = 0;
        s->hole_count = 0;
        if (s->width > 0) s->bit = (size_t)(record * s->width - 8 * walk->before[s->index]);
    }
    return true;
}
