#include "cli_words.h"

#include <inttypes.h>

/* 12345678 as "12,345,678". */
const char *cli_grouped(uint64_t n, char text[32])
{
    char digits[24];
    int length = snprintf(digits, sizeof digits, "%" PRIu64, n), out = 0;
    for (int i = 0; i < length; i++) {
        if (i > 0 && (length - i) % 3 == 0) text[out++] = ',';
        text[out++] = digits[i];
    }
    text[out] = '\0';
    return text;
}

void cli_bytes_text(uint64_t bytes, char text[32])
{
    if (bytes < 10000) snprintf(text, 32, "%" PRIu64 " bytes", bytes);
    else if (bytes < 10000000) snprintf(text, 32, "%.0f kB", (double)bytes / 1e3);
    else if (bytes < UINT64_C(10000000000)) snprintf(text, 32, "%.1f MB", (double)bytes / 1e6);
    else snprintf(text, 32, "%.2f GB", (double)bytes / 1e9);
}

json_t *cli_text_json(const char *text)
{
    json_t *json = json_string(text);
    return json != NULL ? json : json_string("(not UTF-8)");
}

json_t *cli_triple_json(const double v[3])
{
    json_t *array = json_array();
    for (int a = 0; a < 3; a++)
        json_array_append_new(array, json_real(v[a]));
    return array;
}

void cli_write_json(FILE *out, json_t *json)
{
    json_dumpf(json, out, JSON_INDENT(2));
    fputc('\n', out);
    json_decref(json);
}

void cli_print_triple(FILE *out, const double v[3])
{
    fprintf(out, "%.3f  %.3f  %.3f", v[0], v[1], v[2]);
}
