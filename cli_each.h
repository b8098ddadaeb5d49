/* cli_each.h - `build --each`: one dataset per scan file, for whole folders overnight.
 *
 * What fails is named and passed over; what has not changed since its dataset was made is left as
 * it is. */
#pragma once
#include "preprocess/build.h"

typedef enum {
    CLI_EACH_BUILT,
    CLI_EACH_IN_PART,
    CLI_EACH_UP_TO_DATE,
    CLI_EACH_FAILED
} cli_each_status;

typedef struct {
    char *name;    /* owned, of the file, relative to the folder that was named */
    char *dataset; /* owned, its path */
    cli_each_status status;
    char *reason; /* owned: why it failed, or what was wrong with the file; NULL otherwise */
    uint64_t points;
    double seconds;
} cli_each_item;

typedef struct {
    cli_each_item *items; /* [count], owned */
    size_t count;
} cli_each_report;

/* Told before each file; returns false to stop. */
typedef bool (*cli_each_next)(void *context, size_t index, size_t count, const char *name);

/* Builds a dataset FOLDER/NAME.ipts for every scan file of the inputs.
 * options  as for prep_build(); output is the folder, which is made if it is not there
 * out      released by cli_each_fini(), also when it fails
 * errors   MOSPT_EIO (an input or the folder), MOSPT_ENOMEM, MOSPT_ECANCELLED; a file that fails is
 * no error */
bool cli_each(const prep_build_options *options, cli_each_next next, cli_each_report *out,
              mospt_err *err);
void cli_each_fini(cli_each_report *report);
