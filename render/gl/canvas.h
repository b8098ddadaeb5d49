/* render/gl/canvas.h - the textures that a picture is made in, and the passes over the screen that
 * turn drawn points into it: sections 2 to 5 of rgl.h.
 *
 * Points go into colours and depths; when blending, depths are kept, and a second drawing of the
 * points goes into sums. Textures that only some pictures need are made for the first of them. */
#pragma once
#include "render/gl/program.h"
#include "render/gl/rgl.h"

typedef struct {
    GLuint fbo, colours, depths; /* 0: none yet */
} rgl_layer;

typedef struct {
    uint32_t width, height;
    rgl_layer points;   /* depths: a depth buffer */
    rgl_layer sums;     /* colours and depths are sums; tested against the points' depths */
    rgl_layer nearest;  /* only depths: a copy of the points', which may be read while those are
                           tested against */
    rgl_layer resolved; /* of the sums */
    rgl_layer filled;
    rgl_layer picture;                       /* only colours */
    GLuint shown;                            /* framebuffer of the finished picture */
    GLuint resolve, fill, shade, background; /* programs; 0: none yet */
    GLuint nothing;                          /* a vertex array without arrays */
    bool adding; /* the picture in hand has come to its second drawing */
} rgl_canvas;

void rgl_canvas_init(rgl_canvas *canvas);
void rgl_canvas_fini(rgl_canvas *canvas);

/* Makes the canvas as large as the frame; what was on it is lost if it was not.
 * errors   MOSPT_EINVAL: larger than the driver can; MOSPT_EIO: it refuses */
bool rgl_canvas_fit(rgl_canvas *canvas, const rgl_scene *scene, mospt_err *err);

/* Has points drawn into colours and depths; with `clear`, a new picture begins. */
void rgl_canvas_draw(rgl_canvas *canvas, bool clear);

/* Has points added to the sums. The points' program finds the nearest depths in texture unit
 * RGL_CANVAS_NEAREST. */
bool rgl_canvas_add(rgl_canvas *canvas, mospt_err *err);

enum { RGL_CANVAS_NEAREST = 2 };

/* log2(1 + share) / span: how much deeper is what is farther by that share of its distance. */
float rgl_canvas_deeper(const rgl_scene *scene, float share);

/* Finishes the picture and puts it out. */
bool rgl_canvas_finish(rgl_canvas *canvas, const rgl_scene *scene, bool to_window, mospt_err *err);
