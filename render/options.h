/* render/options.h - what a user may choose about a picture. In every struct {0} is a sensible
 * default. */
#pragma once
#include "mospt/err.h"

#define REND_MIB (UINT64_C(1) << 20)
#define REND_ALL UINT64_MAX /* as a point budget: no limit */

enum {
    REND_WIDTH_DEFAULT = 1280,
    REND_HEIGHT_DEFAULT = 720,
    REND_SIZE_MAX = 16384, /* pixels along one side of a picture */
};

typedef struct {
    /* What is not given comes from the overview of the dataset. */
    bool has_eye, has_target, has_up, has_fov;
    double eye[3], target[3]; /* world, metres */
    double up[3];             /* any length; z without it */
    double fov_deg;           /* vertical, 1 to 170; 60 without it */
} rend_camera_options;

/* A box along the axes of the world. */
typedef struct {
    double low[3], high[3]; /* metres */
} rend_box;

/* What colours show. */
typedef enum {
    REND_COLOUR_RGB,
    REND_COLOUR_INTENSITY, /* as it was stretched when the scan was read; with a range, the raw one
                            */
    REND_COLOUR_ELEVATION,
    REND_COLOUR_CLASSIFICATION,
    REND_COLOUR_RETURN,
    REND_COLOUR_TIME,
    REND_COLOUR_SCAN,
    REND_COLOUR_DENSITY,  /* level of the deepest node at a place */
    REND_COLOUR_DISTANCE, /* to the scanner */
    REND_COLOUR_ATTRIBUTE,
    REND_COLOUR_COUNT
} rend_colour;

typedef enum {
    REND_MAP_USUAL, /* grey for intensity, viridis for all else */
    REND_MAP_VIRIDIS,
    REND_MAP_TURBO,
    REND_MAP_INFERNO,
    REND_MAP_GREY,
    REND_MAP_DIVERGING,
    REND_MAP_COUNT
} rend_map;

typedef enum {
    REND_SIZE_AUTO,  /* splat size follows the cells that are drawn, section 5.3 of the paper */
    REND_SIZE_FIXED, /* point_px pixels for every point */
    REND_SIZE_WORLD, /* point_m metres for every point, section 3 */
} rend_size_mode;

/* What a splat that is wide enough looks like, see render/gl/rgl.h. */
typedef enum {
    REND_SHAPE_AUTO,
    REND_SHAPE_SQUARE,
    REND_SHAPE_ROUND,
    REND_SHAPE_PARABOLOID, /* bent away from the eye: splats cut each other halfway */
    REND_SHAPE_COUNT
} rend_shape;

enum { REND_ATTRIBUTE_MAX = 64 }; /* of a name with the number of a component, bytes */

typedef struct {
    rend_size_mode size_mode;
    float point_px;     /* REND_SIZE_FIXED; 0: 1 */
    float point_m;      /* REND_SIZE_WORLD, in the unit of the world coordinates */
    float point_px_min; /* no splat is smaller; 0: 1 */
    float point_px_max; /* no splat is larger; 0: REND_POINT_PX_MAX_DEFAULT */
    rend_shape shape;
    float blend_slab; /* points that are farther than the nearest by this share of its distance are
                         averaged with it; 0: none are */
    uint32_t fill_px; /* holes up to about twice as wide are closed from their borders; 0: off */
    rend_colour colour;
    char attribute[REND_ATTRIBUTE_MAX]; /* REND_COLOUR_ATTRIBUTE: its name, zeros behind it;
                                           "NAME:2" is the second of its components */
    bool has_range;  /* without it all but the lowest and highest hundredth of the values */
    double range[2]; /* values at both ends of the colour map, in the unit of the values */
    rend_map map;
    double brightness;   /* factor on stored colours; 0: 1 */
    double gamma;        /* above 1 lifts the dark ones; 0: 1 */
    bool no_edl;         /* eye-dome lighting off */
    float edl_strength;  /* 0: 1; 2 is twice as dark */
    float edl_radius_px; /* 0: 1 pixel for each 720 of the picture's height, and at least 1 */
    bool has_background;
    float background_top[3], background_bottom[3]; /* 0 to 1; without it a grey that light and dark
                                                      points stand out from */
    bool has_clip;
    rend_box clip; /* points outside are not shown */
} rend_look;

#define REND_POINT_PX_MAX_DEFAULT 6.0f
#define REND_BLEND_DEFAULT 0.01f /* of pictures that nobody waits for */
#define REND_FILL_PX_MAX 8

typedef struct {
    uint64_t budget_points; /* points drawn in one frame; 0: all in a shot, REND_VIEW_BUDGET_DEFAULT
                               in a window */
    uint64_t ram_cache_bytes; /* 0: REND_RAM_CACHE_DEFAULT */
    uint64_t gpu_cache_bytes; /* 0: REND_GPU_CACHE_DEFAULT */
    float min_node_px;        /* minimum node size: nodes projecting to less are skipped; 0: see
                                 render/select.h */
    bool no_occlusion;        /* nodes hidden behind others are drawn, too */
} rend_limits;

/* What draws. */
typedef enum {
    REND_RENDERER_AUTO, /* the graphics card; the processor where OpenGL would draw on it too */
    REND_RENDERER_GL,
    REND_RENDERER_CPU,
} rend_renderer;

typedef struct {
    rend_renderer renderer;
    uint32_t threads; /* of REND_RENDERER_CPU; 0: one per processor */
} rend_engine_options;

#define REND_VIEW_BUDGET_DEFAULT UINT64_C(3000000)
#define REND_RAM_CACHE_DEFAULT (1024 * REND_MIB)
#define REND_GPU_CACHE_DEFAULT (1024 * REND_MIB)
