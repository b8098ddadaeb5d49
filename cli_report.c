#include "cli_report.h"

#include "cli_words.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { UNKNOWN_SHOWN = 10, CRS_SHOWN = 3 };

void cli_report_losses(const prep_build_result *r)
{
    char text[2048];
    for (uint32_t i = 0; i < r->source.left_out_count; i++) {
        mospt_err_text(&r->source.left_out[i].err, text, sizeof text);
        fprintf(stderr, "instantpoints: left out: %s\n", text);
    }
    for (uint32_t i = 0; i < r->source.scan_count; i++) {
        if (r->source.scans[i].damage.code == MOSPT_OK) continue;
        mospt_err_text(&r->source.scans[i].damage, text, sizeof text);
        fprintf(stderr, "instantpoints: damaged, read in part: %s\n", text);
    }
    if (r->files.unknown_count == 0) return;
    fprintf(stderr, "instantpoints: %zu file%s in the folders %s no scan that this program knows:",
            r->files.unknown_count, r->files.unknown_count == 1 ? "" : "s",
            r->files.unknown_count == 1 ? "is" : "are");
    for (size_t i = 0; i < r->files.unknown_count && i < UNKNOWN_SHOWN; i++)
        fprintf(stderr, "%s %s", i > 0 ? "," : "", r->files.unknown[i].name);
    fprintf(stderr, "%s\n", r->files.unknown_count > UNKNOWN_SHOWN ? ", ..." : "");
}

void cli_report_announcement(uint64_t points, uint64_t scratch_bytes, uint64_t output_bytes,
                             bool again)
{
    char number[32], output[32], scratch[32];
    cli_bytes_text(output_bytes, output);
    cli_bytes_text(scratch_bytes, scratch);
    if (again)
        fprintf(stderr,
                "They have less in common than those looked at first, and are read once more.\n");
    fprintf(stderr, "%s points: the dataset takes %s", cli_grouped(points, number), output);
    if (scratch_bytes > 0) fprintf(stderr, ", and up to %s of scratch space", scratch);
    fprintf(stderr, "\n");
}

static uint64_t points_dropped(const mospt_metadata *m)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < m->source_count; i++)
        sum += m->sources[i].dropped;
    return sum;
}

/* Sums a reason over all sources; reasons are listed in the order in which they first appear. */
static void print_reasons(FILE *out, const mospt_metadata *m)
{
    char number[32];
    for (uint32_t i = 0; i < m->source_count; i++)
        for (uint32_t r = 0; r < m->sources[i].reason_count; r++) {
            const char *reason = m->sources[i].drop_reason[r];
            uint64_t sum = 0;
            bool seen = false;
            for (uint32_t j = 0; j < m->source_count; j++)
                for (uint32_t q = 0; q < m->sources[j].reason_count; q++) {
                    if (strcmp(m->sources[j].drop_reason[q], reason) != 0) continue;
                    if (j < i) seen = true;
                    sum += m->sources[j].drop_count[q];
                }
            if (!seen) fprintf(out, ", %s %s", cli_grouped(sum, number), reason);
        }
}

/* One line if some scans state another coordinate reference system than the dataset has, with an
 * example of each. */
static void print_other_crs(FILE *out, const mospt_metadata *m)
{
    char site[CLI_CRS_NAME_SIZE], names[CRS_SHOWN + 1][CLI_CRS_NAME_SIZE];
    const char *examples[CRS_SHOWN];
    uint32_t others = 0, shown = 0;
    bool has_more = false;
    cli_crs_name(m->crs, site);
    for (uint32_t i = 0; i < m->source_count; i++) {
        if (m->sources[i].crs == NULL) continue;
        cli_crs_name(m->sources[i].crs, names[shown]);
        if (strcasecmp(names[shown], site) == 0) continue;
        uint32_t k = 0;
        while (strcasecmp(names[k], names[shown]) != 0)
            k++;
        others++;
        if (k == CRS_SHOWN) has_more = true;
        else if (k == shown) examples[shown++] = m->sources[i].name;
    }
    if (others == 0) return;
    fprintf(out,
            "  crs        %" PRIu32 " of %" PRIu32 " scans state another one than %s: ", others,
            m->source_count, site);
    for (uint32_t k = 0; k < shown; k++)
        fprintf(out, "%s%s (%s)", k > 0 ? ", " : "", names[k], examples[k]);
    fprintf(out, "%s\n", has_more ? ", ..." : "");
}

