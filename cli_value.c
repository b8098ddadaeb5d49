#include "cli_value.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A number from low to high with whatever behind it. */
static bool read_count(const char *text, uint64_t low, uint64_t high, uint64_t *out, char **end)
{
    if (!isdigit((unsigned char)text[0])) return false;
    *out = strtoull(text, end, 10);
    return *out >= low && *out <= high;
}

bool cli_value_count(const char *text, uint64_t low, uint64_t high, uint64_t *out)
{
    char *end;
    return read_count(text, low, high, out, &end) && *end == '\0';
}

bool cli_value_u32(const char *text, uint32_t low, uint32_t high, uint32_t *out)
{
    uint64_t value;
    if (!cli_value_count(text, low, high, &value)) return false;
    *out = (uint32_t)value;
    return true;
}

bool cli_value_pair(const char *text, const char *between, uint32_t out[2])
{
    char *end;
    uint64_t first;
    if (!read_count(text, 1, UINT32_MAX, &first, &end)) return false;
    if (*end == '\0' || strchr(between, *end) == NULL) return false;
    out[0] = (uint32_t)first;
    return cli_value_u32(end + 1, 1, UINT32_MAX, &out[1]);
}

bool cli_value_amount(const char *text, double base, uint64_t *out)
{
    static const char units[] = "KMGT";
    char *end;
    if (!isdigit((unsigned char)text[0]) && text[0] != '.') return false;
    double value = strtod(text, &end);
    if (*end != '\0') {
        const char *unit = strchr(units, toupper((unsigned char)*end));
        if (unit == NULL) return false;
        value *= pow(base, (double)(unit - units + 1));
        end++;
        if (base > 1000 && (*end == 'i' || *end == 'I')) end++;
        if (base > 1000 && (*end == 'b' || *end == 'B')) end++;
    }
    if (*end != '\0' || !(value >= 1) || value > 0x1p62) return false;
    *out = (uint64_t)value;
    return true;
}

bool cli_value_real(const char *text, double low, double high, double *out)
{
    char *end;
    double value = strtod(text, &end);
    if (end == text || *end != '\0' || !(value >= low && value <= high)) return false;
    *out = value;
    return true;
}

bool cli_value_float(const char *text, double low, double high, float *out)
{
    double value;
    if (!cli_value_real(text, low, high, &value)) return false;
    *out = (float)value;
    return true;
}

bool cli_value_triple(const char *text, double out[3])
{
    int used = 0;
    if (sscanf(text, "%lf,%lf,%lf%n", &out[0], &out[1], &out[2], &used) != 3 || text[used] != '\0')
        return false;
    return isfinite(out[0]) && isfinite(out[1]) && isfinite(out[2]);
}

bool cli_value_box(const char *text, double out[6])
{
    int used = 0;
    return sscanf(text, "%lf,%lf,%lf,%lf,%lf,%lf%n", &out[0], &out[1], &out[2], &out[3], &out[4],
                  &out[5], &used) == 6 &&
           text[used] == '\0' && out[0] <= out[3] && out[1] <= out[4] && out[2] <= out[5];
}

bool cli_value_rgb(const char *text, float out[3], const char **end)
{
    static const struct {
        const char *name;
        unsigned rgb;
    } names[] = {{"black", 0x000000}, {"white", 0xffffff}, {"grey", 0x808080}, {"sky", 0x87a5c7}};
    unsigned rgb = 0;
    size_t length = strcspn(text, ",");
    int used = 0;
    bool known = false;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strlen(names[i].name) == length && strncmp(names[i].name, text, length) == 0)
            rgb = names[i].rgb, known = true;
    const char *digits = text[0] == '#' ? text + 1 : text;
    known = known || (sscanf(digits, "%6x%n", &rgb, &used) == 1 && used == 6 &&
                      digits + used == text + length && isxdigit((unsigned char)digits[0]) &&
                      isxdigit((unsigned char)digits[1]));
    for (int c = 0; c < 3; c++)
        out[c] = (float)(rgb >> (16 - 8 * c) & 255) / 255;
    *end = text + length;
    return known;
}
