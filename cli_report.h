/* cli_report.h - what a job says when it is done: words for people, or JSON. */
#pragma once
#include "cli_each.h"
#include "mospt/survey.h"
#include "preprocess/inspect.h"

#include <stdio.h>

/* Files left out, damaged and unknown, one line each, to standard error. */
void cli_report_losses(const prep_build_result *result);

/* What a build will take, before it starts. */
void cli_report_announcement(uint64_t points, uint64_t scratch_bytes, uint64_t output_bytes,
                             bool again);

void cli_report_build(FILE *out, const char *output, const prep_build_result *result);
void cli_report_build_json(FILE *out, const char *output, const prep_build_result *result);

/* points, spt: NULL where they were not looked at */
void cli_report_info(FILE *out, const mospt_dataset *dataset, const mospt_tree_figures *tree,
                     const mospt_point_figures *points, const mospt_spt_figures *spt);
void cli_report_info_json(FILE *out, const mospt_dataset *dataset, const mospt_tree_figures *tree,
                          const mospt_point_figures *points, const mospt_spt_figures *spt);

/* scans: [count] of one file */
void cli_report_scans(FILE *out, const char *path, const prep_inspection *scans, uint32_t count);
void cli_report_scans_json(FILE *out, const char *path, const prep_inspection *scans,
                           uint32_t count);

void cli_report_each(FILE *out, const cli_each_report *report);
void cli_report_each_json(FILE *out, const char *output, const cli_each_report *report);
