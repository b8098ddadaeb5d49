#include "render/asprs.h"

#include "render/ramp.h"

#include <stddef.h>

static const struct {
    const char *name;
    uint32_t colour; /* 0xrrggbb */
} classes[] = {
    [0] = {"never classified", 0x9a9a9a},
    [1] = {"unclassified", 0xbdbdbd},
    [2] = {"ground", 0xb07a48},
    [3] = {"low vegetation", 0xb5d96a},
    [4] = {"medium vegetation", 0x67b54b},
    [5] = {"high vegetation", 0x2f8a3d},
    [6] = {"building", 0xe2653f},
    [7] = {"low point (noise)", 0xff3fd0},
    [8] = {"model key-point", 0xf2e205},
    [9] = {"water", 0x3f8ff0},
    [10] = {"rail", 0x8d6bd8},
    [11] = {"road surface", 0x7d8794},
    [12] = {"overlap", 0xe0d7b0},
    [13] = {"wire: guard", 0xffe680},
    [14] = {"wire: conductor", 0xffc21a},
    [15] = {"transmission tower", 0x5fd3d6},
    [16] = {"wire: connector", 0xffa07a},
    [17] = {"bridge deck", 0x9fb4e8},
    [18] = {"high noise", 0xb026ff},
    [19] = {"overhead structure", 0xc49bd6},
    [20] = {"ignored ground", 0x8a6a4c},
    [21] = {"snow", 0xf4f9ff},
    [22] = {"temporal exclusion", 0x6e5a78},
};
enum { CLASS_COUNT = sizeof classes / sizeof *classes };

const char *rend_asprs_name(uint32_t code)
{
    return code < CLASS_COUNT ? classes[code].name : NULL;
}

void rend_asprs_colour(uint32_t code, uint8_t rgb[3])
{
    if (code >= CLASS_COUNT) {
        rend_ramp_hue(code, rgb);
        return;
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = (uint8_t)(classes[code].colour >> (16 - 8 * c));
}
