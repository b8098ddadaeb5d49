#include "cli_report.h"

#include "cli_words.h"

#include <string.h>

static uint64_t dropped(const prep_inspection *scan)
{
    uint64_t sum = 0;
    for (int r = 0; r < PREP_DROP_REASONS; r++)
        sum += scan->dropped[r];
    return sum;
}

static void print_scan(FILE *out, const prep_inspection *scan, uint32_t count)
{
    const prep_scan_info *info = &scan->info;
    char a[32], text[2048];
    if (count > 1) fprintf(out, "  scan       %s\n", info->name);
    fprintf(out, "  points     %s%s\n", cli_grouped(scan->points, a),
            scan->was_read ? "" : " declared (--stats reads them all)");
    for (int r = 0; r < PREP_DROP_REASONS; r++)
        if (scan->dropped[r] > 0)
            fprintf(out, "  dropped    %s %s\n", cli_grouped(scan->dropped[r], a),
                    prep_drop_name((prep_drop)r));
    if (scan->points > 0 && (scan->was_read || info->has_bounds)) {
        fprintf(out, "  min        ");
        cli_print_triple(out, scan->low);
        fprintf(out, "\n  max        ");
        cli_print_triple(out, scan->high);
        fprintf(out, "\n");
    }
    fprintf(out, "  carries    %s%s%s", info->has_rgb ? "colour" : "",
            info->has_rgb && info->has_intensity ? ", " : "",
            info->has_intensity ? "intensity" : "");
    fprintf(out, "%s\n  attributes", info->has_rgb || info->has_intensity ? "" : "positions only");
    for (uint32_t k = 0; k < info->attributes.count; k++) {
        const mospt_attribute *at = &info->attributes.at[k];
        fprintf(out, "%s %s %s", k > 0 ? "," : "", at->name, mospt_type_name(at->type));
        if (at->components > 1) fprintf(out, "[%u]", at->components);
    }
    fprintf(out, "%s\n", info->attributes.count == 0 ? " none" : "");
    if (info->crs[0] != '\0')
        fprintf(out, "  crs        %.200s%s\n", info->crs, strlen(info->crs) > 200 ? " ..." : "");
    if (info->step > 0) fprintf(out, "  step       %.9g\n", info->step);
    if (info->has_pose) {
        const double at[3] = {info->pose[3], info->pose[7], info->pose[11]};
        fprintf(out, "  scanner at ");
        cli_print_triple(out, at);
        fprintf(out, "\n");
    }
    if (scan->damage.code != MOSPT_OK) {
        mospt_err_text(&scan->damage, text, sizeof text);
        fprintf(out, "  damaged    %s\n", text);
    }
    for (uint32_t n = 0; n < scan->note_count; n++)
        fprintf(out, "  note       %s\n", scan->notes[n]);
}

void cli_report_scans(FILE *out, const char *path, const prep_inspection *scans, uint32_t count)
{
    char size[32];
    cli_bytes_text(scans[0].file_bytes, size);
    fprintf(out, "%s\n  format     %s, %s", path, scans[0].info.format, size);
    if (count > 1) fprintf(out, ", %u scans", count);
    fprintf(out, "\n");
    if (scans[0].info.image_count > 0)
        fprintf(out, "  images     %u, which are not read\n", scans[0].info.image_count);
    for (uint32_t i = 0; i < count; i++)
        print_scan(out, &scans[i], count);
}

