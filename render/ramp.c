#include "render/ramp.h"

#include <math.h>
#include <string.h>

enum { KNOTS = 10 };

/* Colours at equal distances, straight lines between them. Viridis and inferno are even to the eye,
 * also without colour vision and in print; turbo shows more detail; diverging has its neutral
 * middle for values around zero. */
static const struct {
    const char *name;
    uint32_t knots[KNOTS]; /* 0xrrggbb */
    double from, to;       /* the part that is used */
} maps[REND_MAP_COUNT] = {
    [REND_MAP_VIRIDIS] = {"viridis",
                          {0x440154, 0x482878, 0x3e4a89, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779,
                           0x6dcd59, 0xb4de2c, 0xfde725},
                          0.125,
                          1},
    [REND_MAP_TURBO] = {"turbo",
                        {0x30123b, 0x4662d7, 0x36aaf9, 0x1ae4b6, 0x72fe5e, 0xc7ef34, 0xfaba39,
                         0xf66b19, 0xcb2a04, 0x7a0403},
                        0.08,
                        0.94},
    [REND_MAP_INFERNO] = {"inferno",
                          {0x000004, 0x1b0c42, 0x4b0c6b, 0x781c6d, 0xa52c60, 0xcf4446, 0xed6925,
                           0xfb9a06, 0xf7d03c, 0xfcffa4},
                          0.15,
                          1},
    [REND_MAP_GREY] = {"grey",
                       {0x000000, 0x1c1c1c, 0x393939, 0x555555, 0x717171, 0x8e8e8e, 0xaaaaaa,
                        0xc6c6c6, 0xe3e3e3, 0xffffff},
                       0,
                       1},
    [REND_MAP_DIVERGING] = {"diverging",
                            {0x2b57b8, 0x4f7fd0, 0x7fa6e2, 0xb0c9ec, 0xdee3ea, 0xefe3d9, 0xf0c3a5,
                             0xe59b75, 0xd16a4b, 0xb2332b},
                            0,
                            1},
};

static double channel(uint32_t colour, int c)
{
    return (double)(colour >> (16 - 8 * c) & 0xff);
}

void rend_ramp_fill(rend_map map, rend_ramp *out)
{
    for (int i = 0; i < REND_RAMP_STEPS; i++) {
        double t = maps[map].from + (maps[map].to - maps[map].from) * i / (REND_RAMP_STEPS - 1);
        double place = t * (KNOTS - 1);
        int knot = place < KNOTS - 2 ? (int)place : KNOTS - 2;
        for (int c = 0; c < 3; c++) {
            double a = channel(maps[map].knots[knot], c), b = channel(maps[map].knots[knot + 1], c);
            out->rgb[i][c] = (uint8_t)(a + (b - a) * (place - knot) + 0.5);
        }
    }
}

void rend_ramp_curve(double brightness, double gamma, rend_ramp *out)
{
    for (int i = 0; i < REND_RAMP_STEPS; i++) {
        double shown = 255 * pow(brightness * i / 255, 1 / gamma) + 0.5;
        memset(out->rgb[i], shown < 255 ? (uint8_t)shown : 255, 3);
    }
}

/* OKLab (Ottosson 2020) to sRGB, where equal steps look equally far apart. */
static void from_oklab(double lightness, double a, double b, uint8_t rgb[3])
{
    double l = pow(lightness + 0.3963377774 * a + 0.2158037573 * b, 3);
    double m = pow(lightness - 0.1055613458 * a - 0.0638541728 * b, 3);
    double s = pow(lightness - 0.0894841775 * a - 1.2914855480 * b, 3);
    const double linear[3] = {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
                              -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
                              -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
    for (int c = 0; c < 3; c++) {
        double v = fmin(fmax(linear[c], 0), 1);
        v = v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055;
        rgb[c] = (uint8_t)(255 * v + 0.5);
    }
}

/* Steps of the golden angle never come back to a hue; three lightnesses tell apart what comes near
 * one. */
void rend_ramp_hue(uint32_t index, uint8_t rgb[3])
{
    static const double lightness[3] = {0.72, 0.80, 0.62};
    double turns = 0.69 + index * 0.61803398874989485, chroma = 0.145;
    double angle = 6.283185307179586 * (turns - floor(turns));
    from_oklab(lightness[index % 3], chroma * cos(angle), chroma * sin(angle), rgb);
}

const char *rend_ramp_name(rend_map map)
{
    return maps[map].name;
}

bool rend_ramp_from_name(const char *name, rend_map *out)
{
    for (int m = REND_MAP_USUAL + 1; m < REND_MAP_COUNT; m++) {
        if (strcmp(name, maps[m].name) != 0) continue;
        *out = (rend_map)m;
        return true;
    }
    return false;
}
