#include "cli_words.h"

#include <inttypes.h>
#include <stdbool.h>
#include <string.h>

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

/* The authority that the whole of the WKT goes by; its parts have their own. */
static bool find_authority(const char *wkt, char out[CLI_CRS_NAME_SIZE])
{
    char name[16], code[16];
    int depth = 0;
    bool is_quoted = false;
    for (const char *p = wkt; *p != '\0'; p++) {
        if (*p == '"') is_quoted = !is_quoted;
        if (is_quoted) continue;
        depth += (*p == '[') - (*p == ']');
        if (depth != 1 || (*p != 'A' && *p != 'I')) continue;
        if (sscanf(p, "AUTHORITY[\"%15[^\"]\",\"%15[^\"]\"", name, code) == 2 ||
            sscanf(p, "ID[\"%15[^\"]\",%15[0-9]", name, code) == 2)
            return snprintf(out, CLI_CRS_NAME_SIZE, "%s:%s", name, code) > 0;
    }
    return false;
}

void cli_crs_name(const char *crs, char out[CLI_CRS_NAME_SIZE])
{
    const char *quote = strchr(crs, '"');
    if (strchr(crs, '[') == NULL || quote == NULL) snprintf(out, CLI_CRS_NAME_SIZE, "%s", crs);
    else if (!find_authority(crs, out))
        snprintf(out, CLI_CRS_NAME_SIZE, "%.*s", (int)strcspn(quote + 1, "\""), quote + 1);
}

void cli_print_triple(FILE *out, const double v[3])
{
    fprintf(out, "%.3f  %.3f  %.3f", v[0], v[1], v[2]);
}
