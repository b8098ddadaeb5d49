/* tests/fuzz_e57.c - the E57 reader against any bytes: an error or points, never anything else.
 *
 * Few inputs get past wrong checksums, so most are put right; the size says whether. */
#include "tests/scan_points.h"
#include "tests/write_e57.h"

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t *bytes = malloc(size + 1);
    if (bytes == NULL) abort();
    memcpy(bytes, data, size);
    if (size % 4 != 0) write_e57_seal(bytes, size);
    scan_points_survive("fuzz.e57", bytes, size, NULL);
    free(bytes);
    return 0;
}
