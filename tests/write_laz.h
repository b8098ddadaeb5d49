/* tests/write_laz.h - LAZ files of every compressor, item and version, packed from the bytes of a
 * LAS file.
 *
 * A plain twin of the decoder, for what no file made by another program covers. It takes the same
 * decisions as the original writer, and adapts its models by the book rather than fast. */
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint16_t compressor;   /* 1, 2, 3; 0: 2 or 3, as the point format asks for */
    uint16_t version;      /* of the items; 0: 2 or 3 */
    uint32_t chunk_points; /* 0: one chunk for all */
    bool varies;           /* chunks of 1, 2, 3, ... times chunk_points, and a table that says so */
    enum { WRITE_LAZ_TABLE, WRITE_LAZ_TABLE_AT_END, WRITE_LAZ_NO_TABLE } table;
} write_laz_options;

/* Packs a LAS file; returns the bytes of a LAZ file, freed by the caller. */
uint8_t *write_laz(const uint8_t *las, size_t las_size, const write_laz_options *options,
                   size_t *size);
