#include "preprocess/laz_stream.h"

#include <string.h>

void prep_laz_source_skip(prep_laz_source *source, uint64_t size)
{
    if (size > source->size) size = source->size;
    if (source->input == NULL) source->bytes += size;
    source->offset += size;
    source->size -= size;
}

bool prep_laz_source_take(prep_laz_source *source, void *out, size_t size, mospt_err *err)
{
    if (size > source->size) return false;
    size_t got = size;
    if (source->input == NULL) memcpy(out, source->bytes, size);
    else if (!prep_input_read_at(source->input, source->offset, out, size, &got, err)) return false;
    if (got < size) return false;
    prep_laz_source_skip(source, size);
    return true;
}

size_t prep_laz_stream_margin(size_t need)
{
    return need + PREP_LAZ_PEEK + PREP_LAZ_INTEGER_MAX;
}

size_t prep_laz_stream_capacity(uint64_t size, size_t need, size_t most)
{
    size_t least = 2 * prep_laz_stream_margin(need);
    if (most < least) most = least;
    return size < most ? (size_t)size : most;
}

/* Moves what is left to the front and fills up from the source. */
static bool load(prep_laz_stream *s, size_t left)
{
    memmove(s->window, s->range.next, left);
    size_t room = s->capacity - left;
    if (room > s->source.size) room = (size_t)s->source.size;
    mospt_err ignored = {0};
    s->range.next = s->window;
    s->held = left;
    if (!prep_laz_source_take(&s->source, s->window + left, room,
                              s->err != NULL ? s->err : &ignored)) {
        s->has_failed = true;
        s->source.size = 0;
        room = 0;
    }
    s->held = left + room;
    bool is_all = s->source.size == 0;
    if (is_all) memset(s->window + s->held, 0, s->margin);
    s->limit = s->window + (is_all ? s->held : s->held - s->margin);
    return !s->has_failed;
}

bool prep_laz_stream_begin(prep_laz_stream *s, prep_laz_source source, uint8_t *window,
                           size_t capacity, size_t margin, mospt_err *err)
{
    *s = (prep_laz_stream){
        .window = window, .capacity = capacity, .margin = margin, .source = source, .err = err};
    s->range.next = window;
    if (!load(s, 0) || s->held < 4) return false;
    prep_laz_range_begin(&s->range, s->window);
    return true;
}

bool prep_laz_stream_is_beyond(const prep_laz_stream *s)
{
    return s->source.size == 0 && s->range.next > s->window + s->held;
}

bool prep_laz_stream_refill(prep_laz_stream *s)
{
    if (s->source.size == 0) return !prep_laz_stream_is_beyond(s) && !s->has_failed;
    return load(s, (size_t)(s->window + s->held - s->range.next));
}

uint64_t prep_laz_stream_left(const prep_laz_stream *s)
{
    const uint8_t *end = s->window + s->held;
    return s->range.next >= end ? 0 : (uint64_t)(end - s->range.next) + s->source.size;
}
