#include "tests/pcl_ours.h"

#include "preprocess/scan.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool append(double **xyz, size_t *count, const prep_batch *batch)
{
    double *grown = realloc(*xyz, (*count + batch->count) * 3 * sizeof **xyz);
    if (grown == NULL) return false;
    memcpy(grown + 3 * *count, batch->xyz, batch->count * 3 * sizeof **xyz);
    *xyz = grown;
    *count += batch->count;
    return true;
}

int pcl_ours_read(const char *path, double **xyz, size_t *count, char *reason, size_t reason_size)
{
    mospt_err err = {0};
    prep_scan *scan = NULL;
    prep_batch batch = {0};
    *xyz = NULL;
    *count = 0;
    bool ok =
        prep_scan_open(path, 0, NULL, &scan, &err) &&
        prep_batch_init(&batch, &prep_scan_describe(scan)->attributes, PREP_BATCH_CAPACITY, &err);
    do {
        ok = ok && prep_scan_read(scan, &batch, &err) &&
             (batch.count == 0 || append(xyz, count, &batch));
    } while (ok && batch.count > 0);
    snprintf(reason, reason_size, "%s", err.message);
    prep_batch_fini(&batch);
    prep_scan_close(scan);
    return ok;
}