void cli_report_build(FILE *out, const char *output, const prep_build_result *r)
{
    const mospt_metadata *m = &r->metadata;
    char a[32], b[32];
    uint64_t dropped = points_dropped(m);
    fprintf(out, "%s\n", output);
    fprintf(out, "  points     %s read, %s kept", cli_grouped(m->point_count + dropped, a),
            cli_grouped(m->point_count, b));
    if (dropped > 0) print_reasons(out, m);
    if (r->kept_points > 0)
        fprintf(out, "; %s were there from an interrupted build", cli_grouped(r->kept_points, a));
    fprintf(out, "\n  scans      %" PRIu32 "%s\n", m->source_count,
            prep_build_left_something_out(r) ? ", and some input left out (see above)" : "");
    print_other_crs(out, m);
    cli_bytes_text(r->payload_bytes, a);
    fprintf(out, "  tree       %" PRIu32 " nodes in %" PRIu32 " levels, %s (%.1f bytes a point)\n",
            r->node_count, r->level_count, a, (double)r->payload_bytes / (double)m->point_count);
    fprintf(out, "  position   largest error %.3g, step %.3g\n", m->position_error, m->grid.step);
    cli_bytes_text(r->scratch_bytes, b);
    fprintf(out, "  memory     %.0f MiB at the peak, scratch space %s\n",
            (double)r->peak_memory / (1 << 20), b);
    fprintf(out, "  time       %.2f s (", r->total_seconds);
    for (int p = 0; p < PREP_PHASES; p++)
        fprintf(out, "%s%s %.2f", p > 0 ? ", " : "", prep_phase_name((prep_phase)p), r->seconds[p]);
    fprintf(out, "), %.2f M points/s\n", (double)m->point_count / 1e6 / r->total_seconds);
}

static json_t *err_json(const char *name, const mospt_err *err)
{
    char text[2048];
    mospt_err_text(err, text, sizeof text);
    return json_pack("{s:o, s:o}", "name", cli_text_json(name), "reason", cli_text_json(text));
}

static json_t *sources_json(const mospt_metadata *m)
{
    json_t *array = json_array();
    for (uint32_t i = 0; i < m->source_count; i++) {
        const mospt_source *s = &m->sources[i];
        json_t *reasons = json_object();
        for (uint32_t r = 0; r < s->reason_count; r++)
            json_object_set_new(reasons, s->drop_reason[r],
                                json_integer((json_int_t)s->drop_count[r]));
        json_t *json =
            json_pack("{s:o, s:o, s:o, s:I, s:I, s:o, s:b, s:b}", "name", cli_text_json(s->name),
                      "scan", cli_text_json(s->scan), "format", cli_text_json(s->format), "points",
                      (json_int_t)s->points, "dropped", (json_int_t)s->dropped, "dropped_by_reason",
                      reasons, "rgb", (int)s->has_rgb, "intensity", (int)s->has_intensity);
        if (s->points > 0)
            json_object_set_new(json, "bounds",
                                json_pack("{s:o, s:o}", "min", cli_triple_json(s->low), "max",
                                          cli_triple_json(s->high)));
        if (s->crs != NULL) json_object_set_new(json, "crs", cli_text_json(s->crs));
        if (s->damage != NULL) json_object_set_new(json, "damage", cli_text_json(s->damage));
        if (s->has_pose) {
            json_t *pose = json_array();
            for (int k = 0; k < 16; k++)
                json_array_append_new(pose, json_real(s->pose[k]));
            json_object_set_new(json, "pose", pose);
        }
        json_array_append_new(array, json);
    }
    return array;
}

static json_t *bounds_json(const mospt_metadata *m)
{
    return json_pack("{s:o, s:o}", "min", cli_triple_json(m->low), "max", cli_triple_json(m->high));
}

void cli_report_build_json(FILE *out, const char *output, const prep_build_result *r)
{
    const mospt_metadata *m = &r->metadata;
    json_t *left_out = json_array(), *unknown = json_array(), *seconds = json_object();
    for (uint32_t i = 0; i < r->source.left_out_count; i++)
        json_array_append_new(left_out,
                              err_json(r->source.left_out[i].name, &r->source.left_out[i].err));
    for (size_t i = 0; i < r->files.unknown_count; i++)
        json_array_append_new(unknown, cli_text_json(r->files.unknown[i].name));
    for (int p = 0; p < PREP_PHASES; p++)
        json_object_set_new(seconds, prep_phase_name((prep_phase)p), json_real(r->seconds[p]));
    json_object_set_new(seconds, "total", json_real(r->total_seconds));
    cli_write_json(
        out, json_pack("{s:o, s:I, s:I, s:I, s:o, s:o, s:o, s:o, s:o, s:I, s:I, s:I, s:f, s:f, "
                       "s:I, s:I, s:I, s:o}",
                       "output", cli_text_json(output), "points", (json_int_t)m->point_count,
                       "kept_points", (json_int_t)r->kept_points, "dropped",
                       (json_int_t)points_dropped(m), "bounds", bounds_json(m), "crs",
                       cli_text_json(m->crs), "sources", sources_json(m), "left_out", left_out,
                       "unknown", unknown, "nodes", (json_int_t)r->node_count, "levels",
                       (json_int_t)r->level_count, "bytes", (json_int_t)r->payload_bytes,
                       "position_error", m->position_error, "step", m->grid.step, "peak_memory",
                       (json_int_t)r->peak_memory, "scratch_bytes", (json_int_t)r->scratch_bytes,
                       "scratch_announced", (json_int_t)r->scratch_announced, "seconds", seconds));
}

