/* tests/fuzz_e57.c - the E57 reader against any bytes: an error or points, never anything else.
 *
 * Built with clang -fsanitize=fuzzer -DFUZZ_WITH_LIBRARY it is a libFuzzer target; otherwise its
 * own main() mutates a file it made. The first byte of the input says whether the checksums are put
 * right, without which few inputs get past them. */
#include "tests/scan_points.h"
#include "tests/write_e57.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 1) return 0;
    uint8_t *bytes = malloc(size);
    if (bytes == NULL) abort();
    memcpy(bytes, data + 1, size - 1);
    if (data[0] % 4 != 0) write_e57_seal(bytes, size - 1);
    scan_points_survive("fuzz.e57", bytes, size - 1, NULL);
    free(bytes);
    return 0;
}

#ifndef FUZZ_WITH_LIBRARY
enum { COUNT = 500 };

static uint8_t *make_file(size_t *size)
{
    static double values[COUNT];
    static int64_t integers[COUNT];
    for (int i = 0; i < COUNT; i++)
        values[i] = i * 0.25, integers[i] = i % 3;
    const write_e57_field fields[] = {
        {.name = "cartesianX", .kind = WRITE_E57_FLOAT, .values = values},
        {.name = "cartesianY", .kind = WRITE_E57_DOUBLE, .values = values},
        {.name = "cartesianZ",
         .kind = WRITE_E57_SCALED,
         .integers = integers,
         .high = 100,
         .scale = 0.01},
        {.name = "cartesianInvalidState",
         .kind = WRITE_E57_INTEGER,
         .integers = integers,
         .high = 2},
        {.name = "intensity",
         .kind = WRITE_E57_INTEGER,
         .integers = integers,
         .low = -5,
         .high = 1000},
        {.name = "colorRed", .kind = WRITE_E57_INTEGER, .integers = integers, .high = 255},
        {.name = "colorGreen", .kind = WRITE_E57_INTEGER, .integers = integers, .high = 65535},
        {.name = "colorBlue", .kind = WRITE_E57_FLOAT, .values = values},
        {.name = "ext:text", .kind = WRITE_E57_STRING},
        {.name = "returnIndex", .kind = WRITE_E57_INTEGER, .integers = integers, .high = 7},
        {.name = "nor:normalX", .kind = WRITE_E57_FLOAT, .values = values},
        {.name = "nor:normalY", .kind = WRITE_E57_FLOAT, .values = values},
        {.name = "nor:normalZ", .kind = WRITE_E57_FLOAT, .values = values},
    };
    const write_e57_scan scan = {
        .name = "scan",
        .fields = fields,
        .field_count = sizeof fields / sizeof fields[0],
        .count = COUNT,
        .piece = 90,
        .dealing = WRITE_E57_STAGGER,
        .has_other_packets = true,
        .xml = "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">1</w><x "
               "type=\"Float\">1</x>"
               "<y type=\"Float\"/><z type=\"Float\"/></rotation></pose><colorLimits "
               "type=\"Structure\">"
               "<colorRedMaximum type=\"Integer\">255</colorRedMaximum></colorLimits>"};
    const write_e57_scan scans[2] = {scan, scan};
    return write_e57(
        &(write_e57_file){.scans = scans, .scan_count = 2, .crs = "x", .is_xml_first = true}, size);
}

static void mutate(uint8_t *bytes, size_t size, uint64_t *seed)
{
    static const uint8_t special[] = {0, 1, 0x7f, 0x80, 0xff, '0', '9', '<', '"', '-'};
    uint32_t edits = 1 + scan_points_random(seed) % 6;
    for (uint32_t i = 0; i < edits; i++) {
        size_t reach = scan_points_random(seed) % 3 == 0   ? 200
                       : scan_points_random(seed) % 2 == 0 ? 6000
                                                           : size;
        size_t at = scan_points_random(seed) % (reach < size ? reach : size);
        switch (scan_points_random(seed) % 3) {
        case 0:
            bytes[at] ^= (uint8_t)(1u << scan_points_random(seed) % 8);
            break;
        case 1:
            bytes[at] = special[scan_points_random(seed) % sizeof special];
            break;
        default: {
            size_t from = scan_points_random(seed) % size, n = scan_points_random(seed) % 64;
            size_t room = size - (from > at ? from : at);
            memmove(bytes + at, bytes + from, n < room ? n : room);
        }
        }
    }
}

int main(int argc, char **argv)
{
    long rounds = argc > 1 ? strtol(argv[1], NULL, 10) : 10000;
    uint64_t seed = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    size_t size;
    uint8_t *file = make_file(&size), *input = malloc(size + 1);
    if (input == NULL) abort();
    for (long i = 0; i < rounds; i++) {
        input[0] = (uint8_t)scan_points_random(&seed);
        memcpy(input + 1, file, size);
        mutate(input + 1, size, &seed);
        size_t n = scan_points_random(&seed) % 8 == 0 ? scan_points_random(&seed) % size : size;
        LLVMFuzzerTestOneInput(input, n + 1);
    }
    printf("%ld inputs\n", rounds);
    free(input);
    free(file);
    return 0;
}
#endif
