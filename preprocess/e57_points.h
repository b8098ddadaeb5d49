/* preprocess/e57_points.h - from the bytestreams of one E57 scan to points: which field means what,
 * and block after block of values to coordinates. What else a point carries: e57_planes.h. */
#pragma once
#include "preprocess/e57_vector.h"
#include "preprocess/e57_xml.h"
#include "preprocess/scan_format.h"
#include "preprocess/tone.h"

enum { PREP_E57_CHANNELS_MAX = 160 };

/* One field that is wanted, and its values in the current block. */
typedef struct {
    const prep_e57_field *field; /* borrowed */
    prep_e57_stream stream;
    uint64_t *raw; /* [PREP_E57_BLOCK], owned */
} prep_e57_channel;

/* Which channels make up one plane of a batch. */
typedef struct {
    mospt_type type;
    uint32_t components;
    int channel[3];
    uint64_t bias; /* added to integers */
    bool is_normal;
} prep_e57_plane;

typedef struct {
    prep_e57_channel channel[PREP_E57_CHANNELS_MAX];
    uint32_t channel_count;
    /* channels; -1: there is none */
    int xyz[3]; /* or range, azimuth, elevation */
    int invalid, rgb[3], rgb_invalid, intensity, intensity_invalid, normal[3], return_index;
    bool is_spherical;
    bool has_pose, has_rotation;
    double pose[12]; /* the upper rows of a matrix, row-major */
    prep_scale rgb_scale[3];
    prep_tone tone;
    prep_e57_plane plane[MOSPT_ATTRIBUTES_MAX];
    double *scratch; /* [PREP_E57_BLOCK], owned */
    uint8_t *keep;   /* [PREP_E57_BLOCK], owned */
    bool has_lost;   /* in the loaded block: some records lie in a damaged page */
    uint8_t *lost;   /* [PREP_E57_BLOCK], owned, which ones; only with has_lost */
} prep_e57_points;

/* Whether a scan has coordinates; on failure `why` gets a sentence. */
bool prep_e57_points_are_possible(const prep_e57_scan *scan, char *why, size_t size);

/* Finds the meanings of the fields.
 * scan     borrowed, must outlive the points; prep_e57_points_are_possible() */
void prep_e57_points_init(prep_e57_points *points, const prep_e57_scan *scan);

/* Frees the buffers; reading allocates them again. */
void prep_e57_points_release(prep_e57_points *points);

/* The channel of a field, made where there is none yet; -1 if the field is, or if there are too
 * many. */
int prep_e57_points_add_channel(prep_e57_points *points, const prep_e57_scan *scan, int field);

/* Bits of a record, as far as its fields are wanted. */
uint64_t prep_e57_points_bits(const prep_e57_points *points);

/* Goes to the first record. */
void prep_e57_points_start(prep_e57_points *points, const prep_e57_vector *vector);

/* Loads the next `count` records, at most PREP_E57_BLOCK, into the channels.
 * got      out; fewer at the end of the section or of the chain of packets */
bool prep_e57_points_load(prep_e57_points *points, prep_e57_vector *vector, uint32_t count,
                          uint32_t *got, mospt_err *err);

/* Values of a channel in the loaded block, `step` doubles apart. */
void prep_e57_points_values(const prep_e57_points *points, int channel, uint32_t count, double *out,
                            size_t step);

/* World coordinates of the loaded block. */
void prep_e57_points_xyz(const prep_e57_points *points, uint32_t count, double *xyz);

/* Whether each record of the loaded block is a point; returns whether all are. */
bool prep_e57_points_keep(const prep_e57_points *points, uint32_t count, uint8_t *keep);
