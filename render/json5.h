/* render/json5.h - JSON5 (https://spec.json5.org) made plain JSON, as far as programs write it:
 * names without quotes, single quotes, comments, commas before a closing bracket. Pure. */
#pragma once
#include "mospt/err.h"

/* An owned copy that a reader of plain JSON takes where it takes the original in spirit; what is
 * wrong in `text` stays wrong in it. NULL without memory. */
char *rend_json5_to_json(const char *text);
