#include "tests/write_las.h"

#include <stdlib.h>
#include <string.h>

void write_las_u16(uint8_t *p, uint32_t v)
{
    p[0] = (uint8_t)v;
    p[1] = (uint8_t)(v >> 8);
}
void write_las_u32(uint8_t *p, uint32_t v)
{
    write_las_u16(p, v);
    write_las_u16(p + 2, v >> 16);
}
void write_las_u64(uint8_t *p, uint64_t v)
{
    write_las_u32(p, (uint32_t)v);
    write_las_u32(p + 4, (uint32_t)(v >> 32));
}
void write_las_f64(uint8_t *p, double v)
{
    uint64_t bits;
    memcpy(&bits, &v, 8);
    write_las_u64(p, bits);
}

int32_t write_las_xyz(uint32_t i, int axis)
{
    static const int32_t start[3] = {-2147483647 - 1, 1000, -77}, step[3] = {7919, -13, 3};
    return (int32_t)((uint32_t)start[axis] + i * (uint32_t)step[axis]);
}

uint32_t write_las_value(const char *field, uint32_t i)
{
    static const struct {
        const char *name;
        uint32_t start, step;
    } fields[] = {{"return_number", 1, 1},   {"number_of_returns", 3, 5},
                  {"classification", 2, 7},  {"flags", 0, 1},
                  {"scan_angle", 0xffd0, 5}, {"user_data", 9, 11},
                  {"point_source", 500, 17}, {"scanner_channel", 0, 1},
                  {"nir", 40000, 19},        {"extra", 1, 3}};
    for (size_t k = 0; k < sizeof fields / sizeof fields[0]; k++) {
        if (strcmp(fields[k].name, field) == 0) return fields[k].start + i * fields[k].step;
    }
    abort();
}

double write_las_gps(uint32_t i)
{
    return 123456.789 + i * 0.001;
}

uint16_t write_las_record_size(uint8_t format)
{
    static const uint16_t size[11] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
    return size[format];
}

static void put_old(uint8_t *p, uint32_t i)
{
    uint32_t flags = write_las_value("flags", i);
    p[14] = (uint8_t)((write_las_value("return_number", i) & 7) |
                      (write_las_value("number_of_returns", i) & 7) << 3 | (flags & 48) << 2);
    p[15] = (uint8_t)((write_las_value("classification", i) & 31) | (flags & 7) << 5);
    p[16] = (uint8_t)write_las_value("scan_angle", i);
    p[17] = (uint8_t)write_las_value("user_data", i);
    write_las_u16(p + 18, write_las_value("point_source", i));
}

static void put_new(uint8_t *p, uint32_t i)
{
    uint32_t flags = write_las_value("flags", i);
    p[14] = (uint8_t)((write_las_value("return_number", i) & 15) |
                      (write_las_value("number_of_returns", i) & 15) << 4);
    p[15] = (uint8_t)((flags & 15) | (write_las_value("scanner_channel", i) & 3) << 4 |
                      (flags & 48) << 2);
    p[16] = (uint8_t)write_las_value("classification", i);
    p[17] = (uint8_t)write_las_value("user_data", i);
    write_las_u16(p + 18, write_las_value("scan_angle", i));
    write_las_u16(p + 20, write_las_value("point_source", i));
}

static void put_record(const write_las_options *o, uint8_t *p, uint32_t i)
{
    static const uint8_t gps[11] = {0, 20, 0, 20, 20, 20, 22, 22, 22, 22, 22};
    static const uint8_t rgb[11] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};
    static const uint8_t nir[11] = {0, 0, 0, 0, 0, 0, 0, 0, 36, 0, 36};
    uint16_t size = write_las_record_size(o->format);
    for (int a = 0; a < 3; a++)
        write_las_u32(p + 4 * a, (uint32_t)write_las_xyz(i, a));
    write_las_u16(p + 12, i * o->intensity_step);
    memset(p + 14, 0xee, size - 14u); /* so that a wave packet read as something else shows */
    if (o->format < 6) put_old(p, i);
    else put_new(p, i);
    if (gps[o->format] != 0) write_las_f64(p + gps[o->format], write_las_gps(i));
    for (uint32_t c = 0; c < 3 && rgb[o->format] != 0; c++)
        write_las_u16(p + rgb[o->format] + 2 * c, o->rgb_step != 0 ? i * o->rgb_step + c : 0);
    if (nir[o->format] != 0) write_las_u16(p + nir[o->format], write_las_value("nir", i));
    for (uint32_t k = 0; k < o->extra_size; k++)
        p[size + k] = (uint8_t)(write_las_value("extra", i) + k);
}

static uint32_t put_vlr(const write_las_options *o, uint8_t *p)
{
    if (o->extra_description == NULL) return 0;
    memcpy(p + 2, "LASF_Spec", 9);
    write_las_u16(p + 18, 4);
    write_las_u16(p + 20, o->extra_description_size);
    memcpy(p + 54, o->extra_description, o->extra_description_size);
    return 54 + o->extra_description_size;
}

uint8_t *write_las(const write_las_options *o, size_t *size)
{
    uint32_t header = o->minor >= 4 ? 375 : o->minor == 3 ? 235 : 227;
    uint32_t record = write_las_record_size(o->format) + o->extra_size;
    uint32_t vlr = o->extra_description != NULL ? 54 + o->extra_description_size : 0;
    uint64_t declared = o->declared != 0 ? o->declared : o->count;
    *size = header + vlr + (size_t)o->count * record + o->evlr_size;
    uint8_t *p = calloc(*size, 1);
    if (p == NULL) abort();
    memcpy(p, "LASF", 4);
    p[24] = 1;
    p[25] = o->minor;
    write_las_u16(p + 94, header);
    write_las_u32(p + 96, header + vlr);
    write_las_u32(p + 100, vlr > 0);
    p[104] = o->format;
    write_las_u16(p + 105, record);
    if (o->format < 6) write_las_u32(p + 107, (uint32_t)declared);
    for (uint32_t a = 0; a < 3; a++) {
        write_las_f64(p + 131 + 8 * a, o->scale[a]);
        write_las_f64(p + 155 + 8 * a, o->offset[a]);
        write_las_f64(p + 179 + 16 * a, 1000);
        write_las_f64(p + 187 + 16 * a, -1000);
    }
    if (o->minor >= 4) write_las_u64(p + 247, declared);
    if (o->minor >= 4 && o->evlr_size > 0) {
        write_las_u64(p + 235, *size - o->evlr_size);
        write_las_u32(p + 243, 1);
    }
    put_vlr(o, p + header);
    for (uint32_t i = 0; i < o->count; i++)
        put_record(o, p + header + vlr + (size_t)i * record, i);
    return p;
}

void write_las_extra(uint8_t out[192], uint8_t type, uint8_t options, const char *name)
{
    memset(out, 0, 192);
    out[2] = type;
    out[3] = options;
    size_t n = strlen(name);
    memcpy(out + 4, name, n < 32 ? n : 32);
}
