/* scripts/plain_loop.h - the limit that drawing on a processor is measured against: one loop that
 * transforms all vertices of an array and takes a 64-bit minimum of distance and colour at each
 * one's pixel. No clipping but at the picture's border, no sizes, no shading, nothing shared: each
 * thread has a part of the array and a picture of its own, and they are never brought together. */
#pragma once
#include "mospt/point.h"
#include "render/camera.h"

typedef struct plain_loop plain_loop;

/* threads  0: one per processor; NULL without memory */
plain_loop *plain_loop_create(uint32_t width, uint32_t height, uint32_t threads);
void plain_loop_destroy(plain_loop *loop);

/* Empties the pictures and draws. */
void plain_loop_draw(plain_loop *loop, const rend_frame *frame, const mospt_vertex *vertices,
                     uint32_t count);

/* Distance of what is nearest at a pixel, steps; infinite where there is nothing. */
float plain_loop_distance(const plain_loop *loop, uint32_t x, uint32_t y);
