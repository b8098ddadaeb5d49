/* tests/fuzz_text.c - the text reader against any bytes: an error or points, never anything else.
 * The first byte chooses the name, which also says what columns mean. */
#include "tests/scan_points.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const names[] = {"fuzz.txt", "fuzz.pts", "fuzz.xyzirgb", "fuzz.csv"};
    if (size > 0) scan_points_survive(names[data[0] % 4], data, size, NULL);
    return 0;
}
