/* tests/fuzz_seeds.c - small valid files to start fuzzing from, where there are no real ones, and
 * of kinds that real ones seldom are.
 *
 *     fuzz_seeds FOLDER    writes FOLDER/FORMAT/... */
#include "tests/write_e57.h"
#include "tests/write_las.h"
#include "tests/write_laz.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { POINTS = 500 };

static void make_folder(const char *path)
{
    if (mkdir(path, 0777) == 0 || errno == EEXIST) return;
    perror(path);
    exit(1);
}

static void put(const char *folder, const char *format, int number, const void *bytes, size_t size)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, format);
    make_folder(path);
    snprintf(path, sizeof path, "%s/%s/seed_%d.%s", folder, format, number, format);
    FILE *f = fopen(path, "wb");
    if (f != NULL && fwrite(bytes, 1, size, f) == size && fclose(f) == 0) return;
    perror(path);
    exit(1);
}

static void put_las(const char *folder)
{
    for (uint8_t format = 0; format <= 10; format++) {
        write_las_options options = {.minor = format < 6 ? 2 : 4,
                                     .format = format,
                                     .count = POINTS,
                                     .scale = {0.01, 0.01, 0.01},
                                     .rgb_step = 300,
                                     .intensity_step = 7};
        size_t las_size, size;
        uint8_t *las = write_las(&options, &las_size);
        put(folder, "las", format, las, las_size);
        uint8_t *laz = write_laz(las, las_size, &(write_laz_options){.chunk_points = 200}, &size);
        put(folder, "laz", format, laz, size);
        free(laz);
        free(las);
    }
}

static void put_e57(const char *folder)
{
    static double values[POINTS];
    static int64_t integers[POINTS];
    for (int i = 0; i < POINTS; i++)
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
    const char *xml =
        "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">1</w>"
        "<x type=\"Float\">1</x><y type=\"Float\"/><z type=\"Float\"/></rotation>"
        "</pose><colorLimits type=\"Structure\"><colorRedMaximum type=\"Integer\">255"
        "</colorRedMaximum></colorLimits>";
    for (int dealing = WRITE_E57_EVEN; dealing <= WRITE_E57_IN_TURN; dealing++) {
        const write_e57_scan scan = {.name = "scan",
                                     .fields = fields,
                                     .field_count = sizeof fields / sizeof fields[0],
                                     .count = POINTS,
                                     .piece = 90,
                                     .dealing = (write_e57_dealing)dealing,
                                     .has_other_packets = dealing == WRITE_E57_STAGGER,
                                     .xml = xml};
        const write_e57_scan scans[2] = {scan, scan};
        size_t size;
        uint8_t *bytes = write_e57(
            &(write_e57_file){.scans = scans, .scan_count = 2, .crs = "x", .is_xml_first = true},
            &size);
        put(folder, "e57", dealing, bytes, size);
        free(bytes);
    }
}

static void put_texts(const char *folder)
{
    static const struct {
        const char *format, *text;
    } seeds[] = {
        {"text", "1.5 2 3 -2048 10 20 30\n4 5 6.25 2047 0 255 7\n7 8 9 17 1 2 3\n"},
        {"text", "x,y,z,classification,gps_time,label\n1,2,3,4,5.5,wall\n4,5,6,,7.5,roof\n"},
        {"text", "# X Y Z nx ny nz\n1 2 3 0 0 1\n4 5 6 1e0 0 0\n"},
        {"text", "2\n1 2 3 4\n5 6 7 8\n1\n9 10 11 12\n"},
        {"text", "\357\273\277\"X [m]\";\"Y [m]\";\"Z [m]\"\r\n1;2;3\r\nnan;5;6\r\n"},
        {"ply", "ply\nformat ascii 1.0\ncomment seed\nelement camera 1\nproperty float f\nelement "
                "vertex 3\nproperty double x\nproperty float y\nproperty float z\nproperty list "
                "uchar int near\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
                "property short intensity\nelement face 1\nproperty list uchar int "
                "vertex_indices\nend_header\n9\n1 2 3 2 7 8 10 20 30 5\n4 5 6 0 1 2 3 -4\n\n7 8 "
                "nan 1 1 1 1 1 9\n3 0 1 2\n"},
        {"ply", "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\n"
                "property float y\nproperty float z\nproperty ushort red\nproperty ushort green\n"
                "property ushort blue\nend_header\nabcdefghijklmnopqrABCDEFGHIJKLMNOPQR"},
        {"ply", "ply\nformat binary_big_endian 1.0\nelement vertex 2\nproperty list uchar uchar "
                "l\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
                "\001aABCDEFGHIJKL\002abABCDEFGHIJKL"},
        {"pcd", "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 "
                "4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 1 2 3 1 0 0 0\n"
                "POINTS 2\nDATA ascii\n1 2 3 65280\nnan nan nan 7\n"},
        {"pcd",
         "VERSION .7\nFIELDS x y z intensity normal\nSIZE 4 4 4 2 4\nTYPE F F F U F\nCOUNT 1 "
         "1 1 1 3\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary\nabcdefghijklmnopqrstuvwxyz"
         "ABCDEFGHIJKLMNOPQRSTUVWXYZ"},
        {"ptx",
         "2\n2\n1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n1 2 3 0.5 1 2 "
         "3\n0 0 0 0.5 0 0 0\n4 5 6 1 7 8 9\n7 8 9 0 4 5 6\n1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
         "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n3 2 1 0.25\n"},
    };
    for (size_t i = 0; i < sizeof seeds / sizeof seeds[0]; i++)
        put(folder, seeds[i].format, (int)i, seeds[i].text, strlen(seeds[i].text));
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        fprintf(stderr, "usage: fuzz_seeds FOLDER\n");
        return 2;
    }
    make_folder(argv[1]);
    put_las(argv[1]);
    put_e57(argv[1]);
    put_texts(argv[1]);
    return 0;
}
