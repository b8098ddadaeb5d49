/* cli_words.h - numbers and names as reports write them. */
#pragma once
#include <jansson.h>
#include <stdint.h>
#include <stdio.h>

/* 12345678 as "12,345,678", in `text`. */
const char *cli_grouped(uint64_t n, char text[32]);

/* 12345678 as "12.3 MB". */
void cli_bytes_text(uint64_t bytes, char text[32]);

enum { CLI_CRS_NAME_SIZE = 80 };

/* What to call a coordinate reference system: of WKT its code, "EPSG:25832", else its name; other
 * text as it is, as far as it fits. */
void cli_crs_name(const char *crs, char out[CLI_CRS_NAME_SIZE]);

void cli_print_triple(FILE *out, const double v[3]);

/* Text that may not be UTF-8. */
json_t *cli_text_json(const char *text);
json_t *cli_triple_json(const double v[3]);

/* Takes `json`. */
void cli_write_json(FILE *out, json_t *json);
