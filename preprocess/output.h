/* preprocess/output.h - where a dataset is written, and how it takes the place of another one. */
#pragma once
#include "mospt/err.h"

typedef struct {
    char *target;   /* owned: the folder to write to */
    char *replaced; /* owned: the dataset whose place it takes at the end; NULL: none */
} prep_output;

/* The folder that holds a path, owned by the caller; NULL without memory. */
char *prep_output_folder(const char *path);

/* The path itself, or a folder beside it where a dataset is to be replaced at the end.
 * force    replace a finished dataset that is there
 * out      released by prep_output_fini()
 * errors   MOSPT_EINVAL: there is one, and no force; MOSPT_EIO; MOSPT_ENOMEM */
bool prep_output_choose(const char *path, bool force, prep_output *out, mospt_err *err);

/* Puts the new dataset in the place of the old one, in one step where the system can, and removes
 * the old one last. Nothing to do where none is replaced. */
bool prep_output_take_place(const prep_output *output, mospt_err *err);

void prep_output_fini(prep_output *output);
