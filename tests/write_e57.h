/* tests/write_e57.h - E57 files for the tests, from the standard: any fields, any bit width,
 * packets of any shape.
 *
 * Made to be obvious, not fast: one bit at a time, and a checksum of its own. */
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum {
    WRITE_E57_FLOAT,
    WRITE_E57_DOUBLE,
    WRITE_E57_INTEGER,
    WRITE_E57_SCALED,
    WRITE_E57_STRING,
} write_e57_kind;

typedef struct {
    const char *name;
    write_e57_kind kind;
    const double *values;    /* [count], floats and doubles */
    const int64_t *integers; /* [count], integers, scaled or not */
    int64_t low, high;       /* integers; not written where they are those of int64_t */
    double scale, offset;    /* scaled integers */
} write_e57_field;

typedef enum {
    WRITE_E57_EVEN,     /* every packet has `piece` bytes of each bytestream */
    WRITE_E57_STAGGER,  /* and some more, from bytestream to bytestream */
    WRITE_E57_BALANCED, /* or as much of each as makes about the same number of values */
    WRITE_E57_IN_TURN,  /* a packet has only one bytestream; all of the first one comes first */
} write_e57_dealing;

typedef struct {
    const char *name, *guid; /* NULL: not written */
    const char *xml;         /* more elements, as they are; NULL: none */
    const write_e57_field *fields;
    uint32_t field_count, count;
    uint64_t declared; /* records; 0: count */
    uint32_t piece;    /* bytes; 0: 1000 */
    write_e57_dealing dealing;
    bool has_other_packets; /* index packets and ignored ones between the others */
    bool lacks_prototype;
} write_e57_scan;

typedef struct {
    const write_e57_scan *scans;
    uint32_t scan_count;
    const char *crs;     /* NULL: none */
    const char *doctype; /* before the root element; NULL: none */
    const char *xml;     /* behind data3D; NULL: none */
    bool is_xml_first;   /* before the points, so that a cut file still has it */
} write_e57_file;

/* Makes a file in memory; returns its bytes, freed by the caller. */
uint8_t *write_e57(const write_e57_file *file, size_t *size);

/* Puts the right checksum to every whole page. */
void write_e57_seal(uint8_t *bytes, size_t size);
