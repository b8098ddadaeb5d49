/* cli_record.h - `record` and `join`: from options to a film, and what is said about it. */
#pragma once
#include "cli_options.h"
#include "render/record.h"

/* The camera path that the options ask for.
 * out      rend_path_fini() */
bool cli_record_path(const cli_options *options, const mospt_dataset *dataset, rend_path *out,
                     mospt_err *err);

/* should_stop   asked after each frame */
bool cli_record(const cli_options *options, const mospt_dataset *dataset, bool (*should_stop)(void),
                rend_record_result *result, mospt_err *err);
void cli_record_report(const cli_options *options, const rend_record_result *result);

bool cli_join(const cli_options *options, bool (*should_stop)(void), mospt_err *err);
