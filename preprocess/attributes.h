/* preprocess/attributes.h - the attributes of a dataset, from those of its scans. */
#pragma once
#include "preprocess/source.h"

/* "scan" and all attributes of all scans, each of a type that holds all of its values.
 * wanted   names, separated by commas, of those to keep besides "scan", or "none"; NULL: all
 * out      what the points that were looked at have in common is kept so (preprocess/implied.h)
 * errors   MOSPT_EINVAL: a name that no scan has, or too many attributes */
bool prep_attributes_choose(const prep_source *source, const char *wanted, mospt_schema *out,
                            mospt_err *err);