static void print_sources(FILE *out, const mospt_metadata *m)
{
    char number[32];
    fprintf(out, "  scans      %" PRIu32 "\n", m->source_count);
    for (uint32_t i = 0; i < m->source_count; i++) {
        const mospt_source *s = &m->sources[i];
        fprintf(out, "    %15s  %s%s%s  (%s%s%s)\n", cli_grouped(s->points, number), s->name,
                s->scan[0] != '\0' ? " / " : "", s->scan, s->format, s->has_rgb ? ", colour" : "",
                s->has_intensity ? ", intensity" : "");
        if (s->damage != NULL) fprintf(out, "    %15s  damaged: %s\n", "", s->damage);
        for (uint32_t r = 0; r < s->reason_count; r++)
            fprintf(out, "    %15s  dropped: %s\n", cli_grouped(s->drop_count[r], number),
                    s->drop_reason[r]);
    }
}

static void print_points(FILE *out, const mospt_metadata *m, const mospt_point_figures *f)
{
    fprintf(out, "  mean       ");
    cli_print_triple(out, f->mean);
    if (f->has_rgb)
        fprintf(out, "\n  mean rgb   %.2f  %.2f  %.2f", f->mean_rgb[0], f->mean_rgb[1],
                f->mean_rgb[2]);
    fprintf(out, "\n  attribute                      min          max         mean\n");
    for (uint32_t k = 0; k < m->schema.count; k++) {
        const mospt_attribute *a = &m->schema.at[k];
        for (uint32_t c = 0; c < a->components && c < 3; c++)
            fprintf(out, "    %-18s %12.6g %12.6g %12.6g\n", c == 0 ? a->name : "",
                    f->attribute_min[k][c], f->attribute_max[k][c], f->attribute_mean[k][c]);
    }
}

void cli_report_info(FILE *out, const mospt_dataset *d, const mospt_tree_figures *tree,
                     const mospt_point_figures *points, const mospt_spt_figures *spt)
{
    const mospt_metadata *m = &d->metadata;
    char a[32], b[32];
    fprintf(out, "%s\n  points     %s", d->path, cli_grouped(m->point_count, a));
    if (m->unfinished.commit > 0)
        fprintf(out,
                " of %s: the dataset is being built, or its build was interrupted; the same "
                "build command goes on from here",
                cli_grouped(m->unfinished.points, b));
    fprintf(out, "\n  min        ");
    cli_print_triple(out, m->low);
    fprintf(out, "\n  max        ");
    cli_print_triple(out, m->high);
    fprintf(out, "\n  size      ");
    for (int k = 0; k < 3; k++)
        fprintf(out, " %.3f%s", m->high[k] - m->low[k], k < 2 ? " " : "\n");
    fprintf(out, "  grid       step %.6g, root cube %.6g wide, largest position error %.3g\n",
            m->grid.step, m->grid.step * (double)(UINT64_C(1) << m->grid.bits), m->position_error);
    if (m->crs[0] != '\0') fprintf(out, "  crs        %s\n", m->crs);
    print_other_crs(out, m);
    fprintf(out, "  attributes");
    for (uint32_t k = 0; k < m->schema.count; k++) {
        const mospt_attribute *at = &m->schema.at[k];
        fprintf(out, "%s %s %s", k > 0 ? "," : "", at->name, mospt_type_name(at->type));
        if (at->components > 1) fprintf(out, "[%u]", at->components);
    }
    fprintf(out, "\n");
    print_sources(out, m);
    fprintf(out,
            "  tree       %" PRIu32 " nodes (%" PRIu32 " leaves) in %" PRIu32
            " levels, inner depth %" PRIu32 ", branching factor %.2f outside and %.2f inside\n",
            tree->nodes, tree->leaves, tree->levels, m->inner_depth, tree->branching,
            tree->cell_branching);
    fprintf(out, "  MOSPT      %" PRIu32 " to %" PRIu32 " points, median %" PRIu32 ", mean %.0f\n",
            tree->points_min, tree->points_max, tree->points_median, tree->points_mean);
    if (spt == NULL) {
        fprintf(out, "  (--stats reads every point: means, and the memory of a classic sequential "
                     "point tree)\n");
        return;
    }
    cli_bytes_text(spt->classic_bytes, a);
    cli_bytes_text(spt->mospt_bytes, b);
    fprintf(out, "  memory     %s here; a classic sequential point tree of these points has ", b);
    fprintf(out, "%s interior nodes\n             (branching factor %.2f) and takes ",
            cli_grouped(spt->interior, b), spt->branching);
    fprintf(out, "%s: %.0f %% more\n", a,
            100 * ((double)spt->classic_bytes / (double)spt->mospt_bytes - 1));
    if (points != NULL) print_points(out, m, points);
}

