/* tests/write_las.h - LAS files of every version and point format, whose every field is a known
 * function of its index. */
#pragma once
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint8_t minor, format;
    uint32_t count;
    uint64_t declared; /* 0: count */
    double scale[3], offset[3];
    uint16_t rgb_step; /* colour of point i is (i * step) with small differences; 0: black */
    uint16_t intensity_step;
    uint32_t extra_size; /* undescribed bytes behind each record */
    const uint8_t
        *extra_description; /* [extra_description_size], payload of a record LASF_Spec 4, or NULL */
    uint32_t extra_description_size;
    uint32_t evlr_size; /* zero bytes behind the points, 1.4 only */
} write_las_options;

/* Field values of point i, before they are cut to the width of the field. */
int32_t write_las_xyz(uint32_t i, int axis);
uint32_t write_las_value(const char *field, uint32_t i);
double write_las_gps(uint32_t i);

/* Makes a file in memory; returns its bytes, freed by the caller. */
uint8_t *write_las(const write_las_options *options, size_t *size);
uint16_t write_las_record_size(uint8_t format);

/* One entry of a description of extra bytes. */
void write_las_extra(uint8_t out[192], uint8_t type, uint8_t options, const char *name);

void write_las_u16(uint8_t *p, uint32_t v);
void write_las_u32(uint8_t *p, uint32_t v);
void write_las_u64(uint8_t *p, uint64_t v);
void write_las_f64(uint8_t *p, double v);
