/* tests/fuzz_las.c - the LAS reader against any bytes: an error or points, never anything else. LAZ
 * has fuzz_laz.c. */
#include "tests/scan_points.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    scan_points_survive("fuzz.las", data, size, NULL);
    return 0;
}
