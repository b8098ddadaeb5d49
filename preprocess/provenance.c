#include "preprocess/provenance.h"

#include "mospt/hash.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static bool fill_source(mospt_source *to, const prep_source_scan *from, const prep_pack_sums *sums,
                        const mospt_grid *grid)
{
    bool several = from->info.scan_count > 1;
    to->name = strdup(from->name);
    to->scan = strdup(several ? from->info.name : "");
    to->format = strdup(from->info.format);
    to->points = from->points;
    to->has_rgb = from->info.has_rgb;
    to->has_intensity = from->info.has_intensity;
    to->has_pose = from->info.has_pose;
    memcpy(to->pose, from->info.pose, sizeof to->pose);
    bool ok = to->name != NULL && to->scan != NULL && to->format != NULL;
    for (int r = 0; r < PREP_DROP_REASONS; r++) {
        if (from->dropped[r] == 0) continue;
        to->drop_reason[to->reason_count] = strdup(prep_drop_name((prep_drop)r));
        ok = ok && to->drop_reason[to->reason_count] != NULL;
        to->drop_count[to->reason_count++] = from->dropped[r];
        to->dropped += from->dropped[r];
    }
    if (from->damage.code != MOSPT_OK) {
        char text[2048];
        mospt_err_text(&from->damage, text, sizeof text);
        /* The dataset speaks of its sources by their names, wherever the folder was. */
        const char *after = strstr(text, from->path) == text ? text + strlen(from->path) : NULL;
        char named[4096];
        snprintf(named, sizeof named, "%s%s", after != NULL ? from->name : "",
                 after != NULL ? after : text);
        to->damage = strdup(named);
        ok = ok && to->damage != NULL;
    }
    for (int a = 0; a < 3 && from->points > 0; a++) {
        to->low[a] = mospt_grid_axis_to_world(grid, a, sums->low[a]);
        to->high[a] = mospt_grid_axis_to_world(grid, a, sums->high[a]);
    }
    return ok;
}

static bool keep_crs(mospt_source *to, const char *crs, const char *of_site)
{
    if (crs[0] == '\0' || strcmp(crs, of_site) == 0) return true;
    to->crs = strdup(crs);
    return to->crs != NULL;
}

bool prep_provenance_fill(mospt_metadata *m, const prep_source *source,
                          const prep_pack_sums *of_scan, const char *crs, mospt_err *err)
{
    prep_pack_sums all = prep_pack_sums_empty;
    m->sources = calloc(source->scan_count, sizeof *m->sources);
    if (m->sources == NULL) return mospt_err_nomem(err, source->scan_count * sizeof *m->sources);
    for (; m->source_count < source->scan_count; m->source_count++) {
        uint32_t i = m->source_count;
        prep_pack_sums_add(&all, &of_scan[i]);
        if (!fill_source(&m->sources[i], &source->scans[i], &of_scan[i], &m->grid)) {
            m->source_count++;
            return mospt_err_nomem(err, sizeof *m->sources);
        }
    }
    for (uint32_t i = 0; crs == NULL && i < source->scan_count; i++)
        if (source->scans[i].info.crs[0] != '\0') crs = source->scans[i].info.crs;
    m->crs = strdup(crs != NULL ? crs : "");
    if (m->crs == NULL) return mospt_err_nomem(err, PREP_CRS_SIZE);
    for (uint32_t i = 0; i < m->source_count; i++)
        if (!keep_crs(&m->sources[i], source->scans[i].info.crs, m->crs))
            return mospt_err_nomem(err, PREP_CRS_SIZE);
    m->points_hash = all.hash;
    m->position_error = all.position_error;
    for (int a = 0; a < 3; a++) {
        m->low[a] = mospt_grid_axis_to_world(&m->grid, a, all.low[a]);
        m->high[a] = mospt_grid_axis_to_world(&m->grid, a, all.high[a]);
    }
    return true;
}

/* Text goes in with its end, so that no two lists of texts are the same bytes. */
static uint64_t add_text(uint64_t hash, const char *text)
{
    return mospt_hash_more(hash, text, strlen(text) + 1);
}

static uint64_t add_scan(uint64_t hash, const prep_source_scan *scan)
{
    const prep_scan_info *info = &scan->info;
    struct stat status = {0};
    if (stat(scan->path, &status) != 0) return hash;
    const int64_t numbers[] = {scan->index, status.st_size, status.st_mtim.tv_sec,
                               status.st_mtim.tv_nsec, (int64_t)info->point_count};
    hash = add_text(add_text(add_text(hash, scan->name), info->format), info->crs);
    hash = mospt_hash_more(hash, numbers, sizeof numbers);
    return info->has_pose ? mospt_hash_more(hash, info->pose, sizeof info->pose) : hash;
}

uint64_t prep_provenance_hash(const mospt_metadata *m, const prep_source *source, bool dedupe)
{
    const prep_scan_options *o = &source->options;
    const mospt_grid *g = &m->grid;
    const double reals[] = {g->offset[0], g->offset[1], g->offset[2], g->step};
    const int64_t integers[] = {
        g->base[0],       g->base[1],   g->base[2],           g->bits, g->root[0],
        g->root[1],       g->root[2],   m->inner_depth,       dedupe,  o->has_crop,
        m->add_threshold, o->has_range, MOSPT_DATASET_VERSION};
    uint64_t hash = add_text(0, IPTS_VERSION);
    hash = mospt_hash_more(hash, reals, sizeof reals);
    hash = mospt_hash_more(hash, integers, sizeof integers);
    if (o->columns != NULL) hash = add_text(hash, o->columns);
    for (int a = 0; a < 3 && o->has_crop; a++)
        hash = mospt_hash_more(mospt_hash_more(hash, &o->crop_low[a], sizeof(double)),
                               &o->crop_high[a], sizeof(double));
    for (uint32_t i = 0; i < m->schema.count; i++)
        hash = add_text(hash, m->schema.at[i].name);
    for (uint32_t i = 0; i < source->scan_count; i++)
        hash = add_scan(hash, &source->scans[i]);
    return hash;
}
