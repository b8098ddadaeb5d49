#include "preprocess/laz_items.h"

#include <string.h>

size_t prep_laz_gps_size(void)
{
    return prep_laz_model_size(6) + prep_laz_model_size(PREP_LAZ_SYMBOLS_MAX) +
           prep_laz_integer_size(32, 9);
}

size_t prep_laz_rgb_size(void)
{
    return prep_laz_model_size(128) + 6 * prep_laz_model_size(256) + prep_laz_integer_size(8, 6);
}

size_t prep_laz_wave_size(void)
{
    return prep_laz_model_size(256) + 4 * prep_laz_model_size(4) +
           3 * prep_laz_integer_size(32, 1) + prep_laz_integer_size(32, 3);
}

void prep_laz_gps_init(prep_laz_gps *gps, uint64_t time)
{
    memset(gps, 0, sizeof *gps);
    gps->time[0] = time;
    prep_laz_integer_init(&gps->integer, 32);
}

void prep_laz_rgb_init(prep_laz_rgb *rgb)
{
    memset(rgb, 0, sizeof *rgb);
    prep_laz_integer_init(&rgb->integer, 8);
}

void prep_laz_wave_init(prep_laz_wave *wave)
{
    memset(wave, 0, sizeof *wave);
    prep_laz_integer_init(&wave->offset, 32);
    prep_laz_integer_init(&wave->size, 32);
    prep_laz_integer_init(&wave->location, 32);
    prep_laz_integer_init(&wave->xyz, 32);
}

static uint64_t read_offset(prep_laz_range *r, prep_laz_arena *arena, prep_laz_wave *w,
                            const uint8_t *packet)
{
    enum { SAME, BEHIND_LAST, STEP, ANYWHERE };
    uint64_t offset = prep_le64(packet + 1);
    w->how_last = prep_laz_range_symbol(r, prep_laz_model_at(&w->how[w->how_last], arena, 4));
    switch (w->how_last) {
    case SAME:
        return offset;
    case BEHIND_LAST:
        return offset + prep_le32(packet + 9);
    case STEP:
        w->step = prep_laz_integer_read(r, arena, &w->offset, &w->offset_context, w->step);
        return offset + (uint64_t)(int64_t)(int32_t)w->step;
    default:
        return prep_laz_range_bits_64(r);
    }
}

/* A packet: index u8, offset u64, size u32, location of the return f32, direction f32 x 3. */
void prep_laz_wave_read(prep_laz_stream *stream, prep_laz_arena *arena, prep_laz_wave *w,
                        uint8_t *packet)
{
    prep_laz_range r = stream->range;
    packet[0] = (uint8_t)prep_laz_range_symbol(&r, prep_laz_model_at(&w->index, arena, 256));
    uint64_t offset = read_offset(&r, arena, w, packet);
    uint32_t size =
        prep_laz_integer_read(&r, arena, &w->size, &w->size_context, prep_le32(packet + 9));
    uint32_t location = prep_laz_integer_read(&r, arena, &w->location, &w->location_context,
                                              prep_le32(packet + 13));
    prep_put_le64(packet + 1, offset);
    prep_put_le32(packet + 9, size);
    prep_put_le32(packet + 13, location);
    for (uint32_t a = 0; a < 3; a++) {
        uint8_t *p = packet + 17 + 4 * a;
        prep_put_le32(p,
                      prep_laz_integer_read(&r, arena, &w->xyz, &w->xyz_context[a], prep_le32(p)));
    }
    stream->range = r;
}
