/* tests/fuzz_ptx.c - the PTX reader against any bytes: an error or points, in every scan. */
#include "tests/scan_points.h"

#include <stdlib.h>

enum { SCANS_MAX = 8 };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The scans behind the first one; they can be opened once the first could. */
static void read_others(const char *path)
{
    uint32_t count = SCANS_MAX;
    prep_scan_options options = {0};
    if (!prep_scan_memory_create(&options.memory, NULL)) abort();
    for (uint32_t i = 0; i < count && i < SCANS_MAX; i++) {
        prep_scan *scan;
        prep_batch batch;
        if (!prep_scan_open(path, i, &options, &scan, NULL)) abort();
        count = prep_scan_describe(scan)->scan_count;
        if (!prep_batch_init(&batch, &prep_scan_describe(scan)->attributes, 100, NULL)) abort();
        do {
            if (!prep_scan_read(scan, &batch, NULL)) abort();
        } while (batch.count > 0);
        prep_batch_fini(&batch);
        prep_scan_close(scan);
    }
    prep_scan_memory_destroy(options.memory);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (scan_points_survive("fuzz.ptx", data, size, NULL))
        read_others(scan_points_file("fuzz.ptx", data, size));
    return 0;
}