static json_t *scan_json(const prep_inspection *scan)
{
    const prep_scan_info *info = &scan->info;
    json_t *attributes = json_array(), *reasons = json_object(), *notes = json_array();
    for (uint32_t k = 0; k < info->attributes.count; k++) {
        const mospt_attribute *at = &info->attributes.at[k];
        json_array_append_new(
            attributes, json_pack("{s:o, s:s, s:i}", "name", cli_text_json(at->name), "type",
                                  mospt_type_name(at->type), "components", (int)at->components));
    }
    for (int r = 0; r < PREP_DROP_REASONS; r++)
        if (scan->dropped[r] > 0)
            json_object_set_new(reasons, prep_drop_name((prep_drop)r),
                                json_integer((json_int_t)scan->dropped[r]));
    for (uint32_t n = 0; n < scan->note_count; n++)
        json_array_append_new(notes, cli_text_json(scan->notes[n]));
    json_t *json = json_pack(
        "{s:o, s:I, s:I, s:o, s:b, s:o, s:b, s:b, s:o}", "name", cli_text_json(info->name),
        "points", (json_int_t)scan->points, "dropped", (json_int_t)dropped(scan),
        "dropped_by_reason", reasons, "was_read", (int)scan->was_read, "attributes", attributes,
        "rgb", (int)info->has_rgb, "intensity", (int)info->has_intensity, "notes", notes);
    if (scan->points > 0 && (scan->was_read || info->has_bounds))
        json_object_set_new(json, "bounds",
                            json_pack("{s:o, s:o}", "min", cli_triple_json(scan->low), "max",
                                      cli_triple_json(scan->high)));
    if (scan->was_read && scan->points > 0)
        json_object_set_new(json, "mean", cli_triple_json(scan->mean));
    if (info->crs[0] != '\0') json_object_set_new(json, "crs", cli_text_json(info->crs));
    if (info->has_pose) {
        json_t *pose = json_array();
        for (int k = 0; k < 16; k++)
            json_array_append_new(pose, json_real(info->pose[k]));
        json_object_set_new(json, "pose", pose);
    }
    if (scan->damage.code != MOSPT_OK) {
        char text[2048];
        mospt_err_text(&scan->damage, text, sizeof text);
        json_object_set_new(json, "damage", cli_text_json(text));
    }
    return json;
}

void cli_report_scans_json(FILE *out, const char *path, const prep_inspection *scans,
                           uint32_t count)
{
    uint64_t points = 0;
    json_t *list = json_array();
    for (uint32_t i = 0; i < count; i++) {
        points += scans[i].points;
        json_array_append_new(list, scan_json(&scans[i]));
    }
    cli_write_json(out, json_pack("{s:o, s:o, s:I, s:I, s:I, s:o}", "file", cli_text_json(path),
                                  "format", cli_text_json(scans[0].info.format), "bytes",
                                  (json_int_t)scans[0].file_bytes, "images",
                                  (json_int_t)scans[0].info.image_count, "points",
                                  (json_int_t)points, "scans", list));
}

static const char *status_name(cli_each_status status)
{
    static const char *const names[] = {"built", "built in part", "up to date", "failed"};
    return names[status];
}

void cli_report_each(FILE *out, const cli_each_report *report)
{
    size_t width = 4, of[4] = {0};
    char number[32];
    for (size_t i = 0; i < report->count; i++)
        if (strlen(report->items[i].name) > width) width = strlen(report->items[i].name);
    if (width > 60) width = 60;
    fprintf(out, "%-*s  %-13s %15s %8s\n", (int)width, "file", "", "points", "seconds");
    for (size_t i = 0; i < report->count; i++) {
        const cli_each_item *item = &report->items[i];
        of[item->status]++;
        fprintf(out, "%-*s  %-13s %15s %8.2f\n", (int)width, item->name, status_name(item->status),
                cli_grouped(item->points, number), item->seconds);
        if (item->reason != NULL) fprintf(out, "%-*s  %s\n", (int)width, "", item->reason);
    }
    fprintf(out, "%zu built, %zu in part, %zu up to date, %zu failed\n", of[CLI_EACH_BUILT],
            of[CLI_EACH_IN_PART], of[CLI_EACH_UP_TO_DATE], of[CLI_EACH_FAILED]);
}

void cli_report_each_json(FILE *out, const char *output, const cli_each_report *report)
{
    json_t *list = json_array();
    for (size_t i = 0; i < report->count; i++) {
        const cli_each_item *item = &report->items[i];
        json_t *json =
            json_pack("{s:o, s:o, s:s, s:I, s:f}", "name", cli_text_json(item->name), "dataset",
                      cli_text_json(item->dataset), "status", status_name(item->status), "points",
                      (json_int_t)item->points, "seconds", item->seconds);
        if (item->reason != NULL) json_object_set_new(json, "reason", cli_text_json(item->reason));
        json_array_append_new(list, json);
    }
    cli_write_json(out, json_pack("{s:o, s:o}", "output", cli_text_json(output), "files", list));
}