static json_t *components_json(const double *values, uint32_t components)
{
    json_t *array = json_array();
    for (uint32_t c = 0; c < components && c < 3; c++) {
        json_t *value = json_real(values[c]);
        json_array_append_new(array, value != NULL ? value : json_null());
    }
    return array;
}

static json_t *stats_json(const mospt_metadata *m, const mospt_point_figures *f)
{
    json_t *attributes = json_object();
    for (uint32_t k = 0; k < m->schema.count; k++) {
        const mospt_attribute *a = &m->schema.at[k];
        json_object_set_new(attributes, a->name,
                            json_pack("{s:o, s:o, s:o}", "min",
                                      components_json(f->attribute_min[k], a->components), "max",
                                      components_json(f->attribute_max[k], a->components), "mean",
                                      components_json(f->attribute_mean[k], a->components)));
    }
    return json_pack("{s:o, s:o, s:o, s:o, s:o}", "min", cli_triple_json(f->low), "max",
                     cli_triple_json(f->high), "mean", cli_triple_json(f->mean), "mean_rgb",
                     f->has_rgb ? cli_triple_json(f->mean_rgb) : json_null(), "attributes",
                     attributes);
}

static json_t *attributes_json(const mospt_schema *schema)
{
    json_t *array = json_array();
    for (uint32_t k = 0; k < schema->count; k++)
        json_array_append_new(array, json_pack("{s:s, s:s, s:i}", "name", schema->at[k].name,
                                               "type", mospt_type_name(schema->at[k].type),
                                               "components", (int)schema->at[k].components));
    return array;
}

void cli_report_info_json(FILE *out, const mospt_dataset *d, const mospt_tree_figures *t,
                          const mospt_point_figures *points, const mospt_spt_figures *spt)
{
    const mospt_metadata *m = &d->metadata;
    json_t *json =
        json_pack("{s:o, s:I, s:I, s:o, s:o, s:o, s:o, s:{s:f, s:f, s:i}, s:f, s:i}", "dataset",
                  cli_text_json(d->path), "points", (json_int_t)m->point_count, "generation",
                  (json_int_t)m->generation, "bounds", bounds_json(m), "attributes",
                  attributes_json(&m->schema), "sources", sources_json(m), "crs",
                  cli_text_json(m->crs), "grid", "step", m->grid.step, "cube",
                  m->grid.step * (double)(UINT64_C(1) << m->grid.bits), "bits", (int)m->grid.bits,
                  "position_error", m->position_error, "inner_depth", (int)m->inner_depth);
    if (m->unfinished.commit > 0)
        json_object_set_new(json, "unfinished_of", json_integer((json_int_t)m->unfinished.points));
    json_object_set_new(json, "tree",
                        json_pack("{s:I, s:I, s:I, s:f, s:f}", "nodes", (json_int_t)t->nodes,
                                  "leaves", (json_int_t)t->leaves, "levels", (json_int_t)t->levels,
                                  "branching", t->branching, "cell_branching", t->cell_branching));
    json_object_set_new(json, "points_per_mospt",
                        json_pack("{s:I, s:I, s:I, s:f}", "min", (json_int_t)t->points_min, "max",
                                  (json_int_t)t->points_max, "median", (json_int_t)t->points_median,
                                  "mean", t->points_mean));
    if (spt != NULL)
        json_object_set_new(
            json, "classic_spt",
            json_pack("{s:I, s:I, s:I, s:f, s:f}", "interior_nodes", (json_int_t)spt->interior,
                      "bytes", (json_int_t)spt->classic_bytes, "mospt_bytes",
                      (json_int_t)spt->mospt_bytes, "branching", spt->branching, "overhead",
                      (double)spt->classic_bytes / (double)spt->mospt_bytes - 1));
    if (points != NULL) json_object_set_new(json, "stats", stats_json(m, points));
    cli_write_json(out, json);
}
