#include "render/clip.h"

#include <math.h>

#define ROUNDING 1e-3 /* of a step */

void rend_clip_make(const mospt_grid *grid, const rend_box *box, rend_clip *out)
{
    for (int a = 0; a < 3; a++) {
        double origin = grid->offset[a] + (double)grid->base[a] * grid->step;
        double low = ceil((box->low[a] - origin) / grid->step - ROUNDING);
        double high = floor((box->high[a] - origin) / grid->step + ROUNDING);
        bool empty = !(low <= high) || low > UINT32_MAX || high < 0;
        out->low[a] = empty ? 1 : (uint32_t)fmax(low, 0);
        out->high[a] = empty ? 0 : (uint32_t)fmin(high, UINT32_MAX);
    }
}

rend_box rend_clip_open(void)
{
    return (rend_box){{-INFINITY, -INFINITY, -INFINITY}, {INFINITY, INFINITY, INFINITY}};
}

void rend_clip_cut(const double back[3], const double place[3], rend_box *box)
{
    int a = 0;
    for (int b = 1; b < 3; b++)
        if (fabs(back[b]) > fabs(back[a])) a = b;
    /* The other side may be in front of the place: then it opens. */
    if (back[a] > 0) {
        box->high[a] = place[a];
        if (box->low[a] > place[a]) box->low[a] = -INFINITY;
    } else {
        box->low[a] = place[a];
        if (box->high[a] < place[a]) box->high[a] = INFINITY;
    }
}

bool rend_clip_misses(const rend_clip *clip, const uint32_t corner[3], uint64_t width)
{
    for (int a = 0; a < 3; a++)
        if (clip->low[a] > clip->high[a] || corner[a] > clip->high[a] ||
            corner[a] + width <= clip->low[a])
            return true;
    return false;
}
