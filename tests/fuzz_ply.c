/* tests/fuzz_ply.c - the PLY reader against any bytes: an error or points, never anything else. */
#include "tests/scan_points.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    scan_points_survive("fuzz.ply", data, size, NULL);
    return 0;
}
