/* scripts/site_paint.h - colour, relief and reflectance of the sample site's surfaces.
 *
 * Everything is a function of the place alone, so that scans from different positions agree. */
#pragma once
#include "scripts/site_cast.h"

typedef struct {
    site_vec colour;     /* linear red, green, blue; 0 to 1 */
    float reflectance;   /* for the scanner's infrared beam, 0 to 1 */
    float relief;        /* how far the surface stands out from the smooth solid, metres */
    uint8_t class_asprs; /* LAS classification: 2 ground, 3 low and 5 high vegetation, 6 building, 1
                            other */
} site_paint;

site_paint site_paint_at(const site_hit *hit);

/* Sunlight and skylight on a surface, as a factor per channel.
 * sun  unit vector towards the sun */
site_vec site_light(const site_hit *hit, site_vec sun, bool in_shadow);
