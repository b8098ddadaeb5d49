#include "tests/laz_twins.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static const char *const pairs[][2] = {
    {"laz/laz-perf__point10-1.0.laz", "las/laz-perf__point10-1.0.las"},
    {"laz/laz-perf__point10.las.laz", "las/laz-perf__point10.las"},
    {"laz/laz-perf__point-time.las.laz", "las/laz-perf__point-time.las"},
    {"laz/laz-perf__point-color.las.laz", "las/laz-perf__point-color.las"},
    {"laz/laspy__extra.laz", "las/laz-perf__extrabytes.las"},
    {"laz/laspy__simple.laz", "las/pdal__las__simple.las"},
    {"laz/pdal__laz__simple.laz", "las/pdal__las__simple.las"},
    {"laz/pdal__laz__simple-laszip-compressor-version-1.2r0.laz", "las/pdal__las__simple.las"},
    {"laz/pdal__laszip__laszip-generated.laz", "las/pdal__las__1.2-with-color.las"},
    {"laz/pdal__laszip__liblas-generated.laz", "las/pdal__las__1.2-with-color.las"},
    {"laz/libLAS__1.2-with-color.laz", "las/pdal__las__1.2-with-color.las"},
    {"laz/pdal__laz__autzen_trim.laz", "las/pdal__las__autzen_trim.las"},
    {"laz/rlas__example.laz", "las/rlas__example.las"},
    {"laz/olv__tiny.laz", "las/olv__tiny.las"},
    {"laz/loaders.gl__cpp__Model3DTiler__test__resources__ripple.laz",
     "las/loaders.gl__cpp__Model3DTiler__test__resources__ripple.las"},
    {"laz/loaders.gl__las__pdrf4-1.3.laz", "las/loaders.gl__las__pdrf4-1.3.las"},
    {"laz/loaders.gl__las__pdrf6-1.4.laz", "las/loaders.gl__las__pdrf6-1.4.las"},
    {"laz/loaders.gl__las__pdrf8-1.4.laz", "las/loaders.gl__las__pdrf8-1.4.las"},
};

const size_t laz_twins_count = sizeof pairs / sizeof pairs[0];

bool laz_twins_path(size_t i, int which, char *out, size_t size)
{
    const char *shared = getenv("IPTS_SHARED");
    if (shared == NULL) shared = IPTS_SOURCE_DIR "/../shared";
    snprintf(out, size, "%s/scans/%s", shared, pairs[i][which]);
    return access(out, R_OK) == 0;
}
